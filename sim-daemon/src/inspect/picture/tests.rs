//! The renderer against geometry that can be worked out by hand.

use sim_model::geometry::triangles;
use sim_model::{Pose, Shape};

use super::backdrop::{Backdrop, Shadow, round_spacing};
use super::raster::{cover, render_on};
use super::surface::Surface;
use sim_picture::View;

/// A grid of points in a box about `middle`.
fn points(middle: [f64; 3], half: [f64; 3]) -> Vec<[f64; 3]> {
    let step = |index: usize, axis: usize| {
        middle[axis] + half[axis] * ((index / 3_usize.pow(axis as u32) % 3) as f64 - 1.0)
    };
    (0..27)
        .map(|index| std::array::from_fn(|axis| step(index, axis)))
        .collect()
}

#[test]
fn a_fitted_view_holds_all_points_and_wastes_no_room() {
    for (middle, half) in [
        ([0.0, 0.0, 0.0], [1.0, 1.0, 1.0]),
        ([5.0, -300.0, 2.0], [0.01, 0.2, 3.0]),
        ([0.0, 0.0, 1e-4], [1e-4, 2e-5, 1e-5]),
        ([0.0, 0.0, 0.0], [0.0, 0.0, 0.4]),
        ([1e4, 0.0, 0.0], [1e3, 4e3, 0.0]),
    ] {
        for perspective in [true, false] {
            let points = points(middle, half);
            let into = [-0.6, 0.7, -0.4];
            let size = [800, 600];
            let up = [0.0, 0.0, 1.0];
            let view = View::fitted(
                into,
                up,
                perspective,
                size,
                [50.0; 2],
                points.iter().copied(),
            );
            let mut room = f64::INFINITY;
            for &point in &points {
                let [x, y, near] = view.project(point);
                assert!(near.is_finite());
                for gap in [x, 800.0 - x, y, 600.0 - y] {
                    // the margin, to the rounding of a position over that of a pixel
                    assert!(
                        gap > 50.0 - 1e-3,
                        "{middle:?} {half:?} {perspective}: {gap}"
                    );
                    room = room.min(gap);
                }
            }
            assert!(
                room < 50.0 + 1e-3,
                "{middle:?} {half:?} {perspective}: {room}"
            );
        }
    }
}

#[test]
fn a_single_point_is_seen_in_the_middle() {
    for perspective in [true, false] {
        let point = [3.0, 2.0, 1.0];
        let only = std::iter::once(point);
        let view = View::fitted(
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            perspective,
            [400, 300],
            [20.0; 2],
            only,
        );
        let [x, y, near] = view.project(point);
        assert!((x - 200.0).abs() < 1e-9 && (y - 150.0).abs() < 1e-9 && near.is_finite());
    }
}

#[test]
fn a_place_on_the_floor_is_seen_where_it_is() {
    let box_ = points([1.0, 2.0, 3.0], [1.0; 3]);
    for perspective in [true, false] {
        let view = View::fitted(
            [-1.0, 1.0, -0.5],
            [0.0, 0.0, 1.0],
            perspective,
            [640, 480],
            [40.0; 2],
            box_.iter().copied(),
        );
        let [x, y, _] = view.project([1.5, 2.5, 2.0]);
        let [a, b] = view.on_plane(x, y, 2.0).unwrap();
        assert!((a - 1.5).abs() < 1e-9 && (b - 2.5).abs() < 1e-9);
    }
}

