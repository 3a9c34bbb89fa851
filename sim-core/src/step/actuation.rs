//! Applied, drive and damping forces, less the bias (MuJoCo: `qfrc_smooth`).
//!
//! ```text
//! drive = clamp(ke (q* - q) + kd (q̇* - q̇), ± effort limit)      q̇* only where the drive follows it
//! smooth = joint_f + drive - damping q̇ - bias
//! ```

use super::{BlockOf, ConstantsOf};
use crate::lane::{Cx, Num};

#[inline(always)]
pub(super) fn smooth_force<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for (j, dof) in m.dofs.iter().enumerate() {
        let (q, qd) = (cx.get(&b.joint_q[j]), cx.get(&b.joint_qd[j]));
        let error = b.joint_target_q[j] - q;
        let rate = if dof.follows_velocity {
            b.joint_target_qd[j] - qd
        } else {
            -qd
        };
        let mut drive = error.fma(C::F::k(dof.ke), rate * C::F::k(dof.kd));
        if let Some(limit) = dof.effort_limit {
            let limit = C::F::k(limit);
            drive = drive.min(limit).max(-limit);
        }
        let applied = qd.fnma(C::F::k(dof.damping), b.joint_f[j] + drive);
        b.work.smooth_force[j] = applied - b.work.bias_force[j];
    }
}
