//! Robots that fall for ever, hang in the air or touch nothing, and meshes in another unit.

use sim_model::{Description, JointKind, Link, Robot, Shape};
use sim_physics::constants::params::Param;

use super::some;

/// Words in the names of links that robots walk on. Arms have none of them.
const LEGS: [&str; 6] = ["foot", "feet", "calf", "shank", "ankle", "toe"];
/// Links with such names from which on a robot walks.
const FEET: usize = 2;
/// Extent from which on a mesh of a moving link is most likely in millimetres [m].
const MESH_MAX: f64 = 50.0;
/// Extent up to which it was most likely in metres and scaled from millimetres [m].
const MESH_MIN: f64 = 5e-4;

/// Advice on robots from URDF. Models from MuJoCo are as their makers want them.
pub(super) fn advice(scene: &Description) -> Vec<String> {
    let mut all = Vec::new();
    let is_weightless = scene.gravity == [0.0; 3] || varies(scene, Param::Gravity);
    for robot in scene
        .robots
        .iter()
        .filter(|robot| robot.precompiled.is_none())
    {
        if robot.urdf.is_none() {
            continue;
        }
        // a file without moving joints may be a landscape
        if robot.floating
            || robot
                .joints
                .iter()
                .any(|joint| joint.kind != JointKind::Fixed)
        {
            all.extend(meshes(robot));
        }
        if robot.floating && !is_weightless {
            all.extend(falls(scene, robot));
        }
        if !robot.floating && has_floor(scene) {
            all.extend(stands(robot));
        }
    }
    all
}

/// A floating robot that nothing stops, and no force but its weight acts on.
fn falls(scene: &Description, robot: &Robot) -> Option<String> {
    if varies(scene, Param::BodyF) {
        return None;
    }
    let name = &robot.name;
    let touches = |robot: &Robot| robot.links.iter().any(|link| !link.collisions.is_empty());
    if !touches(robot) {
        return (!scene.shapes.is_empty()).then(|| {
            format!(
                "robot `{name}` floats and has no collision shapes, so it falls through everything. Give its links <collision> \
                 in the file, or shapes by add_box(body=...) and the like."
            )
        });
    }
    let is_held = |other: &Robot| {
        let joints = &mut other.joints.iter();
        joints.all(|joint| joint.kind != JointKind::Free || joint.parent.is_some())
    };
    let mut others = scene.robots.iter();
    let is_caught = others.any(|other| is_held(other) && touches(other));
    (scene.shapes.is_empty() && !is_caught).then(|| {
        format!(
            "robot `{name}` floats and nothing is below it, so it falls for ever. Add scene.add_ground(), leave out floating=True, \
             set gravity to (0, 0, 0), or hold it with joint_f."
        )
    })
}

/// Whether a robot could stand on something: on a table alone, one that is held is meant to be held.
fn has_floor(scene: &Description) -> bool {
    let mut shapes = scene.shapes.iter();
    shapes.any(|shape| matches!(shape.shape, Shape::Plane | Shape::HeightField(_)))
}

/// A robot with feet that hangs at its base.
fn stands(robot: &Robot) -> Option<String> {
    let is_foot = |link: &&Link| {
        let name = link.name.to_lowercase();
        LEGS.iter().any(|word| name.contains(word))
    };
    let touches = |link: &&Link| !link.collisions.is_empty();
    let feet = robot.links.iter().filter(is_foot).filter(touches);
    let names: Vec<String> = feet.map(|link| format!("`{}`", link.name)).collect();
    (names.len() >= FEET).then(|| {
        format!(
            "robot `{}` has legs ({}) and a fixed base, so it hangs in the air and cannot walk or fall. Load it with floating=True, \
             unless it is to hang.",
            robot.name,
            some(&names)
        )
    })
}

/// Meshes of links in another unit.
fn meshes(robot: &Robot) -> Vec<String> {
    let (mut large, mut tiny) = (Vec::new(), Vec::new());
    for link in &robot.links {
        for collision in &link.collisions {
            let Shape::Mesh(mesh) = &collision.shape else {
                continue;
            };
            let extent = extent(&mesh.triangles.vertices);
            let file = mesh.path.file_name().unwrap_or(mesh.path.as_os_str());
            let (file, link) = (file.to_string_lossy(), &link.name);
            if extent > MESH_MAX {
                large.push(format!("`{file}` of link `{link}` is {extent:.0} m long"));
            } else if extent < MESH_MIN {
                tiny.push(format!("`{file}` of link `{link}` is {extent:.1e} m long"));
            }
        }
    }
    let told = [
        (
            large,
            "It looks like millimetres: give the mesh scale=\"0.001 0.001 0.001\".",
        ),
        (
            tiny,
            "Its file looks like metres already: leave out a scale of 0.001.",
        ),
    ];
    let told = told.into_iter().filter(|(names, _)| !names.is_empty());
    told.map(|(names, cure)| format!("robot `{}`: mesh {}. {cure}", robot.name, some(&names)))
        .collect()
}

/// The longest edge of a box around points [m].
fn extent(points: &[[f64; 3]]) -> f64 {
    let edge = |axis: usize| {
        let along = points.iter().map(|point| point[axis]);
        let [low, high] = along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
            [low.min(x), high.max(x)]
        });
        high - low
    };
    (0..3).map(edge).fold(0.0, f64::max)
}

/// Whether values differ between worlds.
fn varies(scene: &Description, param: Param) -> bool {
    scene.params.contains(&param) || scene.param_ranges.contains_key(&param)
}
