//! Hulls and limits of MuJoCo's search for contacts, which `f64` has where a model is from MuJoCo.

use super::super::solver::precompiled_parts;
use super::pieces::PlacedShape;
use crate::description::Description;
use crate::geometry::Hull;
use sim_physics::constants::hull::reference::{Limits, ReferenceHull, ReferenceSearch};

/// The search of a scene whose tables have these hulls with these centres.
pub(super) fn search(
    scene: &Description,
    shapes: &[PlacedShape<'_>],
    hulls: &[Hull],
    centers: impl Iterator<Item = [f64; 3]>,
) -> ReferenceSearch {
    let has_geoms = shapes.iter().any(|shape| shape.geom.is_some());
    let Some(limits) = limits(scene).filter(|_| has_geoms) else {
        return ReferenceSearch::default();
    };
    let hulls = hulls.iter().zip(centers);
    ReferenceSearch {
        is_used: true,
        limits,
        hulls: hulls
            .map(|(hull, center)| reference_hull(hull, center))
            .collect(),
    }
}

/// When it ends: of several models, the last to end counts. None where a model has no such search.
fn limits(scene: &Description) -> Option<Limits> {
    let limits: Option<Vec<Limits>> = precompiled_parts(scene)
        .map(|parts| parts.contact_search)
        .collect();
    let both = |a: Limits, b: Limits| Limits {
        iterations: a.iterations.max(b.iterations),
        tolerance: a.tolerance.min(b.tolerance),
        several: a.several && b.several,
    };
    limits?.into_iter().reduce(both)
}

/// The hull that MuJoCo has, or this one where it has none.
fn reference_hull(hull: &Hull, center: [f64; 3]) -> Option<ReferenceHull> {
    // a mesh of MuJoCo has the origin of its vertices as its centre, which is inside of it
    let origin = center.map(|x| -x);
    match &hull.whole {
        Some(whole) => {
            let sides = whole.polygons.iter();
            let sides = sides.map(|side| (side.corners.clone(), side.normal));
            ReferenceHull::new(origin, whole.vertices.clone(), sides)
        }
        None => {
            let sides = hull.sides();
            let sides = sides.map(|(corners, normal)| (corners.to_vec(), normal));
            ReferenceHull::new(origin, hull.vertices.clone(), sides)
        }
    }
}
