//! What a scene looks like, for `tightloop.view`.

use std::path::PathBuf;

use numpy::{Element, PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use sim_daemon::config::{self, ConfigError, Image, Texture, VisualMesh};

use crate::errors::raise;
use crate::interrupt::abandonable;

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
    let scene = scene.to_owned();
    let parts = abandonable(py, move || config::parse(&scene, "scene")?.parts(&folder));
    let parts = parts?.map_err(|error| raise(py, "SceneError", error.to_string()))?;
    let surfaces = parts.meshes.iter().map(|mesh| {
        let corners = mesh.vertices.as_flattened();
        let corners = PyArray1::from_iter(py, corners.iter().map(|&part| part as f32));
        Ok((
            corners.reshape([mesh.vertices.len(), 3])?,
            rows(py, &mesh.triangles)?,
        ))
    });
    Ok((parts.told.to_string(), surfaces.collect::<PyResult<_>>()?))
}

/// A mesh file as it looks ([`VisualMesh`]), its arrays by name; `textures` is a list of dicts, `image` a path or bytes.
#[pyfunction]
pub(crate) fn visual_mesh(
    py: Python<'_>,
    path: PathBuf,
    collada_up_axis: bool,
) -> PyResult<Bound<'_, PyDict>> {
    let mesh = py
        .detach(|| VisualMesh::load(&path, collada_up_axis))
        .map_err(|error| raise(py, "SceneError", ConfigError::from(error).to_string()))?;
    let colors: Vec<_> = mesh.colors.iter().map(|c| c.unwrap_or_default()).collect();
    let painted = mesh.colors.iter().map(Option::is_some);
    let textures: Vec<_> = mesh
        .textures
        .iter()
        .map(|source| texture(py, source))
        .collect::<PyResult<_>>()?;
    let dict = PyDict::new(py);
    dict.set_item("vertices", rows(py, &mesh.vertices)?)?;
    dict.set_item("faces", rows(py, &mesh.triangles)?)?;
    dict.set_item("colors", rows(py, &colors)?)?;
    dict.set_item("painted", PyArray1::from_iter(py, painted))?;
    dict.set_item("textures", textures)?;
    dict.set_item("notes", mesh.notes)?;
    dict.set_item("ignored_up_axis", mesh.ignored_up_axis)?;
    Ok(dict)
}

fn texture<'py>(py: Python<'py>, texture: &Texture) -> PyResult<Bound<'py, PyDict>> {
    let uv = texture.uv.as_ref().map(|uv| {
        PyArray1::from_slice(py, uv.as_flattened().as_flattened()).reshape([uv.len(), 3, 2])
    });
    let dict = PyDict::new(py);
    match &texture.image {
        Image::File(path) => dict.set_item("image", path.as_os_str())?,
        Image::Bytes(bytes) => dict.set_item("image", PyBytes::new(py, bytes))?,
    }
    dict.set_item("faces", PyArray1::from_slice(py, &texture.triangles))?;
    dict.set_item("uv", uv.transpose()?)?;
    dict.set_item("tints", rows(py, &texture.tints)?)?;
    Ok(dict)
}

fn rows<'py, T: Element + Copy, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), N])
}
