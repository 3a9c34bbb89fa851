//! Narrow phase of primitives: closed forms, parry3d, and the same bits whatever the width of a block.

mod shapes;

use shapes::{Pair, Point, Random, Shape, dot, oracle, points, turn};
use sim_core::math::vec3::{Mat3, Vec3};

const UPRIGHT: Mat3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// Random configurations of a pair.
const CONFIGURATIONS: usize = 10_000;
/// Of the sum of both shapes' reaches: the tolerance of distances.
const DISTANCE: f64 = 1e-5;

type Kind = fn(&mut Random) -> Shape;

fn sphere(random: &mut Random) -> Shape {
    Shape::Sphere(random.range(0.02, 0.1))
}
fn capsule(random: &mut Random) -> Shape {
    Shape::Capsule(random.range(0.02, 0.1), random.range(0.02, 0.2))
}
fn cuboid(random: &mut Random) -> Shape {
    Shape::Box([0; 3].map(|_| random.range(0.02, 0.2)))
}
fn cylinder(random: &mut Random) -> Shape {
    Shape::Cylinder(random.range(0.02, 0.1), random.range(0.02, 0.2))
}
fn plane(_: &mut Random) -> Shape {
    Shape::Plane
}

const ROUND: [[Kind; 2]; 6] = [
    [sphere, sphere],
    [sphere, capsule],
    [sphere, cuboid],
    [capsule, capsule],
    [capsule, cuboid],
    [cuboid, cuboid],
];
const ON_PLANE: [[Kind; 2]; 4] = [
    [plane, sphere],
    [plane, capsule],
    [plane, cuboid],
    [plane, cylinder],
];

/// From deep inside each other to well apart.
fn random_pair(random: &mut Random, [a, b]: [Kind; 2]) -> Pair {
    let shapes = [a(random), b(random)];
    let axes = [random.axes(), random.axes()];
    let reach = shapes[0].reach() + shapes[1].reach();
    let (way, far) = (random.direction(), random.range(0.05, 1.3) * reach);
    Pair {
        shapes,
        axes,
        center: way.map(|x| x * far),
        margin: 10.0,
    }
}

/// How far apart a direction shows the shapes to be: at most their signed distance.
fn separation(pair: &Pair, normal: Vec3<f64>) -> f64 {
    let [a, b] = [0, 1].map(|which| {
        let local = pair.axes[which].map(|axis| dot(axis, normal));
        pair.shapes[which].support(local)
    });
    dot(normal, pair.center) - a - b
}

fn nearest(points: &[Point<f64>]) -> Point<f64> {
    let least = |a: Point<f64>, b: &Point<f64>| if b.distance < a.distance { *b } else { a };
    points.iter().fold(points[0], least)
}

fn at_rest(a: Shape, b: Shape, axes: Mat3<f64>, center: Vec3<f64>) -> Vec<Point<f64>> {
    let pair = Pair {
        shapes: [a, b],
        axes: [UPRIGHT, axes],
        center,
        margin: 1e-3,
    };
    points::<f64>(&[pair]).remove(0)
}

#[test]
fn nearest_points_are_parrys() {
    for (number, kinds) in ROUND.into_iter().enumerate() {
        let mut random = Random(number as u64);
        let pairs: Vec<Pair> = (0..CONFIGURATIONS)
            .map(|_| random_pair(&mut random, kinds))
            .collect();
        let (mut classes, mut refuted) = ([0; 3], 0);
        for (pair, found) in pairs.iter().zip(points::<f64>(&pairs)) {
            let size = pair.shapes[0].reach() + pair.shapes[1].reach();
            let (distance, normal) = oracle(pair);
            // parry's expanding polytope stops early now and then: its direction then shows less than it says
            if normal != [0.0; 3] && (separation(pair, normal) - distance).abs() > 1e-6 * size {
                refuted += 1;
                continue;
            }
            assert!(!found.is_empty(), "{distance} {pair:?}");
            let ours = nearest(&found);
            // a direction cannot show more than there is; it must show all but the tolerance
            let shown = separation(pair, ours.normal);
            let length = dot(ours.normal, ours.normal).sqrt();
            assert!((length - 1.0).abs() < 1e-9, "{length} {pair:?}");
            if distance > -0.1 * size {
                classes[usize::from(distance < 0.0)] += 1;
                let off = (ours.distance - distance)
                    .abs()
                    .max((shown - distance).abs());
                assert!(
                    off < DISTANCE * size,
                    "{ours:?} {shown} {distance} {pair:?}"
                );
            } else {
                classes[2] += 1;
                let least = distance * 1.01;
                assert!(shown > least, "{ours:?} {shown} {distance} {pair:?}");
                assert!(
                    (ours.distance - shown).abs() < DISTANCE * size,
                    "{ours:?} {shown} {pair:?}"
                );
            }
            // parry's normals are good to its tolerance over the distance
            if distance > 0.01 * size && dot(normal, normal) > 0.5 {
                let off = (0..3).map(|i| (ours.normal[i] - normal[i]).abs());
                let off = off.fold(0.0, f64::max);
                assert!(off < 1e-5, "{ours:?} {normal:?} {distance} {pair:?}");
            }
        }
        println!("pair {number}: apart, shallow, deep: {classes:?}, refuted {refuted}");
        assert!(refuted < CONFIGURATIONS / 200, "{refuted}");
        assert!(classes[0] > 1000 && classes[1] > 300, "{classes:?}");
    }
}

