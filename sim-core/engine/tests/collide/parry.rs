//! Primitives: their extents, and parry3d's result for two of them.

use super::shapes::*;
use parry3d_f64::math::{Pose, Rotation, Vector as Place};
use parry3d_f64::query::details::contact_support_map_support_map;
use parry3d_f64::query::{contact, distance};
use parry3d_f64::shape::{Ball, Capsule, Cuboid, Segment};

/// Radius of the sphere about a shape.
pub fn reach(shape: Shape) -> f64 {
    match shape {
        Shape::Plane => 0.0,
        Shape::Sphere(r) => r,
        Shape::Capsule(r, h) => r + h,
        Shape::Cylinder(r, h) => r.hypot(h),
        Shape::Box(half) => dot(half, half).sqrt(),
        Shape::Ellipsoid(radii) => radii.iter().copied().fold(0.0, f64::max),
        Shape::Hull(_) => unreachable!("hulls have tests of their own"),
    }
}

/// Its furthest extent along a direction in its own frame.
pub fn support(shape: Shape, d: Vector) -> f64 {
    match shape {
        Shape::Sphere(r) => r,
        Shape::Capsule(r, h) => r + h * d[2].abs(),
        Shape::Cylinder(r, h) => r * d[0].hypot(d[1]) + h * d[2].abs(),
        Shape::Box(half) => (0..3).map(|i| half[i] * d[i].abs()).sum(),
        Shape::Ellipsoid(radii) => (0..3)
            .map(|i| (radii[i] * d[i]).powi(2))
            .sum::<f64>()
            .sqrt(),
        other => unreachable!("{other:?}"),
    }
}

fn pose(axes: &[Vector; 3], center: Vector) -> Pose {
    let columns = axes.map(|a| Place::new(a[0], a[1], a[2]));
    let matrix = parry3d_f64::math::Matrix::from_cols(columns[0], columns[1], columns[2]);
    Pose::from_parts(
        Place::new(center[0], center[1], center[2]),
        Rotation::from_mat3(&matrix),
    )
}

/// Signed distance and normal by parry3d. Round shapes are their cores, whose distance it knows to rounding, and a radius.
pub fn oracle(pair: &Pair) -> (f64, Vector) {
    let a = pose(&pair.axes[0], [0.0; 3]);
    let b = pose(&pair.axes[1], pair.center);
    let segment = |h: f64| Segment::new(Place::new(0.0, 0.0, -h), Place::new(0.0, 0.0, h));
    let cuboid = |h: Vector| Cuboid::new(Place::new(h[0], h[1], h[2]));
    let between = a.inv_mul(&b);
    let cores = |contact: Option<parry3d_f64::query::Contact>, radius: f64| {
        let contact = contact.expect("nothing is out of reach");
        let normal = a.rotation * contact.normal1;
        (contact.dist - radius, [normal.x, normal.y, normal.z])
    };
    let balls = |contact: Option<parry3d_f64::query::Contact>| {
        let contact = contact.expect("nothing is out of reach");
        let normal = contact.normal1;
        (contact.dist, [normal.x, normal.y, normal.z])
    };
    match pair.shapes {
        [Shape::Sphere(r), Shape::Sphere(s)] => {
            balls(contact(&a, &Ball::new(r), &b, &Ball::new(s), 10.0).unwrap())
        }
        [Shape::Sphere(r), Shape::Capsule(s, h)] => {
            let capsule = Capsule::new_z(h, s);
            balls(contact(&a, &Ball::new(r), &b, &capsule, 10.0).unwrap())
        }
        [Shape::Sphere(r), Shape::Box(half)] => {
            balls(contact(&a, &Ball::new(r), &b, &cuboid(half), 10.0).unwrap())
        }
        [Shape::Capsule(r, h), Shape::Capsule(s, k)] => {
            let contact = distance(&a, &segment(h), &b, &segment(k)).unwrap();
            (contact.distance - r - s, [0.0; 3])
        }
        [Shape::Capsule(r, h), Shape::Box(half)] => {
            let (segment, cuboid) = (segment(h), cuboid(half));
            cores(
                contact_support_map_support_map(&between, &segment, &cuboid, 10.0),
                r,
            )
        }
        [Shape::Box(half), Shape::Box(other)] => {
            let (first, second) = (cuboid(half), cuboid(other));
            cores(
                contact_support_map_support_map(&between, &first, &second, 10.0),
                0.0,
            )
        }
        other => unreachable!("{other:?}"),
    }
}
