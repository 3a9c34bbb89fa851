//! Inverse kinematics of a scene, in this process.

use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use sim_daemon::config::{
    self, IkError, IkOptions, IkPrecision, IkProblems, IkSolver, IkStop, IkTask, IkWidth, Model,
    frame_names,
};

use crate::errors::raise;
use crate::interrupt::{abandonable, interruptible};

/// Iterations that take less than a second and need no thread of their own [–].
const SHORT: usize = 100_000;

/// A scene's frames and a solver. `tightloop.IkSolver` wraps it, checks shapes, and documents its methods.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct Ik {
    model: Arc<Model>,
}

/// A solver of a task.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct IkTaskSolver {
    inner: IkSolver,
}

/// Joint positions; whether, and how well, each problem is solved: errors of position and rotation, iterations, restarts.
type Solutions<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<bool>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray1<u32>>,
);

#[pymethods]
impl Ik {
    /// From a scene as TOML, with paths relative to a folder.
    #[new]
    fn new(py: Python<'_>, scene: &str, folder: PathBuf) -> PyResult<Ik> {
        let scene = scene.to_owned();
        let build = move || config::parse(&scene, "scene")?.model(&folder);
        let model =
            abandonable(py, build)?.map_err(|error| raise(py, "SceneError", error.to_string()))?;
        Ok(Ik { model })
    }

    /// Names of the dofs, of the coordinates and of the frames.
    #[getter]
    fn names(&self) -> (Vec<String>, Vec<String>, Vec<String>) {
        (
            self.model.dof_names().to_vec(),
            self.model.coord_names().to_vec(),
            frame_names(&self.model),
        )
    }

    /// Joint positions after a reset.
    #[getter]
    fn start(&self) -> Vec<f64> {
        self.model.start().joint_q.clone()
    }

    /// A solver of a task, given as JSON.
    fn solver(&self, py: Python<'_>, task: &str) -> PyResult<IkTaskSolver> {
        let task: IkTask = serde_json::from_str(task)
            .map_err(|error| raise(py, "ArgumentError", format!("ik: {error}")))?;
        let made = py.detach(|| task.solver(&self.model));
        Ok(IkTaskSolver {
            inner: made.map_err(|error| refused(py, &error))?,
        })
    }
}

#[pymethods]
impl IkTaskSolver {
    /// Solves problems. Arrays are flat, with one row or `count` rows: starts, references of the posture, then of each frame its
    /// positions and its quaternions; those that do not count are empty.
    fn solve<'py>(
        &self,
        py: Python<'py>,
        count: usize,
        arrays: Vec<PyReadonlyArray1<'py, f64>>,
        attempts: (usize, usize, u64),
        tolerance: [f64; 2],
        run: (bool, usize),
    ) -> PyResult<Solutions<'py>> {
        let slices = arrays.iter().map(|array| Ok(array.as_slice()?));
        let slices = slices.collect::<PyResult<Vec<&[f64]>>>()?;
        let [starts, postures, targets @ ..] = &slices[..] else {
            return Err(raise(py, "ArgumentError", "ik: arrays are missing"));
        };
        let (in_double, threads) = run;
        let problems = IkProblems {
            count,
            starts,
            postures,
            positions: targets.iter().copied().step_by(2).collect(),
            orientations: targets.iter().copied().skip(1).step_by(2).collect(),
        };
        let (iterations, restarts, seed) = attempts;
        let options = IkOptions {
            iterations,
            restarts,
            tolerance,
            seed,
        };
        let precision = match in_double {
            true => IkPrecision::F64,
            false => IkPrecision::F32,
        };
        let solve = |stop: IkStop| {
            let width = IkWidth::Auto;
            self.inner
                .solve_until(stop, &problems, options, precision, width, threads)
        };
        let is_short = count.saturating_mul(iterations) < SHORT / restarts.saturating_add(1);
        let solved = match is_short {
            true => py.detach(|| solve(&|| false)),
            false => interruptible(py, solve)?,
        };
        let (q, solutions) = solved.map_err(|error| refused(py, &error))?;
        Ok((
            PyArray1::from_vec(py, q),
            PyArray1::from_iter(py, solutions.iter().map(|solution| solution.is_solved)),
            PyArray1::from_iter(py, solutions.iter().map(|solution| solution.position_error)),
            PyArray1::from_iter(py, solutions.iter().map(|solution| solution.rotation_error)),
            PyArray1::from_iter(py, solutions.iter().map(|solution| solution.iterations)),
            PyArray1::from_iter(py, solutions.iter().map(|solution| solution.restarts)),
        ))
    }
}

fn refused(py: Python<'_>, error: &IkError) -> PyErr {
    raise(py, "ArgumentError", format!("ik: {error}"))
}