#[test]
fn nearest_points_on_a_plane_are_the_supports() {
    for (number, kinds) in ON_PLANE.into_iter().enumerate() {
        let mut random = Random(number as u64);
        let pairs: Vec<Pair> = (0..CONFIGURATIONS)
            .map(|_| random_pair(&mut random, kinds))
            .collect();
        for (pair, found) in pairs.iter().zip(points::<f64>(&pairs)) {
            let normal = pair.axes[0][2];
            let local = pair.axes[1].map(|axis| dot(axis, normal));
            let distance = dot(normal, pair.center) - pair.shapes[1].support(local);
            let ours = nearest(&found);
            assert_eq!(ours.normal, normal);
            assert!(
                (ours.distance - distance).abs() < 1e-12,
                "{ours:?} {distance} {pair:?}"
            );
            let height = dot(normal, ours.at) - 0.5 * distance;
            assert!(
                height.abs() < 1e-12,
                "the point is half-way: {ours:?} {pair:?}"
            );
        }
    }
}

#[test]
fn points_are_between_the_surfaces() {
    // the surfaces are half the distance away along the normal, on either side
    for kinds in ROUND {
        let mut random = Random(11);
        let pairs: Vec<Pair> = (0..1000).map(|_| random_pair(&mut random, kinds)).collect();
        for (pair, found) in pairs.iter().zip(points::<f64>(&pairs)) {
            for point in found {
                let a: Vec3<f64> =
                    std::array::from_fn(|i| point.at[i] - 0.5 * point.distance * point.normal[i]);
                let b: Vec3<f64> =
                    std::array::from_fn(|i| point.at[i] + 0.5 * point.distance * point.normal[i]);
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
fn depth(shape: Shape, at: Vec3<f64>) -> f64 {
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
        let axes = random.axes();
        for quarter in 0..4 {
            let (cos, sin) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarter];
            let turned = [[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]];
            pairs.push(Pair {
                shapes: [cube; 2],
                axes: [axes, turned.map(|axis| turn(&axes, axis))],
                center: turn(&axes, [0.0, 0.0, 0.0999]),
                margin: 1e-3,
            });
        }
    }
    for (pair, found) in pairs.iter().zip(points::<f64>(&pairs)) {
        assert_eq!(found.len(), 4, "{pair:?}");
        for point in &found {
            let at = pair.axes[0].map(|axis| dot(axis, point.at));
            let corner = [at[0].abs(), at[1].abs(), at[2]];
            let off = (corner[0] - 0.05)
                .hypot(corner[1] - 0.05)
                .hypot(corner[2] - 0.04995);
            assert!(off < 1e-12, "{point:?}");
            assert!((point.distance + 1e-4).abs() < 1e-12, "{point:?}");
        }
    }
    for found in points::<f32>(&pairs) {
        assert_eq!(found.len(), 4);
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
        (Shape::Plane, cylinder, UPRIGHT, 0.1, 4),
        (Shape::Plane, brick, UPRIGHT, 0.04, 4),
        (slab, brick, UPRIGHT, 0.09, 4),
    ] {
        let found = at_rest(a, b, axes, [0.01, 0.02, height - 1e-4]);
        assert_eq!(found.len(), count, "{a:?} {b:?} {found:?}");
        for point in found {
            assert!((point.distance + 1e-4).abs() < 1e-12, "{point:?}");
            assert!((point.normal[2] - 1.0).abs() < 1e-12, "{point:?}");
        }
    }
    // the capsule is the first shape: the box is what it lies on
    let flat = Pair {
        shapes: [capsule, slab],
        axes: [lying, UPRIGHT],
        center: [0.0, 0.0, -0.07 + 1e-4],
        margin: 1e-3,
    };
    let beside = Pair {
        shapes: [capsule, long],
        axes: [lying, lying],
        center: [0.05, 0.05 - 1e-4, 0.0],
        margin: 1e-3,
    };
    for (pair, ends) in [(flat, [-0.1, 0.1]), (beside, [-0.1, 0.1])] {
        let found = points::<f64>(&[pair]).remove(0);
        assert_eq!(found.len(), 2, "{pair:?} {found:?}");
        for (point, end) in found.iter().zip(ends) {
            assert!((point.at[0] - end).abs() < 1e-12, "{point:?}");
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
        let found = at_rest(a, b, axes, center);
        let ours = nearest(&found);
        assert!(
            (ours.distance - distance).abs() < 1e-12,
            "{a:?} {b:?} {found:?}"
        );
        for point in found {
            let numbers = point.at.into_iter().chain(point.normal);
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
        let mut random = Random(3);
        let pairs: Vec<Pair> = (0..2000).map(|_| random_pair(&mut random, kinds)).collect();
        let double = points::<f64>(&pairs);
        for ((pair, double), single) in pairs.iter().zip(&double).zip(points::<f32>(&pairs)) {
            let size = pair.shapes[0].reach() + pair.shapes[1].reach();
            let least = single
                .iter()
                .fold(f32::MAX, |least, p| least.min(p.distance));
            let off = (f64::from(least) - nearest(double).distance).abs();
            assert!(
                off < DISTANCE * size,
                "{off} {double:?} {single:?} {pair:?}"
            );
        }
    }
}

fn bits(found: &[Vec<Point<f32>>]) -> Vec<Vec<u32>> {
    let numbers = |p: &Point<f32>| p.at.into_iter().chain(p.normal).chain([p.distance]);
    found
        .iter()
        .map(|points| points.iter().flat_map(numbers).map(f32::to_bits).collect())
        .collect()
}

#[cfg(target_arch = "x86_64")]
mod wide {
    use super::*;
    use sim_core::lane::simd::{F32x8, F32x16};

    #[target_feature(enable = "avx2,fma")]
    pub fn by_eight(pairs: &[Pair]) -> Vec<Vec<Point<f32>>> {
        points::<F32x8>(pairs)
    }

    #[target_feature(enable = "avx512f")]
    pub fn by_sixteen(pairs: &[Pair]) -> Vec<Vec<Point<f32>>> {
        points::<F32x16>(pairs)
    }
}

#[cfg(target_arch = "x86_64")]
#[test]
#[allow(unsafe_code)]
fn a_world_has_the_same_bits_alone_and_among_others() {
    for kinds in ROUND.into_iter().chain(ON_PLANE) {
        let mut random = Random(7);
        let pairs: Vec<Pair> = (0..500)
            .map(|_| Pair {
                margin: random.range(0.0, 0.1),
                ..random_pair(&mut random, kinds)
            })
            .collect();
        let alone = bits(&points::<f32>(&pairs));
        let turned: Vec<Pair> = (0..500).map(|i| pairs[(i * 7) % 500]).collect();
        let expected: Vec<_> = (0..500).map(|i| alone[(i * 7) % 500].clone()).collect();
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the machine has these features (asked the line above)
            let (same, other) = unsafe { (wide::by_eight(&pairs), wide::by_eight(&turned)) };
            assert_eq!(bits(&same), alone);
            assert_eq!(bits(&other), expected);
        } else {
            println!("skipped: no AVX2");
        }
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the machine has this feature (asked the line above)
            let (same, other) = unsafe { (wide::by_sixteen(&pairs), wide::by_sixteen(&turned)) };
            assert_eq!(bits(&same), alone);
            assert_eq!(bits(&other), expected);
        } else {
            println!("skipped: no AVX-512");
        }
    }
}
