//! A capsule and a box where one is a geom of MuJoCo's: `tests/python/mujoco/contacts/test_closed_forms.py` compares with MuJoCo in
//! double precision, and these tests the other backends with that.

use super::shapes::*;
use sim_engine::backend::{Lanes, Precision, cpu};
use std::f64::consts::TAU;

/// Within which contacts are found [m].
const MARGIN: f64 = 0.01;
const CAPSULE: Shape = Shape::Capsule(0.05, 0.09);
const BOX: Shape = Shape::Box([0.05, 0.08, 0.11]);
const UPRIGHT: [Vector; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Boxes of any pose around a still capsule.
fn random_pairs(count: usize) -> Vec<Pair> {
    let mut random = Random(9);
    let still = random.rotation();
    let pair = |_| Pair {
        shapes: [CAPSULE, BOX],
        axes: [still, random.rotation()],
        center: scale(random.direction(), random.between(0.0, 0.25)),
    };
    (0..count).map(pair).collect()
}

#[test]
fn every_lane_has_the_points_of_a_world_alone() {
    let pairs = random_pairs(2000);
    let alone = contacts_of_geoms(SINGLE, &pairs, MARGIN);
    assert!(alone.iter().filter(|points| points.len() == 2).count() > 200);
    for lanes in [Lanes::Eight, Lanes::Sixteen] {
        if !cpu::available(lanes) {
            println!("skipped: this processor has no {lanes:?}");
            continue;
        }
        let machine = Machine {
            precision: Precision::F32,
            lanes,
        };
        assert_eq!(contacts_of_geoms(machine, &pairs, MARGIN), alone);
    }
}

#[test]
fn single_precision_has_the_points_of_double_precision_but_for_1_percent() {
    let pairs = random_pairs(2000);
    let [double, single] = [DOUBLE, SINGLE].map(|m| contacts_of_geoms(m, &pairs, MARGIN));
    let is_same = |(first, other): &(&Vec<Contact>, &Vec<Contact>)| {
        let mut points = first.iter().zip(*other);
        first.len() == other.len()
            && points.all(|(a, b)| {
                let off = [sub(a.point, b.point), sub(a.normal, b.normal)].map(|x| dot(x, x));
                (a.distance - b.distance).abs() < 1e-5 && off[0] < 1e-8 && off[1] < 1e-6
            })
    };
    // the nearest of two features, and the face that is left through, may change places
    let same = double.iter().zip(&single).filter(is_same).count();
    assert!(same >= 1980, "{same} of 2000");
}

/// A capsule that lies 0.1 mm deep on the top of a box: its heading about z [rad], and its middle.
fn lying(heading: f64, middle: [f64; 2], half: Vector) -> Pair {
    let (sin, cos) = heading.sin_cos();
    let axes = [[-sin, cos, 0.0], [0.0, 0.0, 1.0], [cos, sin, 0.0]];
    Pair {
        shapes: [CAPSULE, Shape::Box(half)],
        axes: [axes, UPRIGHT],
        center: [-middle[0], -middle[1], -half[2] - 0.05 + 1e-4],
    }
}

#[test]
fn in_single_precision_a_capsule_that_lies_flat_has_two_points_whatever_it_overhangs() {
    let mut count = 0;
    for half in [[0.05, 0.08, 0.11], [0.02, 0.2, 0.05], [0.3, 0.3, 0.05]] {
        for step in 0..64 {
            for middle in [[0.0, 0.0], [0.01, 0.0], [0.0, -0.01], [-0.013, 0.017]] {
                let pair = lying(TAU * f64::from(step) / 64.0, middle, half);
                let points = contacts_of_geoms(SINGLE, &[pair], 0.0).remove(0);
                assert_eq!(points.len(), 2, "{pair:?} {points:?}");
                let along = sub(points[0].point, points[1].point);
                assert!(dot(along, along).sqrt() > 0.02, "{points:?}");
                for point in points {
                    assert!((point.distance + 1e-4).abs() < 1e-6, "{point:?}");
                    assert!((point.normal[2] + 1.0).abs() < 1e-5, "{point:?}");
                }
                count += 1;
            }
        }
    }
    assert_eq!(count, 768);
}

#[test]
fn in_double_precision_an_axis_that_is_exactly_flat_across_a_box_has_mujocos_one_point() {
    let pair = lying(0.0, [0.0, 0.0], [0.05, 0.08, 0.11]);
    assert_eq!(contacts_of_geoms(DOUBLE, &[pair], 0.0)[0].len(), 1);
    // ours, of scenes without geoms, has both ends of what lies on the box
    assert_eq!(contacts(DOUBLE, &[], &[pair], 0.0)[0].len(), 2);
}
