//! Meshes of a model. MuJoCo has put their vertices into the frames of their geoms.

use std::ops::Range;
use std::sync::Arc;

use super::format::ModelFile;
use super::names::names;
use super::options::MujocoOptions;
use crate::description::Shape;
use crate::error::ModelError;
use crate::geometry::{Mesh, MeshOptions, TriMesh};

/// All meshes of a model.
pub(super) struct Meshes<'a> {
    file: &'a ModelFile,
    names: Vec<String>,
    /// Vertices of all meshes. `(vertices, 3)` [m]
    vertices: Vec<[f64; 3]>,
    /// Corners of all meshes' faces, counted from the first vertex of their mesh. `(faces, 3)`
    faces: Vec<[i64; 3]>,
    /// Vertices of the hulls that MuJoCo made, which `maxhullvert` may limit, counted likewise.
    corners: Vec<i64>,
    /// Of each mesh, its part of the vertices, faces and corners.
    parts: Vec<[Range<usize>; 3]>,
}

impl<'a> Meshes<'a> {
    /// Reads them.
    pub fn read(file: &'a ModelFile) -> Result<Meshes<'a>, ModelError> {
        let count = file.rows("mesh_vertadr");
        let ends = ["mesh_vert", "mesh_face", "mesh_hullvert"].map(|array| file.rows(array));
        let parts = |what: &str, end: usize| -> Result<Vec<Range<usize>>, ModelError> {
            let firsts = file.integers(&format!("mesh_{what}adr"), count)?;
            let counts = file.integers(&format!("mesh_{what}num"), count)?;
            let ranges = firsts.into_iter().zip(counts).map(|(first, count)| {
                let last = first.saturating_add(count);
                let range = usize::try_from(first).ok()?..usize::try_from(last).ok()?;
                (range.start <= range.end && range.end <= end).then_some(range)
            });
            ranges
                .collect::<Option<_>>()
                .ok_or_else(|| file.fault(format!("array `mesh_{what}adr` points beyond its mesh")))
        };
        let vertices = parts("vert", ends[0])?.into_iter();
        let faces = parts("face", ends[1])?.into_iter();
        let corners = parts("hull", ends[2])?.into_iter();
        let parts = vertices.zip(faces).zip(corners);
        Ok(Meshes {
            file,
            names: names(file, "mesh", count)?,
            vertices: file.vectors("mesh_vert", ends[0])?,
            faces: file.vectors_of_integers("mesh_face", ends[1])?,
            corners: file.integers("mesh_hullvert", ends[2])?,
            parts: parts.map(|((v, f), c)| [v, f, c]).collect(),
        })
    }

    /// The mesh that a geom names, as a place in the list.
    fn place(&self, mesh: i64) -> Result<usize, ModelError> {
        let place = usize::try_from(mesh).ok();
        place
            .filter(|&mesh| mesh < self.parts.len())
            .ok_or_else(|| self.file.fault("has a geom without its mesh".to_owned()))
    }

    /// The triangles of a mesh.
    pub fn triangles(&self, mesh: i64) -> Result<TriMesh, ModelError> {
        let [vertices, faces, _] = &self.parts[self.place(mesh)?];
        let vertices = self.vertices[vertices.clone()].to_vec();
        if vertices.as_flattened().iter().any(|x| !x.is_finite()) {
            let fault = "has a mesh with an infinite vertex".to_owned();
            return Err(self.file.fault(fault));
        }
        let triangles = self.faces[faces.clone()].iter().map(|face| {
            let corners = face.map(|corner| u32::try_from(corner).unwrap_or(u32::MAX));
            let is_there = corners.iter().all(|&c| (c as usize) < vertices.len());
            is_there.then_some(corners)
        });
        let triangles = triangles.collect::<Option<_>>().ok_or_else(|| {
            let fault = "has a mesh with corners that are not there".to_owned();
            self.file.fault(fault)
        })?;
        Ok(TriMesh {
            vertices,
            triangles,
        })
    }

    /// A mesh with the convex hull that contacts use.
    pub fn shape(&self, mesh: i64, options: &MujocoOptions) -> Result<Shape, ModelError> {
        let triangles = self.triangles(mesh)?;
        let place = self.place(mesh)?;
        let hull = self.corners[self.parts[place][2].clone()]
            .iter()
            .map(|&corner| {
                let corner = usize::try_from(corner).ok();
                corner.and_then(|corner| triangles.vertices.get(corner).copied())
            });
        let hull = hull.collect::<Option<Vec<[f64; 3]>>>().ok_or_else(|| {
            let fault = "has a hull with corners that are not there".to_owned();
            self.file.fault(fault)
        })?;
        let mesh = Mesh::of(
            &self.names[place],
            triangles,
            (!hull.is_empty()).then_some(&hull[..]),
            &MeshOptions {
                max_hull_vertices: options.max_hull_vertices,
                convex_decomposition: false,
                collada_up_axis: false,
            },
        )?;
        Ok(Shape::Mesh(Arc::new(mesh)))
    }
}
