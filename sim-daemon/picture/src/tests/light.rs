//! Soft shadows, and a floor without an edge.

use super::{BLUE, HEIGHT, RED, WIDTH, at, drawn, shot};
use crate::shade::KEY;
use crate::shadow::LIGHT;
use crate::vector::Vector;
use crate::{Mesh, Rgb, Shot, View};

const SAND: [u8; 4] = [180, 170, 155, 255];

/// A box with its middle at the origin.
fn cuboid(half: [f32; 3], colour: [u8; 4]) -> Mesh {
    let vertices: Vec<[f32; 3]> = (0..8)
        .map(|k| {
            std::array::from_fn(|axis| {
                if k >> axis & 1 == 1 {
                    half[axis]
                } else {
                    -half[axis]
                }
            })
        })
        .collect();
    let faces = [
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    Mesh::new(&vertices, &faces, &[colour; 12]).unwrap()
}

/// From straight above.
fn above(target: Vector, height: f64, angle: f64) -> View {
    let eye = [target[0], target[1] - 1e-3, target[2] + height];
    View::looking(eye, target, [0.0, 0.0, 1.0], angle, [WIDTH, HEIGHT])
}

/// Largest change from a pixel to the next one, along a row or a column.
fn steps(pixels: impl Iterator<Item = Rgb> + Clone) -> i32 {
    let next = pixels.clone().skip(1);
    let change = |(a, b): (Rgb, Rgb)| {
        (0..3)
            .map(|k| (i32::from(a[k]) - i32::from(b[k])).abs())
            .max()
    };
    pixels.zip(next).filter_map(change).max().unwrap_or(0)
}

#[test]
fn flat_tops_in_light_have_no_speckles() {
    // as lit as a table of its own, whatever the texels' size, its turn and its tilt towards the light
    for reach in [0.8, 3.0, 12.0] {
        for (turn, tilt) in [(0.0, 0.0), (0.4, 0.0), (0.3, 0.3), (2.0, 0.5), (4.0, 0.6)] {
            let mut table = at(0, [0.0; 3]);
            let (half_turn, half_tilt): (f64, f64) = (0.5 * turn, 0.5 * tilt);
            // about z, then about x
            table.pose[3..].copy_from_slice(&[
                half_turn.cos() * half_tilt.sin(),
                half_turn.sin() * half_tilt.sin(),
                half_turn.sin() * half_tilt.cos(),
                half_turn.cos() * half_tilt.cos(),
            ]);
            let instances = [table];
            let shot = Shot {
                view: above([0.0, 0.0, 0.05], 1.5, 0.2),
                floor: Some([-1.0, 10.0]),
                reach,
                ..shot(&instances)
            };
            let pixels = drawn(vec![cuboid([0.5, 0.5, 0.05], SAND)], &shot);
            let most = pixels
                .chunks_exact(WIDTH)
                .map(|row| steps(row.iter().copied()))
                .max();
            assert!(
                most <= Some(1),
                "reach {reach}, turn {turn}, tilt {tilt}: {most:?}"
            );
        }
    }
}

/// How many pixels of a row of the floor are neither dark nor lit, and how lit each is; the row crosses the edge of the
/// shadow of a plate whose left side is above x = 0 at this height, from the light into the shadow.
fn penumbra(height: f64) -> (usize, Vec<f64>) {
    let left = -height * KEY[0] / KEY[2];
    let aside = -height * KEY[1] / KEY[2];
    let instances = [at(0, [0.5, 0.0, height - 0.005])];
    let shot = Shot {
        view: above([left, aside, 0.0], 3.0, 0.05),
        floor: Some([0.0, 10.0]),
        ..shot(&instances)
    };
    let shaded = drawn(vec![cuboid([0.5, 0.5, 0.005], RED)], &shot);
    let lit = drawn(
        vec![],
        &Shot {
            instances: &[],
            ..shot
        },
    );
    let row = HEIGHT / 2 * WIDTH;
    let light = |pixel: Rgb| f64::from(pixel[1]).powi(2);
    // further to the right the plate hides the floor
    let share: Vec<f64> = (row..row + WIDTH * 3 / 4)
        .map(|pixel| light(shaded[pixel]) / light(lit[pixel]))
        .collect();
    let dark = share.iter().copied().fold(1.0, f64::min);
    let between = share
        .iter()
        .filter(|&&share| share > dark + 0.02 && share < 0.98);
    (between.count(), share)
}

#[test]
fn a_penumbra_is_as_wide_as_the_light_and_the_distance_of_the_blocker_make_it() {
    // pixels a metre of the floor
    let scale = 0.5 * HEIGHT as f64 / (0.025_f64.tan() * 3.0);
    let mut last = 0;
    for height in [0.15, 0.3, 0.6] {
        let (between, share) = penumbra(height);
        // the light is a disc of this radius at a distance of 1; an eighth at either side is within 2 % of light or dark
        let length = height / KEY[2];
        let wide = 2.0 * f64::from(LIGHT) * length * scale;
        let seen = between as f64;
        assert!(
            seen > 0.6 * wide && seen < wide,
            "{height}: {seen} of {wide}"
        );
        assert!(between > last, "{height}: {between} after {last}");
        // ever darker, to a rounding of a byte
        assert!(
            share.windows(2).all(|pair| pair[1] < pair[0] + 0.01),
            "{height}: {share:?}"
        );
        last = between;
    }
}

#[test]
fn no_light_leaks_in_where_a_box_stands_on_a_table() {
    // the second one as among many worlds, where a texel is as wide as a pixel
    for reach in [0.8, 4.0] {
        let instances = [at(0, [0.0, 0.0, -0.05]), at(1, [0.0, 0.0, 0.1])];
        let shot = Shot {
            view: above([-0.1, 0.1, 0.0], 2.0, 0.4),
            reach,
            ..shot(&instances)
        };
        let meshes = || {
            vec![
                cuboid([0.6, 0.6, 0.05], SAND),
                cuboid([0.1, 0.1, 0.1], BLUE),
            ]
        };
        let pixels = drawn(meshes(), &shot);
        let brightness = |x: f64, y: f64| {
            let [column, row, _] = shot.view.project([x, y, 0.0]);
            i32::from(pixels[row as usize * WIDTH + column as usize][0])
        };
        let texel = 2.0 * reach / 1024.0;
        let (dark, lit) = (brightness(-0.115, 0.08), brightness(0.3, -0.2));
        assert!(dark < lit - 20, "{dark} {lit}");
        // beside the box, away from the light: a texel and a pixel off
        for y in [-0.04, 0.0, 0.04] {
            let beside = brightness(-0.1 - 2.0 * texel - 0.005, y);
            assert!(
                beside < dark + 6,
                "reach {reach}, y {y}: {beside} beside {dark} of {lit}"
            );
        }
    }
}

#[test]
fn the_floor_has_no_edge_and_the_sky_no_horizon() {
    let paper = vec![[250, 250, 251]; WIDTH * HEIGHT];
    // in the middle between lines, which are a kilometre apart
    let middle = [500.0, 500.0, 0.0];
    let there = |place: Vector| std::array::from_fn(|axis| place[axis] + middle[axis]);
    for (eye, target, angle) in [
        ([2.0, -2.0, 1.4], [0.0, 0.0, 0.3], 0.7),
        ([3.0, 0.0, 0.6], [0.0, 0.0, 0.3], 0.7),
        ([0.0, -3.0, 0.1], [0.0, 0.0, 0.2], 0.7),
        ([3.0, 3.0, 0.5], [0.0, 0.0, 0.5], 1.1),
        ([0.0, -1e-3, 4.0], [0.0; 3], 2.0),
        ([40.0, -40.0, 28.0], [0.0; 3], 0.7),
    ] {
        for backdrop in [None, Some(&paper[..])] {
            let shot = Shot {
                view: View::looking(
                    there(eye),
                    there(target),
                    [0.0, 0.0, 1.0],
                    angle,
                    [WIDTH, HEIGHT],
                ),
                floor: Some([0.0, 1e3]),
                backdrop,
                middle,
                ..shot(&[])
            };
            let pixels = drawn(vec![], &shot);
            for column in [0, WIDTH / 3, WIDTH - 1] {
                let column = (0..HEIGHT).map(|row| pixels[row * WIDTH + column]);
                let most = steps(column);
                assert!(most <= 1, "{eye:?}, {}: {most}", backdrop.is_some());
            }
        }
    }
}
