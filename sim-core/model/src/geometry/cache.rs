//! Compiled meshes, kept from run to run: reading a large file and making its hulls takes a second.
//!
//! A kept mesh is found by the digest of what it is made of: the file, the options, and the code. What is beside a file, such
//! as a buffer of a .gltf file, is listed in the kept mesh and compared.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::Hull;
use super::load::{Beside, is_beside};
use super::mesh::{Mesh, MeshOptions};
use super::trimesh::TriMesh;
use crate::cache_files::{digest, load, store};
use crate::error::ModelError;

/// Most bytes of all kept meshes; one of a million triangles takes 24 MB.
const BYTES_MAX: u64 = 512 << 20;
/// What is made faster than this is made again: to look for it would take as long.
const WORTH: Duration = Duration::from_millis(10);
/// Digest of the source code that makes meshes, and of the versions of its libraries.
const CODE: &str = env!("TIGHTLOOP_GEOMETRY_CODE");

/// The axes that COLLADA files may name where they are not z up.
const UP_AXES: [&str; 2] = ["X_UP", "Y_UP"];

static FOLDER: OnceLock<fn() -> Option<PathBuf>> = OnceLock::new();

/// Keeps compiled meshes in `meshes` below this folder from now on, for the whole process. Nothing is kept without it.
///
/// The first call decides. The function is asked for each mesh, since the environment may change.
pub fn keep_meshes(folder: fn() -> Option<PathBuf>) {
    let _ = FOLDER.set(folder);
}

/// A mesh without what its caller knows, as it is written; in the order of [`Kept`].
#[derive(Serialize)]
struct Written<'a> {
    beside: &'a [Beside],
    triangles: &'a TriMesh,
    closed: bool,
    hulls: &'a [Hull],
    notes: &'a [String],
    ignored_up_axis: Option<&'static str>,
}

/// The same as it is read.
#[derive(Deserialize)]
struct Kept {
    beside: Vec<Beside>,
    triangles: TriMesh,
    closed: bool,
    hulls: Vec<Hull>,
    notes: Vec<String>,
    ignored_up_axis: Option<String>,
}

impl Kept {
    fn mesh(self, path: &Path, scale: [f64; 3]) -> Option<Mesh> {
        let ignored_up_axis = match self.ignored_up_axis {
            Some(name) => Some(*UP_AXES.iter().find(|axis| **axis == name)?),
            None => None,
        };
        Some(Mesh {
            path: path.to_owned(),
            scale,
            triangles: self.triangles,
            closed: self.closed,
            hulls: self.hulls,
            notes: self.notes,
            ignored_up_axis,
        })
    }
}

/// What a mesh is made of.
pub(super) struct Recipe(Vec<u8>);

impl Recipe {
    pub fn new(scale: [f64; 3], options: &MeshOptions) -> Recipe {
        let MeshOptions {
            max_hull_vertices,
            convex_decomposition,
            collada_up_axis,
        } = *options;
        let mut recipe = Recipe(CODE.as_bytes().to_vec());
        recipe.add(scale.map(f64::to_le_bytes).as_flattened());
        recipe.add(&max_hull_vertices.to_le_bytes());
        recipe.add(&[u8::from(convex_decomposition), u8::from(collada_up_axis)]);
        recipe
    }

    /// Adds bytes, so that no others in a row have the same result.
    pub fn add(&mut self, bytes: &[u8]) {
        self.0.extend(digest(bytes));
    }

    /// Adds positions.
    pub fn add_rows(&mut self, rows: &[[f64; 3]]) {
        let numbers = rows.as_flattened().iter();
        self.add(&numbers.flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    }

    /// Adds indices.
    pub fn add_corners(&mut self, rows: &[[u32; 3]]) {
        let numbers = rows.as_flattened().iter();
        self.add(&numbers.flat_map(|k| k.to_le_bytes()).collect::<Vec<u8>>());
    }

    /// The mesh, made or kept; `folder` is that of its file.
    pub fn mesh(
        &self,
        path: &Path,
        scale: [f64; 3],
        make: impl FnOnce() -> Result<(Mesh, Vec<Beside>), ModelError>,
    ) -> Result<Mesh, ModelError> {
        let Some(folder) = FOLDER.get().and_then(|folder| folder()) else {
            return make().map(|(mesh, _)| mesh);
        };
        let name: String = digest(&self.0).map(|byte| format!("{byte:02x}")).concat();
        let file = folder.join("meshes").join(name);
        let beside = path.parent().unwrap_or(Path::new(""));
        if let Some(mesh) = find(&file, beside).and_then(|kept| kept.mesh(path, scale)) {
            return Ok(mesh);
        }
        let start = Instant::now();
        let (mesh, beside) = make()?;
        if start.elapsed() < WORTH {
            return Ok(mesh);
        }
        let kept = Written {
            beside: &beside,
            triangles: &mesh.triangles,
            closed: mesh.closed,
            hulls: &mesh.hulls,
            notes: &mesh.notes,
            ignored_up_axis: mesh.ignored_up_axis,
        };
        if let Ok(body) = postcard::to_stdvec(&kept) {
            store(&file, &body, BYTES_MAX);
        }
        Ok(mesh)
    }
}

fn find(file: &Path, folder: &Path) -> Option<Kept> {
    let kept: Kept = postcard::from_bytes(&load(file, BYTES_MAX)?).ok()?;
    let same = kept.beside.iter().all(|file| is_beside(file, folder));
    same.then_some(kept)
}
