//! Scenes as Python has them, JSON, and as files and daemons do, TOML.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use sim_daemon::config::{self, ConfigError, MeshOptions, SceneFile, UrdfOptions};

use crate::errors::raise;
use crate::interrupt::abandonable;

/// Names, defaults and notes of a URDF file as JSON, arrays in dof order.
#[pyfunction]
#[expect(clippy::too_many_arguments)] // those of a file
pub(crate) fn read_urdf(
    py: Python<'_>,
    path: PathBuf,
    package_dirs: Vec<PathBuf>,
    floating: bool,
    strict: bool,
    mesh_max_hull_vertices: usize,
    convex_decomposition: bool,
    collada_up_axis: bool,
) -> PyResult<String> {
    let options = UrdfOptions {
        package_dirs,
        floating,
        strict,
        meshes: MeshOptions {
            max_hull_vertices: mesh_max_hull_vertices,
            convex_decomposition,
            collada_up_axis,
        },
        ..UrdfOptions::default()
    };
    let summary = config::urdf_summary(&path, options);
    summary
        .map(|summary| summary.to_string())
        .map_err(|error| raise(py, "UrdfError", error.to_string()))
}

/// What a mesh file becomes, as JSON.
#[pyfunction]
pub(crate) fn read_mesh(
    py: Python<'_>,
    path: PathBuf,
    scale: [f64; 3],
    max_hull_vertices: usize,
    convex_decomposition: bool,
) -> PyResult<String> {
    let options = MeshOptions {
        max_hull_vertices,
        convex_decomposition,
        ..MeshOptions::default()
    };
    config::mesh_summary(&path, scale, &options)
        .map(|summary| summary.to_string())
        .map_err(|error| scene_error(py, &error))
}

/// What an exported MuJoCo model is, as JSON.
#[pyfunction]
pub(crate) fn read_mujoco(
    py: Python<'_>,
    path: PathBuf,
    max_hull_vertices: usize,
) -> PyResult<String> {
    py.detach(|| config::mujoco_summary(&path, max_hull_vertices))
        .map(|summary| summary.to_string())
        .map_err(|error| scene_error(py, &error))
}

/// A scene given as JSON, as TOML; paths stay as they are.
#[pyfunction]
pub(crate) fn scene_to_toml(py: Python<'_>, scene: &str) -> PyResult<String> {
    Ok(from_json(py, scene)?.to_toml())
}

/// Write a scene given as JSON with absolute paths as a TOML file with paths relative to it.
#[pyfunction]
pub(crate) fn save_scene(py: Python<'_>, scene: &str, path: PathBuf) -> PyResult<()> {
    from_json(py, scene)?
        .save(&path, Path::new("/"))
        .map_err(|error| scene_error(py, &error))
}

/// Read a TOML file as JSON; paths stay relative to the file.
#[pyfunction]
pub(crate) fn load_scene(py: Python<'_>, path: PathBuf) -> PyResult<String> {
    let scene = config::load(&path).map_err(|error| scene_error(py, &error))?;
    Ok(scene.to_json().to_string())
}

/// Read TOML text, as `scene_to_toml` writes it, as JSON; paths stay as they are.
#[pyfunction]
pub(crate) fn parse_scene(py: Python<'_>, text: &str) -> PyResult<String> {
    let scene = config::parse(text, "scene").map_err(|error| scene_error(py, &error))?;
    Ok(scene.to_json().to_string())
}

/// A scene as it is simulated, as JSON (`SceneFile::compiled` says what it has); the scene is TOML with absolute paths.
#[pyfunction]
pub(crate) fn compiled_scene(py: Python<'_>, scene: &str) -> PyResult<String> {
    let scene = scene.to_owned();
    abandonable(py, move || {
        config::parse(&scene, "scene")?.compiled(Path::new("/"))
    })?
    .map(|compiled| compiled.to_string())
    .map_err(|error| scene_error(py, &error))
}

fn from_json(py: Python<'_>, scene: &str) -> PyResult<SceneFile> {
    SceneFile::from_json(scene).map_err(|error| scene_error(py, &error))
}

fn scene_error(py: Python<'_>, error: &ConfigError) -> PyErr {
    raise(py, "SceneError", error.to_string())
}
