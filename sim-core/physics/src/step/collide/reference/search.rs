//! Where two shapes are nearest, and where they touch (MuJoCo: `mjc_Convex`).

use super::clip::{Contact, Contacts};
use super::epa;
use super::features::touching_features;
use super::gjk::{self, Distance, NearSimplex, Simplex};
use super::solid::{Solid, SolidPair};
use super::vector::{Point, add, along, scale, sub, unit};
use crate::constants::hull::reference::Limits;

/// Where two shapes are nearest, or overlap least.
#[derive(Clone, Debug)]
pub struct Nearest {
    /// The corners of the face, edge or corner of the Minkowski difference that is nearest.
    pub corners: Simplex,
    /// The points of both shapes [m].
    pub on: [Point; 2],
    /// That of the first shape with its skin [m].
    pub on_skin: Point,
    /// Half of the margin [m].
    pub skin: f64,
    /// From the first shape to the second, a unit vector.
    pub normal: Point,
    /// Negative in overlap [m].
    pub distance: f64,
}

/// The contact points of two shapes nearer than a margin [m].
pub fn contacts(solids: [Solid<'_>; 2], margin: f64, limits: &Limits) -> Contacts {
    let mut contacts = Contacts::new();
    let Some(nearest) = nearest(solids, margin, limits) else {
        return contacts;
    };
    // faces and edges on each other give several points
    if limits.several && solids.iter().all(Solid::has_faces) {
        touching_features(&solids, &nearest, margin, &mut contacts);
    }
    // otherwise the nearest one
    if contacts.is_empty() {
        let [first, second] = nearest.on;
        contacts.push(Contact {
            point: scale(add(first, second), 0.5),
            distance: nearest.distance,
            normal: nearest.normal,
        });
    }
    // where no point is near enough, none counts
    if !contacts.iter().any(|contact| contact.distance < margin) {
        contacts.clear();
    }
    contacts
}

/// Where two shapes are nearest, if they are nearer than a margin.
fn nearest(solids: [Solid<'_>; 2], margin: f64, limits: &Limits) -> Option<Nearest> {
    // spheres and capsules that overlap by less than their radii are found by their cores
    let skin = 0.5 * margin;
    let cores = solids.map(|solid| solid.core());
    if cores.iter().any(Option::is_some) {
        // the distance of the cores, up to the radii and the margin
        let radii = cores.map(|core| core.map_or(0.0, |(radius, _)| radius));
        let bare = [0, 1].map(|k| cores[k].map_or(solids[k], |(_, core)| core));
        let cutoff = margin + radii[0] + radii[1];
        match gjk::search(&mut SolidPair::new(bare, 0.0), limits, cutoff) {
            Distance::Apart => return None,
            Distance::Near(near) if near.distance > limits.tolerance => {
                return Some(around_cores(near, radii, skin));
            }
            _ => {}
        }
    }
    // shapes with a margin: first without it, and if they overlap with half of it around each
    if margin > 0.0 {
        match gjk::search(&mut SolidPair::new(solids, 0.0), limits, margin) {
            Distance::Apart => return None,
            Distance::Near(near) if near.distance > limits.tolerance => {
                return Some(around_cores(near, [0.0; 2], skin));
            }
            _ => {}
        }
    }
    // the depth of what overlaps
    let mut pair = SolidPair::new(solids, skin);
    match gjk::search(&mut pair, limits, 0.0) {
        Distance::Apart => None,
        Distance::Inside(simplex) => epa::depth(&mut pair, &simplex, limits),
        Distance::Near(near) => {
            // a corner alone spans nothing to expand
            let touches = near.distance <= limits.tolerance && !near.is_separated;
            match touches && near.simplex.len() > 1 {
                true => epa::depth(&mut pair, &near.simplex, limits),
                false => None,
            }
        }
    }
}

/// Two cores with these radii around them.
fn around_cores(near: NearSimplex, radii: [f64; 2], skin: f64) -> Nearest {
    let [first, second] = near.on;
    // both surfaces are along the line between the nearest points
    let normal = unit(sub(second, first));
    let moves = [radii[0], -radii[1]];
    let mut corners = near.simplex;
    for corner in &mut corners {
        corner.on = [0, 1].map(|k| along(corner.on[k], normal, moves[k]));
    }
    Nearest {
        corners,
        on: [0, 1].map(|k| along(near.on[k], normal, moves[k])),
        on_skin: along(first, normal, radii[0] + skin),
        skin,
        normal,
        distance: near.distance - (radii[0] + radii[1]),
    }
}
