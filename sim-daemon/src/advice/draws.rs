//! Distributions with the wrong unit or sign: what a reset draws is checked as the scene's own values are.

use std::f64::consts::{PI, TAU};

use sim_model::{Description, Distribution, JointKind, Robot};
use sim_physics::constants::params::Param;

use super::some;
use super::values::moving;

/// Dofs of a free joint that turn it.
const TURNS: std::ops::Range<usize> = 3..6;
/// Standard deviations below the mean within which a draw of a mass has to stay above its least: 1 in 44 is beyond.
const DEVIATIONS: f64 = 2.0;

/// Advice on what a reset draws.
pub(super) fn advice(scene: &Description) -> Vec<String> {
    // what MuJoCo compiled has its own conventions
    let robots = scene
        .robots
        .iter()
        .filter(|robot| robot.precompiled.is_none());
    let mut all: Vec<String> = robots.filter_map(starts).collect();
    all.extend(noise(scene));
    all.extend(masses(scene));
    all
}

/// Draws of starts that look like degrees.
fn starts(robot: &Robot) -> Option<String> {
    let mut large = Vec::new();
    for joint in moving(robot) {
        let dofs = match joint.kind {
            JointKind::Revolute => 0..joint.dofs.len(),
            JointKind::Free => TURNS,
            _ => continue,
        };
        let offsets = joint.dofs[dofs].iter().filter_map(|dof| dof.offset_q);
        let most = offsets.map(|offset| spread(&offset)).fold(0.0, f64::max);
        if most > TAU {
            large.push(format!("`{}` by up to {most}", joint.name));
        }
    }
    let kind = if robot.urdf.is_some() {
        "robot"
    } else {
        "body"
    };
    (!large.is_empty()).then(|| {
        format!(
            "{kind} `{}`: a reset moves {}, which looks like degrees: angles are in radians, and np.radians converts degrees.",
            robot.name,
            some(&large)
        )
    })
}

/// Noise of angles that looks like degrees.
fn noise(scene: &Description) -> Option<String> {
    let noises = [Param::JointQNoise, Param::JointTargetQNoise];
    let mut noisy = Vec::new();
    for (param, ranges) in noises
        .iter()
        .filter_map(|param| scene.param_ranges.get_key_value(param))
    {
        for (name, drawn) in ranges.iter().filter(|(_, drawn)| spread(drawn) > PI) {
            if turns(scene, name) {
                noisy.push(format!(
                    "{} of `{name}` of up to {}",
                    param.row().name,
                    spread(drawn)
                ));
            }
        }
    }
    (!noisy.is_empty()).then(|| {
        format!(
            "randomize: {} looks like degrees: angles are in radians, and np.radians converts degrees.",
            some(&noisy)
        )
    })
}

/// Whether a name is that of a joint that turns, or of a robot that has some.
fn turns(scene: &Description, name: &str) -> bool {
    let (robot, joint) = name.split_once('/').unwrap_or((name, ""));
    let mut robots = scene.robots.iter().filter(|other| other.name == robot);
    robots.any(|robot| {
        let mut joints = moving(robot).filter(|moved| joint.is_empty() || moved.name == joint);
        joints.any(|joint| joint.kind == JointKind::Revolute)
    })
}

/// Draws of masses of which many are below the least, which they then become: such links are thrown about.
fn masses(scene: &Description) -> Option<String> {
    let mut light = Vec::new();
    for (param, ranges) in [Param::BodyMass, Param::BodyMassScale]
        .iter()
        .filter_map(|param| scene.param_ranges.get_key_value(param))
    {
        let least = param.row().least.unwrap_or_default();
        for (name, drawn) in ranges {
            let is_low = match *drawn {
                // the reader refuses a range that begins below
                Distribution::Uniform { low, high } => low <= 0.0 && high == low,
                Distribution::Normal { mean, std } => mean - DEVIATIONS * std <= least,
            };
            if is_low {
                light.push(format!("{} of `{name}` is often {least}", param.row().name));
            }
        }
    }
    (!light.is_empty()).then(|| {
        format!(
            "randomize: {}, since draws below become that: a link with so little mass is thrown about. Use a smaller standard \
             deviation, or Uniform with a low above 0.",
            some(&light)
        )
    })
}

/// The largest value of a distribution, nearly always.
fn spread(distribution: &Distribution) -> f64 {
    match *distribution {
        Distribution::Uniform { low, high } => low.abs().max(high.abs()),
        Distribution::Normal { mean, std } => mean.abs() + std,
    }
}
