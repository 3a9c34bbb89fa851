//! The polytope that an expansion begins with, from the simplex that GJK ended with.

use super::nearest::{affine, middle};
use super::polytope::Polytope;
use super::solid::{SolidPair, Vertex};
use super::vector::{Point, TINY, cross, dot, norm, scale, sub, volume, weighted};

/// Least squared distance of a face from the origin [m²].
const SQUARE_MIN: f64 = TINY * TINY;

/// Corners of a face, and the faces across its edges.
type Triangle = ([usize; 3], [usize; 3]);

/// Two pyramids on a triangle of the vertices 0, 1 and 2, whose tips are 4 and 3.
const ON_TRIANGLE: [Triangle; 6] = [
    ([4, 0, 1], [1, 3, 2]),
    ([4, 2, 0], [2, 4, 0]),
    ([4, 1, 2], [0, 5, 1]),
    ([3, 1, 0], [5, 0, 4]),
    ([3, 0, 2], [3, 1, 5]),
    ([3, 2, 1], [4, 2, 3]),
];

/// Two pyramids with the tips 0 and 1, on a triangle around the segment between these.
const AROUND_SEGMENT: [Triangle; 6] = [
    ([0, 2, 3], [1, 3, 2]),
    ([0, 4, 2], [2, 4, 0]),
    ([0, 3, 4], [0, 5, 1]),
    ([1, 3, 2], [5, 0, 4]),
    ([1, 2, 4], [3, 1, 5]),
    ([1, 4, 3], [4, 2, 3]),
];

/// A tetrahedron.
const TETRAHEDRON: [Triangle; 4] = [
    ([0, 1, 2], [1, 3, 2]),
    ([0, 3, 1], [2, 3, 0]),
    ([0, 2, 3], [0, 3, 1]),
    ([3, 2, 1], [2, 0, 1]),
];

/// Makes a polytope of a simplex with two, three or four corners; none where it would be flat, or not contain the origin.
pub fn first_polytope(
    polytope: &mut Polytope,
    pair: &mut SolidPair<'_>,
    simplex: &[Vertex],
) -> Option<()> {
    match simplex.len() {
        2 => from_segment(polytope, pair, simplex),
        3 => from_triangle(polytope, pair, simplex),
        _ => from_tetrahedron(polytope, pair, simplex),
    }
}

/// The farthest vertex along a direction of this length; along the first axis if it is short.
pub fn farthest(pair: &mut SolidPair<'_>, direction: Point, length: f64) -> Vertex {
    match length > TINY {
        true => pair.farthest(direction.map(|x| x / length)),
        false => pair.farthest([1.0, 0.0, 0.0]),
    }
}

/// Two pyramids on a triangle.
fn from_triangle(
    polytope: &mut Polytope,
    pair: &mut SolidPair<'_>,
    simplex: &[Vertex],
) -> Option<()> {
    let points = [0, 1, 2].map(|k| simplex[k].point);
    polytope.inside = middle(&points);
    let [a, b, c] = points;
    // a triangle without area has no normal
    let normal = cross(sub(b, a), sub(c, a));
    let length = norm(normal);
    if length < TINY {
        return None;
    }
    for vertex in &simplex[..3] {
        polytope.add_vertex(*vertex);
    }
    // a tip on each side of it, off its plane
    for side in [scale(normal, -1.0), normal] {
        let tip = farthest(pair, side, length);
        polytope.add_vertex(tip);
        if is_in_triangle(points, tip.point) {
            return None;
        }
    }
    // the origin in the plane of a face would leave it without a direction
    for (corners, across) in ON_TRIANGLE {
        if polytope.add_face(corners, across) < SQUARE_MIN {
            return None;
        }
    }
    (0..ON_TRIANGLE.len()).for_each(|face| polytope.consider(face));
    Some(())
}

/// Adds faces. Where the origin is in the plane of one, the polytope begins anew with that face, and the result is false.
fn add_faces(
    polytope: &mut Polytope,
    pair: &mut SolidPair<'_>,
    faces: &[Triangle],
) -> Option<bool> {
    for &(corners, across) in faces {
        if polytope.add_face(corners, across) < SQUARE_MIN {
            // vertices are taken out before the polytope is emptied
            let triangle = corners.map(|corner| polytope.vertices[corner]);
            polytope.clear();
            from_triangle(polytope, pair, &triangle)?;
            return Some(false);
        }
    }
    Some(true)
}

