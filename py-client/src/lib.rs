//! The Python module `tightloop._core`: a client of the daemon, NumPy views of its frames, and the daemon itself.
//!
//! Thin on purpose: arguments are checked in Python (`python/tightloop`), numbers by the daemon. What is here is what has
//! to be fast (a step) or has to be Rust (views of shared memory, scene files, the command line).

mod advice;
mod arrays;
mod client;
mod dynamics;
mod errors;
mod followers;
mod frame;
mod ik;
mod input;
mod interrupt;
mod not_finite;
mod observe;
mod parts;
mod picture;
mod policy;
mod random;
mod rays;
mod rows;
mod scene;
mod xla;

use std::ffi::OsString;

use pyo3::prelude::*;

/// Run the command line of this process, such as ``["tightloop", "serve", "scene.toml"]``; returns its exit code.
///
/// Completes the environment of the process for graphics drivers.
#[pyfunction]
fn command_line(py: Python<'_>, arguments: Vec<OsString>) -> PyResult<i32> {
    if let Some((name, value)) = sim_daemon::environment::missing() {
        let environment = py.import("os")?.getattr("environ")?;
        environment.set_item(name, value.as_os_str())?;
    }
    Ok(py.detach(|| sim_daemon::serve(arguments)))
}

/// Names of all fields that frames may carry.
#[pyfunction]
fn field_names() -> Vec<&'static str> {
    sim_daemon::field_names()
}

/// Every command of a step: name, axis, columns of each of its entries, unit, sentence, and whether it is a switch, `write`
/// sets it, and it is a parameter.
#[pyfunction]
fn command_rows() -> Vec<CommandRow> {
    let rows = sim_daemon::command_rows().into_iter();
    rows.map(|row| {
        let kinds = [row.is_switch, row.is_written, row.is_param];
        (row.name, row.axis, row.parts, row.unit, row.doc, kinds)
    })
    .collect()
}

type CommandRow = (
    &'static str,
    String,
    usize,
    &'static str,
    &'static str,
    [bool; 3],
);

/// Names of all parameters that may vary between worlds.
#[pyfunction]
fn param_names() -> Vec<&'static str> {
    sim_daemon::param_names()
}

#[pymodule(name = "_core")]
mod core {
    use super::*;

    #[pymodule_export]
    use super::arrays::{drive, pack};
    #[pymodule_export]
    use super::client::{Client, groups, sweep};
    #[pymodule_export]
    use super::dynamics::Dynamics;
    #[pymodule_export]
    use super::frame::{PyFrame, Sample};
    #[pymodule_export]
    use super::ik::{Ik, IkTaskSolver};
    #[pymodule_export]
    use super::input::Columns;
    #[pymodule_export]
    use super::observe::{Evaluation, Playback};
    #[pymodule_export]
    use super::parts::{parts, visual_mesh};
    #[pymodule_export]
    use super::picture::Renderer;
    #[pymodule_export]
    use super::policy::PolicyNetwork;
    #[pymodule_export]
    use super::random::draw;
    #[pymodule_export]
    use super::rays::RayScene;
    #[pymodule_export]
    use super::scene::{
        compiled_scene, load_scene, parse_scene, read_mesh, read_mujoco, read_urdf, save_scene,
        scene_to_toml,
    };
    #[pymodule_export]
    use super::xla::{xla_call, xla_function, xla_handlers};
    #[pymodule_export]
    use super::{command_line, command_rows, field_names, param_names};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        sim_daemon::keep_meshes();
        let not_ready = module.py().get_type::<super::input::NotReady>();
        module.add("NotReady", not_ready)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
