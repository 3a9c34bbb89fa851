//! Pictures of meshes, drawn on the processor.

use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use numpy::ndarray::ArrayView2;
use numpy::{PyArray1, PyArray3, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use sim_picture::{Instance, Lamp, Line, Mesh, Shading, Shot, View};

use crate::errors::raise;

/// Longest side of a picture [pixels]: beyond, places in 16ths of a pixel lose their fractions.
const SIDE_MAX: usize = 8192;
/// Numbers of a lamp: whether it is at a place, the place, direction, ambient, diffuse and specular light, attenuation,
/// cutoff, exponent, and whether it may cast shadows.
const LAMP: usize = 22;

/// Keeps meshes and draws them. `tightloop.view.Picture` wraps it, and documents what a picture shows.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct Renderer {
    inner: Arc<RwLock<sim_picture::Renderer>>,
    size: [usize; 2],
}

#[pymethods]
impl Renderer {
    /// For pictures of this size [pixels], drawn by at most so many threads; by all cores if left out.
    #[new]
    #[pyo3(signature = (width, height, threads = None))]
    fn new(
        py: Python<'_>,
        width: usize,
        height: usize,
        threads: Option<usize>,
    ) -> PyResult<Renderer> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let inner = sim_picture::Renderer::new(threads.unwrap_or_else(cores));
        Ok(Renderer {
            inner: Arc::new(RwLock::new(inner)),
            size: checked_size(py, width, height)?,
        })
    }

    /// For pictures of another size, of the same meshes, which both keep.
    fn resized(&self, py: Python<'_>, width: usize, height: usize) -> PyResult<Renderer> {
        Ok(Renderer {
            inner: self.inner.clone(),
            size: checked_size(py, width, height)?,
        })
    }

    /// Keeps a mesh, whose triangles may be shaded each on its own; returns its number.
    #[pyo3(signature = (vertices, faces, colors, flat = false))]
    fn add(
        &self,
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f32>,
        faces: PyReadonlyArray2<'_, u32>,
        colors: PyReadonlyArray2<'_, u8>,
        flat: bool,
    ) -> PyResult<usize> {
        let vertices: Vec<[f32; 3]> = rows(py, "vertices", &vertices.as_array())?;
        let faces: Vec<[u32; 3]> = rows(py, "faces", &faces.as_array())?;
        let colors: Vec<[u8; 4]> = rows(py, "colors", &colors.as_array())?;
        let shading = match flat {
            true => Shading::Flat,
            false => Shading::Smooth,
        };
        let made = py.detach(|| Mesh::shaded(&vertices, &faces, &colors, shading));
        let mesh = made.map_err(|error| raise(py, "ArgumentError", format!("mesh: {error}")))?;
        py.detach(|| {
            let mut inner = self.inner.write().unwrap_or_else(PoisonError::into_inner);
            Ok(inner.add(mesh))
        })
    }

    /// A picture, uint8, shape ``(height, width, 3)``.
    #[allow(clippy::too_many_arguments, reason = "arrays of one length each")]
    #[pyo3(signature = (
        camera, angle, around, floor, meshes, poses, tints, opacities, lines, line_colors, line_widths, lamps = None
    ))]
    fn render<'py>(
        &self,
        py: Python<'py>,
        camera: [[f64; 3]; 3],
        angle: f64,
        around: [f64; 4],
        floor: Option<[f64; 2]>,
        meshes: PyReadonlyArray1<'py, u32>,
        poses: PyReadonlyArray2<'py, f64>,
        tints: PyReadonlyArray2<'py, u8>,
        opacities: PyReadonlyArray1<'py, f32>,
        lines: PyReadonlyArray2<'py, f64>,
        line_colors: PyReadonlyArray2<'py, u8>,
        line_widths: PyReadonlyArray1<'py, f32>,
        lamps: Option<PyReadonlyArray2<'py, f64>>,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let refused = |problem: &str| Err(raise(py, "ArgumentError", problem.to_owned()));
        let poses: Vec<[f64; 7]> = rows(py, "poses", &poses.as_array())?;
        let tints: Vec<[u8; 4]> = rows(py, "tints", &tints.as_array())?;
        let ends: Vec<[f64; 6]> = rows(py, "lines", &lines.as_array())?;
        let colors: Vec<[u8; 4]> = rows(py, "line_colors", &line_colors.as_array())?;
        let lamps: Vec<[f64; LAMP]> = match lamps {
            Some(lamps) => rows(py, "lamps", &lamps.as_array())?,
            None => Vec::new(),
        };
        let lamps: Vec<Lamp> = lamps
            .iter()
            .filter(|row| row.iter().all(|part| part.is_finite()))
            .map(lamp)
            .collect();
        let (meshes, opacities) = (meshes.as_array(), opacities.as_array());
        let widths = line_widths.as_array();
        if [poses.len(), tints.len(), opacities.len()] != [meshes.len(); 3] {
            return refused("render: poses, tints and opacities must be as many as meshes");
        }
        if [colors.len(), widths.len()] != [ends.len(); 2] {
            return refused("render: line_colors and line_widths must be as many as lines");
        }
        let known = self.read().meshes();
        if meshes.iter().any(|&mesh| mesh as usize >= known) {
            return refused("render: meshes names one that was not added");
        }
        let numbers = camera.as_flattened().iter().chain(&around).chain([&angle]);
        let spacing = floor.is_none_or(|[height, lines]| height.is_finite() && lines > 0.0);
        if !(numbers.clone().all(|number| number.is_finite())
            && (0.0..3.1).contains(&angle)
            && angle > 0.0
            && around[3] > 0.0
            && spacing)
        {
            return refused("render: the camera must be finite, its angle within (0, 3.1) rad");
        }
        // a body that is not finite cannot be anywhere
        let instances: Vec<Instance> = (0..meshes.len())
            .filter(|&k| poses[k].iter().all(|part| part.is_finite()))
            .map(|k| Instance {
                mesh: meshes[k] as usize,
                pose: poses[k],
                tint: tints[k],
                opacity: opacities[k],
            })
            .collect();
        let lines: Vec<Line> = (0..ends.len())
            .filter(|&k| ends[k].iter().all(|part| part.is_finite()))
            .map(|k| Line {
                ends: [
                    std::array::from_fn(|axis| ends[k][axis]),
                    std::array::from_fn(|axis| ends[k][3 + axis]),
                ],
                colour: colors[k],
                width: widths[k],
            })
            .collect();
        let [eye, target, up] = camera;
        let shot = Shot {
            view: View::looking(eye, target, up, angle, self.size),
            instances: &instances,
            lines: &lines,
            lamps: &lamps,
            floor,
            backdrop: None,
            outlines: false,
            middle: [around[0], around[1], around[2]],
            reach: around[3],
        };
        // the lock is of this closure: held beyond, it and the interpreter's could wait for each other
        let pixels = py.detach(|| self.read().render(&shot));
        let [width, height] = self.size;
        PyArray1::from_vec(py, pixels.into_flattened()).reshape([height, width, 3])
    }
}

