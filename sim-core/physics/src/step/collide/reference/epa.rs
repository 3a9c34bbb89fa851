//! The depth of two shapes that overlap, by a polytope that expands (van den Bergh 2001) with the decisions of MuJoCo's
//! `engine_collision_gjk.c`.

use super::Nearest;
use super::first_polytope::{farthest, first_polytope};
use super::gjk::Simplex;
use super::nearest::affine;
use super::polytope::{Growth, Polytope};
use super::solid::{SolidPair, Vertex};
use super::vector::{TINY, along, dot, unit, weighted};
use crate::constants::hull::reference::Limits;

/// The depth of two shapes whose difference has a simplex at or around the origin; none where rounding leaves no polytope.
pub fn depth(pair: &mut SolidPair<'_>, simplex: &Simplex, limits: &Limits) -> Option<Nearest> {
    // expand a first polytope until its nearest face is one of the difference
    let mut polytope = Polytope::new(limits.iterations);
    first_polytope(&mut polytope, pair, simplex)?;
    let face = expand(&mut polytope, pair, limits)?;
    let face = polytope.faces[face];
    let corners: Simplex = face.corners.iter().map(|&k| polytope.vertices[k]).collect();
    // the points of both shapes whose difference is the face's nearest point
    let weights = affine([0, 1, 2].map(|k| corners[k].point), face.nearest);
    let on = [0, 1].map(|k| weighted(&weights, corners.iter().map(|corner| corner.on[k])));
    // skins move them along the directions in which the corners were found
    let with_skin = |corner: &Vertex| along(corner.on[0], corner.direction, pair.skin);
    Some(Nearest {
        on,
        on_skin: match pair.skin > 0.0 {
            true => weighted(&weights, corners.iter().map(with_skin)),
            false => on[0],
        },
        skin: pair.skin,
        normal: unit(face.nearest),
        distance: 2.0 * pair.skin - face.square.sqrt(),
        corners,
    })
}

/// Grows a polytope until its face nearest to the origin is on the surface of the difference, up to the tolerance.
fn expand(polytope: &mut Polytope, pair: &mut SolidPair<'_>, limits: &Limits) -> Option<usize> {
    /// A first face farther out than the surface is none [m].
    const BEYOND: f64 = 1e-10;
    // polytopes have a face on the surface, so only rounding is left
    let is_discrete = pair.is_discrete();
    let tolerance = if is_discrete { TINY } else { limits.tolerance };
    let (mut upper, mut upper_square) = (f64::MAX, f64::MAX);
    let mut nearest = None;
    for iteration in 0..limits.iterations {
        // faces only get farther; one beyond the bound of an earlier vertex is an error of rounding
        let previous = nearest;
        let Some(face) = polytope.nearest_candidate() else {
            return previous;
        };
        let lower_square = polytope.faces[face].square;
        if lower_square > upper_square {
            return previous;
        }
        nearest = Some(face);
        // the origin is on the face: there is no direction to go on
        if lower_square <= 0.0 {
            break;
        }
        // the depth is between the face's distance and that of the vertex beyond it
        let lower = lower_square.sqrt();
        let toward = polytope.faces[face].nearest;
        let vertex = farthest(pair, toward, lower);
        let place = polytope.add_vertex(vertex);
        let bound = dot(toward, vertex.point) / lower;
        if bound < upper {
            (upper, upper_square) = (bound, bound * bound);
        }
        if upper - lower < tolerance {
            if iteration == 0 && upper < lower - BEYOND {
                return None;
            }
            break;
        }
        // of polytopes, a corner that is there already is not farther
        let is_known = |known: &Vertex| known.corners == vertex.corners;
        if is_discrete && polytope.vertices[..place].iter().any(is_known) {
            break;
        }
        // all faces that the vertex sees give way to a fan around it
        match polytope.grow(place, face, [lower_square, upper_square]) {
            Growth::Done => {}
            Growth::Full => break,
            Growth::Broken => return None,
        }
        if polytope.candidates.is_empty() {
            break;
        }
    }
    nearest
}
