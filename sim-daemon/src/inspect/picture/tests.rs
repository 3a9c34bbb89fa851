//! The shapes of a robot as meshes, against geometry that can be worked out by hand.

use sim_model::geometry::triangles;
use sim_model::{Pose, Shape};
use sim_picture::View;

use super::Drawing;
use super::canvas::{Canvas, PAPER};
use super::paper::round_spacing;
use super::solids::Solids;

const RED: [u8; 3] = [200, 40, 40];
const BLUE: [u8; 3] = [40, 40, 200];

#[test]
fn shapes_are_drawn_at_their_frames_in_the_colours_of_their_links() {
    let half_extents = [0.3, 0.1, 0.1];
    let long = triangles(&Shape::Box { half_extents });
    let ball = triangles(&Shape::Sphere { radius: 0.1 });
    // a quarter turn about z: the box is long along y
    let turned = Pose {
        pos: [1000.0, 0.0, 0.0],
        quat: [0.0, 0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt()],
    };
    let solids = Solids::new(
        &[(1, turned, long), (0, Pose::at([1000.5, 0.0, 0.0]), ball)],
        &[],
        &[RED, BLUE],
    );
    let expected = [[999.9, -0.3, -0.1], [1000.6, 0.3, 0.1]];
    for (actual, expected) in solids
        .extent
        .as_flattened()
        .iter()
        .zip(expected.as_flattened())
    {
        // a ball's facets reach its surface only at their corners
        assert!((actual - expected).abs() < 1e-3, "{:?}", solids.extent);
    }
    let points = solids.points.iter().copied();
    let [above, up] = [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0]];
    let view = View::fitted(above, up, false, [300, 300], [20.0; 2], points);
    let paper = Canvas::new(300, 300, PAPER);
    let picture = solids.render(&view, None, &paper);
    let at = |x: f64, y: f64| {
        let [column, row, _] = view.project([x, y, 0.0]);
        picture.pixels[row as usize * picture.width + column as usize]
    };
    let is_blue = |[red, _, blue]: [u8; 3]| blue > red + 40;
    let is_red = |[red, _, blue]: [u8; 3]| red > blue + 40;
    for y in [-0.28, 0.0, 0.28] {
        assert!(is_blue(at(1000.0, y)), "{y}");
    }
    assert!(is_red(at(1000.5, 0.0)));
    // between them, and where the box would be without its turn
    assert_eq!([at(1000.25, 0.0), at(999.85, 0.0)], [PAPER; 2]);
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
        let rounded = round_spacing(size, 12.0);
        assert!((rounded / spacing - 1.0).abs() < 1e-12, "{size}: {rounded}");
    }
}

#[test]
fn what_is_around_a_robot_leaves_its_views_as_they_are() {
    let ball = |radius| triangles(&Shape::Sphere { radius });
    let mut drawing = Drawing {
        links: vec!["world".to_owned(), "ball".to_owned()],
        frames: vec![(Pose::identity(), None), (Pose::identity(), Some(0))],
        shapes: vec![(1, Pose::identity(), ball(1.0))],
        ..Drawing::default()
    };
    let alone = drawing.render();
    // far behind the ball as the side sees it
    drawing.surroundings = vec![(0, Pose::at([0.0, 500.0, 400.0]), ball(50.0))];
    let with = drawing.render();
    let [left, top] = [1070, 80];
    for y in top..top + 350 {
        for x in left..left + 500 {
            let at = y * alone.width + x;
            assert_eq!(alone.pixels[at], with.pixels[at], "{x} {y}");
        }
    }
}
