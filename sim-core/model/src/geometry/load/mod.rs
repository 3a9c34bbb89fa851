//! Mesh files to triangles, in the file's own frame and units turned to metres and z up.
//!
//! What comes from outside is checked: sizes before memory is taken, indices before they are followed, numbers for being
//! finite. STL and OBJ say nothing of units and axes and are taken as they are; COLLADA and glTF say both.

mod dae;
mod dae_mesh;
mod gltf;
mod obj;
mod scene;
mod stl;

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::trimesh::TriMesh;
use super::vector::Vector;
use scene::Affine;

/// Largest file [bytes].
pub const FILE_MAX: u64 = 256 << 20;
/// Most triangles of a mesh.
pub const TRIANGLES_MAX: usize = 4_000_000;
/// Largest coordinate [m]: far beyond any robot, and its sixth power, which inertias need, is still a number.
const COORDINATE_MAX: f64 = 1e9;

/// What a file may ask for.
#[derive(Clone, Copy)]
struct Limits {
    triangles: usize,
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

/// Triangles as a file gives them.
#[derive(Default)]
struct RawMesh {
    vertices: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
    /// What was done to it that its author may not expect, a sentence each.
    notes: Vec<String>,
}

impl RawMesh {
    /// Adds a triangle with corners of its own.
    fn triangle(&mut self, corners: [Vector; 3]) {
        let first = self.vertices.len() as u32;
        self.vertices.extend(corners);
        self.triangles.push([first, first + 1, first + 2]);
    }

    /// Adds a part of a scene where this map puts it; a map that mirrors keeps the outside outside.
    fn place(&mut self, part: &RawMesh, map: &Affine, limits: Limits) -> Result<(), String> {
        limits.triangles(self.triangles.len() + part.triangles.len())?;
        limits.vertices(self.vertices.len() + part.vertices.len())?;
        let first = self.vertices.len() as u32;
        let places = part.vertices.iter().map(|&vertex| map.apply(vertex));
        self.vertices.extend(places);
        let mirrors = map.mirrors();
        self.triangles.extend(part.triangles.iter().map(|corners| {
            let [a, b, c] = corners.map(|corner| first + corner);
            if mirrors { [a, c, b] } else { [a, b, c] }
        }));
        Ok(())
    }

    /// Adds a strip of triangles, every other of which runs the other way.
    fn strip(&mut self, corners: &[u32]) {
        for (index, corners) in corners.windows(3).enumerate() {
            let swap = index % 2;
            self.polygon(&[corners[0], corners[1 + swap], corners[2 - swap]]);
        }
    }

    /// Adds a polygon as a fan around its first corner, where it has three or more; integrals over it come out right even
    /// where it is concave.
    fn polygon(&mut self, corners: &[u32]) {
        for pair in corners.windows(2).skip(1) {
            self.triangles.push([corners[0], pair[0], pair[1]]);
        }
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

/// Reads the triangles of a file, vertices at the same place joined, with notes on what its author may not expect.
///
/// # Errors
/// Why the file cannot be used, and the cure.
pub(super) fn load(path: &Path) -> Result<(TriMesh, Vec<String>), String> {
    let format = format_of(path)?;
    let bytes = bytes_of(path, FILE_MAX)?;
    if bytes.is_empty() {
        return Err("it is empty; export it again".to_owned());
    }
    let limits = Limits {
        triangles: TRIANGLES_MAX,
    };
    let raw = match format {
        Format::Stl => stl::read(&bytes, limits),
        Format::Obj => obj::read(&bytes, limits),
        Format::Dae => dae::read(&bytes, limits),
        Format::Gltf => gltf::read(&bytes, path.parent().unwrap_or(Path::new("")), limits),
    }?;
    if raw.triangles.is_empty() {
        return Err("it holds no triangles; export a surface".to_owned());
    }
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
    let mesh = TriMesh {
        vertices: raw.vertices,
        triangles: raw.triangles,
    }
    .joined();
    if mesh.triangles.is_empty() {
        return Err("all its triangles are without area; export a surface".to_owned());
    }
    Ok((mesh, raw.notes))
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
    let unreadable = |error: std::io::Error| format!("cannot be read: {error}");
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    // a pipe or a device may never end
    if !metadata.is_file() {
        return Err("it is not a file".to_owned());
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(unreadable)?;
    file.take(most + 1)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.len() as u64 > most {
        return Err(format!(
            "it is larger than the limit of {} MiB; simplify the mesh",
            most >> 20
        ));
    }
    Ok(bytes)
}

/// Lines of a text, whether they end as on Unix, Windows or the old Macintosh.
fn lines(text: &str) -> impl Iterator<Item = &str> {
    let end = if text.contains('\n') { '\n' } else { '\r' };
    text.split(end)
}
