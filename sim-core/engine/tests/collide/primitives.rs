//! Primitives against closed forms and parry3d.

use super::parry::{oracle, reach, support};
use super::shapes::*;

const UPRIGHT: [Vector; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// Random configurations of a pair.
const CONFIGURATIONS: usize = 10_000;
/// Those that share a model: the same shapes, the first where it is.
const OF_A_MODEL: usize = 50;
/// Of the sum of both shapes' reaches: the tolerance of distances.
const DISTANCE: f64 = 1e-5;
/// Nothing is out of reach.
const FAR: f64 = 10.0;

type Kind = fn(&mut Random) -> Shape;

fn sphere(random: &mut Random) -> Shape {
    Shape::Sphere(random.between(0.02, 0.1))
}
fn capsule(random: &mut Random) -> Shape {
    Shape::Capsule(random.between(0.02, 0.1), random.between(0.02, 0.2))
}
fn cuboid(random: &mut Random) -> Shape {
    Shape::Box([0; 3].map(|_| random.between(0.02, 0.2)))
}
fn cylinder(random: &mut Random) -> Shape {
    Shape::Cylinder(random.between(0.02, 0.1), random.between(0.02, 0.2))
}
fn ellipsoid(random: &mut Random) -> Shape {
    Shape::Ellipsoid([0; 3].map(|_| random.between(0.02, 0.2)))
}
fn plane(_: &mut Random) -> Shape {
    Shape::Plane
}

const ROUND: [[Kind; 2]; 5] = [
    [sphere, sphere],
    [sphere, capsule],
    [sphere, cuboid],
    [capsule, capsule],
    [capsule, cuboid],
];
const ON_PLANE: [[Kind; 2]; 5] = [
    [plane, sphere],
    [plane, capsule],
    [plane, cuboid],
    [plane, cylinder],
    [plane, ellipsoid],
];

/// From deep inside each other to well apart.
fn random_pairs(random: &mut Random, [a, b]: [Kind; 2], count: usize) -> Vec<Pair> {
    let mut pairs = Vec::new();
    while pairs.len() < count {
        let shapes = [a(random), b(random)];
        let still = random.rotation();
        let both = reach(shapes[0]) + reach(shapes[1]);
        for _ in 0..OF_A_MODEL {
            let (way, far) = (random.direction(), random.between(0.05, 1.3) * both);
            pairs.push(Pair {
                shapes,
                axes: [still, random.rotation()],
                center: scale(way, far),
            });
        }
    }
    pairs
}

/// How far apart a direction shows the shapes to be: at most their signed distance.
fn separation(pair: &Pair, normal: Vector) -> f64 {
    let [a, b] = [0, 1].map(|which| {
        let local = pair.axes[which].map(|axis| dot(axis, normal));
        support(pair.shapes[which], local)
    });
    dot(normal, pair.center) - a - b
}

fn nearest(points: &[Contact]) -> Contact {
    let least = |a: Contact, b: &Contact| if b.distance < a.distance { *b } else { a };
    points.iter().fold(points[0], least)
}

fn at_rest(a: Shape, b: Shape, axes: [Vector; 3], center: Vector) -> Vec<Contact> {
    let pair = Pair {
        shapes: [a, b],
        axes: [UPRIGHT, axes],
        center,
    };
    contacts(DOUBLE, &[], &[pair], 1e-3).remove(0)
}

#[test]
fn nearest_points_are_parrys() {
    for (number, kinds) in ROUND.into_iter().enumerate() {
        let mut random = Random(number as u64);
        let pairs = random_pairs(&mut random, kinds, CONFIGURATIONS);
        let (mut classes, mut refuted) = ([0; 3], 0);
        for (pair, contacts) in pairs.iter().zip(contacts(DOUBLE, &[], &pairs, FAR)) {
            let size = reach(pair.shapes[0]) + reach(pair.shapes[1]);
            let (distance, normal) = oracle(pair);
            // parry's expanding polytope stops early now and then: its direction then shows less than it says
            if normal != [0.0; 3] && (separation(pair, normal) - distance).abs() > 1e-6 * size {
                refuted += 1;
                continue;
            }
            assert!(!contacts.is_empty(), "{distance} {pair:?}");
            let nearest_contact = nearest(&contacts);
            // a direction cannot show more than there is; it must show all but the tolerance
            let shown = separation(pair, nearest_contact.normal);
            let length = dot(nearest_contact.normal, nearest_contact.normal).sqrt();
            assert!((length - 1.0).abs() < 1e-9, "{length} {pair:?}");
            if distance > -0.1 * size {
                classes[usize::from(distance < 0.0)] += 1;
                let off = (nearest_contact.distance - distance)
                    .abs()
                    .max((shown - distance).abs());
                assert!(
                    off < DISTANCE * size,
                    "{nearest_contact:?} {shown} {distance} {pair:?}"
                );
            } else {
                classes[2] += 1;
                let least = distance * 1.01;
                assert!(
                    shown > least,
                    "{nearest_contact:?} {shown} {distance} {pair:?}"
                );
                // the deepest corner of a box may be beside the other's face, where the manifold is cut
                assert!(
                    nearest_contact.distance > shown - DISTANCE * size
                        && nearest_contact.distance < shown * 0.99,
                    "{nearest_contact:?} {shown} {pair:?}"
                );
            }
            // parry's normals are good to its tolerance over the distance
            if distance > 0.01 * size && dot(normal, normal) > 0.5 {
                let off = (0..3).map(|i| (nearest_contact.normal[i] - normal[i]).abs());
                let off = off.fold(0.0, f64::max);
                assert!(
                    off < 1e-5,
                    "{nearest_contact:?} {normal:?} {distance} {pair:?}"
                );
            }
        }
        println!("pair {number}: apart, shallow, deep: {classes:?}, refuted {refuted}");
        assert!(refuted < CONFIGURATIONS / 200, "{refuted}");
        assert!(classes[0] > 1000 && classes[1] > 300, "{classes:?}");
    }
}

#[test]
fn boxes_that_overlap_are_pushed_out_a_twentieth_beyond_the_short_way_at_most() {
    let mut random = Random(6);
    let pairs = random_pairs(&mut random, [cuboid, cuboid], CONFIGURATIONS);
    let mut overlapping = 0;
    for (pair, contacts) in pairs.iter().zip(contacts(DOUBLE, &[], &pairs, FAR)) {
        let size = reach(pair.shapes[0]) + reach(pair.shapes[1]);
        let (distance, _) = oracle(pair);
        for point in &contacts {
            let shown = separation(pair, point.normal);
            assert!(
                point.distance > shown - DISTANCE * size,
                "{point:?} {pair:?}"
            );
        }
        // apart, an axis that separates them is not the way between their nearest points
        if distance > -0.01 * size {
            continue;
        }
        overlapping += 1;
        // a face is kept where an edge is a twentieth better; parry's depth is good to a hundredth where it is deep
        let shown = separation(pair, nearest(&contacts).normal);
        assert!(shown > distance * 1.07, "{contacts:?} {distance} {pair:?}");
    }
    assert!(overlapping > 1000, "{overlapping}");
}

#[test]
fn nearest_points_on_a_plane_are_the_supports() {
    for (number, kinds) in ON_PLANE.into_iter().enumerate() {
        let mut random = Random(number as u64);
        let pairs = random_pairs(&mut random, kinds, CONFIGURATIONS);
        for (pair, contacts) in pairs.iter().zip(contacts(DOUBLE, &[], &pairs, FAR)) {
            let normal = pair.axes[0][2];
            let local = pair.axes[1].map(|axis| dot(axis, normal));
            let distance = dot(normal, pair.center) - support(pair.shapes[1], local);
            let nearest_contact = nearest(&contacts);
            let off = sub(nearest_contact.normal, normal);
            assert!(
                dot(off, off).sqrt() < 1e-12,
                "{nearest_contact:?} {normal:?}"
            );
            assert!(
                (nearest_contact.distance - distance).abs() < 1e-12,
                "{nearest_contact:?} {distance} {pair:?}"
            );
            let height = dot(normal, nearest_contact.point) - 0.5 * distance;
            assert!(
                height.abs() < 1e-12,
                "the point is half-way: {nearest_contact:?} {pair:?}"
            );
        }
    }
}

#[test]
fn points_are_between_the_surfaces() {
    // the surfaces are half the distance away along the normal, on either side
    for kinds in ROUND {
        let mut random = Random(11);
        let pairs = random_pairs(&mut random, kinds, 1000);
        for (pair, contacts) in pairs.iter().zip(contacts(DOUBLE, &[], &pairs, FAR)) {
            for point in contacts {
                let a: Vector = std::array::from_fn(|i| {
                    point.point[i] - 0.5 * point.distance * point.normal[i]
                });
                let b: Vector = std::array::from_fn(|i| {
                    point.point[i] + 0.5 * point.distance * point.normal[i]
                });
                let b = std::array::from_fn(|i| b[i] - pair.center[i]);
                for (which, at) in [a, b].into_iter().enumerate() {
                    let at = pair.axes[which].map(|axis| dot(axis, at));
                    let depth = depth(pair.shapes[which], at);
                    assert!(depth > -1e-6, "{depth} outside: {point:?} {pair:?}");
                }
            }
        }
    }
}

/// How deep a point is inside a shape.
fn depth(shape: Shape, at: Vector) -> f64 {
    match shape {
        Shape::Sphere(r) => r - dot(at, at).sqrt(),
        Shape::Capsule(r, h) => {
            let past = at[2] - at[2].clamp(-h, h);
            r - at[0].hypot(at[1]).hypot(past)
        }
        Shape::Box(half) => (0..3)
            .map(|i| half[i] - at[i].abs())
            .fold(f64::MAX, f64::min),
        other => unreachable!("{other:?}"),
    }
}

#[test]
fn equal_stacked_cubes_have_four_points_at_their_corners() {
    let mut random = Random(5);
    let cube = Shape::Box([0.05; 3]);
    let mut pairs = Vec::new();
    for _ in 0..200 {
        let axes = random.rotation();
        for quarter in 0..4 {
            let (cos, sin) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarter];
            let turned = [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]];
            pairs.push(Pair {
                shapes: [cube; 2],
                axes: [axes, turned.map(|axis| transform(&axes, axis))],
                center: transform(&axes, [0.0, 0.0, 0.0999]),
            });
        }
    }
    for (pair, contacts) in pairs.iter().zip(contacts(DOUBLE, &[], &pairs, 1e-3)) {
        assert_eq!(contacts.len(), 4, "{pair:?}");
        for point in &contacts {
            let at = pair.axes[0].map(|axis| dot(axis, point.point));
            let corner = [at[0].abs(), at[1].abs(), at[2]];
            let off = (corner[0] - 0.05)
                .hypot(corner[1] - 0.05)
                .hypot(corner[2] - 0.04995);
            assert!(off < 1e-12, "{point:?}");
            assert!((point.distance + 1e-4).abs() < 1e-12, "{point:?}");
        }
    }
    for contacts in contacts(SINGLE, &[], &pairs, 1e-3) {
        assert_eq!(contacts.len(), 4);
    }
}

