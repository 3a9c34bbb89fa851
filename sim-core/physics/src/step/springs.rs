//! Springs of joints, and springs and dampers of tendons (MuJoCo: `mj_passive`).
//!
//! ```text
//! smooth -= stiffness (q - rest)                       of a joint
//! smooth -= c (stiffness (l - rest) + damping v)       of a tendon with the coefficients c; no spring force between its rests
//! ```

use super::ties::length;
use super::{BlockOf, ConstantsOf, Stage};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::mujoco::Tendon;
use crate::lane::{Cx, Num, Real};

/// Forces of springs and dampers.
pub struct Springs;

impl Stage for Springs {
    const READS: &'static [A] = &[A::JointQ, A::JointQd, A::SmoothForce];
    const WRITES: &'static [A] = &[A::SmoothForce];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.mujoco.springs.is_empty() || !m.mujoco.tendons.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for spring in &m.mujoco.springs {
            let stretch = cx.get(&b.joint_q[m.dofs[spring.dof].coord]) - C::F::k(spring.rest);
            let force = &mut b.work.smooth_force[spring.dof];
            *force = stretch.fnma(C::F::k(spring.stiffness), *force);
        }
        for tendon in &m.mujoco.tendons {
            let stretch = stretch(cx, m, b, tendon);
            let mut velocity = C::F::c(0.0);
            for term in &tendon.terms {
                let qd = cx.get(&b.joint_qd[term.dof]);
                velocity = qd.fma(C::F::k(term.coefficient), velocity);
            }
            let damped = velocity * C::F::k(tendon.damping);
            let pull = stretch.fma(C::F::k(tendon.stiffness), damped);
            for term in &tendon.terms {
                let force = &mut b.work.smooth_force[term.dof];
                *force = pull.fnma(C::F::k(term.coefficient), *force);
            }
        }
    }
}

/// How far a tendon is beyond its rests.
#[inline(always)]
pub(super) fn stretch<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    tendon: &Tendon<<C::F as Num>::Real>,
) -> C::F {
    let length = length(cx, m, b, &tendon.terms);
    let [shortest, longest] = tendon.rest.map(C::F::k);
    length - length.max(shortest).min(longest)
}
