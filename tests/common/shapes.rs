//! A scene in which shapes of every kind touch.

use sim_model::geometry::{HeightField, Hull, Mesh, TriMesh};
use sim_model::{Body, Collision, Cone, Description, HeightScan, Pose, Shape, Surface};
use std::path::PathBuf;
use std::sync::Arc;

/// Shapes of every kind that stand still, a body with one of every kind but the plane, and a smaller body.
pub fn shapes(cone: Cone) -> Description {
    let mut scene = Description::new(1.0 / 480.0, 8);
    scene.solver.cone = cone;
    scene.add_ground("ground", 0.0);
    let around = [
        [0.15, 0.0, 0.1],
        [-0.15, 0.0, 0.1],
        [0.0, 0.15, 0.1],
        [0.0, -0.15, 0.1],
        [0.0, 0.0, 0.25],
        [-0.11, -0.11, 0.1],
    ];
    for (shape, place) in every_kind(0.06).into_iter().zip(around) {
        scene.add_shape("", shape, Pose::at(place));
    }
    // a contact without friction, and others with more of it
    scene.shapes[1].surface.condim = 1;
    scene.shapes[2].surface.mu = 1.5;
    let mut body = Body::new("body", Pose::at([0.0, 0.0, 0.08]));
    let places = [
        [0.06, 0.0, 0.0],
        [-0.06, 0.0, 0.0],
        [0.0, 0.06, 0.0],
        [0.0, -0.06, 0.0],
        [0.0, 0.0, 0.06],
        // between the others, and away from the smaller body
        [-0.045, -0.045, 0.0],
    ];
    for (k, (shape, place)) in every_kind(0.03).into_iter().zip(places).enumerate() {
        let surface = Surface {
            mu: 0.3 * k as f64,
            condim: if k == 0 { 1 } else { 3 },
            margin: 0.002,
            ..Surface::default()
        };
        let turned = Pose::about([0.6, 0.0, 0.8], 0.7 * k as f64).quat;
        let pose = Pose {
            pos: place,
            quat: turned,
        };
        let shape = Collision {
            surface,
            ..Collision::new(None, shape, pose)
        };
        // the ellipsoid touches, and weighs nothing
        let density = if k == 5 { 0.0 } else { 1000.0 };
        body.shapes.push((shape, density));
    }
    scene.add_body(body).unwrap();
    let mut small = Body::new("small", Pose::at([0.05, 0.05, 0.1]));
    let edge = Shape::Box {
        half_extents: [0.03, 0.02, 0.04],
    };
    small
        .shapes
        .push((Collision::new(None, edge, Pose::identity()), 400.0));
    scene.add_body(small).unwrap();
    scene
}

/// A body with one shape of every kind but the plane, on rough ground, and a scan of that ground.
pub fn on_a_field() -> Description {
    let mut scene = Description::new(1.0 / 480.0, 8);
    let heights = (0..7 * 9).map(|k: usize| (k * 37 % 11) as f64 * 0.01);
    let field = HeightField::new([7, 9], heights.collect(), [0.8, 0.6], 0.2).unwrap();
    let turned = Pose {
        pos: [0.05, -0.02, 0.01],
        ..Pose::about([0.0, 0.0, 1.0], 0.4)
    };
    scene.add_shape("", Shape::HeightField(Arc::new(field)), turned);
    let mut body = Body::new("body", Pose::at([0.0, 0.0, 0.12]));
    let places = [
        [0.06, 0.0, 0.0],
        [-0.06, 0.0, 0.0],
        [0.0, 0.06, 0.0],
        [0.0, -0.06, 0.0],
        [0.0, 0.0, 0.06],
        [0.0, 0.0, -0.06],
    ];
    for (shape, place) in every_kind(0.03).into_iter().zip(places) {
        let shape = Collision::new(None, shape, Pose::at(place));
        body.shapes.push((shape, 1000.0));
    }
    scene.add_body(body).unwrap();
    scene.height_scans.push(HeightScan {
        name: "scan".to_owned(),
        body: Some("body".to_owned()),
        pos: [0.02, 0.0, 0.0],
        counts: [4, 3],
        spacing: [0.06, 0.05],
        reach: 1.0,
    });
    scene
}

/// One shape of every kind but the plane, about as large as a ball of this radius [m].
pub fn every_kind(size: f64) -> [Shape; 6] {
    let [x, y, z] = [0.9 * size, 0.7 * size, 1.1 * size];
    let corners = [
        [x, 0.0, 0.0],
        [-x, 0.1 * x, 0.0],
        [0.0, y, 0.2 * y],
        [0.0, -y, 0.0],
        [0.1 * z, 0.0, z],
        [0.5 * x, 0.5 * y, -z],
        [-0.5 * x, -0.5 * y, -z],
    ];
    [
        Shape::Sphere { radius: size },
        Shape::Capsule {
            radius: 0.6 * size,
            half_height: 0.7 * size,
        },
        Shape::Box {
            half_extents: [x, y, z],
        },
        Shape::Cylinder {
            radius: 0.8 * size,
            half_height: 0.9 * size,
        },
        stone(&corners),
        Shape::Ellipsoid { radii: [x, y, z] },
    ]
}

/// A mesh that is the hull of some corners.
pub fn stone(corners: &[[f64; 3]]) -> Shape {
    Shape::Mesh(Arc::new(Mesh {
        path: PathBuf::from("stone"),
        scale: [1.0; 3],
        triangles: solid(corners),
        closed: true,
        hulls: vec![Hull::from_points(corners, 64).unwrap()],
        notes: Vec::new(),
        ignored_up_axis: None,
    }))
}

/// Triangles of the hull of some corners, counter-clockwise from outside.
fn solid(corners: &[[f64; 3]]) -> TriMesh {
    let hull = Hull::from_points(corners, 64).unwrap();
    let fan = |corners: &[u32]| -> Vec<[u32; 3]> {
        let pairs = corners[1..].windows(2);
        pairs.map(|pair| [corners[0], pair[0], pair[1]]).collect()
    };
    TriMesh {
        triangles: hull
            .faces
            .iter()
            .flat_map(|face| fan(&face.corners))
            .collect(),
        vertices: hull.vertices,
    }
}
