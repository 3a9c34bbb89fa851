//! Cameras.

use crate::View;

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
