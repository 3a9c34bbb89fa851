//! glTF 2.0, binary (`.glb`) or JSON with buffers inside or beside it: every mesh of the scene, where its nodes put it.
//!
//! The format is in metres and y up; it is turned to z up as Blender, Drake and, since 2025, RViz do. The gltf crate reads
//! the JSON; the numbers are read by `gltf_rows`, since its readers trust strides and counts.

use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

use gltf::json::image::MimeType;
use gltf::json::validation::Checked;
use gltf::mesh::{Mode, Semantic};
use gltf::scene::Transform;
use gltf::{Document, Gltf, Node};

use super::gltf_material::{self, Images};
use super::gltf_rows::Buffers;
use super::raw::{fan, separate, strip};
use super::scene::Affine;
use super::text::unmarked;
use super::{Limits, RawMesh, Run};

/// Deepest nesting of scene nodes.
const DEPTH_MAX: usize = 100;
/// Places of further copies of a node's mesh.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// How a binary file begins; its version and its length follow, then chunks.
const MAGIC: &[u8] = b"glTF";
/// Bytes before the first chunk, and before what a chunk holds.
const HEAD: usize = 12;
const CHUNK_HEAD: usize = 8;
/// Most scene nodes visited: those that refer to one another can stand for billions.
const VISITS_MAX: usize = 10_000;

pub(super) fn read(bytes: &[u8], folder: &Path, limits: Limits) -> Result<RawMesh, String> {
    let bytes = unmarked(bytes)?;
    if bytes.starts_with(MAGIC) {
        check_lengths(bytes)?;
    }
    let broken = |error: gltf::Error| format!("is not glTF 2.0: {error}; export it again");
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes).map_err(broken)?;
    // the check of the whole file would call an extension that is not read an error of the file
    if let Some(needed) = needed(&document) {
        return Err(needed);
    }
    let mut document = document.into_json();
    check_positions(&document)?;
    complete_images(&mut document);
    let document = Document::from_json(document).map_err(broken)?;
    if document
        .extensions_used()
        .any(|extension| extension == INSTANCING)
    {
        return Err(format!(
            "it repeats meshes by the extension {INSTANCING}; export a node for each"
        ));
    }
    let mut scene = Scene {
        buffers: Buffers::read(&document, blob, folder)?,
        images: Images::new(folder),
        limits,
        mesh: RawMesh::default(),
        read: HashMap::new(),
        visits: 0,
    };
    scene.whole(&document)?;
    scene.mesh.beside = scene.buffers.beside;
    Ok(scene.mesh)
}

/// Refuses a binary file that was cut: the gltf crate subtracts from its length, and names no number.
fn check_lengths(bytes: &[u8]) -> Result<(), String> {
    let number = |at: usize| {
        let word = bytes.get(at..at + 4)?.first_chunk()?;
        Some(u32::from_le_bytes(*word) as usize)
    };
    let short = |part: &str, least: usize, present: usize| {
        format!("{part} should have {least} bytes and has {present}; copy or export it again")
    };
    let declared = number(8).unwrap_or_default();
    if bytes.len() < declared.max(HEAD) {
        return Err(short("it", declared.max(HEAD), bytes.len()));
    }
    if declared < HEAD {
        return Err(format!(
            "its header declares {declared} bytes, fewer than its own {HEAD}; export it again"
        ));
    }
    if number(4) != Some(2) {
        // its parts are others, and the gltf crate refuses it
        return Ok(());
    }
    // what follows the two chunks is not read
    let mut start = HEAD;
    for part in ["its JSON part", "its binary part"] {
        let rest = bytes.len() - start;
        match number(start) {
            None if start > HEAD && rest == 0 => {}
            Some(length) if rest >= CHUNK_HEAD && length <= rest - CHUNK_HEAD => {
                start += CHUNK_HEAD + length;
            }
            length => {
                let least = length.unwrap_or_default().saturating_add(CHUNK_HEAD);
                return Err(short(part, least, rest));
            }
        }
    }
    Ok(())
}

/// What is wrong with a file that cannot be read without some extension.
fn needed(document: &Document) -> Option<String> {
    let extension = document.extensions_required().next()?;
    Some(format!(
        "it needs the extension {extension}; export it without"
    ))
}

