//! Two grounds: parallel planes of which the lower one holds nothing, or both the same.

use sim_model::{Description, Pose, Shape};

/// Normals whose product is at least this are parallel [–].
const PARALLEL: f64 = 0.9999;
/// Planes nearer than this are one [m].
const SAME: f64 = 1e-6;

/// Advice on planes, of the scene and of the fixed roots of robots.
pub(super) fn advice(scene: &Description) -> Vec<String> {
    let mut planes: Vec<(String, Pose)> = Vec::new();
    let of_scene = scene.shapes.iter();
    for shape in of_scene.filter(|shape| matches!(shape.shape, Shape::Plane)) {
        planes.push((format!("`{}`", shape.name), shape.pose));
    }
    for robot in scene.robots.iter().filter(|robot| !robot.floating) {
        let Some(root) = robot.links.first() else {
            continue;
        };
        for collision in &root.collisions {
            if matches!(collision.shape, Shape::Plane) {
                let shape_name = collision.name.as_deref().unwrap_or("plane");
                let name = format!("`{shape_name}` of `{}`", robot.name);
                planes.push((name, robot.pose.mul(&collision.pose)));
            }
        }
    }
    let mut all = Vec::new();
    for (place, (name, pose)) in planes.iter().enumerate() {
        let normal = pose.rotate([0.0, 0.0, 1.0]);
        let twin = planes[..place].iter().find_map(|(other, of_other)| {
            let is_parallel = dot(normal, of_other.rotate([0.0, 0.0, 1.0])) >= PARALLEL;
            let apart: [f64; 3] = std::array::from_fn(|axis| pose.pos[axis] - of_other.pos[axis]);
            is_parallel.then(|| (other, dot(normal, apart)))
        });
        let Some((other, height)) = twin else {
            continue;
        };
        let problem = if height.abs() < SAME {
            format!(
                "{other} and {name} are the same plane, so everything touches both and its contacts count twice"
            )
        } else {
            let (upper, lower) = if height > 0.0 {
                (name, other)
            } else {
                (other, name)
            };
            format!(
                "{upper} is {:.4} m above {lower}, a parallel plane without end, so all that falls stays on {upper}",
                height.abs()
            )
        };
        all.push(format!("{problem}. Leave one of them out."));
    }
    all
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.into_iter().zip(b).map(|(a, b)| a * b).sum()
}
