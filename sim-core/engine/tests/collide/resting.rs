//! Faces that lie on each other touch in as many points as hold them.

use super::shapes::*;
use sim_model::geometry::Hull;

/// Columns of a rotation about z, after one about y by `tilt`.
fn turned(angle: f64, tilt: f64) -> [Vector; 3] {
    let ((s, c), (t, u)) = (angle.sin_cos(), tilt.sin_cos());
    [[c * u, s * u, -t], [-s, c, 0.0], [c * t, s * t, u]]
}

/// Corners of a prism of height 2 `half` about z.
fn prism(corners: usize, radius: f64, half: f64) -> Hull {
    let points: Vec<Vector> = (0..2 * corners)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * (i / 2) as f64 / corners as f64).sin_cos();
            [
                radius * cos,
                radius * sin,
                if i % 2 == 0 { half } else { -half },
            ]
        })
        .collect();
    Hull::from_points(&points, 64).unwrap()
}

/// Points of b on a, b upside down or on its side, 0.1 mm deep, in both precisions.
fn points(hulls: &[Hull], shapes: [Shape; 2], turn: [Vector; 3], center: Vector) -> Vec<Contact> {
    let pair = Pair {
        shapes,
        axes: [turned(0.3, 0.0), turn],
        center,
    };
    let [double, single] = [DOUBLE, SINGLE].map(|m| contacts(m, hulls, &[pair], 0.0).remove(0));
    assert_eq!(double.len(), single.len(), "{pair:?}");
    for contact in double.iter().chain(&single) {
        assert!((contact.normal[2] - 1.0).abs() < 1e-6, "{contact:?}");
        assert!((contact.distance + 1e-4).abs() < 2e-6, "{contact:?}");
    }
    double
}

/// Does the polygon of the points hold the place, with this much room around it?
fn hold(points: &[Contact], place: [f64; 2], room: f64) -> bool {
    // no line through the place with all points on one side of it, nor nearer than the room
    (0..360).all(|degree| {
        let (sin, cos) = f64::from(degree).to_radians().sin_cos();
        points
            .iter()
            .any(|x| cos * (x.point[0] - place[0]) + sin * (x.point[1] - place[1]) > room)
    })
}

#[test]
fn a_hull_on_its_face_has_three_or_four_points_around_its_centre() {
    let half = 0.03;
    let hulls = [3, 4, 6, 16].map(|corners| prism(corners, 0.04, half));
    let high = half - 1e-4;
    for hull in 0..4 {
        let expected = if hull == 0 { 3 } else { 4 };
        let shape = Shape::Hull(hull);
        for axes in [
            turned(0.0, 0.0),
            turned(1.1, 0.0),
            turned(0.4, std::f64::consts::PI),
        ] {
            for (a, top) in [
                (Shape::Plane, 0.0),
                (Shape::Box([0.2, 0.2, 0.1]), 0.1),
                (Shape::Cylinder(0.2, 0.1), 0.1),
                (Shape::Hull(3), half),
            ] {
                let contacts = points(&hulls, [a, shape], axes, [0.0, 0.0, top + high]);
                let least = if a == Shape::Hull(3) { 3 } else { expected };
                assert!(
                    contacts.len() >= least && contacts.len() <= 4,
                    "{a:?} {hull}: {contacts:?}"
                );
                assert!(
                    hold(&contacts, [0.0; 2], 0.01),
                    "{a:?} {hull}: {contacts:?}"
                );
            }
        }
    }
}

#[test]
fn a_cylinder_stands_on_four_points_and_lies_on_two() {
    let hulls = [prism(4, 0.2, 0.1)];
    let (radius, half) = (0.03, 0.05);
    let cylinder = Shape::Cylinder(radius, half);
    for base in [Shape::Box([0.2, 0.2, 0.1]), Shape::Cylinder(0.2, 0.1)] {
        let standing = points(
            &hulls,
            [base, cylinder],
            turned(0.7, 0.0),
            [0.05, 0.0, 0.1 + half - 1e-4],
        );
        assert_eq!(standing.len(), 4);
        assert!(hold(&standing, [0.05, 0.0], 0.6 * radius), "{standing:?}");
        let lying = turned(0.7, std::f64::consts::FRAC_PI_2);
        let resting = points(
            &hulls,
            [base, cylinder],
            lying,
            [0.05, 0.0, 0.1 + radius - 1e-4],
        );
        assert_eq!(resting.len(), 2);
        let way = sub(resting[0].point, resting[1].point);
        assert!(
            (dot(way, way).sqrt() - 2.0 * half).abs() < 1e-6,
            "{resting:?}"
        );
    }
    // a hull on a standing and on a lying cylinder
    let contacts = points(
        &hulls,
        [cylinder, Shape::Hull(0)],
        turned(0.7, 0.0),
        [0.0, 0.0, half + 0.1 - 1e-4],
    );
    assert_eq!(contacts.len(), 4);
}

#[test]
fn a_capsule_lies_on_two_points() {
    let hulls = [prism(5, 0.2, 0.1)];
    let (radius, half) = (0.03, 0.05);
    let pair = |b: Shape, high: f64| Pair {
        shapes: [Shape::Capsule(radius, half), b],
        axes: [turned(0.7, std::f64::consts::FRAC_PI_2), turned(0.1, 0.0)],
        center: [0.02, 0.01, high],
    };
    for (b, high) in [(Shape::Hull(0), 0.1), (Shape::Cylinder(0.2, 0.1), 0.1)] {
        let pair = pair(b, high + radius - 1e-4);
        let contacts = contacts(DOUBLE, &hulls, &[pair], 0.0).remove(0);
        assert_eq!(contacts.len(), 2, "{contacts:?}");
        for contact in &contacts {
            assert!((contact.distance + 1e-4).abs() < 1e-9 && contact.normal[2] > 0.999_999);
        }
        let way = sub(contacts[0].point, contacts[1].point);
        assert!(
            (dot(way, way).sqrt() - 2.0 * half).abs() < 1e-6,
            "{contacts:?}"
        );
    }
}
