//! The robots of these tests, and states that take every path through the stages.

use crate::{SUBSTEPS, Scalar, toy};
use sim_core::batch::Block;
use sim_core::model::constants::{Constants, Motion};
use sim_core::model::{Description, UrdfOptions};
use std::path::Path;

/// The FR3 with drives and armatures of the usual size.
pub fn fr3() -> Constants<f32> {
    robot("examples/assets/fr3/fr3_franka_hand.urdf", 0.1, false)
}

/// Every kind of joint on a floating base, with accelerations refined.
pub fn every_joint() -> Constants<f32> {
    let m = robot("tests/record_stages/every_joint.urdf", 0.0, true);
    assert!(m.solver.refinements > 0);
    for motion in [
        Motion::Revolute,
        Motion::Prismatic,
        Motion::Ball,
        Motion::Free,
    ] {
        assert!(m.bodies.iter().any(|body| body.motion == motion));
    }
    assert!(!m.equalities.is_empty() && !m.frictions.is_empty() && !m.limits.is_empty());
    m
}

/// The FR3 with limits as its only constraints: the solver passes over states within them.
pub fn limits_only() -> Constants<f32> {
    let mut m = fr3();
    m.equalities.clear();
    m.frictions.clear();
    m.solver.refinements = 1;
    m
}

fn robot(file: &str, armature: f64, floating: bool) -> Constants<f32> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(file);
    let mut scene = Description::new(1.0 / 480.0, SUBSTEPS);
    let options = UrdfOptions {
        floating,
        ..UrdfOptions::named("robot")
    };
    let robot = scene
        .add_urdf(path, options)
        .unwrap_or_else(|e| panic!("{file}: {e}"));
    for joint in robot
        .joints
        .iter_mut()
        .filter(|joint| joint.parent.is_some())
    {
        for dof in &mut joint.dofs {
            (dof.target_ke, dof.target_kd, dof.armature) = (400.0, 40.0, armature);
        }
    }
    scene
        .compile()
        .unwrap_or_else(|e| panic!("{file}: {e}"))
        .constants()
        .cast()
}

/// Random states: a tenth beyond the joints' ranges at either end, so that rows become active.
pub fn random_state(m: &Constants<f32>, random: &mut toy::Random) -> Scalar {
    let mut block = Block::new(m, 0.0);
    let mut number = |size: f64| (random.unit() * size) as f32;
    for (j, dof) in m.dofs.iter().enumerate() {
        let (lower, upper) = m
            .limits
            .iter()
            .find(|l| l.dof == j)
            .map_or((-1.0, 1.0), |l| (l.lower, l.upper));
        let (middle, half) = (0.5 * (lower + upper), 0.5 * (upper - lower));
        let position = middle + 1.2 * half * number(1.0);
        if matches!(
            m.bodies[dof.body].motion,
            Motion::Revolute | Motion::Prismatic
        ) {
            block.joint_q[dof.coord] = position;
        }
        block.joint_target_q[j] = middle + half * number(1.0);
        block.joint_qd[j] = number(2.0);
        block.joint_qdd[j] = number(20.0);
        block.joint_f[j] = number(30.0);
        block.joint_target_qd[j] = number(1.0);
    }
    for body in m.bodies.iter().filter(|body| body.motion == Motion::Free) {
        block.joint_q[body.coord..body.coord + 3].fill_with(|| number(5.0));
    }
    for first in m.quaternions() {
        let turn = [number(1.0), number(1.0), number(1.0), 1.0 + number(0.5)];
        let norm = turn.iter().map(|x| x * x).sum::<f32>().sqrt();
        for (to, x) in block.joint_q[first..first + 4].iter_mut().zip(turn) {
            *to = x / norm;
        }
    }
    block
}
