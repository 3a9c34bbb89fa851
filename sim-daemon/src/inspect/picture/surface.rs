//! Triangles of all links in world axes, with the normals they are shaded by.

use sim_core::model::Pose;
use sim_core::model::geometry::TriMesh;

use super::vector::{Vector, along, cross, dot, sub, unit};

/// Facets that meet at less than this are one curved surface: its cosine, of 35°.
const SMOOTH: f64 = 0.82;
/// Most facets at a vertex that is smoothed: the pole of a ball has 48. It bounds the work, which is its square.
const FAN_MAX: usize = 128;

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

/// The middle of a box.
pub(super) fn middle([low, high]: [Vector; 2]) -> Vector {
    std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]))
}

/// Lowest and highest coordinates; zeros if there are no points.
pub(super) fn extent(points: impl Iterator<Item = Vector>) -> [Vector; 2] {
    points
        .fold(None, |extent: Option<[Vector; 2]>, point| {
            let [low, high] = extent.unwrap_or([point; 2]);
            Some([
                std::array::from_fn(|axis| low[axis].min(point[axis])),
                std::array::from_fn(|axis| high[axis].max(point[axis])),
            ])
        })
        .unwrap_or_default()
}

fn placed(pose: &Pose, vertices: &[Vector]) -> Vec<Vector> {
    let rows = pose.rotation();
    vertices
        .iter()
        .map(|&vertex| std::array::from_fn(|axis| dot(rows[axis], vertex) + pose.pos[axis]))
        .collect()
}

/// Normal at each corner of each triangle: the mean of the facets around that vertex that form one smooth surface with
/// this one, weighted by area.
fn corner_normals(vertices: &[Vector], triangles: &[[u32; 3]]) -> Vec<[[i16; 3]; 3]> {
    // twice the area along the normal
    let areas: Vec<Vector> = triangles
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|vertex| vertices[vertex as usize]);
            cross(sub(b, a), sub(c, a))
        })
        .collect();
    let mut start = vec![0_usize; vertices.len() + 1];
    for &vertex in triangles.iter().flatten() {
        start[vertex as usize + 1] += 1;
    }
    for vertex in 0..vertices.len() {
        start[vertex + 1] += start[vertex];
    }
    let mut around = vec![0_u32; 3 * triangles.len()];
    let mut filled = start.clone();
    for (facet, corners) in triangles.iter().enumerate() {
        for &vertex in corners {
            around[filled[vertex as usize]] = facet as u32;
            filled[vertex as usize] += 1;
        }
    }
    let at_corner = |facet: usize, vertex: u32| {
        let own = unit(areas[facet]);
        let fan = &around[start[vertex as usize]..start[vertex as usize + 1]];
        if fan.len() > FAN_MAX {
            return own;
        }
        let mut sum = [0.0; 3];
        for &other in fan {
            let area = areas[other as usize];
            if dot(own, area) > SMOOTH * dot(area, area).sqrt() {
                sum = along(sum, 1.0, area);
            }
        }
        unit(sum)
    };
    let quantised = |normal: Vector| normal.map(|part| (part * 32767.0).round() as i16);
    triangles
        .iter()
        .enumerate()
        .map(|(facet, corners)| corners.map(|vertex| quantised(at_corner(facet, vertex))))
        .collect()
}
