//! Applied, drive and damping forces, less the bias (MuJoCo: `qfrc_smooth`).
//!
//! ```text
//! drive = clamp(ke (q* - q) + kd (q̇* - q̇), ± effort limit)      q̇* only where the drive follows it
//! smooth = joint_f + drive - damping q̇ - bias
//! ```
//!
//! The target of a ball is a rotation vector; its error is the rotation vector from here to there.

use super::kinematics::read_quat;
use super::{BlockOf, ConstantsOf};
use crate::lane::{Cx, Num};
use crate::math::quat::{self, conjugate, mul};
use crate::math::vec3::Vec3;
use crate::model::constants::{Dof, Motion};

#[inline(always)]
pub(super) fn smooth_force<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for body in &m.bodies {
        match body.motion {
            Motion::Revolute | Motion::Prismatic => {
                let j = body.dof;
                let error = b.joint_target_q[j] - cx.get(&b.joint_q[body.coord]);
                drive(cx, &m.dofs[j], b, j, error);
            }
            Motion::Ball => {
                let errors = ball_error(cx, b, body.coord, body.dof);
                for (j, error) in body.dofs().zip(errors) {
                    drive(cx, &m.dofs[j], b, j, error);
                }
            }
            Motion::Free => {
                for j in body.dofs() {
                    let damping = C::F::k(m.dofs[j].damping);
                    let applied = cx.get(&b.joint_qd[j]).fnma(damping, b.joint_f[j]);
                    b.work.smooth_force[j] = applied - b.work.bias_force[j];
                }
            }
        }
    }
}

/// The force of dof `j` at this position error.
#[inline(always)]
fn drive<C: Cx>(
    cx: &mut C,
    dof: &Dof<<C::F as Num>::Real>,
    b: &mut BlockOf<C>,
    j: usize,
    error: C::F,
) {
    let qd = cx.get(&b.joint_qd[j]);
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

/// log(q⁻¹ exp(target)), in the body's axes.
#[inline(always)]
fn ball_error<C: Cx>(cx: &mut C, b: &BlockOf<C>, coord: usize, dof: usize) -> Vec3<C::F> {
    let t = &b.joint_target_q[dof..dof + 3];
    let target = quat::exp([t[0], t[1], t[2]]);
    let here = read_quat(cx, &b.joint_q, coord);
    quat::log(mul(conjugate(here), target))
}