impl Renderer {
    fn read(&self) -> RwLockReadGuard<'_, sim_picture::Renderer> {
        self.inner.read().unwrap_or_else(PoisonError::into_inner)
    }
}

fn checked_size(py: Python<'_>, width: usize, height: usize) -> PyResult<[usize; 2]> {
    for (name, size) in [("width", width), ("height", height)] {
        if !(1..=SIDE_MAX).contains(&size) {
            let problem = format!("{name} is {size}; give 1 to {SIDE_MAX} pixels");
            return Err(raise(py, "ArgumentError", problem));
        }
    }
    Ok([width, height])
}

/// A lamp of its row.
fn lamp(row: &[f64; LAMP]) -> Lamp {
    let three = |first: usize| std::array::from_fn(|axis| row[first + axis]);
    let single = |first: usize| std::array::from_fn(|axis| row[first + axis] as f32);
    Lamp {
        position: (row[0] != 0.0).then(|| three(1)),
        direction: three(4),
        ambient: single(7),
        diffuse: single(10),
        specular: single(13),
        attenuation: single(16),
        cutoff: row[19] as f32,
        exponent: row[20] as f32,
        shadows: row[21] != 0.0,
    }
}

/// Rows of so many numbers.
fn rows<T: Copy + Default, const COLUMNS: usize>(
    py: Python<'_>,
    name: &str,
    array: &ArrayView2<'_, T>,
) -> PyResult<Vec<[T; COLUMNS]>> {
    if array.ncols() != COLUMNS {
        let shape = array.shape();
        let problem = format!("{name} has shape {shape:?}; give (n, {COLUMNS})");
        return Err(raise(py, "ArgumentError", problem));
    }
    let row = |row: numpy::ndarray::ArrayView1<'_, T>| std::array::from_fn(|k| row[k]);
    Ok(array.rows().into_iter().map(row).collect())
}
