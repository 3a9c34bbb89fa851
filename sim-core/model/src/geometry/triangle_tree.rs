//! Triangles of a mesh in a tree of boxes, which finds those near a ray; the tree is parry3d's.

use std::cmp::Ordering;

use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector as Point;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhNode};

use super::trimesh::TriMesh;
use super::vector::{Vector, cross, dot, extent, norm, scale, size, sub};

/// Smallest area of a triangle across a ray [m²], and smallest product of a direction and a normal [m³] (MuJoCo:
/// `mjMINVAL`).
const SMALL: f64 = 1e-15;
/// Width of boxes around triangles, relative to the mesh: rounding loses no triangle that lies in a plane of the axes.
const MARGIN: f64 = 1e-9;

/// Triangles that rays meet from both sides.
pub struct TriangleTree {
    tree: Bvh,
    /// Corners of each triangle [m].
    triangles: Vec<[Vector; 3]>,
    center: Vector,
    radius: f64,
}

impl TriangleTree {
    /// The triangles of a mesh.
    pub fn new(mesh: &TriMesh) -> TriangleTree {
        let triangles: Vec<[Vector; 3]> = mesh.triangles.iter().map(|&t| mesh.corners(t)).collect();
        let corners = triangles.as_flattened();
        let margin = if corners.is_empty() {
            0.0
        } else {
            MARGIN * size(corners)
        };
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|corners| {
                let [low, high] = extent(corners);
                let (low, high) = (low.map(|x| x - margin), high.map(|x| x + margin));
                Aabb::new(Point::from(low), Point::from(high))
            })
            .collect();
        let [low, high] = extent(corners);
        let center = [0, 1, 2].map(|k| 0.5 * (low[k] + high[k]));
        let far = corners.iter().map(|&corner| norm(sub(corner, center)));
        TriangleTree {
            tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
            radius: far.fold(0.0, f64::max),
            center: if corners.is_empty() { [0.0; 3] } else { center },
            triangles,
        }
    }

    /// Centre [m] and radius [m] of a sphere around all triangles.
    pub fn bounds(&self) -> (Vector, f64) {
        (self.center, self.radius)
    }

    /// Where a ray first meets a triangle, in units of its direction and below `limit`, and the triangle's normal: from
    /// the side where the corners run counter-clockwise.
    pub fn cast(&self, origin: Vector, direction: Vector, limit: f64) -> Option<(f64, Vector)> {
        let across = across(direction);
        let inverse = direction.map(|x| 1.0 / x);
        let (triangle, far) = self.tree.find_best(
            limit,
            |node: &BvhNode, best| enters(node, origin, inverse, best),
            |triangle, _| {
                meets(
                    &self.triangles[triangle as usize],
                    origin,
                    direction,
                    across,
                )
            },
        )?;
        let normal = normal(&self.triangles[triangle as usize]);
        Some((far, scale(normal, 1.0 / norm(normal))))
    }
}

/// Where a ray enters a box, if it does so before `limit`; else the largest number.
#[inline]
fn enters(node: &BvhNode, origin: Vector, inverse: Vector, limit: f64) -> f64 {
    let (low, high) = (node.mins(), node.maxs());
    let (low, high) = ([low.x, low.y, low.z], [high.x, high.y, high.z]);
    let (mut first, mut last) = (0.0, limit);
    for k in 0..3 {
        let (a, b) = (
            (low[k] - origin[k]) * inverse[k],
            (high[k] - origin[k]) * inverse[k],
        );
        let (near, far) = match a.partial_cmp(&b) {
            Some(Ordering::Less) => (a, b),
            Some(_) => (b, a),
            // along a side of the box and on it
            None => continue,
        };
        first = if near > first { near } else { first };
        last = if far < last { far } else { last };
    }
    if first <= last { first } else { f64::MAX }
}

/// Two unit vectors across a direction.
fn across(direction: Vector) -> [Vector; 2] {
    let [x, y, z] = direction.map(f64::abs);
    let mut other = [1.0; 3];
    other[if x >= y && x >= z {
        0
    } else if y >= z {
        1
    } else {
        2
    }] = 0.0;
    let along = dot(direction, other) / dot(direction, direction);
    let first = sub(other, scale(direction, along));
    let first = scale(first, 1.0 / norm(first));
    let second = cross(first, direction);
    [scale(second, 1.0 / norm(second)), first]
}

fn normal(&[a, b, c]: &[Vector; 3]) -> Vector {
    cross(sub(a, c), sub(b, c))
}

/// Where a ray meets a triangle. The sign of an edge is the same for both triangles beside it, so none is lost between.
#[inline]
fn meets(
    corners: &[Vector; 3],
    origin: Vector,
    direction: Vector,
    across: [Vector; 2],
) -> Option<f64> {
    let [a, b, c] = corners.map(|corner| {
        let apart = sub(corner, origin);
        [dot(across[0], apart), dot(across[1], apart)]
    });
    let turn = |p: [f64; 2], q: [f64; 2]| p[0] * q[1] - p[1] * q[0];
    let (u, v, w) = (turn(b, c), turn(c, a), turn(a, b));
    let is_outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
    if is_outside || (u + v + w).abs() < SMALL {
        return None;
    }
    let normal = normal(corners);
    let towards = dot(direction, normal);
    if towards.abs() < SMALL {
        return None;
    }
    let far = -dot(sub(origin, corners[2]), normal) / towards;
    (far >= 0.0).then_some(far)
}
