//! Kinematics and dynamics at states that a caller gives, in this process and in double precision.

use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use sim_daemon::config::{self, BackendError, Field};

use crate::errors::raise;
use crate::interrupt::abandonable;

/// A scene's model. `tightloop.Dynamics` wraps it, checks shapes, and documents its methods.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct Dynamics {
    inner: Mutex<config::Dynamics>,
    hash: u64,
}

#[pymethods]
impl Dynamics {
    /// From a scene as TOML, with paths relative to a folder.
    #[new]
    fn new(py: Python<'_>, scene: &str, folder: PathBuf) -> PyResult<Dynamics> {
        let scene = scene.to_owned();
        let build = move || config::parse(&scene, "scene")?.dynamics(&folder);
        let inner =
            abandonable(py, build)?.map_err(|error| raise(py, "SceneError", error.to_string()))?;
        Ok(Dynamics {
            hash: inner.model().hash(),
            inner: Mutex::new(inner),
        })
    }

    /// Hash of the model.
    #[getter]
    fn model_hash(&self) -> u64 {
        self.hash
    }

    /// Names of the dofs, of the coordinates and of the bodies.
    #[getter]
    fn names(&self) -> (Vec<String>, Vec<String>, Vec<String>) {
        let inner = self.inner();
        let model = inner.model();
        (
            model.dof_names().to_vec(),
            model.coord_names().to_vec(),
            model.body_names().to_vec(),
        )
    }

    /// A field, flat.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        field: &str,
        joint_q: PyReadonlyArray1<'py, f64>,
        joint_qd: PyReadonlyArray1<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (q, qd) = (joint_q.as_slice()?, joint_qd.as_slice()?);
        let Some(field) = Field::named(field) else {
            return Err(raise(
                py,
                "UnknownField",
                format!("there is no field `{field}`"),
            ));
        };
        answer(py, || self.inner().evaluate(field, q, qd))
    }

    /// Joint forces, flat.
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        joint_q: PyReadonlyArray1<'py, f64>,
        joint_qd: PyReadonlyArray1<'py, f64>,
        joint_qdd: PyReadonlyArray1<'py, f64>,
        damping: bool,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (q, qd, qdd) = (
            joint_q.as_slice()?,
            joint_qd.as_slice()?,
            joint_qdd.as_slice()?,
        );
        answer(py, || self.inner().inverse_dynamics(q, qd, qdd, damping))
    }
}

impl Dynamics {
    fn inner(&self) -> std::sync::MutexGuard<'_, config::Dynamics> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Computes without the interpreter lock.
fn answer<'py>(
    py: Python<'py>,
    compute: impl FnOnce() -> Result<Vec<f64>, BackendError> + Send,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    match py.detach(compute) {
        Ok(values) => Ok(PyArray1::from_vec(py, values)),
        Err(error) => Err(raise(py, "ArgumentError", error.to_string())),
    }
}
