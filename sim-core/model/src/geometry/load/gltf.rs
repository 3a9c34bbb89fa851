//! glTF 2.0, binary (`.glb`) or JSON with buffers inside or beside it: every mesh of the scene, where its nodes put it.
//!
//! The format is in metres and y up; it is turned to z up as Blender, Drake and, since 2025, RViz do. The gltf crate reads
//! the JSON; the numbers are read by `gltf_rows`, since its readers trust strides and counts.

use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

use gltf::mesh::{Mode, Semantic};
use gltf::{Document, Gltf, Node};

use super::gltf_material::{self, Images};
use super::gltf_rows::Buffers;
use super::raw::{fan, separate, strip};
use super::scene::Affine;
use super::text::unmarked;
use super::{Limits, RawMesh, Run};

/// Deepest nesting of scene nodes.
const DEPTH_MAX: usize = 100;
/// Most scene nodes visited: those that refer to one another can stand for billions.
const VISITS_MAX: usize = 10_000;

pub(super) fn read(bytes: &[u8], folder: &Path, limits: Limits) -> Result<RawMesh, String> {
    let Gltf { document, blob } = Gltf::from_slice(unmarked(bytes)?)
        .map_err(|error| format!("is not glTF 2.0: {error}; export it again"))?;
    if let Some(extension) = document.extensions_required().next() {
        return Err(format!(
            "it needs the extension {extension}; export it without"
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
            self.limits.vertices(raw.vertices.len() + count)?;
            self.limits
                .triangles(raw.triangles.len() + corners / step)?;
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
                let own = places
                    .iter()
                    .map(|places| places.map(|at| indices[at] as usize));
                let own: Vec<[usize; 3]> = own.collect();
                raw.runs.push(Run {
                    first: first_triangle,
                    ..gltf_material::looks(&primitive, &own, &self.buffers, &mut self.images)
                });
            }
        }
        Ok(raw)
    }
}
