//! Applied, drive and damping forces, less the bias (MuJoCo: `qfrc_smooth`).
//!
//! ```text
//! drive = clamp(ke (q* - q) + kd (q̇* - q̇), ± effort limit)      q̇* only where the drive follows it
//! smooth = joint_f + drive - damping q̇ - bias + Σ Jᵀ body_f
//! ```
//!
//! A joint's damping may grow with its speed ([`super::curves`]). The target of a ball is a rotation vector. Its error is the rotation vector from the present rotation to the target.

use super::command::{Kind, command_of};
use super::{link_forces, springs};
use crate::arrays::{Array as A, Workspace};
use crate::constants::params::Param;
use crate::constants::{Body, Constants, Motion};
use crate::lane::{Cx, Num};
use crate::math::quat::{self, conjugate, mul};
use crate::math::vec3::Vec3;
use crate::step::masses;
use crate::step::tree::kinematics::read_quat;
use crate::step::{BlockOf, ConstantsOf, Stage, param};

/// Applied, drive and damping forces.
pub struct Actuation;

impl Stage for Actuation {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::JointF,
        A::JointTargetQ,
        A::JointTargetQd,
        A::Applied,
        A::Params,
        A::Rotation,
        A::Origin,
        A::Motion,
        A::BiasForce,
    ];
    const WRITES: &'static [A] = &[A::SmoothForce];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        smooth_force(cx, m, b);
    }
}

/// Joint forces of commands and drives, for output.
pub struct JointTorque;

impl Stage for JointTorque {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::JointF,
        A::JointTargetQ,
        A::JointTargetQd,
        A::Applied,
        A::Params,
    ];
    const WRITES: &'static [A] = &[A::JointTorque];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        joint_torque(cx, m, b);
    }
}

/// Writes `smooth_force`: applied and drive forces, less damping and bias.
#[inline(always)]
fn smooth_force<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for body in &m.bodies {
        let torques = torques(cx, m, b, body);
        b.work.smooth_force[body.dofs()].copy_from_slice(&torques[..body.motion.dofs()]);
    }
    // damping of joints is passive: the effort limit does not clamp it. `springs` has that of free joints
    for &j in &m.diagonal_dofs {
        let qd = cx.get(&b.joint_qd[j]);
        let damping = springs::joint_damping(m, &b.params, j, qd);
        let force = &mut b.work.smooth_force[j];
        *force = qd.fnma(damping, *force);
    }
    // the bias: Coriolis, centrifugal and gravity forces
    for (force, bias) in b.work.smooth_force.iter_mut().zip(&b.work.bias_force) {
        *force = *force - *bias;
    }
    // forces of clients on links, where they are parameters
    if let Some(first) = m.varying.first(Param::BodyF) {
        add_link_forces(m, &b.params, first, &mut b.work);
    }
}

/// Writes `joint_torque`: applied and drive forces alone.
#[inline(always)]
fn joint_torque<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for body in &m.bodies {
        let torques = torques(cx, m, b, body);
        b.work.joint_torque[body.dofs()].copy_from_slice(&torques[..body.motion.dofs()]);
    }
}

/// Applied and drive forces of the dofs of a body; the rest is 0.
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
            let target = command_of::<C>(m, b, Kind::Position, first);
            let error = target - cx.get(&b.joint_q[body.coord]);
            torques[0] = joint_force(cx, m, b, first, error);
        }
        Motion::Ball => {
            // three drives, one about each axis of the body
            let errors = ball_error(cx, m, b, body.coord, first);
            for k in 0..3 {
                torques[k] = joint_force(cx, m, b, first + k, errors[k]);
            }
        }
        // nothing drives a free body
        Motion::Free => {
            for k in 0..6 {
                torques[k] = command_of::<C>(m, b, Kind::Force, first + k);
            }
        }
        Motion::Mocap => {}
    }
    torques
}

/// Applied and drive force of dof `j` at this position error.
#[inline(always)]
fn joint_force<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    j: usize,
    error: C::F,
) -> C::F {
    let dof = &m.dofs[j];
    let qd = cx.get(&b.joint_qd[j]);
    // kd damps towards 0 where the drive has no velocity target
    let rate = if dof.follows_velocity {
        command_of::<C>(m, b, Kind::Velocity, j) - qd
    } else {
        -qd
    };
    let mut drive = rate * param(m, &b.params, Param::JointTargetKd, j, dof.kd);
    // clamp(ke (q* - q) + kd (q̇* - q̇), ± limit)
    if dof.follows_position {
        drive = error.fma(param(m, &b.params, Param::JointTargetKe, j, dof.ke), drive);
    }
    // the limit of each world where it varies, otherwise the model's
    let limit = match m.varying.first(Param::JointEffortLimit) {
        Some(first) => Some(b.params[first + j]),
        None => dof.effort_limit.map(C::F::k),
    };
    // the limit is that of the drive alone (MuJoCo: `actfrcrange`); `joint_f` is not clamped
    if let Some(limit) = limit {
        drive = drive.min(limit).max(-limit);
    }
    command_of::<C>(m, b, Kind::Force, j) + drive
}

/// Adds the forces on links, Σ Jᵀ body_f, body by body from the leaves.
#[inline(always)]
fn add_link_forces<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    first: usize,
    w: &mut Workspace<F>,
) {
    link_forces::clear(w);
    for (link, frame) in m.frames.iter().enumerate() {
        if let Some(body) = frame.body {
            // force and torque at the link's own centre of mass, in world axes
            let given = &params[first + 6 * link..first + 6 * link + 6];
            let force = Vec3([given[0], given[1], given[2]]);
            let torque = Vec3([given[3], given[4], given[5]]);
            let center = masses::center_of_frame(m, params, link, frame.center);
            let point = w.rotation[body].mul_add(center, w.origin[body]);
            link_forces::add(w, body, point, force, torque);
        }
    }
    // Σ Jᵀ body_f
    link_forces::project(m, w);
    for (smooth, projected) in w.smooth_force.iter_mut().zip(&w.joint_force) {
        *smooth = *smooth + *projected;
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
    // q* = exp of the target
    let mut turn = Vec3::zero();
    for k in 0..3 {
        turn[k] = command_of::<C>(m, b, Kind::Position, dof + k);
    }
    let target = quat::exp(turn);
    // the rotation from q to q*, along which the drive's spring pulls
    let here = read_quat(cx, &b.joint_q, coord);
    quat::log(mul(conjugate(here), target))
}
