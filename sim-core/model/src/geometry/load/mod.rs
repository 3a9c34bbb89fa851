//! Mesh files to triangles and their looks, in the file's own frame and units turned to metres and z up.
//!
//! One reader per format serves both: collisions take the triangles ([`Source::load`]), visuals the materials, too
//! ([`super::visual`]).
//!
//! What comes from outside is checked: sizes before memory is taken, indices before they are followed, numbers for being
//! finite. STL and OBJ say nothing of units and axes and are taken as they are; COLLADA and glTF say both. COLLADA's up axis
//! is applied where the reader of a file asks for it.

mod color;
mod dae;
mod dae_material;
mod dae_mesh;
mod dae_xml;
mod gltf;
mod gltf_material;
mod gltf_rows;
mod mtl;
mod obj;
mod raw;
mod scene;
mod stl;
mod text;

use std::path::Path;

use super::trimesh::TriMesh;
use crate::cache_files::digest;
use crate::contents;
use crate::files::{self, FileError};
pub(super) use raw::{Beside, Material, RawMesh, Run, Uv};

/// Largest file [bytes].
pub const FILE_MAX: u64 = 256 << 20;
/// Most triangles of a mesh.
pub const TRIANGLES_MAX: usize = 4_000_000;
/// Largest coordinate [m]: far beyond any robot, and its sixth power, which inertias need, is still a number.
const COORDINATE_MAX: f64 = 1e9;

/// What is said of a file that only has points and lines left.
pub(super) const NO_AREA: &str = "all its triangles are without area; export a surface";

/// What a file may ask for, and what is wanted of it.
#[derive(Clone, Copy)]
struct Limits {
    triangles: usize,
    /// Whether materials are read, too.
    looks: bool,
    /// Whether COLLADA's `<up_axis>` is applied.
    collada_up_axis: bool,
}

impl Limits {
    /// Refuses more triangles than this.
    fn triangles(self, count: usize) -> Result<(), String> {
        if count > self.triangles {
            let most = self.triangles;
            return Err(format!(
                "it has {count} triangles or more, the limit is {most}; simplify the mesh"
            ));
        }
        Ok(())
    }

    /// Refuses more vertices than so many triangles can have.
    fn vertices(self, count: usize) -> Result<(), String> {
        let most = 3 * self.triangles;
        if count > most {
            return Err(format!(
                "it has more than {most} vertices; simplify the mesh"
            ));
        }
        Ok(())
    }
}

/// Formats by the ending of the file's name.
#[derive(Clone, Copy)]
enum Format {
    Stl,
    Obj,
    Dae,
    Gltf,
}

/// Triangles of a file, vertices at the same place joined.
pub(super) struct Loaded {
    pub triangles: TriMesh,
    /// What was done to it that its author may not expect.
    pub notes: Vec<String>,
    /// The axis that its file says is up, where that is not z and was not applied.
    pub ignored_up_axis: Option<&'static str>,
    /// Other files whose bytes are in the triangles.
    pub beside: Vec<Beside>,
}

/// A mesh file that was read and not yet understood.
pub(super) struct Source<'a> {
    path: &'a Path,
    format: Format,
    pub bytes: Vec<u8>,
}

