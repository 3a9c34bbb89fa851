//! Keyframes of MuJoCo models as states of the whole scene, in its own conventions.

use crate::description::{Keyframe, Robot};
use crate::model::{KeyState, RobotRange, Start};
use crate::pose::Pose;
use sim_physics::constants::{Body, Motion};

/// The keyframes of all robots. Each is the scene's start but for its own robot.
pub(super) fn states(
    robots: &[Robot],
    ranges: &[RobotRange],
    bodies: &[Body<f64>],
    start: &Start,
    [actuators, activations]: [usize; 2],
) -> Vec<KeyState> {
    let base = KeyState {
        name: String::new(),
        joint_q: start.joint_q.clone(),
        joint_qd: vec![0.0; start.joint_target_qd.len()],
        act: vec![0.0; activations],
        ctrl: vec![0.0; actuators],
        mocap_pos: start.mocap_pos.clone(),
        mocap_quat: start.mocap_quat.clone(),
    };
    let (mut all, mut first_act, mut first_mocap) = (Vec::new(), 0, 0);
    for (robot, range) in robots.iter().zip(ranges) {
        let Some(parts) = &robot.precompiled else {
            continue;
        };
        for key in &parts.keyframes {
            let mut state = base.clone();
            state.name = format!("{}/{}", robot.name, key.name);
            state.joint_q[range.coords.clone()].copy_from_slice(&key.qpos);
            state.joint_qd[range.dofs.clone()].copy_from_slice(&key.qvel);
            let robot_bodies = bodies
                .iter()
                .filter(|body| range.coords.contains(&body.coord));
            for body in robot_bodies.filter(|body| body.motion.coords() > 1) {
                convert(robot, body, &mut state);
            }
            put(&mut state.act, first_act, &key.act);
            put(&mut state.ctrl, range.actuators.start, &key.ctrl);
            place_mocaps(robot, key, first_mocap, &mut state);
            all.push(state);
        }
        let acting = parts.actuators.iter();
        first_act += acting
            .filter(|actuator| actuator.activation.is_some())
            .count();
        first_mocap += parts.mocaps.len();
    }
    all
}

fn put(to: &mut [f64], first: usize, from: &[f64]) {
    to[first..first + from.len()].copy_from_slice(from);
}

/// Position and velocity of a ball or a free body, from MuJoCo's conventions.
fn convert(robot: &Robot, body: &Body<f64>, state: &mut KeyState) {
    let q = &mut state.joint_q[body.coord..body.coord + body.motion.coords()];
    let qd = &mut state.joint_qd[body.dof..body.dof + body.motion.dofs()];
    if body.motion == Motion::Ball {
        q.rotate_left(1);
        return;
    }
    q[3..].rotate_left(1);
    let pose = robot.pose.mul(&Pose {
        pos: [q[0], q[1], q[2]],
        quat: [q[3], q[4], q[5], q[6]],
    });
    let pose = pose.normalized();
    q[..3].copy_from_slice(&pose.pos);
    q[3..].copy_from_slice(&pose.quat);
    // of the frame's origin in the model's world, and in the axes of the body: of the centre of mass, in those of the world
    let linear = robot.pose.rotate([qd[0], qd[1], qd[2]]);
    let [x, y, z] = pose.rotate([qd[3], qd[4], qd[5]]);
    let [u, v, w] = pose.rotate(body.center);
    let swing = [y * w - z * v, z * u - x * w, x * v - y * u];
    for i in 0..3 {
        qd[i] = linear[i] + swing[i];
    }
    qd[3..].copy_from_slice(&[x, y, z]);
}

fn place_mocaps(robot: &Robot, key: &Keyframe, first: usize, state: &mut KeyState) {
    let (positions, _) = key.mocap_pos.as_chunks::<3>();
    let (quats, _) = key.mocap_quat.as_chunks::<4>();
    for (k, (&pos, &[w, x, y, z])) in positions.iter().zip(quats).enumerate() {
        let pose = robot.pose.mul(&Pose {
            pos,
            quat: [x, y, z, w],
        });
        let [x, y, z, w] = pose.quat;
        put(&mut state.mocap_pos, 3 * (first + k), &pose.pos);
        put(&mut state.mocap_quat, 4 * (first + k), &[w, x, y, z]);
    }
}
