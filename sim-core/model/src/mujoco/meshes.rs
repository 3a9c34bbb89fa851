//! Meshes of a model. MuJoCo has put their vertices into the frames of their geoms.

use std::ops::Range;
use std::sync::Arc;

use super::format::ModelFile;
use super::names::names;
use super::options::MujocoOptions;
use crate::description::Shape;
use crate::error::ModelError;
use crate::geometry::{Hull, Mesh, MeshOptions, Polygon, TriMesh, WholeHull};

/// Of a mesh with fewer vertices MuJoCo looks at all of them, of others at those of its hull.
const HULL_VERTICES_MIN: usize = 10;

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
    /// Polygons around each mesh's hull, with corners counted likewise; none where a file of an older version lacks them.
    polygons: Vec<Vec<Polygon>>,
}

/// Reads the polygons around the hull of each mesh.
fn polygons(file: &ModelFile, count: usize) -> Result<Vec<Vec<Polygon>>, ModelError> {
    let beyond = || file.fault("has polygons that are not there".to_owned());
    // each is of one mesh, and a corner of one polygon: shared ones could stand for more than any memory
    let is_shared = |counts: &[i64], all: usize| {
        let counts = counts
            .iter()
            .filter_map(|&count| usize::try_from(count).ok());
        counts.fold(0, usize::saturating_add) > all
    };
    let shared = || file.fault("has polygons or corners that meshes share".to_owned());
    let parts = |first: i64, count: i64| {
        let first = usize::try_from(first).ok()?;
        Some(first..first.checked_add(usize::try_from(count).ok()?)?)
    };
    let corners = file.integers_or("mesh_polyvert", file.rows("mesh_polyvert"), 0)?;
    let rows = file.rows("mesh_polynormal");
    let normals: Vec<[f64; 3]> = match rows {
        0 => Vec::new(),
        _ => file.vectors("mesh_polynormal", rows)?,
    };
    if normals.as_flattened().iter().any(|x| !x.is_finite()) {
        return Err(file.fault("has a polygon with an infinite normal".to_owned()));
    }
    let firsts = file.integers_or("mesh_polyvertadr", rows, 0)?;
    let counts = file.integers_or("mesh_polyvertnum", rows, 0)?;
    if is_shared(&counts, corners.len()) {
        return Err(shared());
    }
    let mut all = Vec::with_capacity(rows);
    for (polygon, (&first, &count)) in firsts.iter().zip(&counts).enumerate() {
        let listed = parts(first, count).and_then(|part| corners.get(part));
        let indices = listed.and_then(|listed| {
            listed
                .iter()
                .map(|&corner| u32::try_from(corner).ok())
                .collect()
        });
        all.push(Polygon {
            corners: indices.ok_or_else(beyond)?,
            normal: normals[polygon],
        });
    }
    let firsts = file.integers_or("mesh_polyadr", count, 0)?;
    let counts = file.integers_or("mesh_polynum", count, 0)?;
    if is_shared(&counts, all.len()) {
        return Err(shared());
    }
    let of_meshes = firsts.into_iter().zip(counts);
    let of_meshes = of_meshes.map(|(first, count)| Some(all.get(parts(first, count)?)?.to_vec()));
    of_meshes.collect::<Option<_>>().ok_or_else(beyond)
}

