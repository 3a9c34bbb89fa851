//! What viewers need: fields of worlds at a state that a daemon shows, and frames of recordings.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use numpy::{Element, PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::PyDict;
use sim_daemon::observe::{
    self, Array, Arrays, DaemonError, Drawn, Draws, Dtype, FrameFields, Precision, Shows,
};

use crate::errors::raise;

/// Worlds of a scene, in this process, at states that a daemon shows.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct Evaluation(Mutex<observe::Evaluation>);

#[pymethods]
impl Evaluation {
    /// The first ``worlds`` of a scene as TOML, with paths relative to a folder.
    #[new]
    #[pyo3(signature = (scene, folder, worlds, precision, fields, *, drawn = (0, "world".to_owned(), false)))]
    fn new(
        py: Python<'_>,
        scene: &str,
        folder: PathBuf,
        worlds: usize,
        precision: &str,
        fields: Vec<String>,
        drawn: (usize, String, bool),
    ) -> PyResult<Evaluation> {
        let (first_world, draws, resets) = drawn;
        let drawn = Drawn {
            first_world,
            draws: Draws::named(&draws).unwrap_or_default(),
            resets,
        };
        let fields = named(py, &fields, None)?;
        let precision = match precision {
            "f64" => Precision::F64,
            _ => Precision::F32,
        };
        let made = py
            .detach(|| observe::Evaluation::new(scene, &folder, worlds, precision, &fields, drawn));
        let made = made.map_err(|error| raised(py, &error))?;
        Ok(Evaluation(Mutex::new(made)))
    }

    /// Hash of the model, as a daemon tells its own.
    #[getter]
    fn model_hash(&self, py: Python<'_>) -> u64 {
        lock(py, &self.0).model_hash()
    }

    /// The fields at the state of the first worlds.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        state: PyReadonlyArray1<'py, u8>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let state = state.as_slice()?;
        let mut guard = lock(py, &self.0);
        let inner = &mut *guard;
        let arrays = py.detach(move || inner.evaluate(state));
        let copied = arrays.map(|arrays| dict(py, arrays, usize::MAX));
        drop(guard); // raising runs Python code
        copied.map_err(|error| raised(py, &error))?
    }
}

/// A recording, frame after frame.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct Playback {
    inner: Mutex<observe::Playback>,
    worlds: usize,
}

#[pymethods]
impl Playback {
    /// Frames of the first ``worlds`` of a recording, with those of its starts if ``starts``.
    #[new]
    #[pyo3(signature = (path, worlds, fields, *, starts = false, threads = None, cameras = None))]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        worlds: usize,
        fields: Vec<String>,
        starts: bool,
        threads: Option<usize>,
        cameras: Option<&str>,
    ) -> PyResult<Playback> {
        let fields = named(py, &fields, cameras)?;
        let opened = py.detach(|| observe::Playback::open(&path, &fields, threads));
        let opened = opened.map_err(|error| raised(py, &error))?;
        Ok(Playback {
            inner: Mutex::new(match starts {
                true => opened.with_starts(),
                false => opened,
            }),
            worlds,
        })
    }

    /// What the daemon announced about itself, as JSON.
    fn describe(&self, py: Python<'_>) -> String {
        serde_json::to_string(lock(py, &self.inner).description())
            .expect("a description is plain data")
    }

    /// What a viewer should know, if anything.
    #[getter]
    fn note(&self, py: Python<'_>) -> Option<String> {
        lock(py, &self.inner).note().map(str::to_owned)
    }

    /// What the last frame shows: ``"start"``, ``"step"`` or ``"still"``.
    #[getter]
    fn shows(&self, py: Python<'_>) -> &'static str {
        match lock(py, &self.inner).shows() {
            Shows::Start => "start",
            Shows::Step => "step",
            Shows::Still => "still",
        }
    }

    /// Names of the arrays that clients sent for the last frame, if it is a step.
    #[getter]
    fn sent(&self, py: Python<'_>) -> Vec<String> {
        lock(py, &self.inner).sent().to_vec()
    }

    /// Why there are no more frames, once there are none.
    #[getter]
    fn end(&self, py: Python<'_>) -> Option<String> {
        lock(py, &self.inner).end().map(str::to_owned)
    }

    /// The next frame; None at the end.
    fn next<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let mut guard = lock(py, &self.inner);
        let inner = &mut *guard;
        let arrays = py.detach(move || inner.advance());
        let copied = arrays.map(|arrays| arrays.map(|arrays| dict(py, arrays, self.worlds)));
        drop(guard); // raising runs Python code
        copied.map_err(|error| raised(py, &error))?.transpose()
    }
}

/// Without the interpreter lock while it waits, which the holder will want again.
fn lock<'a, T>(py: Python<'_>, mutex: &'a Mutex<T>) -> MutexGuard<'a, T> {
    let locked = mutex.lock_py_attached(py);
    locked.unwrap_or_else(PoisonError::into_inner)
}

fn raised(py: Python<'_>, error: &DaemonError) -> PyErr {
    raise(py, error.kind(), error.to_string())
}

/// The fields of these names, and cameras as JSON besides those of the scene.
fn named(py: Python<'_>, names: &[String], cameras: Option<&str>) -> PyResult<FrameFields> {
    let asked = FrameFields::named(names.iter().map(String::as_str));
    let asked =
        asked.map_err(|name| raise(py, "UnknownField", format!("there is no field `{name}`")))?;
    let cameras = serde_json::from_str(cameras.unwrap_or("[]"));
    let cameras = cameras.map_err(|error| raise(py, "SceneError", format!("cameras: {error}")))?;
    Ok(FrameFields { cameras, ..asked })
}

/// Copies of the first worlds of arrays, by name.
fn dict<'py>(py: Python<'py>, arrays: &Arrays, worlds: usize) -> PyResult<Bound<'py, PyDict>> {
    let to = PyDict::new(py);
    for array in arrays.iter() {
        to.set_item(array.name, copied(py, &array, worlds)?)?;
    }
    Ok(to)
}

fn copied<'py>(py: Python<'py>, array: &Array<'_>, worlds: usize) -> PyResult<Bound<'py, PyAny>> {
    match array.dtype {
        Dtype::F32 => to_numpy::<f32>(py, array, worlds),
        Dtype::F64 => to_numpy::<f64>(py, array, worlds),
        Dtype::I32 => to_numpy::<i32>(py, array, worlds),
        Dtype::U32 => to_numpy::<u32>(py, array, worlds),
        Dtype::U64 => to_numpy::<u64>(py, array, worlds),
        Dtype::U8 => to_numpy::<u8>(py, array, worlds),
    }
}

fn to_numpy<'py, T: Element + bytemuck::AnyBitPattern>(
    py: Python<'py>,
    array: &Array<'_>,
    worlds: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let entries: &[T] = bytemuck::cast_slice(array.bytes);
    let mut shape = array.shape.to_vec();
    shape[0] = shape[0].min(worlds);
    let first = &entries[..shape.iter().product()];
    Ok(PyArray1::from_slice(py, first).reshape(shape)?.into_any())
}
