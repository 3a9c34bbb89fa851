//! Random parts of scenes, and the same for rays in double precision.

use std::sync::Arc;

use fastrand::Rng;
use sim_model::Pose;
use sim_model::geometry::{HeightField, RayShape, Shape, TriMesh, TriangleTree, triangles};
use sim_render::{Frame, Look, Paint, Part};

/// A part, what rays in `f64` meet of it, and the frame of its body.
pub struct Seen {
    pub part: Part,
    pub ray: RayShape,
    pub body: Pose,
}

pub fn rotation(rng: &mut Rng) -> [f64; 4] {
    let mut quat = [0.0; 4];
    loop {
        for x in &mut quat {
            *x = 2.0 * rng.f64() - 1.0;
        }
        let norm = quat.iter().map(|x| x * x).sum::<f64>().sqrt();
        if norm > 0.1 && norm < 1.0 {
            // what a frame in shared memory has
            return quat.map(|x| f64::from((x / norm) as f32));
        }
    }
}

fn pose(rng: &mut Rng, reach: f64) -> Pose {
    let pos = [0; 3].map(|_| f64::from((reach * (2.0 * rng.f64() - 1.0)) as f32));
    Pose {
        pos,
        quat: rotation(rng),
    }
}

/// A height field of random elevations about the origin, with as many samples along x and y, and its triangles.
pub fn field(rng: &mut Rng, [columns, rows]: [usize; 2], label: i32) -> Seen {
    let rough = if rng.bool() { 0.3 } else { 0.02 };
    // of single precision, so that both sides have the same shape
    let elevations = (0..rows * columns).map(|_| f64::from((rough * rng.f64()) as f32));
    let field = HeightField::new([rows, columns], elevations.collect(), [2.0, 3.0], 0.25);
    let field = field.unwrap();
    Seen {
        ray: RayShape::Mesh(Arc::new(TriangleTree::new(&field.surface()))),
        part: Part {
            body: None,
            pose: pose(rng, 0.2),
            look: Look::Shape(Shape::HeightField(Arc::new(field))),
            label,
            paint: Paint {
                color: [rng.f32(), rng.f32(), rng.f32(), 1.0],
                squares: false,
            },
        },
        body: Pose::identity(),
    }
}

fn mesh(rng: &mut Rng, size: f64) -> TriMesh {
    let shape = match rng.u32(0..3) {
        0 => Shape::Sphere { radius: size },
        1 => Shape::Box {
            half_extents: [size, 0.4 * size, 0.1 * size],
        },
        _ => Shape::Capsule {
            radius: 0.3 * size,
            half_height: size,
        },
    };
    triangles(&shape)
}

pub fn part(rng: &mut Rng, label: i32) -> Seen {
    // sizes of single precision, so that both sides have the same shape
    let size = |rng: &mut Rng| f64::from((0.02 + 0.3 * rng.f64()) as f32);
    let (a, b, c) = (size(rng), size(rng), size(rng));
    let (look, ray) = match rng.u32(0..7) {
        0 => (
            Look::Shape(Shape::Box {
                half_extents: [a, b, c],
            }),
            RayShape::Box([a, b, c]),
        ),
        1 => (
            Look::Shape(Shape::Sphere { radius: a }),
            RayShape::Sphere(a),
        ),
        2 => (
            Look::Shape(Shape::Ellipsoid { radii: [a, b, c] }),
            RayShape::Ellipsoid([a, b, c]),
        ),
        3 => (
            Look::Shape(Shape::Cylinder {
                radius: a,
                half_height: b,
            }),
            RayShape::Cylinder(a, b),
        ),
        4 => (
            Look::Shape(Shape::Capsule {
                radius: a,
                half_height: b,
            }),
            RayShape::Capsule(a, b),
        ),
        5 => (Look::Sheet([a, b]), RayShape::Plane([a, b])),
        _ => {
            let mesh = mesh(rng, a);
            let ray = RayShape::Mesh(Arc::new(TriangleTree::new(&mesh)));
            (Look::Triangles(Arc::new(mesh)), ray)
        }
    };
    let body = pose(rng, 1.0);
    let part = Part {
        body: Some(label as usize / 2),
        pose: pose(rng, 0.2),
        look,
        label,
        paint: Paint {
            color: [rng.f32(), rng.f32(), rng.f32(), 1.0],
            squares: rng.bool(),
        },
    };
    Seen { part, ray, body }
}

pub fn frame(pose: &Pose) -> Frame {
    Frame::new(pose.pos.map(|x| x as f32), pose.quat.map(|x| x as f32))
}
