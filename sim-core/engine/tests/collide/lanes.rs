//! Every lane finds what a world alone finds, and nothing that is no number.

use super::shapes::*;
use sim_engine::backend::{Lanes, Precision, cpu};
use sim_model::geometry::Hull;

/// Within which contacts are found [m].
const MARGIN: f64 = 0.01;
/// Sizes of the shapes of two kinds, each with its worlds.
const SIZES: usize = 8;

/// A shape of random sizes, or the hull of a number.
type Kind = fn(&mut dyn FnMut() -> f64, usize) -> Shape;

/// Pairs of kinds: each with worlds of some sizes, most of them near each other, some far apart.
fn blocks(worlds: usize) -> (Vec<Hull>, Vec<Vec<Pair>>) {
    let mut random = Random(3);
    let hulls: Vec<Hull> = (0..4).map(|i| random.hull(10 + 10 * i)).collect();
    let kinds: [Kind; 6] = [
        |size, _| Shape::Sphere(size()),
        |size, _| Shape::Capsule(0.5 * size(), size()),
        |size, _| Shape::Box([size(), size(), size()]),
        |size, _| Shape::Cylinder(size(), size()),
        |size, _| Shape::Ellipsoid([size(), size(), size()]),
        |_, number| Shape::Hull(number % 4),
    ];
    let mut blocks = Vec::new();
    for (k, second) in kinds.iter().enumerate() {
        for first in (0..=k).map(Some).chain([None]) {
            let mut block = Vec::new();
            for number in 0..SIZES.min(worlds) {
                let mut size = || random.between(0.02, 0.1);
                let shapes = [
                    first.map_or(Shape::Plane, |first| kinds[first](&mut size, number)),
                    second(&mut size, number + 1),
                ];
                let still = random.rotation();
                for _ in 0..worlds.div_ceil(SIZES) {
                    let far = random.between(0.0, 0.25);
                    block.push(Pair {
                        shapes,
                        axes: [still, random.rotation()],
                        center: scale(random.direction(), far),
                    });
                }
            }
            blocks.push(block);
        }
    }
    (hulls, blocks)
}

fn bits(worlds: &[Vec<Contact>]) -> Vec<Vec<[u64; 7]>> {
    let contact = |x: &Contact| {
        let [p, n] = [x.point, x.normal];
        [p[0], p[1], p[2], x.distance, n[0], n[1], n[2]].map(f64::to_bits)
    };
    let world = |world: &Vec<Contact>| world.iter().map(contact).collect();
    worlds.iter().map(world).collect()
}

#[test]
fn contacts_of_a_lane_are_bitwise_those_of_a_world_alone_in_any_order() {
    let (hulls, blocks) = blocks(400);
    for pairs in blocks {
        let alone = contacts(SINGLE, &hulls, &pairs, MARGIN);
        let near = alone.iter().filter(|contacts| !contacts.is_empty()).count();
        assert!(near > 100 && near < 400, "{near} of {:?}", pairs[0].shapes);
        let turned: Vec<Pair> = pairs.iter().rev().copied().collect();
        for lanes in [Lanes::Eight, Lanes::Sixteen] {
            if !cpu::available(lanes) {
                println!("skipped: this processor has no {lanes:?}");
                continue;
            }
            let machine = Machine {
                precision: Precision::F32,
                lanes,
            };
            let straight = contacts(machine, &hulls, &pairs, MARGIN);
            assert!(
                bits(&straight) == bits(&alone),
                "{lanes:?} {:?}",
                pairs[0].shapes
            );
            let mut other = contacts(machine, &hulls, &turned, MARGIN);
            other.reverse();
            assert!(
                bits(&other) == bits(&alone),
                "{lanes:?} {:?}",
                pairs[0].shapes
            );
        }
    }
}