#[test]
fn shapes_at_rest_have_the_points_that_hold_them() {
    let lying = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
    let capsule = Shape::Capsule(0.02, 0.1);
    let cylinder = Shape::Cylinder(0.03, 0.1);
    let slab = Shape::Box([0.3, 0.3, 0.05]);
    let long = Shape::Capsule(0.03, 0.2);
    let brick = Shape::Box([0.02, 0.03, 0.04]);
    for (a, b, axes, height, count) in [
        (Shape::Plane, capsule, lying, 0.02, 2),
        (Shape::Plane, capsule, UPRIGHT, 0.12, 1),
        (Shape::Plane, cylinder, lying, 0.03, 2),
        (Shape::Plane, cylinder, UPRIGHT, 0.1, 3),
        (Shape::Plane, brick, UPRIGHT, 0.04, 4),
        (slab, brick, UPRIGHT, 0.09, 4),
    ] {
        let contacts = at_rest(a, b, axes, [0.01, 0.02, height - 1e-4]);
        assert_eq!(contacts.len(), count, "{a:?} {b:?} {contacts:?}");
        for point in contacts {
            assert!((point.distance + 1e-4).abs() < 1e-12, "{point:?}");
            assert!((point.normal[2] - 1.0).abs() < 1e-12, "{point:?}");
        }
    }
    // the capsule is the first shape: the box is what it lies on
    let flat = Pair {
        shapes: [capsule, slab],
        axes: [lying, UPRIGHT],
        center: [0.0, 0.0, -0.07 + 1e-4],
    };
    let beside = Pair {
        shapes: [capsule, long],
        axes: [lying, lying],
        center: [0.05, 0.05 - 1e-4, 0.0],
    };
    for (pair, ends) in [(flat, [-0.1, 0.1]), (beside, [-0.1, 0.1])] {
        let contacts = contacts(DOUBLE, &[], &[pair], 1e-3).remove(0);
        assert_eq!(contacts.len(), 2, "{pair:?} {contacts:?}");
        for (point, end) in contacts.iter().zip(ends) {
            assert!((point.point[0] - end).abs() < 1e-12, "{point:?}");
            assert!((point.distance + 1e-4).abs() < 1e-12, "{point:?}");
        }
    }
}

