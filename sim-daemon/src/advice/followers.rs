//! Mimic joints that start, or are driven, elsewhere than their leaders put them: the constraint and the drives fight.

use sim_model::{Description, Joint, JointKind, Mimic, Robot};

use super::some;

/// Distance from the leader's place that is reported [rad or m]: a state that ran has less.
const AWAY: f64 = 1e-3;

/// Advice on followers of robots from URDF.
pub(super) fn advice(scene: &Description) -> Vec<String> {
    let mut all = Vec::new();
    for robot in &scene.robots {
        let starts = told(robot, |follower, mimic, leader| {
            let (here, there) = (follower.q[0], mimic.position(leader.q[0]));
            ((here - there).abs() > AWAY).then_some((here, there))
        });
        if !starts.is_empty() {
            all.push(format!(
                "robot `{}` starts with {}. The constraint pulls at both: set joint_q of the leader alone.",
                robot.name,
                some(&starts)
            ));
        }
        let targets = told(robot, |follower, mimic, leader| {
            let drives = |joint: &Joint| joint.dofs[0].target_ke > 0.0;
            let target = |joint: &Joint| joint.dofs[0].target_q.unwrap_or(joint.q[0]);
            let (here, there) = (target(follower), mimic.position(target(leader)));
            let fights = drives(follower) && drives(leader) && (here - there).abs() > AWAY;
            fights.then_some((here, there))
        });
        if starts.is_empty() && !targets.is_empty() {
            all.push(format!(
                "robot `{}` has targets with {}. Their drives work against each other: set joint_target_q of the leader alone.",
                robot.name,
                some(&targets)
            ));
        }
    }
    all
}

/// Followers with where they are and where their leaders put them.
fn told(robot: &Robot, away: impl Fn(&Joint, Mimic, &Joint) -> Option<(f64, f64)>) -> Vec<String> {
    let moving = robot.moving_joints().into_iter();
    moving
        .filter_map(|index| {
            let follower = &robot.joints[index];
            let mimic = follower.mimic?;
            let leader = &robot.joints[mimic.joint];
            let (here, there) = away(follower, mimic, leader)?;
            let unit = match follower.kind {
                JointKind::Prismatic => "m",
                _ => "rad",
            };
            Some(format!(
                "`{}` at {here:.4} {unit}, where its leader `{}` puts it at {there:.4}",
                follower.name, leader.name
            ))
        })
        .collect()
}
