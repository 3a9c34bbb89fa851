//! Springs of joints (MuJoCo: `stiffness` and `springref`, part of `qfrc_passive`).
//!
//! ```text
//! smooth -= stiffness (q - rest)
//! ```

use super::{BlockOf, ConstantsOf, Stage};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::lane::{Cx, Num, Real};

/// Forces of the springs of joints.
pub struct Springs;

impl Stage for Springs {
    const READS: &'static [A] = &[A::JointQ, A::SmoothForce];
    const WRITES: &'static [A] = &[A::SmoothForce];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.mujoco.springs.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for spring in &m.mujoco.springs {
            let stretch = cx.get(&b.joint_q[m.dofs[spring.dof].coord]) - C::F::k(spring.rest);
            let force = &mut b.work.smooth_force[spring.dof];
            *force = stretch.fnma(C::F::k(spring.stiffness), *force);
        }
    }
}
