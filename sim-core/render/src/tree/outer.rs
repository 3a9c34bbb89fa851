//! Triangles that nothing of their tree is in front of, such as all of a convex body.
//!
//! A ray that leaves one of them from its front meets no other. So a body does not shade itself there.

use sim_model::geometry::vector::{Vector as Point, cross, dot, sub};

use super::{LEAF, Node, Tree};
use crate::vector::Vector;

/// By how much corners may be in front of a plane, relative to the size of the body: more than their rounding in files [–].
const ROUGH: f64 = 2e-6;

impl Tree {
    /// Which triangles have nothing in front of their planes, of those that the tree was made of; `center` is its origin.
    pub(crate) fn outer(&self, triangles: &[[Point; 3]], center: Vector) -> Vec<bool> {
        let center = center.map(f64::from);
        let half = self.half.map(f64::from);
        let rough = ROUGH * dot(half, half).sqrt();
        let mut stack = Vec::new();
        // what is in front of one plane often is in front of the next as well
        let mut last = [f64::NAN; 3];
        let is_outer = triangles.iter().map(|&[a, b, c]| {
            let normal = cross(sub(b, a), sub(c, a));
            let normal = normal.map(|part| part / dot(normal, normal).sqrt());
            let height = dot(normal, a) + rough;
            let above = height - dot(normal, center);
            // of a triangle without area nothing is known
            if !above.is_finite() || dot(normal, last) > height {
                return false;
            }
            let in_front = self.beyond(triangles, normal, [height, above], &mut stack);
            last = in_front.unwrap_or(last);
            in_front.is_none()
        });
        is_outer.collect()
    }

    /// A corner of a triangle in front of a plane with a height, which is `above` that of the tree's origin.
    fn beyond(
        &self,
        triangles: &[[Point; 3]],
        normal: Point,
        [height, above]: [f64; 2],
        stack: &mut Vec<u32>,
    ) -> Option<Point> {
        stack.clear();
        if !self.nodes.is_empty() {
            stack.push(0);
        }
        while let Some(at) = stack.pop() {
            if at & LEAF == 0 {
                let node = &self.nodes[at as usize];
                let highest = highest(node, normal.map(|part| part as f32));
                let children = highest.iter().zip(&node.children);
                // boxes of no child have no number
                let in_front = children.filter(|(high, _)| f64::from(**high) > above);
                stack.extend(in_front.map(|(_, &child)| child));
                continue;
            }
            let leaf = &self.leaves[(at & !LEAF) as usize];
            let numbers = leaf.number.iter();
            let mut corners = numbers.flat_map(|&number| triangles[number as usize]);
            let in_front = corners.find(|&corner| dot(normal, corner) > height);
            if in_front.is_some() {
                return in_front;
            }
        }
        None
    }
}

/// The largest products of a vector and the corners of boxes.
fn highest(node: &Node, v: Vector) -> [f32; 8] {
    let mut sums = [0.0; 8];
    for k in 0..3 {
        let bounds = if v[k] < 0.0 {
            &node.low[k]
        } else {
            &node.high[k]
        };
        for child in 0..8 {
            sums[child] += v[k] * bounds[child];
        }
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Triangles of a cube with half edges of 1 m about a point, and their normals.
    fn cube(center: Point) -> Vec<([Point; 3], Point)> {
        let mut triangles = Vec::new();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                let corner = |u: f64, v: f64| {
                    let mut at = [0.0; 3];
                    (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (side, side * u, v);
                    [0, 1, 2].map(|k| center[k] + at[k])
                };
                let mut normal = [0.0; 3];
                normal[axis] = side;
                for [(a, b), (c, d), (e, f)] in [
                    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)],
                    [(-1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)],
                ] {
                    triangles.push(([corner(a, b), corner(c, d), corner(e, f)], normal));
                }
            }
        }
        triangles
    }

    fn outer(triangles: &[([Point; 3], Point)]) -> Vec<bool> {
        let corners: Vec<_> = triangles.iter().map(|triangle| triangle.0).collect();
        let (tree, center) = Tree::new(&corners);
        tree.outer(&corners, center)
    }

    #[test]
    fn all_of_a_convex_body_are_outer_and_sides_that_see_another_part_are_not() {
        let alone = cube([0.3, -0.2, 5.0]);
        assert!(outer(&alone).iter().all(|&is_outer| is_outer));
        // the second is beside the first along x, and higher
        let two: Vec<_> = [cube([0.0; 3]), cube([4.0, 0.0, 0.5])].concat();
        let expected = two.iter().enumerate().map(|(place, (_, normal))| {
            let between = if place < 12 {
                [1.0, 0.0, 0.0]
            } else {
                [-1.0, 0.0, 0.0]
            };
            let below = if place < 12 {
                [0.0, 0.0, 1.0]
            } else {
                [0.0, 0.0, -1.0]
            };
            *normal != between && *normal != below
        });
        assert_eq!(outer(&two), expected.collect::<Vec<bool>>());
    }

    #[test]
    fn what_is_a_little_in_front_counts_and_rounding_does_not() {
        let with_bump = |height: f64| {
            let mut triangles = cube([0.0; 3]);
            let tip = [0.1, 0.1, 1.0 + height];
            triangles.push(([[0.0, 0.0, 1.0], [0.2, 0.0, 1.0], tip], [0.0; 3]));
            let outer = outer(&triangles);
            let mut tops = triangles
                .iter()
                .zip(outer)
                .filter(|(one, _)| one.1 == [0.0, 0.0, 1.0]);
            tops.all(|(_, is_outer)| is_outer)
        };
        assert!(!with_bump(1e-5));
        assert!(with_bump(1e-7));
    }
}
