//! Rangefinders: the distance from a site along its z axis to the nearest geom (MuJoCo: `mj_ray`).
//!
//! ```text
//! p + t z, t ≥ 0        in the axes of each geom; -1 where the ray meets none
//! ```
//!
//! A plane is seen from its front alone, and only in its bounds.

use super::zone::distance;
use super::{has, put};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::sensors::{RayGeom, SensorKind};
use crate::constants::site::Mount;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::Vec3;
use crate::step::outputs::sites::{axes, position, reference, to_local};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Part of a direction towards a plane below which a ray does not meet it (MuJoCo: `mjMINVAL`) [–].
const PARALLEL: f64 = 1e-15;

/// Rangefinders.
pub struct Rays;

impl Stage for Rays {
    const READS: &'static [A] = &[A::Rotation, A::Origin, A::Reference, A::Sensordata];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        has(m, |kind| matches!(kind, SensorKind::Range(..)))
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let (zero, none) = (C::F::c(0.0), C::F::c(-1.0));
        for sensor in &m.sensors.all {
            let SensorKind::Range(site, geoms) = &sensor.kind else {
                continue;
            };
            // least distance of all geoms; -1 stands for none, so it is never the nearer one
            let mut nearest = none;
            for &geom in geoms {
                let range = seen(&b.work, site, &m.sensors.geoms[geom]);
                let is_nearer = range.lt(nearest) | nearest.lt(zero);
                let is_met = !range.lt(zero);
                nearest = C::F::select(is_met & is_nearer, range, nearest);
            }
            put(&mut b.work.sensordata, sensor, &[nearest]);
        }
    }
}

/// Distance from a site along its z axis to a geom, or -1.
#[inline(always)]
fn seen<F: Num>(w: &Workspace<F>, site: &Mount<F::Real>, geom: &RayGeom<F::Real>) -> F {
    // origin of the site from that of the geom; within a tree reference points cancel
    let mut apart = position(w, site) - position(w, &geom.at);
    if site.tree != geom.at.tree {
        apart = apart + (reference(w, site) - reference(w, &geom.at));
    }
    // the ray in the axes of the geom
    let point = to_local(w, &geom.at, apart);
    let along = to_local(w, &geom.at, axes(w, site)[2]);
    match geom.kind {
        Some(kind) => distance(kind, geom.size, point, along),
        None => to_plane(geom.size, point, along),
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