/// Refuses positions that are not there: the check of the whole file relies on them.
fn check_positions(document: &gltf::json::Root) -> Result<(), String> {
    let primitives = document.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let positions = Checked::Valid(Semantic::Positions);
    let mut places = primitives.filter_map(|primitive| primitive.attributes.get(&positions));
    let count = document.accessors.len();
    match places.find(|place| place.value() >= count) {
        Some(place) => Err(format!(
            "a mesh has its positions in accessor {place}, and there are {count}; export it again"
        )),
        None => Ok(()),
    }
}

/// Gives images what the gltf crate relies on: one in a buffer a type, which is seen in its bytes, and one that is nowhere the
/// address of nothing.
fn complete_images(document: &mut gltf::json::Root) {
    for image in &mut document.images {
        if image.buffer_view.is_some() {
            let unknown = || MimeType(String::new());
            image.mime_type.get_or_insert_with(unknown);
        } else {
            image.uri.get_or_insert_with(|| "data:".to_owned());
        }
    }
}

struct Scene<'a> {
    buffers: Buffers,
    images: Images<'a>,
    limits: Limits,
    mesh: RawMesh,
    /// Meshes that were shown before, by index.
    read: HashMap<usize, Rc<RawMesh>>,
    visits: usize,
}

impl Scene<'_> {
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
        let columns = unit(node.transform())?.matrix();
        let row = |row: usize| [0, 1, 2, 3].map(|column| f64::from(columns[column][row]));
        let frame = frame.after(Affine([row(0), row(1), row(2)]));
        if let Some(mesh) = node.mesh() {
            let blended = node.weights().or(mesh.weights()).unwrap_or_default();
            if blended.iter().any(|&weight| weight != 0.0) {
                return Err("morph targets give it its shape; bake them into its mesh".to_owned());
            }
            // the joints of a skin place it; where it was bound to them, they leave it as it lies in the file
            if node.skin().is_some() {
                let note = "has a skin, and is taken as it was bound to its joints";
                if !self.mesh.notes.iter().any(|known| known == note) {
                    self.mesh.notes.push(note.to_owned());
                }
                self.mesh(&mesh, Affine::Y_UP)?;
            } else {
                self.mesh(&mesh, frame)?;
            }
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
    fn read(&mut self, mesh: &gltf::Mesh) -> Result<RawMesh, String> {
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
            self.limits
                .vertices(raw.vertices.len().saturating_add(count))?;
            self.limits
                .triangles(raw.triangles.len().saturating_add(corners / step))?;
            raw.vertices.append(&mut self.buffers.points(&positions)?);
            let indices: Vec<u32> = match primitive.indices() {
                Some(indices) => self.buffers.indices(&indices)?,
                None => (0..count as u32).collect(),
            };
            if let Some(wrong) = indices.iter().find(|&&index| index as usize >= count) {
                return Err(format!(
                    "an index is {wrong}, but there are {count} vertices; export it again"
                ));
            }
            let places: Vec<[usize; 3]> = match primitive.mode() {
                Mode::TriangleStrip => strip(indices.len()).collect(),
                Mode::TriangleFan => fan(0, indices.len()).collect(),
                _ => separate(indices.len()).collect(),
            };
            let first_triangle = raw.triangles.len();
            let corners: Vec<u32> = indices.iter().map(|index| first + index).collect();
            raw.extend(&corners, &places);
            if self.limits.looks {
                let faces = places
                    .iter()
                    .map(|places| places.map(|at| indices[at] as usize));
                let faces: Vec<[usize; 3]> = faces.collect();
                raw.runs.push(Run {
                    first: first_triangle,
                    ..gltf_material::looks(&primitive, &faces, &self.buffers, &mut self.images)
                });
            }
        }
        Ok(raw)
    }
}

/// A transformation with a rotation of unit length, which some exporters round away from it.
fn unit(transform: Transform) -> Result<Transform, String> {
    let Transform::Decomposed {
        translation,
        rotation,
        scale,
    } = transform
    else {
        return Ok(transform);
    };
    let length = rotation
        .iter()
        .map(|&part| f64::from(part) * f64::from(part))
        .sum::<f64>()
        .sqrt();
    if length == 0.0 {
        return Err("the rotation of a node is 0 0 0 0; export it again".to_owned());
    }
    // one that is a unit to the roundings of a text stays as it was written
    let rotation = match (length - 1.0).abs() < 1e-6 {
        true => rotation,
        false => rotation.map(|part| (f64::from(part) / length) as f32),
    };
    Ok(Transform::Decomposed {
        translation,
        rotation,
        scale,
    })
}