#[test]
fn single_precision_differs_from_double_by_less_than_1e_4_of_the_size_but_for_few() {
    let (hulls, blocks) = blocks(400);
    for pairs in blocks {
        let [single, double] = [SINGLE, DOUBLE].map(|m| contacts(m, &hulls, &pairs, MARGIN));
        let least = |contacts: &[Contact]| {
            let distances = contacts.iter().map(|x| x.distance);
            distances.fold(MARGIN, f64::min)
        };
        let far = |(first, other): &(&Vec<Contact>, &Vec<Contact>)| {
            (least(first) - least(other)).abs() / 0.1 > 1e-4
        };
        let apart = single.iter().zip(&double).filter(far).count();
        // two local minima of depth may change places, and fewer rounds of a curved one end sooner: 4 in 400 worlds, and 14
        // of ellipsoids
        let is_ellipsoid = |shape: &Shape| matches!(shape, Shape::Ellipsoid(_));
        let (most, farthest) = match pairs[0].shapes.iter().any(is_ellipsoid) {
            true => (16, 0.2),
            false => (4, 0.1),
        };
        assert!(apart <= most, "{:?}: {apart}", pairs[0].shapes);
        let each = single.iter().zip(&double);
        let worst = each.map(|(first, other)| (least(first) - least(other)).abs() / 0.1);
        let worst = worst.fold(0.0, f64::max);
        assert!(worst < farthest, "{:?}: {worst}", pairs[0].shapes);
    }
}

#[test]
fn contacts_are_the_same_whichever_of_two_shapes_stands_still() {
    let (hulls, blocks) = blocks(24);
    for pairs in blocks {
        let [first, second] = pairs[0].shapes;
        let is_one_kind = std::mem::discriminant(&first) == std::mem::discriminant(&second);
        // a plane cannot move; of one kind, the one that stands still is the first
        if first == Shape::Plane || is_one_kind {
            continue;
        }
        for (pair, contacts) in pairs.iter().zip(contacts(DOUBLE, &hulls, &pairs, MARGIN)) {
            let other = contacts_exchanged(&hulls, pair, MARGIN);
            let least = |a: &&Contact, b: &&Contact| a.distance.total_cmp(&b.distance);
            let nearest = [&contacts, &other].map(|contacts| contacts.iter().min_by(least));
            let [Some(first), Some(other)] = nearest else {
                assert_eq!(nearest, [None; 2], "{pair:?}");
                continue;
            };
            // from the shape that stands still to the free one
            let turned = size(add(first.normal, other.normal));
            let apart = size(sub(first.point, other.point));
            let off = (first.distance - other.distance).abs();
            // a search on a curved surface ends where the normal is good to 1e-6; inside each other lines may cross anywhere
            assert!(off < 1e-9 && turned < 1e-5, "{first:?} {other:?} {pair:?}");
            let touching = first.distance < 0.0;
            assert!(apart < 1e-5 || touching, "{first:?} {other:?} {pair:?}");
        }
    }
}

fn size(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

#[test]
fn touching_parallel_and_concentric_shapes_have_finite_points() {
    let (mut hulls, blocks) = blocks(1);
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { 0.02 } else { -0.02 });
    let corners: Vec<Vector> = (0..8).map(corner).collect();
    hulls.push(Hull::from_points(&corners, 64).unwrap());
    let upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let lying = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    let even = |shape: Shape| match shape {
        Shape::Sphere(_) => Shape::Sphere(0.02),
        Shape::Capsule(..) => Shape::Capsule(0.02, 0.03),
        Shape::Box(_) => Shape::Box([0.02; 3]),
        Shape::Cylinder(..) => Shape::Cylinder(0.02, 0.02),
        Shape::Ellipsoid(_) => Shape::Ellipsoid([0.02, 0.03, 0.02]),
        Shape::Hull(_) => Shape::Hull(hulls.len() - 1),
        Shape::Plane => Shape::Plane,
    };
    for shapes in blocks.iter().map(|pairs| pairs[0].shapes.map(even)) {
        let mut pairs = Vec::new();
        for axes in [
            [upright, upright],
            [upright, lying],
            [lying, upright],
            [lying, lying],
        ] {
            for way in [
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [0.6, 0.0, 0.8],
            ] {
                for far in [0.0, 1e-9, 1e-6, 1e-3, 0.02, 0.04, 0.05, 0.1] {
                    let center = scale(way, far);
                    pairs.push(Pair {
                        shapes,
                        axes,
                        center,
                    });
                }
            }
        }
        for machine in [SINGLE, DOUBLE] {
            for (pair, contacts) in pairs.iter().zip(contacts(machine, &hulls, &pairs, MARGIN)) {
                let far = size(pair.center);
                assert!(!contacts.is_empty() || far > 0.01, "{pair:?}");
                for x in contacts {
                    let length = dot(x.normal, x.normal);
                    let finite = x.point.iter().all(|x| x.abs() < 1.0) && x.distance.abs() < 1.0;
                    assert!(finite && (length - 1.0).abs() < 1e-5, "{pair:?}: {x:?}");
                }
            }
        }
    }
}
