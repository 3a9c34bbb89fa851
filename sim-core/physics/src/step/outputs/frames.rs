//! Frames of bodies, sites and geoms of MuJoCo models, for output (MuJoCo: `mj_kinematics`).
//!
//! ```text
//! x = p + r        p of the frame from the reference point r of its tree
//! ```
//!
//! Quaternions have w first, and matrices are row by row.

use super::sites::{axes, orientation, position, reference};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::site::Mount;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::masses;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Frames of bodies.
pub struct Bodies;

impl Stage for Bodies {
    const READS: &'static [A] = &[
        A::Params,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Orientation,
    ];
    const WRITES: &'static [A] = &[A::Xpos, A::Xquat, A::Xmat, A::Xipos, A::Ximat];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.outputs.bodies.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for (k, body) in m.outputs.bodies.iter().enumerate() {
            let center = masses::position(m, b, body);
            let w = &mut b.work;
            w.xpos[k] = in_world(w, &body.frame);
            // (w, x, y, z) as in MuJoCo
            let [x, y, z, real] = orientation(w, &body.frame);
            w.xquat[k] = [real, x, y, z];
            w.xmat[k] = rows(&axes(w, &body.frame));
            w.xipos[k] = center + reference(w, &body.inertial);
            w.ximat[k] = rows(&axes(w, &body.inertial));
        }
    }
}

/// Frames of sites.
pub struct Sites;

impl Stage for Sites {
    const READS: &'static [A] = &[A::Rotation, A::Origin, A::Reference];
    const WRITES: &'static [A] = &[A::SiteXpos, A::SiteXmat];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.outputs.sites.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let w = &mut b.work;
        for (k, site) in m.outputs.sites.iter().enumerate() {
            w.site_xpos[k] = in_world(w, site);
            w.site_xmat[k] = rows(&axes(w, site));
        }
    }
}

/// Frames of geoms.
pub struct Geoms;

impl Stage for Geoms {
    const READS: &'static [A] = &[A::Rotation, A::Origin, A::Reference];
    const WRITES: &'static [A] = &[A::GeomXpos, A::GeomXmat];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.outputs.geoms.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let w = &mut b.work;
        for (k, geom) in m.outputs.geoms.iter().enumerate() {
            w.geom_xpos[k] = in_world(w, geom);
            w.geom_xmat[k] = rows(&axes(w, geom));
        }
    }
}

/// Origin of a mount in the world.
#[inline(always)]
pub(in crate::step) fn in_world<F: Num>(w: &Workspace<F>, mount: &Mount<F::Real>) -> Vec3<F> {
    position(w, mount) + reference(w, mount)
}

/// A matrix row by row.
#[inline(always)]
pub(in crate::step) fn rows<F: Num>(matrix: &Mat3<F>) -> [F; 9] {
    // a Mat3 has its columns one after the other
    let Mat3([Vec3(x), Vec3(y), Vec3(z)]) = *matrix;
    [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]]
}
