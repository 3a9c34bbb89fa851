//! Values with the wrong unit or order.

use std::f64::consts::TAU;

use sim_model::{Description, Joint, JointKind, Pose, Robot};

use super::{draws, drives, gravity, some};

/// Physics steps longer than this are rare [s].
const DT_USUAL: f64 = 0.05;
/// How far outside of their limits joints may start, that turn [rad] and that slide [m]: Newton's lesson begins with the
/// fingers 1 cm beyond theirs.
const OUTSIDE: [f64; 2] = [0.2, 0.05];
/// Limits between these look like degrees [rad]: robots turn twice about an axis, and exporters that know no limits write
/// larger ones.
const TURNS: [f64; 2] = [2.0 * TAU, 720.0];
/// The identity, as libraries write it that put w first.
const W_FIRST: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

/// Advice on numbers of the scene.
pub(super) fn advice(scene: &Description) -> Vec<String> {
    let mut all: Vec<String> = step(scene).into_iter().collect();
    all.extend(gravity::advice(scene));
    all.extend(empty(scene));
    all.extend(draws::advice(scene));
    let shapes = scene.shapes.iter();
    all.extend(shapes.filter_map(|shape| turned(&format!("shape `{}`", shape.name), &shape.pose)));
    let sites = scene.sites.iter();
    all.extend(sites.filter_map(|site| turned(&format!("site `{}`", site.name), &site.pose)));
    // what MuJoCo compiled has its own conventions, and its own warnings
    for robot in scene
        .robots
        .iter()
        .filter(|robot| robot.precompiled.is_none())
    {
        let name = full_name(robot);
        let base = robot.joints.iter().find(|joint| joint.parent.is_none());
        let start = base.filter(|joint| joint.kind == JointKind::Free);
        let pose = start.map_or(robot.pose, |joint| Pose {
            pos: robot.pose.pos,
            quat: [joint.q[3], joint.q[4], joint.q[5], joint.q[6]],
        });
        all.extend(turned(&name, &pose));
        all.extend(turned_shapes(robot));
        all.extend(degrees(robot, &name));
        all.extend(outside(robot, &name));
        all.extend(drives::advice(scene, robot, &name));
    }
    all
}

/// A robot or body with its kind.
pub(super) fn full_name(robot: &Robot) -> String {
    let kind = match robot.urdf {
        Some(_) => "robot",
        None => "body",
    };
    format!("{kind} `{}`", robot.name)
}

/// A time step that is far too long.
fn step(scene: &Description) -> Option<String> {
    let dt = scene.dt;
    (dt > DT_USUAL).then(|| {
        format!("dt is {dt} s. Simulations are seldom stable at it; 0.001 to 0.01 s are usual.")
    })
}

/// A scene in which nothing can move.
fn empty(scene: &Description) -> Option<String> {
    scene.robots.is_empty().then(|| {
        "the scene has no robot and no body, so nothing happens in it. Add some with add_urdf, add_mujoco or add_body."
            .to_owned()
    })
}

/// A half turn about x that was most likely to be no turn.
fn turned(what: &str, pose: &Pose) -> Option<String> {
    (pose.quat == W_FIRST).then(|| {
        format!(
            "{what} is turned by 180° about x: quat is (1, 0, 0, 0), and the order is (x, y, z, w). Give (0, 0, 0, 1) for no turn, \
             or (-1, 0, 0, 0) if the half turn is meant."
        )
    })
}

/// Shapes on links with such a quaternion.
fn turned_shapes(robot: &Robot) -> Vec<String> {
    let shapes = robot.links.iter().flat_map(|link| {
        let collisions = link.collisions.iter().enumerate();
        collisions.map(move |(index, shape)| (link, index, shape))
    });
    shapes
        .filter_map(|(link, index, shape)| {
            let label = shape.name.clone().unwrap_or_else(|| index.to_string());
            let what = format!("shape `{}/{}/{label}`", robot.name, link.name);
            turned(&what, &shape.pose)
        })
        .collect()
}

/// Limits of a file that look like degrees.
fn degrees(robot: &Robot, what: &str) -> Option<String> {
    let limits: Vec<String> = moving(robot)
        .filter(|joint| joint.kind == JointKind::Revolute)
        .filter_map(|joint| {
            let [lower, upper] = joint.range?;
            let largest = lower.abs().max(upper.abs());
            (TURNS[0] < largest && largest <= TURNS[1])
                .then(|| format!("`{}` ({lower} to {upper})", joint.name))
        })
        .collect();
    (!limits.is_empty()).then(|| {
        format!(
            "{what}: limits of {} look like degrees: <limit> is in radians. Divide them by 57.29578 in the file.",
            some(&limits)
        )
    })
}

/// Joints that start far outside of their limits. A follower starts where its leader puts it.
fn outside(robot: &Robot, what: &str) -> Option<String> {
    let mut outside_joints = Vec::new();
    let (mut is_large, mut follows) = (false, false);
    for joint in moving(robot) {
        let (Some([lower, upper]), [q]) = (joint.range, joint.q.as_slice()) else {
            continue;
        };
        let is_angle = joint.kind == JointKind::Revolute;
        let slack = if is_angle { OUTSIDE[0] } else { OUTSIDE[1] };
        // draws are clamped to the limits
        let is_drawn = joint.dofs.iter().any(|dof| dof.offset_q.is_some());
        if !is_drawn && (*q < lower - slack || *q > upper + slack) {
            is_large |= is_angle && q.abs() > TAU;
            follows |= joint.mimic.is_some();
            let unit = if is_angle { "rad" } else { "m" };
            outside_joints.push(format!(
                "`{}` at {q:.4} {unit} ({lower:.4} to {upper:.4})",
                joint.name
            ));
        }
    }
    (!outside_joints.is_empty()).then(|| {
        let cure = match (is_large, follows) {
            (_, true) => "Limits and leaders will push against each other: mend <mimic> or <limit> in the file.",
            (true, false) => "Angles are in radians: np.radians converts degrees.",
            (false, false) => "The limits will push them back: set joint_q.",
        };
        format!(
            "{what} starts far outside of joint limits: {}. {cure}",
            some(&outside_joints)
        )
    })
}

pub(super) fn moving(robot: &Robot) -> impl Iterator<Item = &Joint> {
    robot
        .moving_joints()
        .into_iter()
        .map(|joint| &robot.joints[joint])
}