#[test]
fn shapes_inside_each_other_are_pushed_out_the_short_way() {
    let along = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
    let cuboid = Shape::Box([0.1, 0.2, 0.3]);
    let (ball, rod) = (Shape::Sphere(0.05), Shape::Capsule(0.02, 0.5));
    for (a, b, axes, center, distance) in [
        (ball, ball, UPRIGHT, [0.0; 3], -0.1),
        (ball, rod, UPRIGHT, [0.0; 3], -0.07),
        (ball, cuboid, UPRIGHT, [0.0; 3], -0.15),
        (ball, cuboid, UPRIGHT, [-0.09, 0.0, 0.0], -0.06),
        (rod, rod, UPRIGHT, [0.0; 3], -0.04),
        (rod, rod, along, [0.0; 3], -0.04),
        (rod, cuboid, UPRIGHT, [0.0; 3], -0.12),
        (rod, cuboid, along, [0.0; 3], -0.12),
        (cuboid, cuboid, UPRIGHT, [0.0; 3], -0.2),
        (cuboid, cuboid, UPRIGHT, [0.15, 0.0, 0.0], -0.05),
    ] {
        let contacts = at_rest(a, b, axes, center);
        let nearest_contact = nearest(&contacts);
        assert!(
            (nearest_contact.distance - distance).abs() < 1e-12,
            "{a:?} {b:?} {contacts:?}"
        );
        for point in contacts {
            let numbers = point.point.into_iter().chain(point.normal);
            assert!(numbers.into_iter().all(f64::is_finite), "{point:?}");
            assert!(
                (dot(point.normal, point.normal) - 1.0).abs() < 1e-12,
                "{point:?}"
            );
        }
    }
}

#[test]
fn single_precision_is_right_to_its_rounding() {
    // 1e-5 of the size is 80 roundings; a nearest vertex comes of some 30 operations
    for kinds in ROUND.into_iter().chain(ON_PLANE) {
        let pairs = random_pairs(&mut Random(3), kinds, 2000);
        let [double, single] = [DOUBLE, SINGLE].map(|m| contacts(m, &[], &pairs, FAR));
        for ((pair, double), single) in pairs.iter().zip(&double).zip(&single) {
            let size = reach(pair.shapes[0]) + reach(pair.shapes[1]);
            let off = (nearest(single).distance - nearest(double).distance).abs();
            assert!(
                off < DISTANCE * size,
                "{off} {double:?} {single:?} {pair:?}"
            );
        }
    }
}
