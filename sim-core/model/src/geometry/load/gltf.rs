//! glTF 2.0, binary (`.glb`) or JSON with buffers inside or beside it: every mesh of the scene, where its nodes put it.
//!
//! The format is in metres and y up; it is turned to z up as Blender, Drake and, since 2025, RViz do. The gltf crate reads
//! the JSON; the numbers are read here, since its readers trust strides and counts.

use std::collections::HashMap;
use std::path::{Component, Path};
use std::rc::Rc;

use base64::Engine as _;
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::{Mode, Semantic};
use gltf::{Accessor, Document, Gltf, Node, buffer};

use super::scene::Affine;
use super::{FILE_MAX, Limits, RawMesh, bytes_of};

/// Deepest nesting of scene nodes.
const DEPTH_MAX: usize = 100;
/// Most scene nodes visited: those that refer to one another can stand for billions.
const VISITS_MAX: usize = 10_000;

pub(super) fn read(bytes: &[u8], folder: &Path, limits: Limits) -> Result<RawMesh, String> {
    let Gltf { document, mut blob } = Gltf::from_slice(bytes)
        .map_err(|error| format!("is not glTF 2.0: {error}; export it again"))?;
    if let Some(extension) = document.extensions_required().next() {
        return Err(format!(
            "it needs the extension {extension}; export it without"
        ));
    }
    let mut buffers = Vec::new();
    let mut total = 0;
    for buffer in document.buffers() {
        let data = match buffer.source() {
            buffer::Source::Bin => blob
                .take()
                .ok_or("its binary part is missing; export it again")?,
            buffer::Source::Uri(uri) => external(uri, folder)?,
        };
        if data.len() < buffer.length() {
            let (told, found) = (buffer.length(), data.len());
            return Err(format!(
                "a buffer should have {told} bytes and has {found}; copy or export it again"
            ));
        }
        total += data.len() as u64;
        if total > FILE_MAX {
            return Err(format!(
                "its buffers exceed the limit of {} MiB; simplify the mesh",
                FILE_MAX >> 20
            ));
        }
        buffers.push(data);
    }
    let mut scene = Scene {
        buffers,
        limits,
        mesh: RawMesh::default(),
        read: HashMap::new(),
        visits: 0,
    };
    scene.whole(&document)?;
    Ok(scene.mesh)
}

/// The bytes of a buffer that is not in the file itself.
fn external(uri: &str, folder: &Path) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) = data
            .split_once(";base64,")
            .ok_or("a buffer's data: URI is not base64; export it again")?;
        return base64::engine::general_purpose::STANDARD
            .decode(text)
            .map_err(|error| format!("a buffer's base64 is broken: {error}; export it again"));
    }
    let path = Path::new(uri);
    let inside = path
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if uri.contains(':') || !inside {
        return Err(format!(
            "its buffer `{uri}` is not a file beside it; export it as .glb"
        ));
    }
    bytes_of(&folder.join(path), FILE_MAX).map_err(|reason| format!("its buffer `{uri}`: {reason}"))
}

struct Scene {
    buffers: Vec<Vec<u8>>,
    limits: Limits,
    mesh: RawMesh,
    /// Meshes that were shown before, by index.
    read: HashMap<usize, Rc<RawMesh>>,
    visits: usize,
}

impl Scene {
    fn whole(&mut self, document: &Document) -> Result<(), String> {
        match document
            .default_scene()
            .or_else(|| document.scenes().next())
        {
            Some(scene) => scene
                .nodes()
                .try_for_each(|node| self.node(&node, Affine::Y_UP, 0)),
            None => document
                .meshes()
                .try_for_each(|mesh| self.mesh(&mesh, Affine::Y_UP)),
        }
    }

    fn node(&mut self, node: &Node, frame: Affine, depth: usize) -> Result<(), String> {
        self.visits += 1;
        if depth > DEPTH_MAX || self.visits > VISITS_MAX {
            return Err(format!(
                "its nodes nest deeper than {DEPTH_MAX}, or stand for more than {VISITS_MAX}; simplify the scene"
            ));
        }
        let columns = node.transform().matrix();
        let row = |row: usize| [0, 1, 2, 3].map(|column| f64::from(columns[column][row]));
        let frame = frame.after(Affine([row(0), row(1), row(2)]));
        if let Some(mesh) = node.mesh() {
            self.mesh(&mesh, frame)?;
        }
        node.children()
            .try_for_each(|child| self.node(&child, frame, depth + 1))
    }