impl<'a> Source<'a> {
    /// Reads the bytes of a mesh file.
    ///
    /// # Errors
    /// Why the file cannot be used, and the cure.
    pub fn read(path: &'a Path) -> Result<Source<'a>, String> {
        let format = format_of(path)?;
        let bytes = bytes_of(path, FILE_MAX)?;
        if bytes.is_empty() {
            return Err("it is empty; export it again".to_owned());
        }
        if let Some(other) = contents::neither_robot_nor_mesh(&bytes) {
            return Err(other.to_owned());
        }
        Ok(Source {
            path,
            format,
            bytes,
        })
    }

    /// What the bytes mean, beside themselves.
    pub fn kind(&self) -> [u8; 1] {
        [self.format as u8]
    }

    /// The triangles of the file.
    ///
    /// # Errors
    /// Why the file cannot be used, and the cure.
    pub fn load(&self, collada_up_axis: bool) -> Result<Loaded, String> {
        let raw = self.raw(false, collada_up_axis)?;
        let triangles = TriMesh {
            vertices: raw.vertices,
            triangles: raw.triangles,
        }
        .joined();
        if triangles.triangles.is_empty() {
            return Err(NO_AREA.to_owned());
        }
        Ok(Loaded {
            triangles,
            notes: raw.notes,
            ignored_up_axis: raw.ignored_up_axis,
            beside: raw.beside,
        })
    }

    /// The file as it is, with its materials if looks are wanted; coordinates are finite and indices in range.
    fn raw(&self, looks: bool, collada_up_axis: bool) -> Result<RawMesh, String> {
        let limits = Limits {
            triangles: TRIANGLES_MAX,
            looks,
            collada_up_axis,
        };
        let folder = self.path.parent().unwrap_or(Path::new(""));
        let raw = match self.format {
            Format::Stl => stl::read(&self.bytes, limits),
            Format::Obj => obj::read(&self.bytes, folder, limits),
            Format::Dae => dae::read(&self.bytes, folder, limits),
            Format::Gltf => gltf::read(&self.bytes, folder, limits),
        };
        let raw = raw.and_then(|raw| match raw.triangles.is_empty() {
            true => Err("it holds no triangles; export a surface".to_owned()),
            false => Ok(raw),
        });
        let raw = raw.map_err(|reason| self.renamed().unwrap_or(reason))?;
        if let Some(far) = raw
            .vertices
            .iter()
            .flatten()
            .find(|x| x.is_nan() || x.abs() > COORDINATE_MAX)
        {
            return Err(format!(
                "a vertex has the coordinate {far}; give finite numbers of at most {COORDINATE_MAX:e}"
            ));
        }
        Ok(raw)
    }
}

impl Source<'_> {
    /// What is wrong with a file of another format under this one's name.
    fn renamed(&self) -> Option<String> {
        let (format, ending) = contents::mesh_format(&self.bytes)?;
        match format_of(Path::new(&format!("mesh{ending}"))) {
            Ok(by_ending) if by_ending as u8 == self.format as u8 => None,
            Ok(_) => Some(format!("it is {format}; end its name in {ending}")),
            Err(reason) => Some(format!("it is {format}: {reason}")),
        }
    }
}

/// Whether a file is still beside a mesh file in this folder.
pub(super) fn is_beside(file: &Beside, folder: &Path) -> bool {
    bytes_of(&folder.join(&file.path), FILE_MAX).is_ok_and(|bytes| digest(&bytes) == file.digest)
}

/// Reads a file as it is, with its materials if looks are wanted; coordinates are finite and indices in range.
///
/// # Errors
/// Why the file cannot be used, and the cure.
pub(super) fn read(path: &Path, looks: bool, collada_up_axis: bool) -> Result<RawMesh, String> {
    Source::read(path)?.raw(looks, collada_up_axis)
}

fn format_of(path: &Path) -> Result<Format, String> {
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_ascii_lowercase();
    match ending.as_str() {
        "stl" => Ok(Format::Stl),
        "obj" => Ok(Format::Obj),
        "dae" => Ok(Format::Dae),
        "glb" | "gltf" => Ok(Format::Gltf),
        "" => Err(
            "its name has no ending; name the format by .stl, .obj, .dae, .glb or .gltf".to_owned(),
        ),
        other => Err(format!(
            "`.{other}` is not read; convert it to .stl, .obj, .dae, .glb or .gltf"
        )),
    }
}

/// The bytes of a regular file, up to a limit.
fn bytes_of(path: &Path, most: u64) -> Result<Vec<u8>, String> {
    files::read(path, most).map_err(|error| match error {
        FileError::TooLarge { .. } => format!("{error}; simplify the mesh"),
        error => error.to_string(),
    })
}
