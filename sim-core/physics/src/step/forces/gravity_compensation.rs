//! Compensation of gravity (MuJoCo: `gravcomp`).
//!
//! ```text
//! τ = Σ Jᵀ (-s m g)      at the centre of mass of each link, s its share of compensation
//! ```
//!
//! The force of joints with `actuatorgravcomp` counts as one of their actuators ([`super::actuators`]).

use super::link_forces;
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::params::Param;
use crate::lane::{Cx, Real};
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf, Stage, gravity, masses, param};

/// Forces that hold links against gravity.
pub struct GravityCompensation;

impl Stage for GravityCompensation {
    const READS: &'static [A] = &[A::Params, A::Rotation, A::Origin, A::Motion, A::SmoothForce];
    const WRITES: &'static [A] = &[A::SmoothForce, A::QfrcGravcomp];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.compensation.links.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        forces::<C>(m, b);
        let w = &mut b.work;
        // joints without `actuatorgravcomp`
        for &d in &m.compensation.passive_dofs {
            w.smooth_force[d] = w.smooth_force[d] + w.joint_force[d];
        }
        // of the other joints, `actuators` adds it
        if !m.compensation.actuated_dofs.is_empty() {
            w.qfrc_gravcomp.copy_from_slice(&w.joint_force);
        }
    }
}

/// Writes the forces that hold bodies against gravity to `joint_force`.
#[inline(always)]
pub(in crate::step) fn forces<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let up = -gravity(m, &b.params);
    let (w, params) = (&mut b.work, &b.params);
    link_forces::clear(w);
    for held in &m.compensation.links {
        // -s m g at the centre of mass, with the mass that the link has in each world
        let center = masses::center_of_frame(m, params, held.link, held.center);
        let point = w.rotation[held.body].mul_add(center, w.origin[held.body]);
        let mass = masses::mass(m, params, held.link, held.mass);
        let share = param(m, params, Param::BodyGravcomp, held.link, held.share);
        let force = up * (mass * share);
        link_forces::add(w, held.body, point, force, Vec3::zero());
    }
    // Σ Jᵀ f
    link_forces::project(m, w);
}
