//! Triangles of all links in world axes, with the normals they are shaded by.

use sim_model::Pose;
use sim_model::geometry::TriMesh;

use sim_picture::corner_normals;
use sim_picture::vector::{Vector, along, dot, extent, middle, sub};

/// A triangle.
#[derive(Clone, Debug)]
pub(super) struct Facet {
    /// Corners from the middle of the surface [m].
    pub corners: [[f32; 3]; 3],
    /// Normal at each corner, parts in 32767ths.
    pub normals: [[i16; 3]; 3],
    /// Which link it belongs to, as counted by the caller.
    pub link: u32,
}

/// All triangles of a robot.
#[derive(Clone, Debug, Default)]
pub(super) struct Surface {
    /// Lowest and highest coordinates [m].
    pub extent: [Vector; 2],
    pub facets: Vec<Facet>,
}

impl Surface {
    /// The shapes of some links: number of the link, frame of the shape in the world, its triangles.
    pub fn new(shapes: &[(u32, Pose, TriMesh)]) -> Surface {
        let world: Vec<Vec<Vector>> = shapes
            .iter()
            .map(|(_, pose, mesh)| placed(pose, &mesh.vertices))
            .collect();
        let extent = extent(world.iter().flatten().copied());
        let middle = middle(extent);
        let mut facets = Vec::with_capacity(shapes.iter().map(|s| s.2.triangles.len()).sum());
        for ((link, _, mesh), vertices) in shapes.iter().zip(&world) {
            let normals = corner_normals(vertices, &mesh.triangles);
            facets.extend(
                mesh.triangles
                    .iter()
                    .zip(normals)
                    .map(|(corners, normals)| {
                        Facet {
                            // less the middle, f32 resolves far more than a pixel
                            corners: corners.map(|vertex| {
                                sub(vertices[vertex as usize], middle).map(|x| x as f32)
                            }),
                            normals,
                            link: *link,
                        }
                    }),
            );
        }
        Surface { extent, facets }
    }

    /// Length of its diagonal, 1 m if it has none [m].
    pub fn size(&self) -> f64 {
        let [low, high] = self.extent;
        let diagonal = sub(high, low);
        let size = dot(diagonal, diagonal).sqrt();
        if size > 0.0 { size } else { 1.0 }
    }

    /// Corners of all facets [m].
    pub fn points(&self) -> impl Iterator<Item = Vector> {
        let middle = self.middle();
        let corners = self.facets.iter().flat_map(|facet| facet.corners);
        corners.map(move |corner| along(middle, 1.0, corner.map(f64::from)))
    }

    /// The middle of its extent [m].
    pub fn middle(&self) -> Vector {
        middle(self.extent)
    }
}

fn placed(pose: &Pose, vertices: &[Vector]) -> Vec<Vector> {
    let rows = pose.rotation();
    vertices
        .iter()
        .map(|&vertex| std::array::from_fn(|axis| dot(rows[axis], vertex) + pose.pos[axis]))
        .collect()
}
