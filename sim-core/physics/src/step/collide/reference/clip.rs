//! Contact points of two faces, or of a face and an edge: one is clipped by the other (Sutherland and Hodgman 1974).

use super::vector::{Point, TINY, add, along, cross, dot, norm, scale, sub, unit};
use crate::constants::hull::reference::CORNERS_MAX;
use arrayvec::ArrayVec;

/// Corners of a face, or of what is left of two.
pub type Polygon = ArrayVec<Point, { 2 * CORNERS_MAX }>;

/// A contact point.
#[derive(Clone, Copy, Debug)]
pub struct Contact {
    /// Half-way between the surfaces [m].
    pub point: Point,
    /// Of the surfaces, negative in penetration [m].
    pub distance: f64,
    /// From the first shape to the second, a unit vector.
    pub normal: Point,
}

/// Contact points of a pair.
pub type Contacts = ArrayVec<Contact, 4>;

/// A face and what it clips: another face, or an edge.
pub struct Clipping<'a> {
    /// Corners of the face, clockwise around its normal.
    pub face: &'a Polygon,
    /// Its outward normal, a unit vector.
    pub normal: Point,
    /// The corners of the other feature.
    pub clipped: &'a Polygon,
    /// The direction in which distances count: the outward normal of the other face, or for an edge that of this one, back.
    pub back: Point,
    /// Distance below which points count [m].
    pub margin: f64,
}

/// Adds the points of a feature that are within the sides of a face and near its plane, four at most. Normals point away from
/// the face.
pub fn clip(clipping: &Clipping<'_>, out: &mut Contacts) {
    let Clipping {
        face, normal, back, ..
    } = *clipping;
    if face.len() < 3 {
        return;
    }
    // planes through the edges of the face, along its normal; what is outside of one is cut away
    // one side plane of the face after the other, of which the new polygon becomes the old one
    let mut polygon = clipping.clipped.clone();
    let mut kept = Polygon::new();
    for (k, &corner) in face.iter().enumerate() {
        // the corner after the last one is the first
        let edge = sub(face[(k + 1) % face.len()], corner);
        let above = sub(add(corner, normal), corner);
        cut(&polygon, corner, unit(cross(edge, above)), &mut kept);
        std::mem::swap(&mut polygon, &mut kept);
    }
    // heights above the plane of the face: points far above do not touch
    let height = |point: Point| dot(sub(point, face[0]), normal);
    polygon.retain(|point| height(*point) <= clipping.margin);
    for k in counting(&polygon, clipping.clipped.len() == 2) {
        // onto the face along its normal, then onto the other feature
        let height = height(polygon[k]);
        let foot = along(polygon[k], normal, -height);
        // h cos(angle between the faces), as `back` is against the normal
        let distance = -height * dot(normal, back);
        out.push(Contact {
            point: along(foot, back, -0.5 * distance),
            distance,
            normal: scale(back, -1.0),
        });
    }
}

/// Keeps the part of a polygon on the inner side of a plane through a point.
fn cut(polygon: &Polygon, point: Point, normal: Point, kept: &mut Polygon) {
    // a point in the plane counts as inside
    let is_inside = |p: Point| dot(sub(p, point), normal) > -TINY;
    let offset = dot(normal, point);
    kept.clear();
    // a convex polygon gains one corner at most: there is room
    let mut keep = |point: Point| {
        let _ = kept.try_push(point);
    };
    for (k, &from) in polygon.iter().enumerate() {
        // an edge that crosses the plane leaves its crossing, and its end if that is inside
        let to = polygon[(k + 1) % polygon.len()];
        let (starts, ends) = (is_inside(from), is_inside(to));
        if starts != ends {
            // the place t on the edge where its height is that of the plane
            let edge = sub(to, from);
            let slope = dot(normal, edge);
            let t = (offset - dot(normal, from)) / slope;
            if slope != 0.0 && (0.0..=1.0).contains(&t) {
                keep(along(from, edge, t));
            }
        }
        if ends {
            keep(to);
        }
    }
}

/// Which points of a polygon count: of an edge its ends, of many four.
fn counting(polygon: &Polygon, is_edge: bool) -> ArrayVec<usize, 4> {
    match polygon.len() {
        3.. if is_edge => farthest_two(polygon).into_iter().collect(),
        5.. => large_quadrilateral(polygon).into(),
        count => (0..count).collect(),
    }
}

/// Four corners that span a large part of a convex polygon, by moving each on while the area grows (MuJoCo: `hull4`).
fn large_quadrilateral(polygon: &Polygon) -> [usize; 4] {
    let count = polygon.len();
    // half the product of the diagonals, as vectors
    let area = |[a, b, c, d]: [usize; 4]| {
        let diagonals = [sub(polygon[a], polygon[c]), sub(polygon[b], polygon[d])];
        0.5 * norm(cross(diagonals[0], diagonals[1]))
    };
    let mut at = [0, 1, 2, 3];
    let mut best = at;
    let mut largest = area(at);
    // moves one corner on if the area grows
    let mut moves = |at: &mut [usize; 4], which: usize| {
        let mut next = *at;
        next[which] = (next[which] + 1) % count;
        let size = area(next);
        let grows = size > largest;
        if grows {
            (*at, best, largest) = (next, next, size);
        }
        grows
    };
    // for each first corner: the last moves on, and after each of its steps the third and the second
    for first in 0..count {
        at[0] = first;
        while moves(&mut at, 3) {
            while moves(&mut at, 2) {}
            while moves(&mut at, 1) {}
        }
        // the others stay ahead of the first
        for k in 1..4 {
            if at[k] != at[k - 1] {
                break;
            }
            at[k] = (at[k] + 1) % count;
        }
    }
    best
}

/// The two points of a polygon that are farthest from each other.
fn farthest_two(polygon: &Polygon) -> [usize; 2] {
    // all pairs: an edge that was cut has few points
    let (mut best, mut most) = ([0, 1], 0.0);
    for i in 0..polygon.len() {
        for j in i + 1..polygon.len() {
            let between = sub(polygon[j], polygon[i]);
            let square = dot(between, between);
            if square > most {
                (best, most) = ([i, j], square);
            }
        }
    }
    best
}
