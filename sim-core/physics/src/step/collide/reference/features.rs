//! Two shapes that touch in more than a point: faces and edges that lie on each other (MuJoCo: `multicontact` of
//! `engine_collision_gjk.c`).

use super::Nearest;
use super::clip::{Clipping, Contacts, clip};
use super::sides::{Edges, FACES_ALIGNED, Sides, Touching};
use super::solid::{Form, Solid};
use super::vector::{Point, TINY, along, dot, scale};

/// An edge lies on a face where the cosine of its direction and the normal is below this (MuJoCo: `mjEDGE_TOL`).
const EDGE_ALIGNED: f64 = 0.0888;

/// Adds the contact points of two faces, or of an edge and a face, that lie on each other; none where neither do.
pub fn touching_features(
    solids: &[Solid<'_>; 2],
    nearest: &Nearest,
    margin: f64,
    out: &mut Contacts,
) {
    // sides at the corners that touch, of which those of boxes may come from the normal
    let [first, second] = solids;
    let touching = [0, 1].map(|which| Touching::new(&nearest.corners, which));
    let back = scale(nearest.normal, -1.0);
    let sides = [
        first.sides(&touching[0], nearest.normal),
        second.sides(&touching[1], back),
    ];
    // two faces: the second is clipped by the first, and distances count along the second's normal
    if let Some([(normal, side), (other, other_side)]) = faces(&sides) {
        let clipping = Clipping {
            face: &first.face(side),
            normal,
            clipped: &second.face(other_side),
            back: other,
            margin,
        };
        return clip(&clipping, out);
    }
    // an edge of the shape without a side, or of the one with fewer corners
    let [a, b] = &touching;
    let is_first = sides[0].is_empty() || (!sides[1].is_empty() && a.count <= b.count);
    let (edged, faced, toward) = match is_first {
        true => (0, 1, back),
        false => (1, 0, nearest.normal),
    };
    // three corners are a face, which faces no other
    if touching[edged].count == 3 {
        return;
    }
    let edges = solids[edged].edges(&touching[edged], nearest.on_skin);
    let Some((ends, normal, side)) = edge_on(&edges, &sides[faced], toward) else {
        return;
    };
    // the edge of a capsule is that of its skin
    let skin = match solids[edged].form {
        Form::Capsule => nearest.skin,
        _ => 0.0,
    };
    let clipping = Clipping {
        face: &solids[faced].face(side),
        normal,
        clipped: &ends.into_iter().collect(),
        back: scale(normal, -1.0),
        margin: margin - skin,
    };
    // the skin comes off again; normals of the first shape's edges point from the face to it
    clip(&clipping, out);
    for contact in out {
        contact.distance += skin;
        contact.point = along(contact.point, contact.normal, 0.5 * skin);
        if is_first {
            contact.normal = scale(contact.normal, -1.0);
        }
    }
}

/// The two faces that face each other most, if they do.
fn faces(sides: &[Sides; 2]) -> Option<[(Point, u32); 2]> {
    let mut least = -FACES_ALIGNED;
    let mut facing = None;
    for &first in &sides[0] {
        for &second in &sides[1] {
            let cosine = dot(first.0, second.0);
            if cosine < least {
                (least, facing) = (cosine, Some([first, second]));
            }
        }
    }
    facing
}

/// The ends of the first edge that lies on a side which faces along a direction, and that side.
fn edge_on(edges: &Edges, sides: &Sides, toward: Point) -> Option<([Point; 2], Point, u32)> {
    // the first side and the first edge that agree, in the order of the shapes' tables
    for &(normal, side) in sides {
        if dot(normal, toward) <= TINY {
            continue;
        }
        for &(direction, ends) in edges {
            if dot(direction, normal).abs() < EDGE_ALIGNED {
                return Some((ends, normal, side));
            }
        }
    }
    None
}
