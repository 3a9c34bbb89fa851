//! A plane and a mesh: the deepest vertex, and up to three corners of that polygon at it which faces the plane best (MuJoCo:
//! `mjc_PlaneConvex`, from 3.13 on). It is the rule of [`super::super::convex::plane_hull`], with the whole hull of a mesh of which
//! tables have the farthest vertices alone.

use super::clip::{Contact, Contacts};
use super::solid::Solid;
use super::vector::{along, dot, norm, scale};
use crate::constants::hull::reference::ReferenceHull;

/// Roundings of a height, up to which vertices are equally deep: the first one counts [–].
const ROUNDINGS: f64 = 16.0;

/// The contact points of a plane through the origin, with this normal, and a mesh that is nearer than a margin [m].
pub fn plane_contacts(
    normal: [f64; 3],
    mesh: &Solid<'_>,
    hull: &ReferenceHull,
    margin: f64,
) -> Contacts {
    let mut contacts = Contacts::new();
    // in the frame of the mesh: heights above its origin, and that of the origin above the plane
    let n = mesh.local(normal);
    let height = |vertex: u32| dot(n, hull.vertices[vertex as usize]);
    let origin = dot(normal, mesh.center);
    // the bounding box rejects meshes above the margin
    let reach: f64 = n
        .iter()
        .zip(mesh.size)
        .map(|(x, half)| x.abs() * half)
        .sum();
    if origin - dot(n, hull.origin) - reach >= margin {
        return contacts;
    }
    let lowest = hull.farthest(scale(n, -1.0), None);
    if origin + height(lowest) >= margin {
        return contacts;
    }
    let same = ROUNDINGS * f64::EPSILON * norm(hull.vertices[lowest as usize]);
    let limit = height(lowest) + same;
    let deepest = (0..lowest).find(|&vertex| height(vertex) < limit);
    let deepest = deepest.unwrap_or(lowest);
    // the outward normal most against the plane's; MuJoCo begins with one that faces away
    let mut best = (1.0, &[][..]);
    let sides = hull.around[deepest as usize].iter();
    for (&side, corners) in sides.zip(&hull.resting[deepest as usize]) {
        let facing = dot(hull.normals[side as usize], n);
        if facing < best.0 {
            best = (facing, &corners[..]);
        }
    }
    // a corner above the origin by more than a rounding does not count
    let low = best.1.iter().filter(|&&vertex| height(vertex) <= same);
    for vertex in std::iter::once(deepest).chain(low.copied()) {
        let distance = origin + height(vertex);
        if distance < margin {
            let on_mesh = mesh.placed(hull.vertices[vertex as usize]);
            contacts.push(Contact {
                // half-way between vertex and plane
                point: along(on_mesh, normal, -0.5 * distance),
                distance,
                normal,
            });
        }
    }
    contacts
}
