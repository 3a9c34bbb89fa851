//! Drives that cannot act, that swing for ever, or that a time step makes unstable.

use sim_model::{Description, Joint, JointDof, JointKind, Model, Robot, TargetMode};
use sim_physics::constants::params::Param;

use super::some;
use super::values::{full_name, moving};

/// Share of critical damping below which a drive swings for minutes [–].
const DAMPED: f64 = 0.01;
/// How far from its target dry friction may hold a drive that swings all the same [rad or m].
const HELD: f64 = 0.002;

/// Advice on the drives of a robot from URDF.
pub(super) fn advice(scene: &Description, robot: &Robot, what: &str) -> Vec<String> {
    let mut all: Vec<String> = powerless(scene, robot, what).into_iter().collect();
    all.extend(aimless(scene, robot, what));
    all
}

/// Drives with gains that may not use any effort.
fn powerless(scene: &Description, robot: &Robot, what: &str) -> Option<String> {
    if varies(scene, Param::JointEffortLimit) {
        return None;
    }
    let names: Vec<String> = moving(robot)
        .filter(|joint| {
            let is_powerless = |dof: &JointDof| {
                dof.effort_limit == Some(0.0) && (dof.target_ke > 0.0 || dof.target_kd > 0.0)
            };
            joint.dofs.iter().any(is_powerless)
        })
        .map(|joint| format!("`{}`", joint.name))
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "{what}: the drives of {} have gains and an effort limit of 0, so they do nothing. Set joint_effort_limit; inf is no limit.",
            some(&names)
        )
    })
}

/// Targets of drives without gains.
fn aimless(scene: &Description, robot: &Robot, what: &str) -> Option<String> {
    if varies(scene, Param::JointTargetKe) || varies(scene, Param::JointTargetKd) {
        return None;
    }
    let names: Vec<String> = moving(robot)
        // a follower has the target of its leader, and the constraint moves it
        .filter(|joint| joint.mimic.is_none())
        .filter(|joint| matches!(joint.kind, JointKind::Revolute | JointKind::Prismatic))
        .filter(|joint| {
            joint.dofs.iter().zip(&joint.q).any(|(dof, start)| {
                let aims =
                    dof.target_q.is_some_and(|target| target != *start) || dof.target_qd != 0.0;
                let is_velocity = dof.target_mode == TargetMode::Velocity;
                aims && dof.target_kd == 0.0 && (is_velocity || dof.target_ke == 0.0)
            })
        })
        .map(|joint| format!("`{}`", joint.name))
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "{what}: {} have targets and no gains, so they ignore them. Set joint_target_ke and joint_target_kd.",
            some(&names)
        )
    })
}

/// Stiff drives of joints that hardly anything damps. With inertia I, damping d and stiffness k the share of critical damping
/// is d / (2 √(k I)); dry friction f holds a drive within f / k of its target.
pub(super) fn swinging(scene: &Description, model: &Model) -> Vec<String> {
    let params = [
        Param::JointTargetKe,
        Param::JointTargetKd,
        Param::JointDamping,
    ];
    if params.into_iter().any(|param| varies(scene, param)) {
        return Vec::new();
    }
    let weights = model.dof_inverse_weight();
    let mut first = 0;
    let mut all = Vec::new();
    for robot in &scene.robots {
        let mut names = Vec::new();
        for joint in moving(robot) {
            let range = first..first + joint.dofs.len();
            first = range.end;
            let swings = |(dof, weight): (&JointDof, &f64)| {
                let inertia = if *weight > 0.0 { weight.recip() } else { 0.0 };
                dof.target_ke > 0.0
                    && dof.target_kd == 0.0
                    && dof.target_mode != TargetMode::Velocity
                    && dof.damping <= 2.0 * DAMPED * (dof.target_ke * inertia).sqrt()
                    && dof.friction <= HELD * dof.target_ke
                    && dof.effort_limit != Some(0.0)
            };
            if robot.precompiled.is_none() && joint.dofs.iter().zip(&weights[range]).any(swings) {
                names.push(format!("`{}`", joint.name));
            }
        }
        if !names.is_empty() {
            all.push(format!(
                "{}: the drives of {} have stiffness and nothing damps them, so they swing about their targets. Set \
                 joint_target_kd, to about a tenth of joint_target_ke at first.",
                full_name(robot),
                some(&names)
            ));
        }
    }
    all
}

/// Drives that are too stiff for the time step. With inertia I, damping d and stiffness k a drive is unstable where
/// k h² > 4 I + 2 d h: the step is implicit in d alone.
pub(super) fn unstable(scene: &Description, model: &Model) -> Vec<String> {
    let params = [
        Param::JointTargetKe,
        Param::JointTargetKd,
        Param::JointArmature,
    ];
    if params.into_iter().any(|param| varies(scene, param)) {
        return Vec::new();
    }
    let (h, weights) = (model.dt(), model.dof_inverse_weight());
    let mut first = 0;
    let mut all = Vec::new();
    for robot in &scene.robots {
        let (mut names, mut shortest) = (Vec::new(), f64::INFINITY);
        for joint in moving(robot) {
            let range = first..first + joint.dofs.len();
            first = range.end;
            let is_simple = matches!(joint.kind, JointKind::Revolute | JointKind::Prismatic);
            // what MuJoCo compiled has actuators of its own, and a follower moves its leader's inertia
            if !is_simple || robot.precompiled.is_some() || is_coupled(robot, joint) {
                continue;
            }
            for (dof, weight) in joint.dofs.iter().zip(&weights[range]) {
                let is_held = dof.target_mode != TargetMode::Velocity && dof.target_ke > 0.0;
                if !is_held || *weight <= 0.0 || !weight.is_finite() {
                    continue;
                }
                let (k, d) = (dof.target_ke, dof.target_kd + dof.damping);
                let inertia = weight.recip();
                if k * h * h > 4.0 * inertia + 2.0 * d * h {
                    names.push(format!("`{}`", joint.name));
                    shortest = shortest.min((d + (d * d + 4.0 * k * inertia).sqrt()) / k);
                }
            }
        }
        if !names.is_empty() {
            all.push(format!(
                "robot `{}`: the drives of {} are too stiff for dt of {h:.2e} s and will shake: at these inertias they are stable \
                 below {shortest:.1e} s. Use a smaller dt, more joint_armature, or a smaller joint_target_ke.",
                robot.name,
                some(&names)
            ));
        }
    }
    all
}

/// Whether a joint follows another or leads one.
fn is_coupled(robot: &Robot, joint: &Joint) -> bool {
    let mut mimics = robot.joints.iter().filter_map(|other| other.mimic);
    joint.mimic.is_some() || mimics.any(|mimic| robot.joints[mimic.joint].name == joint.name)
}

/// Whether values differ between worlds.
fn varies(scene: &Description, param: Param) -> bool {
    scene.params.contains(&param) || scene.param_ranges.contains_key(&param)
}