#[test]
fn triangles_that_share_an_edge_leave_no_gap() {
    // a fan around a point that is nowhere near a sample's middle
    let hub = [1003, 997];
    let rim: Vec<[i64; 2]> = (0..37)
        .map(|step| {
            let angle = std::f64::consts::TAU * f64::from(step) / 37.0;
            [
                hub[0] + (900.0 * angle.cos()) as i64,
                hub[1] + (900.0 * angle.sin()) as i64,
            ]
        })
        .collect();
    let (columns, lines) = (128, 128);
    let mut hits = vec![0; columns * lines];
    for (step, &corner) in rim.iter().enumerate() {
        let next = rim[(step + 1) % rim.len()];
        cover(&[hub, corner, next], columns, 0, lines, |index, weights| {
            assert!((weights.iter().sum::<f32>() - 1.0).abs() < 1e-5);
            hits[index] += 1;
        });
    }
    for line in 0..lines {
        for column in 0..columns {
            let [x, y] = [column, line].map(|part| 16.0 * part as f64 + 8.0);
            let away = (x - hub[0] as f64).hypot(y - hub[1] as f64);
            let hit = hits[line * columns + column];
            // 37 corners on a circle of 900 keep 896.7 of it
            assert!(away > 896.0 || hit > 0, "({column}, {line}) is a gap");
            assert!(away < 901.5 || hit == 0, "({column}, {line}) is outside");
        }
    }
}

#[test]
fn a_ball_is_shaded_round_and_a_box_flat() {
    let ball = triangles(&Shape::Sphere { radius: 2.0 });
    let surface = Surface::new(&[(0, Pose::identity(), ball)]);
    for facet in &surface.facets {
        for (corner, normal) in facet.corners.iter().zip(&facet.normals) {
            let radial = corner.map(|part| part / 2.0);
            let cosine: f32 = (0..3)
                .map(|axis| radial[axis] * f32::from(normal[axis]) / 32767.0)
                .sum();
            // facets are 7.5° wide: at a pole, where they all lean outward alike, the mean is still the axis
            assert!(cosine > 0.997, "{cosine}");
        }
    }
    let half_extents = [1.0, 2.0, 3.0];
    let surface = Surface::new(&[(0, Pose::identity(), triangles(&Shape::Box { half_extents }))]);
    for facet in &surface.facets {
        assert_eq!(facet.normals[0], facet.normals[1]);
        assert_eq!(facet.normals[0], facet.normals[2]);
        let parts = facet.normals[0].map(|part| i32::from(part).abs());
        assert_eq!(parts.iter().sum::<i32>(), 32767);
    }
}

#[test]
fn a_picture_is_the_same_on_any_number_of_threads() {
    let ball = triangles(&Shape::Sphere { radius: 0.3 });
    let pose = |x: f64| Pose::at([x, 0.1 * x, 0.3]);
    let surface = Surface::new(&[(0, pose(-0.2), ball.clone()), (1, pose(0.2), ball)]);
    let view = View::fitted(
        [-0.6, 0.7, -0.4],
        [0.0, 0.0, 1.0],
        true,
        [200, 150],
        [20.0; 2],
        points([0.0, 0.0, 0.3], [0.5, 0.3, 0.3]).into_iter(),
    );
    let shadow = Shadow::new(&surface, 0.0);
    let backdrop = Backdrop::Floor {
        spacing: 0.1,
        shadow,
    };
    let colours = [[200, 40, 40], [40, 40, 200]];
    let one = render_on(1, &surface, &view, &colours, &backdrop);
    for threads in [2, 3, 16] {
        assert_eq!(
            one,
            render_on(threads, &surface, &view, &colours, &backdrop)
        );
    }
    let reds = one.pixels.iter().filter(|[r, _, b]| *r > *b + 40).count();
    let blues = one.pixels.iter().filter(|[r, _, b]| *b > *r + 40).count();
    assert!(reds > 500 && blues > 500, "{reds} {blues}");
}

#[test]
fn lines_of_a_grid_are_1_2_or_5_apart() {
    for (size, spacing) in [
        (12.0, 1.0),
        (13.0, 2.0),
        (40.0, 5.0),
        (0.9, 0.1),
        (7e-4, 1e-4),
    ] {
        let found = round_spacing(size, 12.0);
        assert!((found / spacing - 1.0).abs() < 1e-12, "{size}: {found}");
    }
}
