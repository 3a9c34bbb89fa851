//! A scene of hulls with more vertices than one cluster has.

use super::shapes::stone;
use sim_model::geometry::Hull;
use sim_model::{Body, Collision, Cone, Description, Pose, Shape};

/// Two nearly round stones that fall on a plane, on a box and on each other. Their hulls have more vertices than one cluster.
pub fn stones(cone: Cone) -> Description {
    let mut scene = Description::new(1.0 / 480.0, 8);
    scene.solver.cone = cone;
    scene.add_ground("ground", 0.0);
    let half_extents = [0.12, 0.1, 0.03];
    let pose = Pose::at([0.12, 0.0, 0.03]);
    scene.add_shape("", Shape::Box { half_extents }, pose);
    let corners = nearly_round(0.05);
    let vertices = Hull::from_points(&corners, 64).unwrap().vertices.len();
    assert_eq!(vertices, NEARLY_ROUND, "a corner is inside the hull");
    for (name, place) in [("one", [0.1, 0.0, 0.12]), ("other", [-0.05, 0.05, 0.07])] {
        let mut body = Body::new(name, Pose::at(place));
        body.shapes.push((
            Collision::new(None, stone(&corners), Pose::identity()),
            1000.0,
        ));
        scene.add_body(body).unwrap();
    }
    scene
}

/// Vertices of the stones [–].
const NEARLY_ROUND: usize = 24;

/// Corners on a spiral about a ball, now farther out and now nearer; each is a vertex of their hull.
fn nearly_round(size: f64) -> Vec<[f64; 3]> {
    let corner = |k: usize| {
        let z = 1.0 - (2 * k + 1) as f64 / NEARLY_ROUND as f64;
        // the golden angle
        let (sin, cos) = (2.399_963_229_728_653 * k as f64).sin_cos();
        let r = (1.0 - z * z).sqrt();
        let far = size * (1.0 + 0.01 * (k % 3) as f64);
        [far * r * cos, far * r * sin, far * z]
    };
    (0..NEARLY_ROUND).map(corner).collect()
}
