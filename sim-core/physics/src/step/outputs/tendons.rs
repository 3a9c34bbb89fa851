//! Lengths of tendons of MuJoCo models, and their rates, for output (MuJoCo: `mj_tendon`).
//!
//! ```text
//! l = Σ c q          v = Σ c q̇                 of a fixed tendon
//! l = L              v = Σ ∂L̇/∂q̇ q̇             of a spatial one, see `step::tendons`
//! ```
//!
//! A step has the spatial tendons that something uses. The others are measured here alone.

use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::tendons::SpatialTendon;
use crate::lane::{Cx, Num, Real};
use crate::step::lengths::{length, rate};
use crate::step::tendons::{moment, stretch};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Lengths of tendons.
pub struct Lengths;

impl Stage for Lengths {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Motion,
        A::TenLength,
        A::TenVelocity,
    ];
    const WRITES: &'static [A] = &[A::TendonLength, A::TendonVelocity];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.outputs.tendons.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for (k, tendon) in m.outputs.tendons.iter().enumerate() {
            let [length, velocity] = match &tendon.idle {
                // what a step measures, or a sum of coordinates
                None => [
                    length(cx, m, b, &tendon.length),
                    rate(cx, b, &tendon.length),
                ],
                Some(idle) => idle_length(cx, b, idle),
            };
            b.work.tendon_length[k] = length;
            b.work.tendon_velocity[k] = velocity;
        }
    }
}

/// Length of a tendon that a step does without, and its rate.
#[inline(always)]
fn idle_length<C: Cx>(
    cx: &mut C,
    b: &mut BlockOf<C>,
    tendon: &SpatialTendon<<C::F as Num>::Real>,
) -> [C::F; 2] {
    let length = stretch(cx, &mut b.work, tendon);
    // v = Σ ∂L̇/∂q̇ q̇
    let mut velocity = C::F::c(0.0);
    for (place, &dof) in tendon.dofs.iter().enumerate() {
        let speed = cx.get(&b.joint_qd[dof]);
        velocity = speed.fma(moment(&b.work, tendon, place), velocity);
    }
    [length, velocity]
}