/// Two pyramids on three vertices around a segment.
fn from_segment(
    polytope: &mut Polytope,
    pair: &mut SolidPair<'_>,
    simplex: &[Vertex],
) -> Option<()> {
    let ends = [simplex[0].point, simplex[1].point];
    polytope.inside = middle(&ends);
    // three directions across the segment: the first by the axis that it has least of
    let segment = sub(ends[1], ends[0]);
    let shorter = |a: usize, b: usize| {
        if segment[b].abs() < segment[a].abs() {
            b
        } else {
            a
        }
    };
    // the cross product with that axis is the longest
    let mut axis = [0.0; 3];
    axis[shorter(shorter(0, 1), 2)] = 1.0;
    let first = cross(axis, segment);
    let second = third_of_a_turn(segment, first);
    let third = third_of_a_turn(segment, second);
    // the ends of the segment are the tips
    polytope.add_vertex(simplex[0]);
    polytope.add_vertex(simplex[1]);
    for direction in [first, second, third] {
        let vertex = farthest(pair, direction, norm(direction));
        polytope.add_vertex(vertex);
    }
    if !add_faces(polytope, pair, &AROUND_SEGMENT)? {
        return Some(());
    }
    // the segment passes through the triangle of the others, or the pyramids are not convex together
    let [a, b, c] = [2, 3, 4].map(|k| sub(polytope.vertices[k].point, ends[0]));
    let turns = [(a, b), (b, c), (c, a)].map(|(p, q)| volume(p, q, segment));
    if !turns.iter().all(|v| *v >= 0.0) && !turns.iter().all(|v| *v <= 0.0) {
        return None;
    }
    (0..AROUND_SEGMENT.len()).for_each(|face| polytope.consider(face));
    Some(())
}

/// The tetrahedron itself.
fn from_tetrahedron(
    polytope: &mut Polytope,
    pair: &mut SolidPair<'_>,
    simplex: &[Vertex],
) -> Option<()> {
    let points = [0, 1, 2, 3].map(|k| simplex[k].point);
    polytope.inside = middle(&points);
    // a face through the origin is a better start than the tetrahedron
    for vertex in simplex {
        polytope.add_vertex(*vertex);
    }
    if !add_faces(polytope, pair, &TETRAHEDRON)? {
        return Some(());
    }
    if !contains_origin(points) {
        return None;
    }
    (0..TETRAHEDRON.len()).for_each(|face| polytope.consider(face));
    Some(())
}

/// A vector turned by 120° about an axis (Rodrigues).
fn third_of_a_turn(axis: Point, v: Point) -> Point {
    // sin 120° with MuJoCo's digits
    let (sine, cosine) = (0.866_025_403_78, -0.5);
    // R = cos I + sin [u]ₓ + (1 - cos) u uᵀ
    let length = norm(axis);
    let [x, y, z] = axis.map(|u| u / length);
    let versine = 1.0 - cosine;
    let rows = [
        [
            cosine + x * x * versine,
            x * y * versine - z * sine,
            x * z * versine + y * sine,
        ],
        [
            y * x * versine + z * sine,
            cosine + y * y * versine,
            y * z * versine - x * sine,
        ],
        [
            x * z * versine - y * sine,
            y * z * versine + x * sine,
            cosine + z * z * versine,
        ],
    ];
    rows.map(|row| dot(row, v))
}

/// Is a point in a triangle?
fn is_in_triangle(corners: [Point; 3], point: Point) -> bool {
    // its projection has no negative weight, and is the point itself
    let weights = affine(corners, point);
    let there = weighted(&weights, corners.into_iter());
    !weights.iter().any(|w| *w < 0.0) && norm(sub(there, point)) < TINY
}

/// Is the origin in a tetrahedron: on the side of each face where the other corner is?
fn contains_origin([a, b, c, d]: [Point; 4]) -> bool {
    // the face p q r, and s across it
    let same_side = |p: Point, q: Point, r: Point, s: Point| {
        let normal = cross(sub(q, p), sub(r, p));
        let (corner, origin) = (dot(normal, sub(s, p)), dot(normal, scale(p, -1.0)));
        (corner > 0.0 && origin > 0.0) || (corner < 0.0 && origin < 0.0)
    };
    same_side(a, b, c, d) && same_side(b, c, d, a) && same_side(c, d, a, b) && same_side(d, a, b, c)
}
