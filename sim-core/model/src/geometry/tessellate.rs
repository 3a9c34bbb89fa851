//! Triangles of any shape, for a picture.

use std::f64::consts::{PI, TAU};

use super::shape::Shape;
use super::trimesh::TriMesh;

/// Corners of a circle: the picture of a ball is within 0.3% of its radius.
const AROUND: usize = 48;

/// The surface of a shape in its own frame, counter-clockwise from outside [m].
///
/// Round shapes are inscribed polyhedra with 48 corners per circle. A mesh keeps the triangles of its file. A plane is a
/// square of 2 m around the origin.
pub fn triangles(shape: &Shape) -> TriMesh {
    match shape {
        Shape::Plane => TriMesh {
            vertices: vec![
                [-1.0, -1.0, 0.0],
                [1.0, -1.0, 0.0],
                [1.0, 1.0, 0.0],
                [-1.0, 1.0, 0.0],
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        },
        &Shape::Box { half_extents } => cuboid(half_extents),
        &Shape::Sphere { radius } => revolved(&half_circles(radius, 0.0)),
        &Shape::Cylinder {
            radius,
            half_height,
        } => revolved(&[
            [0.0, -half_height],
            [radius, -half_height],
            [radius, half_height],
            [0.0, half_height],
        ]),
        &Shape::Capsule {
            radius,
            half_height,
        } => revolved(&half_circles(radius, half_height)),
        &Shape::Ellipsoid { radii } => ellipsoid(radii),
        Shape::HeightField(field) => field.surface(),
        Shape::Mesh(mesh) => mesh.triangles.clone(),
    }
}

fn ellipsoid(radii: [f64; 3]) -> TriMesh {
    let mut mesh = revolved(&half_circles(1.0, 0.0));
    for vertex in &mut mesh.vertices {
        *vertex = std::array::from_fn(|axis| radii[axis] * vertex[axis]);
    }
    mesh
}

fn cuboid(half: [f64; 3]) -> TriMesh {
    // corner k is on the high side of axis i where bit i of k is set
    let vertices = (0..8_usize)
        .map(|corner| {
            std::array::from_fn(|axis| {
                if corner >> axis & 1 == 1 {
                    half[axis]
                } else {
                    -half[axis]
                }
            })
        })
        .collect();
    let sides = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    let triangles = sides
        .iter()
        .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]])
        .collect();
    TriMesh {
        vertices,
        triangles,
    }
}

/// Radius and height along a half circle from pole to pole, cut open at the equator by twice `half_height`.
fn half_circles(radius: f64, half_height: f64) -> Vec<[f64; 2]> {
    let quarter = AROUND / 4;
    let at = |step: usize, shift: f64| {
        let angle = PI * (step as f64 / (2 * quarter) as f64 - 0.5);
        // the poles are on the axis to the bit
        let out = if step == 0 || step == 2 * quarter {
            0.0
        } else {
            radius * libm::cos(angle)
        };
        [out, radius * libm::sin(angle) + shift]
    };
    let mut profile: Vec<[f64; 2]> = (0..=quarter).map(|step| at(step, -half_height)).collect();
    let above = if half_height > 0.0 {
        quarter
    } else {
        quarter + 1
    };
    profile.extend((above..=2 * quarter).map(|step| at(step, half_height)));
    profile
}

/// A profile of radius and height turned about z, from its lowest point to its highest, both on the axis.
fn revolved(profile: &[[f64; 2]]) -> TriMesh {
    let mut mesh = TriMesh::default();
    // the ring of each height, one vertex where it has no radius
    let mut below: Option<Vec<u32>> = None;
    for &[radius, height] in profile {
        let first = mesh.vertices.len() as u32;
        let ring: Vec<u32> = if radius > 0.0 {
            for step in 0..AROUND {
                let (sin, cos) = libm::sincos(TAU * step as f64 / AROUND as f64);
                mesh.vertices.push([radius * cos, radius * sin, height]);
            }
            (first..first + AROUND as u32).collect()
        } else {
            mesh.vertices.push([0.0, 0.0, height]);
            vec![first; AROUND]
        };
        if let Some(below) = below {
            for step in 0..AROUND {
                let next = (step + 1) % AROUND;
                let (a, b, c, d) = (below[step], below[next], ring[next], ring[step]);
                if a != b {
                    mesh.triangles.push([a, b, c]);
                }
                if c != d {
                    mesh.triangles.push([a, c, d]);
                }
            }
        }
        below = Some(ring);
    }
    mesh
}
