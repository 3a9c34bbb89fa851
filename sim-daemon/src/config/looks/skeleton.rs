//! What stands for a robot whose file says nothing of its looks: a ball at each joint, and lines between them.

use sim_model::{Pose, Robot, Shape};

/// Half the thickness of a line, as a part of the middle one's length: one that is far longer than the others, such as to a
/// base that is fixed far away, makes them no thicker.
const THIN: f64 = 0.05;
/// The same where there is no line at all [m].
const THIN_ALONE: f64 = 0.02;

/// Links, by their places, each with shapes in its frame.
pub(super) fn skeleton(robot: &Robot) -> Vec<(usize, Pose, Shape)> {
    let mut lines: Vec<(usize, [f64; 3])> = Vec::new();
    for joint in &robot.joints {
        lines.extend(joint.parent.map(|parent| (parent, joint.origin.pos)));
    }
    for (place, link) in robot.links.iter().enumerate() {
        lines.extend(link.inertial.as_ref().map(|inertial| (place, inertial.pos)));
    }
    let mut lengths: Vec<f64> = lines.iter().map(|(_, end)| length(*end)).collect();
    lengths.retain(|length| *length > 0.0);
    lengths.sort_by(f64::total_cmp);
    let thin = match lengths.get(lengths.len() / 2) {
        Some(length) => THIN * length,
        None => THIN_ALONE,
    };
    let ball = Shape::Sphere { radius: 2.0 * thin };
    let balls = (0..robot.links.len()).map(|link| (link, Pose::default(), ball.clone()));
    let lines = lines.into_iter().filter(|(_, end)| length(*end) > thin);
    balls
        .chain(lines.map(|(link, end)| (link, half_way(end), line(end, thin))))
        .collect()
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn line(end: [f64; 3], radius: f64) -> Shape {
    Shape::Capsule {
        radius,
        half_height: 0.5 * length(end),
    }
}

/// The frame between the origin and a point whose z axis points there.
fn half_way(end: [f64; 3]) -> Pose {
    let [x, y, z] = end.map(|e| e / length(end));
    // half of the turn from z to it; straight down any turn about x or y will do
    let quat = if z > -0.999_999 {
        let scale = (2.0 * (1.0 + z)).sqrt();
        [-y / scale, x / scale, 0.0, 0.5 * scale]
    } else {
        [1.0, 0.0, 0.0, 0.0]
    };
    Pose {
        pos: end.map(|e| 0.5 * e),
        quat,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_goes_from_the_origin_to_its_end() {
        for end in [
            [0.3, 0.0, 0.0],
            [0.0, -0.2, 0.1],
            [0.0, 0.0, 0.5],
            [0.0, 0.0, -0.5],
            [1e-4, 0.0, -0.5],
            [-0.1, 0.2, -0.4],
        ] {
            let (pose, half) = (half_way(end), 0.5 * length(end));
            for (z, point) in [(-half, [0.0; 3]), (half, end)] {
                let reached = pose.rotate([0.0, 0.0, z]);
                for i in 0..3 {
                    let off = reached[i] + pose.pos[i] - point[i];
                    assert!(off.abs() < 2e-3 * half, "{end:?}: {off}");
                }
            }
        }
    }
}
