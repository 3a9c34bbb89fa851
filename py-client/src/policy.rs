//! Policies from ONNX files, read and evaluated in this process.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use sim_policy::Runner;
use sim_policy::onnx::{self, Policy};

use crate::errors::raise;

/// Most bytes of weights in a file of their own, as of the policy's file.
const FILE_MAX: u64 = 1 << 30;

/// A multilayer perceptron. `tightloop.Policy` wraps it, checks shapes, and documents its methods.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct PolicyNetwork {
    policy: Policy,
    runner: Mutex<Runner>,
}

#[pymethods]
impl PolicyNetwork {
    /// From the bytes of an ONNX file, and the folder that it lies in.
    #[new]
    #[pyo3(signature = (data, folder, output, /))]
    fn new(
        py: Python<'_>,
        data: &[u8],
        folder: PathBuf,
        output: Option<&str>,
    ) -> PyResult<PolicyNetwork> {
        let external = |name: &str, offset, length| beside(&folder, name, offset, length);
        let policy = onnx::read(data, output, &external)
            .map_err(|error| raise(py, "ArgumentError", error.to_string()))?;
        let runner = Mutex::new(Runner::new(&policy.network));
        Ok(PolicyNetwork { policy, runner })
    }

    /// Values of an observation, and of an action.
    #[getter]
    fn sizes(&self) -> (usize, usize) {
        (self.policy.network.inputs(), self.policy.network.outputs())
    }

    /// Names of the input and the output.
    #[getter]
    fn ports(&self) -> (&str, &str) {
        (&self.policy.input, &self.policy.output)
    }

    /// Texts by name.
    #[getter]
    fn metadata(&self) -> Vec<(String, String)> {
        self.policy.metadata.clone()
    }

    /// Layers as JSON.
    #[getter]
    fn layers(&self) -> String {
        serde_json::to_string(self.policy.network.layers()).expect("layers are plain data")
    }

    /// Parameters of all layers, one after another.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_slice(py, self.policy.network.parameters())
    }

    /// Actions for observations, one per row.
    fn run<'py>(
        &self,
        py: Python<'py>,
        observations: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let rows = observations.shape()[0];
        let outputs = PyArray2::zeros(py, [rows, self.policy.network.outputs()], false);
        let mut runner = self.runner.lock().unwrap_or_else(PoisonError::into_inner);
        let mut written = outputs.readwrite();
        runner
            .run(observations.as_slice()?, written.as_slice_mut()?, 1)
            .map_err(|error| raise(py, "ArgumentError", error.to_string()))?;
        drop(written);
        Ok(outputs)
    }

    fn __repr__(&self) -> String {
        self.policy.network.to_string()
    }
}

/// Bytes of a file in a folder; a link may not lead out of it.
fn beside(folder: &Path, name: &str, offset: u64, length: u64) -> Result<Vec<u8>, String> {
    let path = folder.join(name);
    let failed = |problem: std::io::Error| {
        format!(
            "lies in {}, which cannot be read: {problem}; put it beside the ONNX file",
            path.display()
        )
    };
    let folder = folder.canonicalize().map_err(failed)?;
    let canonical = path.canonicalize().map_err(failed)?;
    if !canonical.starts_with(folder) {
        return Err(format!(
            "lies in {}, which leads to {}; put the file itself beside the ONNX file",
            path.display(),
            canonical.display()
        ));
    }
    // looked at before it is opened: a pipe would be waited for
    if !canonical.symlink_metadata().map_err(failed)?.is_file() {
        return Err(format!(
            "lies in {}, which is not a file; put its weights there",
            path.display()
        ));
    }
    let mut file = File::open(&canonical).map_err(failed)?;
    let rest = file
        .metadata()
        .map_err(failed)?
        .len()
        .saturating_sub(offset);
    if length > rest || length > FILE_MAX {
        return Err(format!(
            "lies in {}, of which it needs {length} bytes from {offset} on, and there are {rest}; export the policy anew",
            path.display()
        ));
    }
    file.seek(SeekFrom::Start(offset)).map_err(failed)?;
    let mut bytes = Vec::with_capacity(length as usize);
    file.take(length).read_to_end(&mut bytes).map_err(failed)?;
    Ok(bytes)
}
