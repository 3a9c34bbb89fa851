//! The distance of two shapes, by GJK (Gilbert, Johnson and Keerthi 1988) with the decisions of MuJoCo's
//! `engine_collision_gjk.c`.

use super::nearest::nearest_weights;
use super::solid::{SolidPair, Vertex};
use super::vector::{Point, TINY, cross, dot, norm, scale, sub, weighted};
use crate::constants::hull::reference::Limits;
use arrayvec::ArrayVec;

/// Corners of the Minkowski difference, four at most.
pub type Simplex = ArrayVec<Vertex, 4>;

/// What a search came to.
#[derive(Clone, Debug)]
pub enum Distance {
    /// The shapes are farther apart than asked.
    Apart,
    /// The simplex nearest to the origin.
    Near(NearSimplex),
    /// The simplex contains the origin: the shapes overlap.
    Inside(Simplex),
}

/// A simplex, and its point nearest to the origin.
#[derive(Clone, Debug)]
pub struct NearSimplex {
    pub simplex: Simplex,
    /// The points of both shapes [m].
    pub on: [Point; 2],
    /// How far they are from each other [m].
    pub distance: f64,
    /// Does a plane separate the shapes?
    pub is_separated: bool,
}

/// Searches from the line between two centres. `cutoff` is the distance that counts [m]; 0 asks for overlap alone.
pub fn search(pair: &mut SolidPair<'_>, limits: &Limits, cutoff: f64) -> Distance {
    // polytopes have a nearest face that is reached exactly; of round shapes a tolerance is left
    let (gap_min, length_min) = match pair.is_discrete() {
        true => (0.0, TINY),
        false => (0.5 * limits.tolerance * limits.tolerance, limits.tolerance),
    };
    let mut on = pair.solids.map(|solid| solid.center);
    let mut nearest = sub(on[0], on[1]);
    let (mut length, mut before) = (norm(nearest), 0.0f64);
    let mut simplex = Simplex::new();
    let mut weights = [0.0; 4];
    // overlap alone is found by tetrahedra, once
    let mut may_surround = cutoff <= 0.0;
    let mut iteration = 0;
    while iteration < limits.iterations {
        // at the origin, or no nearer than before
        if length < length_min || (before - length).abs() < TINY {
            break;
        }
        let vertex = pair.farthest(toward_origin(nearest, length));
        // |x - x*|² is at most x · (x - s), the gap of Frank and Wolfe; a centre outside of its shape says nothing
        let gap = dot(nearest, sub(nearest, vertex.point));
        if gap < gap_min && !simplex.is_empty() {
            break;
        }
        // a plane at this distance separates them
        let lower = dot(nearest, vertex.point);
        if lower > 0.0 && (cutoff <= 0.0 || lower >= cutoff * length) {
            return Distance::Apart;
        }
        // where only overlap counts, tetrahedra end sooner than distances do
        simplex.push(vertex);
        if simplex.len() == 4 && may_surround {
            if let Some(found) = surround(pair, &simplex, limits, &mut iteration) {
                return found;
            }
            may_surround = false;
        }
        // the corners that the nearest point needs
        let corners: ArrayVec<Point, 4> = simplex.iter().map(|vertex| vertex.point).collect();
        let all = nearest_weights(&corners);
        let kept: ArrayVec<usize, 4> = (0..simplex.len()).filter(|&k| all[k] != 0.0).collect();
        simplex = kept.iter().map(|&k| simplex[k]).collect();
        weights = [0.0; 4];
        for (weight, &k) in weights.iter_mut().zip(&kept) {
            *weight = all[k];
        }
        if simplex.is_empty() {
            return Distance::Apart;
        }
        // the next direction is from the nearest point to the origin
        nearest = weighted(&weights, simplex.iter().map(|vertex| vertex.point));
        (before, length) = (length, norm(nearest));
        // a tetrahedron that needs all its corners contains the origin
        if simplex.len() == 4 {
            break;
        }
        iteration += 1;
    }
    // the same weights give the points of both shapes
    if !simplex.is_empty() {
        on = [0, 1].map(|k| weighted(&weights, simplex.iter().map(|vertex| vertex.on[k])));
    }
    // a last look along the direction tells shapes apart that are within the tolerance
    let last = pair.farthest(toward_origin(nearest, length));
    let is_separated = dot(nearest, last.point) > 0.0;
    let distance = match simplex.len() == 4 && !is_separated {
        true => 0.0,
        false => length,
    };
    Distance::Near(NearSimplex {
        simplex,
        on,
        distance,
        is_separated,
    })
}

/// The direction from a point to the origin.
fn toward_origin(point: Point, length: f64) -> Point {
    scale(scale(point, 1.0 / length), -1.0)
}

/// Looks for a tetrahedron around the origin: the corner across the face that is farthest from it moves beyond that face.
/// Returns whether the shapes overlap, or none where the search does not find it.
fn surround(
    pair: &mut SolidPair<'_>,
    simplex: &Simplex,
    limits: &Limits,
    iteration: &mut usize,
) -> Option<Distance> {
    let mut corners = simplex.clone();
    // an order of the corners in which faces are turned outward
    let mut order = [0, 1, 2, 3];
    while *iteration < limits.iterations {
        // face k is across corner k
        let faces = [[2, 1, 3], [0, 2, 3], [1, 0, 3], [0, 1, 2]];
        let planes = faces.map(|face| plane(face.map(|k| corners[order[k]].point)));
        let heights = planes.map(|(_, height)| height);
        if heights.contains(&0.0) {
            return None;
        }
        // all faces are above the origin: it is inside
        let lower = |i: usize, j: usize| if heights[i] < heights[j] { i } else { j };
        let least = lower(lower(0, 1), lower(2, 3));
        if heights[least] > 0.0 {
            let around = order.map(|k| corners[k]).into_iter().collect();
            return Some(Distance::Inside(around));
        }
        // the farthest point beyond the lowest face; if it is below the origin, nothing surrounds that
        let normal = planes[least].0;
        let vertex = pair.farthest(normal);
        corners[order[least]] = vertex;
        if dot(normal, vertex.point) < 0.0 {
            return Some(Distance::Apart);
        }
        // two corners change places, or the new faces would be turned inward
        order.swap((least + 1) % 4, (least + 2) % 4);
        *iteration += 1;
    }
    None
}

/// Unit normal of a triangle, and the height of its plane above the origin; a huge one where it has no area.
fn plane([a, b, c]: [Point; 3]) -> (Point, f64) {
    const AREA_MAX: f64 = 1e10;
    let normal = cross(sub(c, a), sub(b, a));
    let square = dot(normal, normal);
    if square > TINY * TINY && square < AREA_MAX * AREA_MAX {
        let normal = scale(normal, 1.0 / square.sqrt());
        return (normal, dot(normal, a));
    }
    (normal, f64::MAX)
}
