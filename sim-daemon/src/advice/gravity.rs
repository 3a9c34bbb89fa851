//! Gravity with the wrong sign, axis or unit.

use sim_model::{Description, Distribution};
use sim_physics::constants::params::Param;

use super::factors;

/// Gravity beyond this is on no planet, and in other units everywhere: cm/s² and mm/s² [m/s²].
const MOST: f64 = 50.0;

/// Advice on the gravity of a scene and on its draws. Scenes that MuJoCo compiled have that of their makers.
pub(super) fn advice(scene: &Description) -> Vec<String> {
    if !has_moving(scene) {
        return Vec::new();
    }
    constant(scene).into_iter().chain(drawn(scene)).collect()
}

fn constant(scene: &Description) -> Option<String> {
    let gravity @ [x, y, z] = scene.gravity;
    let shown = format!("gravity is ({x}, {y}, {z})");
    let largest = gravity.into_iter().map(f64::abs).fold(0.0, f64::max);
    let told = if z > 0.0 {
        "which points up, and z is up. Give (0, 0, -9.81). To hang a robot from a ceiling, turn it with quat=(-1, 0, 0, 0)"
    } else if z == 0.0 && largest > 0.0 && [x, y].contains(&0.0) {
        "which acts along the ground, and z is up. Give (0, 0, -9.81)"
    } else if largest > MOST {
        "which looks like another unit: it is in m/s². Give (0, 0, -9.81)"
    } else if gravity == [0.0, 0.0, -1.0] {
        "which looks like multiples of 9.81: it is in m/s². Give (0, 0, -9.81)"
    } else {
        return None;
    };
    Some(format!("{shown}, {told}."))
}

/// Draws of gravity that point up. Those that look like factors are reported as factors.
fn drawn(scene: &Description) -> Option<String> {
    let drawn = scene.param_ranges.get(&Param::Gravity)?.get("z")?;
    let least = match *drawn {
        Distribution::Uniform { low, .. } => low,
        Distribution::Normal { mean, .. } => mean,
    };
    let is_factor = factors::is_told(Param::Gravity, drawn, scene.gravity[2]);
    (least > 0.0 && !is_factor).then(|| {
        format!("randomize: gravity of `z` is {least} or more, which points up, and z is up. Give -9.81, or draw around it.")
    })
}

/// Whether something of the scene moves that MuJoCo did not compile.
fn has_moving(scene: &Description) -> bool {
    let mut robots = scene
        .robots
        .iter()
        .filter(|robot| robot.precompiled.is_none());
    robots.any(|robot| !robot.moving_joints().is_empty())
}
