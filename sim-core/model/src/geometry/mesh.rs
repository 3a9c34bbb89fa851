//! A mesh of a scene: the triangles of a file, scaled, and the convex hulls that contacts use.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use super::cache::Recipe;
use super::hull::Hull;
use super::load::{Beside, Loaded, Source};
use super::parry::convex_parts;
use super::polytope::triangles_around;
use super::stretch::stretched;
use super::trimesh::TriMesh;
use super::vector::size;
use crate::error::ModelError;

/// Smallest size of a mesh [m]: a scale is wrong below a micrometre.
const SIZE_MIN: f64 = 1e-6;
/// Largest size of a mesh [m]: above it a unit is wrong, and inertias lose their meaning.
const SIZE_MAX: f64 = 1e6;
/// Least volume of a solid over that of the box around it: a folded sheet is closed and holds roundings only [–].
const FILL_MIN: f64 = 1e-12;
/// Share of the hull's volume that a mesh may lack and still count as convex [–].
const CONVEX: f64 = 1e-3;
/// Error of a hull that is worth a note [m].
const NOTED_ERROR: f64 = 1e-3;
/// The same, relative to the size [–].
const NOTED_SHARE: f64 = 0.01;
/// How notes on the error of a hull end.
pub const HULL_NOTE: &str = "(see mesh_max_hull_vertices)";
/// Bounds of `max_hull_vertices`: a box needs 8; more than a few hundred slow contacts down for little accuracy.
const HULL_VERTICES: std::ops::RangeInclusive<usize> = 8..=1024;

/// How meshes become convex hulls for contacts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MeshOptions {
    /// Most vertices of a convex hull, 8 to 1024.
    pub max_hull_vertices: usize,
    /// Whether a concave mesh becomes several convex hulls; otherwise it becomes its convex hull.
    pub convex_decomposition: bool,
    /// Whether a COLLADA file is turned from its `<up_axis>` to z up. Its `<unit>` always counts.
    pub collada_up_axis: bool,
}

impl Default for MeshOptions {
    fn default() -> MeshOptions {
        MeshOptions {
            max_hull_vertices: 64,
            convex_decomposition: false,
            collada_up_axis: true,
        }
    }
}

impl MeshOptions {
    /// Refuses a number of vertices out of bounds.
    ///
    /// # Errors
    /// The number and its bounds.
    pub fn validate(&self) -> Result<(), ModelError> {
        if HULL_VERTICES.contains(&self.max_hull_vertices) {
            return Ok(());
        }
        Err(ModelError::OutOfRange {
            what: "mesh_max_hull_vertices".to_owned(),
            value: self.max_hull_vertices as f64,
            rule: "it must be between 8 and 1024",
        })
    }
}

/// Triangles of a file, scaled.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// The file, as resolved.
    pub path: PathBuf,
    /// Factor on each axis of the file [–].
    pub scale: [f64; 3],
    /// What the file holds, scaled, vertices at the same place joined; if closed, counter-clockwise from outside.
    pub triangles: TriMesh,
    /// Whether the triangles bound a solid.
    pub closed: bool,
    /// What stands for it in contacts.
    pub hulls: Vec<Hull>,
    /// What was done to it that its author may not expect, a sentence each without a subject.
    pub notes: Vec<String>,
    /// The axis that its file says is up, where that is not z and was not applied.
    pub ignored_up_axis: Option<&'static str>,
}

impl Mesh {
    /// Reads a mesh file; `scale` [–] multiplies its coordinates, a negative factor mirrors.
    ///
    /// # Errors
    /// Why the file cannot be used, by its path, with the cure.
    pub fn load(path: &Path, scale: [f64; 3], options: &MeshOptions) -> Result<Mesh, ModelError> {
        options.validate()?;
        let source = Source::read(path).map_err(|reason| fault(path, reason))?;
        let mut recipe = Recipe::new(scale, options);
        recipe.add(&source.kind());
        recipe.add(&source.bytes);
        recipe.mesh(path, scale, || {
            let loaded = source.load(options.collada_up_axis);
            let loaded = loaded.map_err(|reason| fault(path, reason))?;
            Mesh::of_loaded(path, scale, loaded, options)
        })
    }

    fn of_loaded(
        path: &Path,
        scale: [f64; 3],
        loaded: Loaded,
        options: &MeshOptions,
    ) -> Result<(Mesh, Vec<Beside>), ModelError> {
        let Loaded {
            mut triangles,
            notes,
            ignored_up_axis,
            beside,
        } = loaded;
        for vertex in &mut triangles.vertices {
            for axis in 0..3 {
                vertex[axis] *= scale[axis];
            }
        }
        // a mirror turns the inside out
        if scale.iter().product::<f64>() < 0.0 {
            triangles.turn_over();
        }
        let mesh = Mesh::made(path, scale, triangles, None, notes, options)?;
        let mesh = Mesh {
            ignored_up_axis,
            ..mesh
        };
        Ok((mesh, beside))
    }