    /// Shows a mesh, which is read when it is met first.
    fn mesh(&mut self, mesh: &gltf::Mesh, frame: Affine) -> Result<(), String> {
        let part = match self.read.get(&mesh.index()) {
            Some(part) => part.clone(),
            None => {
                let part = Rc::new(self.read(mesh)?);
                self.read.insert(mesh.index(), part.clone());
                part
            }
        };
        self.mesh.place(&part, &frame, self.limits)
    }

    /// The triangles of a mesh in its own frame.
    fn read(&self, mesh: &gltf::Mesh) -> Result<RawMesh, String> {
        let mut raw = RawMesh::default();
        for primitive in mesh.primitives() {
            let Some(positions) = primitive.get(&Semantic::Positions) else {
                continue;
            };
            let step = match primitive.mode() {
                Mode::Triangles => 3,
                Mode::TriangleStrip | Mode::TriangleFan => 1,
                Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => continue,
            };
            let (first, count) = (raw.vertices.len() as u32, positions.count());
            // several primitives may tell of the same numbers, so the limits come before reading
            let corners = primitive.indices().map_or(count, |indices| indices.count());
            self.limits.vertices(raw.vertices.len() + count)?;
            self.limits
                .triangles(raw.triangles.len() + corners / step)?;
            let number = |bytes: &[u8], at: usize| {
                f64::from(f32::from_le_bytes([
                    bytes[at],
                    bytes[at + 1],
                    bytes[at + 2],
                    bytes[at + 3],
                ]))
            };
            let point = |bytes: &[u8]| [0, 4, 8].map(|at| number(bytes, at));
            raw.vertices
                .append(&mut self.rows(&positions, Dimensions::Vec3, point)?);
            let indices: Vec<u32> = match primitive.indices() {
                Some(indices) => self.indices(&indices)?,
                None => (0..count as u32).collect(),
            };
            if let Some(wrong) = indices.iter().find(|&&index| index as usize >= count) {
                return Err(format!(
                    "an index is {wrong}, but there are {count} vertices; export it again"
                ));
            }
            let corners: Vec<u32> = indices.into_iter().map(|index| first + index).collect();
            match primitive.mode() {
                Mode::TriangleStrip => raw.strip(&corners),
                Mode::TriangleFan => raw.polygon(&corners),
                _ => corners
                    .chunks_exact(3)
                    .for_each(|corners| raw.polygon(corners)),
            }
        }
        Ok(raw)
    }

    fn indices(&self, accessor: &Accessor) -> Result<Vec<u32>, String> {
        let scalar = Dimensions::Scalar;
        match accessor.data_type() {
            DataType::U8 => self.rows(accessor, scalar, |bytes| u32::from(bytes[0])),
            DataType::U16 => self.rows(accessor, scalar, |bytes| {
                u32::from(u16::from_le_bytes([bytes[0], bytes[1]]))
            }),
            DataType::U32 => self.rows(accessor, scalar, |bytes| {
                u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
            }),
            _ => Err("its indices are no whole numbers; export it again".to_owned()),
        }
    }

    /// The rows of an accessor, each read from its bytes; positions are f32.
    fn rows<T>(
        &self,
        accessor: &Accessor,
        shape: Dimensions,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, String> {
        let wrong_kind = shape == Dimensions::Vec3 && accessor.data_type() != DataType::F32;
        if accessor.dimensions() != shape || wrong_kind || accessor.sparse().is_some() {
            return Err(
                "its positions or indices are packed or sparse; export it plainly".to_owned(),
            );
        }
        let short = || "its buffers are shorter than it tells; copy or export it again".to_owned();
        let view = accessor.view().ok_or_else(short)?;
        let width = accessor.size();
        let stride = view.stride().unwrap_or(width).max(width);
        let data = self.buffers.get(view.buffer().index()).ok_or_else(short)?;
        let data = data
            .get(view.offset()..)
            .and_then(|rest| rest.get(..view.length()))
            .ok_or_else(short)?;
        let count = accessor.count();
        let mut rows = Vec::new();
        for row in 0..count {
            // read one by one: a count that is too large ends here before it takes memory
            let start = row
                .checked_mul(stride)
                .and_then(|at| at.checked_add(accessor.offset()))
                .ok_or_else(short)?;
            let end = start.checked_add(width).ok_or_else(short)?;
            rows.push(read(data.get(start..end).ok_or_else(short)?));
        }
        Ok(rows)
    }
}
