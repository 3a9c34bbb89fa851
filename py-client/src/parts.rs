//! What a scene looks like, for `tightloop.view`.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use sim_daemon::config;

use crate::errors::raise;

/// Corners `(n, 3)` [m] and triangles `(m, 3)`.
type Surface<'py> = (Bound<'py, PyArray2<f32>>, Bound<'py, PyArray2<u32>>);

/// Parts and notes of a scene as JSON (`SceneFile::parts` says what they have), and the surfaces that the parts name; the scene
/// is TOML with paths relative to a folder.
#[pyfunction]
pub(crate) fn parts<'py>(
    py: Python<'py>,
    scene: &str,
    folder: PathBuf,
) -> PyResult<(String, Vec<Surface<'py>>)> {
    let found = py.detach(|| config::parse(scene, "scene")?.parts(&folder));
    let found = found.map_err(|error| raise(py, "SceneError", error.to_string()))?;
    let surfaces = found.meshes.iter().map(|mesh| {
        let corners = mesh.vertices.as_flattened();
        let corners = PyArray1::from_iter(py, corners.iter().map(|&part| part as f32));
        let triangles = PyArray1::from_slice(py, mesh.triangles.as_flattened());
        Ok((
            corners.reshape([mesh.vertices.len(), 3])?,
            triangles.reshape([mesh.triangles.len(), 3])?,
        ))
    });
    Ok((found.told.to_string(), surfaces.collect::<PyResult<_>>()?))
}