    /// A mesh by its name, of these triangles; its hull is that of some of its vertices, or of all.
    ///
    /// # Errors
    /// Why they cannot be used, by the name, with the cure.
    pub fn from_triangles(
        name: &str,
        triangles: TriMesh,
        hull: Option<&[[f64; 3]]>,
        options: &MeshOptions,
    ) -> Result<Mesh, ModelError> {
        options.validate()?;
        let (path, scale) = (Path::new(name), [1.0; 3]);
        let mut recipe = Recipe::new(scale, options);
        recipe.add_rows(&triangles.vertices);
        recipe.add_corners(&triangles.triangles);
        recipe.add_rows(hull.unwrap_or_default());
        recipe.mesh(path, scale, || {
            let mesh = Mesh::made(path, scale, triangles, hull, Vec::new(), options)?;
            Ok((mesh, Vec::new()))
        })
    }

    fn made(
        path: &Path,
        scale: [f64; 3],
        mut triangles: TriMesh,
        hull: Option<&[[f64; 3]]>,
        notes: Vec<String>,
        options: &MeshOptions,
    ) -> Result<Mesh, ModelError> {
        let size = size(&triangles.vertices);
        if !(SIZE_MIN..=SIZE_MAX).contains(&size) {
            return Err(fault(
                path,
                format!(
                    "its size is {size:e} m, scale {scale:?}; it must be between {SIZE_MIN:e} and {SIZE_MAX:e} m, mend the scale"
                ),
            ));
        }
        let closed = triangles.is_closed()
            && triangles.turn_outward()
            && stretched(&triangles.vertices)
                .is_ok_and(|room| triangles.signed_volume() > FILL_MIN * room.room);
        let mut mesh = Mesh {
            path: path.to_owned(),
            scale,
            triangles,
            closed,
            hulls: Vec::new(),
            notes,
            ignored_up_axis: None,
        };
        mesh.make_hulls(size, hull, options)?;
        Ok(mesh)
    }

    fn make_hulls(
        &mut self,
        size: f64,
        hull: Option<&[[f64; 3]]>,
        options: &MeshOptions,
    ) -> Result<(), ModelError> {
        let most = options.max_hull_vertices;
        let vertices = hull.unwrap_or(&self.triangles.vertices);
        let whole = Hull::from_points(vertices, most)
            .map_err(|why| fault(&self.path, format!("{why}; give it an area, or mend it")))?;
        let flat = whole.flat;
        if flat {
            let thickness = size / 1000.0;
            self.notes.push(format!(
                "is flat; in contacts it is a plate of {thickness:.1e} m"
            ));
        } else if whole.error > NOTED_ERROR || whole.error > NOTED_SHARE * size {
            self.notes.push(format!(
                "has a hull of more than {most} vertices; that many leave {:.2e} m of it out {HULL_NOTE}",
                whole.error
            ));
        }
        self.hulls = if options.convex_decomposition && !flat {
            let parts = self.convex_parts(whole, most).ok_or_else(|| {
                let cure = "mend the mesh, or leave convex_decomposition off";
                fault(
                    &self.path,
                    format!("it cannot be decomposed into convex parts; {cure}"),
                )
            })?;
            if parts.len() > 1 {
                self.notes
                    .push(format!("is decomposed into {} convex parts", parts.len()));
            }
            parts
        } else {
            vec![whole]
        };
        Ok(())
    }

    /// Hulls that cover the mesh together, its own where it is convex; `None` where none can be made.
    fn convex_parts(&self, whole: Hull, vertices_max: usize) -> Option<Vec<Hull>> {
        // measured on the hull of all points: that of few vertices is smaller
        let full = Hull::from_points(&self.triangles.vertices, usize::MAX)
            .ok()?
            .volume();
        if self.closed && self.triangles.signed_volume() >= (1.0 - CONVEX) * full {
            return Some(vec![whole]);
        }
        // a part without surface is inside others; a thin one adds nothing to its neighbours
        let parts = convex_parts(&self.triangles)?;
        let hulls = parts
            .iter()
            .filter_map(|part| Hull::from_points(part, vertices_max).ok());
        let hulls: Vec<Hull> = hulls.collect();
        (!hulls.is_empty()).then_some(hulls)
    }

    /// The surface of the body that the mesh stands for: its own if closed, else that of its convex hull.
    ///
    /// # Errors
    /// A mesh without volume, by its file.
    pub(super) fn solid(&self) -> Result<Cow<'_, TriMesh>, ModelError> {
        if self.closed {
            return Ok(Cow::Borrowed(&self.triangles));
        }
        let vertices = &self.triangles.vertices;
        let triangles = triangles_around(vertices, usize::MAX).map_err(|why| {
            let cure = "so it has no volume; give it thickness, or the link an <inertial>";
            fault(&self.path, format!("{why}, {cure}"))
        })?;
        Ok(Cow::Owned(TriMesh {
            vertices: vertices.clone(),
            triangles,
        }))
    }
}

pub(super) fn fault(path: &Path, reason: String) -> ModelError {
    ModelError::Mesh {
        owner: String::new(),
        path: path.to_owned(),
        reason,
    }
}
