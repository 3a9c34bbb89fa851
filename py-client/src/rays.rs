//! Rays against the geoms of a scene, in this process.

use std::collections::HashMap;
use std::path::PathBuf;

use numpy::ndarray::ArrayView3;
use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim_daemon::config::{self, Casting, Hits, Placed, Pose, Ray, RayGeom};

use crate::errors::raise;
use crate::interrupt::abandonable;

/// Distances in units of the directions, geoms, and normals, each flat.
type Found<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i32>>,
    Bound<'py, PyArray1<f64>>,
);

/// What rays meet in a scene. `tightloop.sim.rays` wraps it, checks arguments, and chooses geoms.
#[pyclass(frozen, module = "tightloop._core")]
pub(crate) struct RayScene(config::RayScene);

#[pymethods]
impl RayScene {
    /// From a scene as TOML, with paths relative to a folder, and the first body of each MuJoCo model by its name.
    #[new]
    fn new(
        py: Python<'_>,
        scene: &str,
        folder: PathBuf,
        first_bodies: HashMap<String, usize>,
    ) -> PyResult<RayScene> {
        let scene = scene.to_owned();
        let build = move || config::parse(&scene, "scene")?.rays(&folder, &first_bodies);
        let inner =
            abandonable(py, build)?.map_err(|error| raise(py, "SceneError", error.to_string()))?;
        Ok(RayScene(inner))
    }

    /// Lists about the geoms: `name`, `kind`, `group` (None where the file has no groups), `has_shape`, `is_static` and
    /// `is_visible`.
    fn geoms<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        let all = &self.0.geoms;
        let flags = |of: fn(&RayGeom) -> bool| all.iter().map(of).collect::<Vec<bool>>();
        let names: Vec<_> = all.iter().map(|geom| geom.name.as_str()).collect();
        let kinds: Vec<_> = all.iter().map(|geom| geom.kind.as_str()).collect();
        let groups: Vec<_> = all.iter().map(|geom| geom.group).collect();
        dict.set_item("name", names)?;
        dict.set_item("kind", kinds)?;
        dict.set_item("group", groups)?;
        dict.set_item("has_shape", flags(|geom| geom.shape.is_some()))?;
        dict.set_item("is_static", flags(|geom| geom.is_static))?;
        dict.set_item("is_visible", flags(|geom| geom.is_visible))?;
        Ok(dict)
    }

    /// What rays meet in worlds. `chosen` are the geoms that count.
    ///
    /// `poses` are `geom_xpos` and `geom_xmat`, `(worlds, geoms, 3)` and `(worlds, geoms, 9)`, or `body_q` alone,
    /// `(worlds, bodies, 7)`. `pnt` and `vec` are `(worlds, rays, 3)`, `exclude` is `(worlds, rays)`.
    #[allow(clippy::too_many_arguments)] // a call of Python's
    fn cast<'py>(
        &self,
        py: Python<'py>,
        chosen: PyReadonlyArray1<'py, i64>,
        poses: Vec<Bound<'py, PyAny>>,
        pnt: Bound<'py, PyAny>,
        vec: Bound<'py, PyAny>,
        exclude: PyReadonlyArray2<'py, i32>,
        threads: usize,
    ) -> PyResult<Found<'py>> {
        let geoms = &self.0.geoms;
        let chosen: Vec<_> = chosen.as_array().iter().map(|&k| k as usize).collect();
        let poses = poses.iter().map(Array::new).collect::<PyResult<Vec<_>>>()?;
        let poses: Vec<_> = poses.iter().map(Array::view).collect();
        let (pnt, vec) = (Array::new(&pnt)?, Array::new(&vec)?);
        let (pnt, vec) = (pnt.view(), vec.view());
        let exclude = exclude.as_array();
        let (worlds, rays) = exclude.dim();
        let last_body = geoms.iter().map(|geom| geom.body).max().unwrap_or(0);
        let are_placed = match &poses[..] {
            [pos, mat] => [pos.dim(), mat.dim()] == [3, 9].map(|n| (worlds, geoms.len(), n)),
            [bodies] => {
                let (count, bodies, width) = bodies.dim();
                (count, width) == (worlds, 7) && bodies > last_body
            }
            _ => false,
        };
        let have_rays = [pnt.dim(), vec.dim()] == [(worlds, rays, 3); 2];
        if !are_placed || !have_rays || chosen.iter().any(|&geom| geom >= geoms.len()) {
            let problem = format!("rays: arrays do not fit {worlds} worlds of {rays} rays");
            return Err(raise(py, "ArgumentError", problem));
        }
        let place = |world: usize, geom: usize| match &poses[..] {
            [pos, mat] => Placed {
                pos: pos.row(world, geom),
                mat: mat.row(world, geom),
            },
            _ => on_body(poses[0].row(world, geoms[geom].body), &geoms[geom].pose),
        };
        let ray = |world: usize, ray: usize| Ray {
            origin: pnt.row(world, ray),
            direction: vec.row(world, ray),
            exclude: exclude[(world, ray)],
        };
        let casting = Casting {
            geoms: &chosen,
            place: &place,
            ray: &ray,
            rays,
            threads,
        };
        let (mut dist, mut geom) = (vec![0.0; worlds * rays], vec![0; worlds * rays]);
        let mut normal = vec![0.0; 3 * worlds * rays];
        let hits = Hits {
            dist: &mut dist,
            geom: &mut geom,
            normal: &mut normal,
        };
        py.detach(|| self.0.cast(&casting, hits));
        let normal = PyArray1::from_vec(py, normal);
        Ok((
            PyArray1::from_vec(py, dist),
            PyArray1::from_vec(py, geom),
            normal,
        ))
    }
}

/// A frame on a body that is at a position and a quaternion (x, y, z, w).
fn on_body([x, y, z, a, b, c, d]: [f64; 7], pose: &Pose) -> Placed {
    let body = Pose {
        pos: [x, y, z],
        quat: [a, b, c, d],
    };
    let pose = body.mul(pose);
    let mut mat = [0.0; 9];
    mat.copy_from_slice(pose.rotation().as_flattened());
    Placed { pos: pose.pos, mat }
}

/// An array of three axes, float32 or float64.
enum Array<'py> {
    F32(PyReadonlyArray3<'py, f32>),
    F64(PyReadonlyArray3<'py, f64>),
}

enum View<'a> {
    F32(ArrayView3<'a, f32>),
    F64(ArrayView3<'a, f64>),
}

impl<'py> Array<'py> {
    fn new(array: &Bound<'py, PyAny>) -> PyResult<Array<'py>> {
        match array.extract() {
            Ok(array) => Ok(Array::F32(array)),
            Err(_) => Ok(Array::F64(array.extract()?)),
        }
    }

    fn view(&self) -> View<'_> {
        match self {
            Array::F32(array) => View::F32(array.as_array()),
            Array::F64(array) => View::F64(array.as_array()),
        }
    }
}

impl View<'_> {
    fn dim(&self) -> (usize, usize, usize) {
        match self {
            View::F32(view) => view.dim(),
            View::F64(view) => view.dim(),
        }
    }

    fn row<const N: usize>(&self, i: usize, j: usize) -> [f64; N] {
        match self {
            View::F32(view) => std::array::from_fn(|k| f64::from(view[(i, j, k)])),
            View::F64(view) => std::array::from_fn(|k| view[(i, j, k)]),
        }
    }
}
