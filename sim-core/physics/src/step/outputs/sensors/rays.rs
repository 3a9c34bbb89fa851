//! Rangefinders: what a ray from a site along its z axis meets first (MuJoCo: `mj_ray`).
//!
//! ```text
//! p + t z, t ≥ 0        in the axes of each geom; -1 where the ray meets none
//! ```
//!
//! A plane is seen from its front alone, and only in its bounds. Normals point out of a geom,
//! whichever side is met.

use super::ray_meshes::to_triangles;
use super::zone::{distance, normal};
use super::{distances, has, put_at};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::sensors::{RangeSensor, RayGeom, SensorKind};
use crate::constants::site::Mount;
use crate::lane::{Cx, Num, Real, map};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::outputs::sites::{axes, position, reference, to_local};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Part of a direction towards a plane below which a ray does not meet it (MuJoCo: `mjMINVAL`) [–].
const PARALLEL: f64 = 1e-15;

/// Rangefinders, and distances of geoms.
pub struct Rays;

impl Stage for Rays {
    const READS: &'static [A] = &[A::Rotation, A::Origin, A::Reference, A::Sensordata];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        use SensorKind::*;
        has(m, |kind| matches!(kind, Range(_) | Distance(_)))
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let zero = C::F::c(0.0);
        for sensor in &m.sensors.all {
            let range = match &sensor.kind {
                SensorKind::Range(range) => range,
                SensorKind::Distance(distance) => {
                    distances::show(m, &mut b.work, sensor, distance);
                    continue;
                }
                _ => continue,
            };
            let (far, normal) = nearest(cx, m, &b.work, range);
            // a ray that meets nothing has neither a direction nor a point, but an origin
            let is_met = !far.lt(zero);
            let z = axes(&b.work, &range.site)[2];
            let origin = position(&b.work, &range.site) + reference(&b.work, &range.site);
            let point = z.scale_add(far, origin);
            let way = map(z.0, |x| C::F::select(is_met, x, zero));
            let point = map(point.0, |x| C::F::select(is_met, x, zero));
            // distance, direction, origin, point, normal, and depth, the distance along z
            let parts: [&[C::F]; 6] = [&[far], &way, &origin.0, &point, &normal.0, &[far]];
            // parts that are shown follow each other
            let (data, mut place) = (&mut b.work.sensordata, sensor.first);
            for (part, shows) in parts.into_iter().zip(range.shows) {
                if shows {
                    put_at(data, place, sensor.cutoff.as_ref(), part);
                    place += part.len();
                }
            }
        }
    }
}

/// Least distance of the geoms that a ray meets, or -1, and the normal there, or 0.
#[inline(always)]
fn nearest<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    w: &Workspace<C::F>,
    range: &RangeSensor<<C::F as Num>::Real>,
) -> (C::F, Vec3<C::F>) {
    let zero = C::F::c(0.0);
    let has_normal = range.shows[4];
    let (mut nearest, mut outwards) = (C::F::c(-1.0), Vec3::zero());
    for &geom in &range.geoms {
        let geom = &m.sensors.geoms[geom];
        let (far, normal) = met(cx, m, w, &range.site, geom, has_normal);
        // -1 stands for none, so it is never the nearer one
        let is_nearer = far.lt(nearest) | nearest.lt(zero);
        let is_it = !far.lt(zero) & is_nearer;
        nearest = C::F::select(is_it, far, nearest);
        if has_normal {
            // in the axes of the world
            let normal = axes(w, &geom.at).mul_add(normal, Vec3::zero());
            for k in 0..3 {
                outwards[k] = C::F::select(is_it, normal[k], outwards[k]);
            }
        }
    }
    (nearest, outwards)
}

/// Distance from a site along its z axis to a geom, or -1, and the normal in the axes of the geom.
#[inline(always)]
fn met<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    w: &Workspace<C::F>,
    site: &Mount<<C::F as Num>::Real>,
    geom: &RayGeom<<C::F as Num>::Real>,
    has_normal: bool,
) -> (C::F, Vec3<C::F>) {
    // origin of the site from that of the geom; within a tree reference points cancel
    let mut apart = position(w, site) - position(w, &geom.at);
    if site.tree != geom.at.tree {
        apart = apart + (reference(w, site) - reference(w, &geom.at));
    }
    // the ray in the axes of the geom
    let point = to_local(w, &geom.at, apart);
    let turned = axes(w, site);
    let along = to_local(w, &geom.at, turned[2]);
    if let Some(boxes) = geom.boxes {
        // the axes of the site across the ray, which triangles are seen along
        let (x, y) = (
            to_local(w, &geom.at, turned[0]),
            to_local(w, &geom.at, turned[1]),
        );
        return to_triangles(cx, m, boxes, point, &Mat3([x, y, along]), has_normal);
    }
    match geom.kind {
        Some(kind) => {
            let far = distance(kind, geom.size, point, along);
            // where the ray meets nothing, no normal counts
            let mut outwards = Vec3::zero();
            if has_normal {
                outwards = normal(kind, geom.size, along.scale_add(far, point));
            }
            (far, outwards)
        }
        None => {
            let upwards = Vec3([C::F::c(0.0), C::F::c(0.0), C::F::c(1.0)]);
            (to_plane(geom.size, point, along), upwards)
        }
    }
}

/// Distance to the front of a plane.
#[inline(always)]
fn to_plane<F: Num>(size: [F::Real; 3], point: Vec3<F>, along: Vec3<F>) -> F {
    let (zero, none) = (F::c(0.0), F::c(-1.0));
    // t = -z / d_z for a ray towards the front, d_z < 0; other rays divide by -1 and do not count
    let comes = along[2].lt(F::c(-PARALLEL));
    let range = (-point[2]).div(F::select(comes, along[2], none));
    let mut is_met = comes & !range.lt(zero);
    for i in 0..2 {
        // a plane without bounds has size 0
        if size[i].to_f64() > 0.0 {
            let there = along[i].fma(range, point[i]);
            is_met = is_met & !F::k(size[i]).lt(there.abs());
        }
    }
    F::select(is_met, range, none)
}
