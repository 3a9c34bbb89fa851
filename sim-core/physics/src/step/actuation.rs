//! Applied, drive and damping forces, less the bias (MuJoCo: `qfrc_smooth`).
//!
//! ```text
//! drive = clamp(ke (q* - q) + kd (q̇* - q̇), ± effort limit)      q̇* only where the drive follows it
//! smooth = joint_f + drive - damping q̇ - bias + Σ Jᵀ body_f
//! ```
//!
//! The target of a ball is a rotation vector; its error is the rotation vector from here to there.

use super::command::{Command, acting};
use super::kinematics::read_quat;
use super::{BlockOf, ConstantsOf, param};
use crate::arrays::Workspace;
use crate::constants::params::Param;
use crate::constants::{Body, Constants, Motion};
use crate::lane::{Cx, Num};
use crate::math::quat::{self, conjugate, mul};
use crate::math::spatial::{power, sum};
use crate::math::vec3::{Vec3, constant, cross_add, transform_add, zero};

#[inline(always)]
pub(super) fn smooth_force<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for body in &m.bodies {
        let torques = torques(cx, m, b, body);
        for (j, torque) in body.dofs().zip(torques) {
            let damping = param(m, &b.params, Param::JointDamping, j, m.dofs[j].damping);
            let applied = cx.get(&b.joint_qd[j]).fnma(damping, torque);
            b.work.smooth_force[j] = applied - b.work.bias_force[j];
        }
    }
    if let Some(first) = m.varying.first(Param::BodyF) {
        push(m, &b.params, first, &mut b.work);
    }
}

/// What the joints are driven by, for output.
#[inline(always)]
pub(super) fn joint_torque<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for body in &m.bodies {
        let torques = torques(cx, m, b, body);
        b.work.joint_torque[body.dofs()].copy_from_slice(&torques[..body.motion.dofs()]);
    }
}

/// Applied and drive forces of the dofs of a body, as many as it has.
#[inline(always)]
fn torques<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    body: &Body<<C::F as Num>::Real>,
) -> [C::F; 6] {
    let mut torques = [C::F::c(0.0); 6];
    let first = body.dof;
    match body.motion {
        Motion::Revolute | Motion::Prismatic => {
            let target = acting::<C>(m, b, Command::Position, first);
            let error = target - cx.get(&b.joint_q[body.coord]);
            torques[0] = driven(cx, m, b, first, error);
        }
        Motion::Ball => {
            let errors = ball_error(cx, m, b, body.coord, first);
            for k in 0..3 {
                torques[k] = driven(cx, m, b, first + k, errors[k]);
            }
        }
        Motion::Free => {
            for k in 0..6 {
                torques[k] = acting::<C>(m, b, Command::Force, first + k);
            }
        }
    }
    torques
}

/// Applied and drive force of dof `j` at this position error.
#[inline(always)]
fn driven<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &BlockOf<C>, j: usize, error: C::F) -> C::F {
    let dof = &m.dofs[j];
    let qd = cx.get(&b.joint_qd[j]);
    let rate = if dof.follows_velocity {
        acting::<C>(m, b, Command::Velocity, j) - qd
    } else {
        -qd
    };
    let mut drive = rate * param(m, &b.params, Param::JointTargetKd, j, dof.kd);
    if dof.follows_position {
        drive = error.fma(param(m, &b.params, Param::JointTargetKe, j, dof.ke), drive);
    }
    let limit = match m.varying.first(Param::JointEffortLimit) {
        Some(first) => Some(b.params[first + j]),
        None => dof.effort_limit.map(C::F::k),
    };
    if let Some(limit) = limit {
        drive = drive.min(limit).max(-limit);
    }
    acting::<C>(m, b, Command::Force, j) + drive
}

/// Adds the forces on links to those of the joints that carry them.
#[inline(always)]
fn push<F: Num>(m: &Constants<F::Real>, params: &[F], first: usize, w: &mut Workspace<F>) {
    for force in &mut w.force {
        *force = [zero(), zero()];
    }
    for (link, frame) in m.frames.iter().enumerate() {
        if let Some(body) = frame.body {
            let given = &params[first + 6 * link..first + 6 * link + 6];
            let force = [given[0], given[1], given[2]];
            let torque = [given[3], given[4], given[5]];
            let point = transform_add(&w.rotation[body], constant(frame.center), w.origin[body]);
            let wrench = [force, cross_add(point, force, torque)];
            w.force[body] = sum(w.force[body], wrench);
        }
    }
    for (k, body) in m.bodies.iter().enumerate().rev() {
        let force = w.force[k];
        for (axis, d) in body.dofs().enumerate() {
            let pushed = match body.motion {
                Motion::Free => force.as_flattened()[axis],
                _ => power(&w.motion[d], &force),
            };
            w.smooth_force[d] = w.smooth_force[d] + pushed;
        }
        if let Some(parent) = body.parent {
            w.force[parent] = sum(w.force[parent], force);
        }
    }
}

/// log(q⁻¹ exp(target)), in the body's axes.
#[inline(always)]
fn ball_error<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    coord: usize,
    dof: usize,
) -> Vec3<C::F> {
    let mut turn = zero();
    for k in 0..3 {
        turn[k] = acting::<C>(m, b, Command::Position, dof + k);
    }
    let target = quat::exp(turn);
    let here = read_quat(cx, &b.joint_q, coord);
    quat::log(mul(conjugate(here), target))
}
