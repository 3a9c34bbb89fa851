//! Every lane finds what a world alone finds, and nothing that is no number.

use super::shapes::*;
use sim_core::lane::Lane;

/// Pairs of one kind each with as many worlds, most of them near each other, some far apart.
fn blocks(worlds: usize) -> (Hulls, Vec<Vec<Pair>>) {
    let mut random = Random(3);
    let hulls = Hulls::new((0..4).map(|i| random.hull(10 + 10 * i)).collect());
    let shapes = |random: &mut Random| {
        let mut size = || random.between(0.02, 0.1);
        let cylinder = Shape::Cylinder(size(), size());
        let firsts = [
            Shape::Sphere(size()),
            Shape::Capsule(0.5 * size(), size()),
            Shape::Box([size(), size(), size()]),
            Shape::Cylinder(size(), size()),
        ];
        let mut pairs: Vec<(Shape, Shape)> = firsts.iter().map(|&a| (a, cylinder)).collect();
        pairs.extend(firsts.iter().map(|&a| (a, Shape::Hull(1))));
        pairs.extend([
            (Shape::Plane, Shape::Hull(0)),
            (Shape::Hull(2), Shape::Hull(3)),
        ]);
        pairs
    };
    let mut blocks = vec![vec![]; shapes(&mut random).len()];
    for _ in 0..worlds {
        for (block, (a, b)) in blocks.iter_mut().zip(shapes(&mut random)) {
            let (axes_a, axes_b) = (random.rotation(), random.rotation());
            let far = random.between(0.0, 0.25);
            let center = scale(random.direction(), far);
            block.push(Pair {
                a,
                axes_a,
                b,
                axes_b,
                center,
            });
        }
    }
    (hulls, blocks)
}

#[inline(always)]
fn all<F: Lane<Real = f32>>(hulls: &Hulls, pairs: &[Pair]) -> Vec<Vec<Contact>> {
    let mut memory = vec![F::default(); MEMORY];
    pairs
        .chunks(F::WIDTH)
        .flat_map(|chunk| contacts::<F>(chunk, &hulls.places, &hulls.single, 0.01, &mut memory))
        .collect()
}

#[cfg(target_arch = "x86_64")]
mod wide {
    use super::*;
    use sim_core::lane::simd::{F32x8, F32x16};

    #[target_feature(enable = "avx2,fma")]
    pub fn by_eight(hulls: &Hulls, pairs: &[Pair]) -> Vec<Vec<Contact>> {
        all::<F32x8>(hulls, pairs)
    }

    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
    pub fn by_sixteen(hulls: &Hulls, pairs: &[Pair]) -> Vec<Vec<Contact>> {
        all::<F32x16>(hulls, pairs)
    }
}

#[cfg(target_arch = "x86_64")]
#[test]
fn contacts_of_a_lane_are_bitwise_those_of_a_world_alone_in_any_order() {
    let (hulls, blocks) = blocks(400);
    for pairs in blocks {
        let alone = all::<f32>(&hulls, &pairs);
        let near = alone.iter().filter(|contacts| !contacts.is_empty()).count();
        assert!(near > 100 && near < 400, "{near} of {:?}", pairs[0]);
        let turned: Vec<Pair> = pairs.iter().rev().copied().collect();
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the machine has the features, as was just asked
            let eight = unsafe {
                [
                    wide::by_eight(&hulls, &pairs),
                    wide::by_eight(&hulls, &turned),
                ]
            };
            same(&alone, eight);
        }
        if is_x86_feature_detected!("avx512bw") && is_x86_feature_detected!("avx512dq") {
            // SAFETY: as above
            let sixteen = unsafe {
                [
                    wide::by_sixteen(&hulls, &pairs),
                    wide::by_sixteen(&hulls, &turned),
                ]
            };
            same(&alone, sixteen);
        }
    }
}

fn same(alone: &[Vec<Contact>], [straight, mut turned]: [Vec<Vec<Contact>>; 2]) {
    turned.reverse();
    let bits = |worlds: &[Vec<Contact>]| -> Vec<Vec<[u64; 7]>> {
        let contact = |x: &Contact| {
            let [p, n] = [x.point, x.normal];
            [p[0], p[1], p[2], x.distance, n[0], n[1], n[2]].map(f64::to_bits)
        };
        worlds
            .iter()
            .map(|world| world.iter().map(contact).collect())
            .collect()
    };
    assert_eq!(bits(&straight), bits(alone));
    assert_eq!(bits(&turned), bits(alone));
}

#[test]
fn single_precision_differs_from_double_by_less_than_1e_4_of_the_size_but_for_1_percent() {
    let (hulls, blocks) = blocks(400);
    let mut memory = vec![0.0_f64; MEMORY];
    for pairs in blocks {
        let single = all::<f32>(&hulls, &pairs);
        let mut apart = 0;
        for (pair, contacts_single) in pairs.iter().zip(single) {
            let double = contacts::<f64>(&[*pair], &hulls.places, &hulls.tables, 0.01, &mut memory);
            let least =
                |contacts: &[Contact]| contacts.iter().map(|x| x.distance).fold(0.01, f64::min);
            let error = (least(&double[0]) - least(&contacts_single)).abs() / 0.1;
            apart += usize::from(error > 1e-4);
        }
        // two local minima of depth may change places, and fewer rounds of a curved one end sooner
        assert!(apart <= 4, "{:?} {:?}: {apart}", pairs[0].a, pairs[0].b);
    }
}

#[test]
fn touching_parallel_and_concentric_shapes_have_finite_points() {
    let (hulls, blocks) = blocks(1);
    let upright = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let lying = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]];
    for pair in blocks.iter().map(|pairs| pairs[0]) {
        for (axes_a, axes_b) in [
            (upright, upright),
            (lying, upright),
            (upright, lying),
            (lying, lying),
        ] {
            for way in [
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [0.6, 0.0, 0.8],
            ] {
                for far in [0.0, 1e-9, 1e-6, 1e-3, 0.02, 0.04, 0.05, 0.1] {
                    let pair = Pair {
                        a: match pair.a {
                            Shape::Sphere(_) => Shape::Sphere(0.02),
                            Shape::Capsule(..) => Shape::Capsule(0.02, 0.03),
                            Shape::Box(_) => Shape::Box([0.02; 3]),
                            Shape::Cylinder(..) => Shape::Cylinder(0.02, 0.02),
                            other => other,
                        },
                        b: match pair.b {
                            Shape::Cylinder(..) => Shape::Cylinder(0.02, 0.02),
                            other => other,
                        },
                        axes_a,
                        axes_b,
                        center: scale(way, far),
                    };
                    let mut memory = vec![0.0_f32; MEMORY];
                    let single =
                        contacts::<f32>(&[pair], &hulls.places, &hulls.single, 0.01, &mut memory);
                    let mut memory = vec![0.0_f64; MEMORY];
                    let double =
                        contacts::<f64>(&[pair], &hulls.places, &hulls.tables, 0.01, &mut memory);
                    for contacts in [&single[0], &double[0]] {
                        assert!(!contacts.is_empty() || far > 0.01, "{pair:?}");
                        for x in contacts {
                            let length = dot(x.normal, x.normal);
                            let finite =
                                x.point.iter().all(|x| x.abs() < 1.0) && x.distance.abs() < 1.0;
                            assert!(finite && (length - 1.0).abs() < 1e-5, "{pair:?}: {x:?}");
                        }
                    }
                }
            }
        }
    }
}