/// MuJoCo's hull of these vertices: `corners` are those that it has, in the order in which equally deep ones count. None where its
/// polygons have others.
fn mujocos_hull(
    vertices: &[[f64; 3]],
    corners: &[usize],
    polygons: &[Polygon],
) -> Option<WholeHull> {
    let order: Vec<usize> = match vertices.len() < HULL_VERTICES_MIN {
        true => (0..vertices.len()).collect(),
        false => corners.to_vec(),
    };
    let mut places = vec![None; vertices.len()];
    for (place, &vertex) in order.iter().enumerate() {
        places[vertex] = Some(place as u32);
    }
    let renamed = polygons.iter().map(|polygon| {
        let corners = polygon.corners.iter();
        let corners = corners.map(|&corner| places.get(corner as usize).copied()?);
        Some(Polygon {
            corners: corners.collect::<Option<_>>()?,
            normal: polygon.normal,
        })
    });
    Some(WholeHull {
        polygons: renamed.collect::<Option<_>>()?,
        vertices: order.into_iter().map(|vertex| vertices[vertex]).collect(),
    })
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
            polygons: polygons(file, count)?,
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
        let corners = self.corners[self.parts[place][2].clone()].iter();
        let corners = corners.map(|&corner| {
            let corner = usize::try_from(corner).ok();
            corner.filter(|&corner| corner < triangles.vertices.len())
        });
        let corners = corners.collect::<Option<Vec<usize>>>().ok_or_else(|| {
            let fault = "has a hull with corners that are not there".to_owned();
            self.file.fault(fault)
        })?;
        let points = triangles.vertices.clone();
        let hull: Vec<[f64; 3]> = corners.iter().map(|&corner| points[corner]).collect();
        let most = options.max_hull_vertices;
        let mut mesh = Mesh::from_triangles(
            &self.names[place],
            triangles,
            (!hull.is_empty()).then_some(&hull[..]),
            &MeshOptions {
                max_hull_vertices: most,
                convex_decomposition: false,
                collada_up_axis: false,
            },
        )?;
        let of_mujoco = match hull.is_empty() {
            true => None,
            false => mujocos_hull(&points, &corners, &self.polygons[place]),
        };
        if let Some(whole) = of_mujoco {
            let has_room = hull.len() <= most;
            let as_mujocos = |computed: Hull| match (computed.flat, has_room) {
                (true, _) => computed,
                (false, true) => {
                    computed.with_polygons(whole.vertices.clone(), whole.polygons.clone())
                }
                // a lower limit counts in `f64`, too, and a file of an older version has no polygons
                (false, false) => Hull {
                    whole: (most == MujocoOptions::HULL_VERTICES && !whole.polygons.is_empty())
                        .then(|| Arc::new(whole.clone())),
                    ..computed
                },
            };
            mesh.hulls = mesh.hulls.into_iter().map(as_mujocos).collect();
        }
        Ok(Shape::Mesh(Arc::new(mesh)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use safetensors::{Dtype, serialize, tensor::TensorView};

    /// The polygons of so many meshes in a file with triangles of corners 0, 1 and 2, whose numbers begin at `firsts`; each mesh
    /// has one triangle from the first on.
    fn read(firsts: &[i32], meshes: usize) -> Result<Vec<Vec<Polygon>>, ModelError> {
        let bytes = |numbers: &[i32]| -> Vec<u8> {
            let numbers = numbers.iter().flat_map(|number| number.to_le_bytes());
            numbers.collect()
        };
        let rows = firsts.len();
        let normals = vec![0; 24 * rows];
        let columns = [
            ("format", vec![1]),
            ("mesh_polyvert", vec![0, 1, 2]),
            ("mesh_polyvertadr", firsts.to_vec()),
            ("mesh_polyvertnum", vec![3; rows]),
            ("mesh_polyadr", vec![0; meshes]),
            ("mesh_polynum", vec![1; meshes]),
        ];
        let columns = columns.map(|(name, numbers)| (name, numbers.len(), bytes(&numbers)));
        let mut views: Vec<_> = columns
            .iter()
            .map(|(name, count, data)| {
                let view = TensorView::new(Dtype::I32, vec![*count], data);
                (*name, view.unwrap())
            })
            .collect();
        let normals = TensorView::new(Dtype::F64, vec![rows, 3], &normals).unwrap();
        views.push(("mesh_polynormal", normals));
        let name = format!("tightloop-polygons-{}-{rows}-{meshes}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, serialize(views, None).unwrap()).unwrap();
        let file = ModelFile::read(&path);
        std::fs::remove_file(&path).unwrap();
        polygons(&file.unwrap(), meshes)
    }

    #[test]
    fn polygons_and_corners_that_are_shared_are_refused() {
        let whole = read(&[0], 1).unwrap();
        assert_eq!(whole[0][0].corners, [0, 1, 2]);
        for (firsts, meshes) in [(&[0][..], 2), (&[0, 0][..], 1)] {
            let message = read(firsts, meshes).unwrap_err().to_string();
            assert!(message.contains("that meshes share"), "{message}");
        }
    }
}
