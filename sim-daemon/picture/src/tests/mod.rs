//! Pictures against geometry that can be worked out by hand.

mod cover;
mod lamps;
mod light;
mod normals;
mod pieces;
mod view;

use crate::vector::Vector;
use crate::{Instance, Line, Mesh, MeshError, Renderer, Rgb, Shot, View};

const RED: [u8; 4] = [210, 30, 30, 255];
const BLUE: [u8; 4] = [30, 30, 210, 255];
const WIDTH: usize = 200;
const HEIGHT: usize = 150;

/// Vertices and triangles of a ball at the origin, with so many triangles from pole to pole.
fn ball_triangles(radius: f32, count: u32) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let mut vertices = Vec::new();
    for i in 0..=count {
        for j in 0..2 * count {
            let [a, b] = [i, j].map(|k| std::f32::consts::PI * k as f32 / count as f32);
            vertices.push([a.sin() * b.cos(), a.sin() * b.sin(), a.cos()].map(|x| radius * x));
        }
    }
    let ring = 2 * count;
    let corner = |i: u32, j: u32| i * ring + j % ring;
    let mut faces = Vec::new();
    for i in 0..count {
        for j in 0..ring {
            faces.push([corner(i, j), corner(i + 1, j), corner(i, j + 1)]);
            faces.push([corner(i, j + 1), corner(i + 1, j), corner(i + 1, j + 1)]);
        }
    }
    (vertices, faces)
}

fn ball(radius: f32, count: u32, colour: [u8; 4]) -> Mesh {
    let (vertices, faces) = ball_triangles(radius, count);
    Mesh::new(&vertices, &faces, &vec![colour; faces.len()]).unwrap()
}

/// A square in the plane z = 0 with this half width.
fn sheet(half: f32, colour: [u8; 4]) -> Mesh {
    let corners = [[-half, -half], [half, -half], [half, half], [-half, half]];
    let vertices = corners.map(|[x, y]| [x, y, 0.0]);
    Mesh::new(&vertices, &[[0, 1, 2], [0, 2, 3]], &[colour; 2]).unwrap()
}

fn at(mesh: usize, [x, y, z]: Vector) -> Instance {
    Instance {
        mesh,
        pose: [x, y, z, 0.0, 0.0, 0.0, 1.0],
        tint: [0; 4],
        opacity: 1.0,
    }
}

/// From in front and above, towards the origin.
fn view() -> View {
    let eye = [2.0, -1.5, 1.0];
    View::looking(eye, [0.0; 3], [0.0, 0.0, 1.0], 0.6, [WIDTH, HEIGHT])
}

fn shot(instances: &[Instance]) -> Shot<'_> {
    Shot {
        view: view(),
        instances,
        lines: &[],
        lamps: &[],
        floor: None,
        backdrop: None,
        outlines: false,
        middle: [0.0; 3],
        reach: 1.5,
    }
}

fn drawn(meshes: Vec<Mesh>, shot: &Shot) -> Vec<Rgb> {
    let mut renderer = Renderer::new(2);
    for mesh in meshes {
        renderer.add(mesh);
    }
    renderer.render(shot)
}

fn is_red([red, green, blue]: Rgb) -> bool {
    i32::from(red) > i32::from(green.max(blue)) + 25
}

fn is_blue([red, green, blue]: Rgb) -> bool {
    i32::from(blue) > i32::from(green.max(red)) + 25
}

/// How many pixels there are of a kind, and their middle.
fn spot(pixels: &[Rgb], kind: impl Fn(Rgb) -> bool) -> (f64, [f64; 2]) {
    let (mut count, mut sum) = (0.0, [0.0; 2]);
    for (index, &pixel) in pixels.iter().enumerate() {
        if kind(pixel) {
            count += 1.0;
            sum[0] += (index % WIDTH) as f64 + 0.5;
            sum[1] += (index / WIDTH) as f64 + 0.5;
        }
    }
    (count, sum.map(|part| part / count))
}

#[test]
fn a_ball_is_seen_where_it_is_and_as_large_as_it_is() {
    // the last one is shown by a coarser copy
    for (place, count) in [
        ([0.0, 0.0, 0.0], 24),
        ([0.3, 0.2, -0.2], 24),
        ([-4.0, 3.0, -2.0], 120),
    ] {
        let radius = 0.2;
        let pixels = drawn(vec![ball(radius, count, RED)], &shot(&[at(0, place)]));
        let (area, middle) = spot(&pixels, is_red);
        let [x, y, near] = view().project(place);
        assert!((middle[0] - x).abs() < 0.5 && (middle[1] - y).abs() < 0.5);
        let seen = f64::from(radius) * view().scale * near;
        let round = std::f64::consts::PI * seen * seen;
        // half a pixel around the rim, where it is mixed with the sky
        let rim = 0.5 * std::f64::consts::TAU * seen;
        assert!((area - round).abs() < rim, "{area} of {round}");
    }
}

#[test]
fn what_is_nearer_hides_what_is_behind_in_any_order() {
    // towards the camera
    let near = at(0, [0.4, -0.3, 0.2]);
    let far = at(1, [0.0; 3]);
    let meshes = || vec![ball(0.25, 24, RED), ball(0.25, 24, BLUE)];
    let first = drawn(meshes(), &shot(&[near, far]));
    let other = drawn(meshes(), &shot(&[far, near]));
    assert_eq!(first, other);
    let (reds, _) = spot(&first, is_red);
    let (blues, _) = spot(&first, is_blue);
    assert!(reds > 1000.0 && blues == 0.0, "{reds} {blues}");
}

#[test]
fn a_picture_is_the_same_on_any_number_of_threads() {
    let mut through = at(1, [0.2, -0.4, 0.1]);
    through.opacity = 0.4;
    let instances = [at(0, [0.0; 3]), at(1, [0.1, 0.3, 0.0]), through];
    let line = Line {
        ends: [[0.0; 3], [0.5, 0.0, 0.5]],
        colour: BLUE,
        width: 3.0,
    };
    let shot = Shot {
        lines: &[line],
        floor: Some([-0.3, 0.1]),
        ..shot(&instances)
    };
    let render = |threads| {
        let mut renderer = Renderer::new(threads);
        renderer.add(ball(0.25, 120, RED));
        renderer.add(ball(0.2, 16, BLUE));
        renderer.render(&shot)
    };
    let expected = render(1);
    for threads in [2, 3, 16] {
        assert!(expected == render(threads), "{threads} threads");
    }
}

#[test]
fn a_scene_far_from_the_origin_is_the_same_picture() {
    // a power of two, so that places are exact
    let away = [16384.0, -8192.0, 4096.0];
    let moved = |place: Vector| std::array::from_fn(|axis| place[axis] + away[axis]);
    let place = [0.25, 0.5, 0.125];
    let here = drawn(vec![ball(0.25, 24, RED)], &shot(&[at(0, place)]));
    let mut there = view();
    there.eye = moved(there.eye);
    let instances = [at(0, moved(place))];
    let shot = Shot {
        view: there,
        middle: away,
        ..shot(&instances)
    };
    assert!(here == drawn(vec![ball(0.25, 24, RED)], &shot));
}

#[test]
fn a_sheet_that_runs_past_the_camera_covers_all_below_the_horizon() {
    let level = View::looking(
        [0.0, 0.0, 0.5],
        [0.0, 1.0, 0.5],
        [0.0, 0.0, 1.0],
        1.0,
        [WIDTH, HEIGHT],
    );
    let instances = [at(0, [0.0; 3])];
    let shot = Shot {
        view: level,
        ..shot(&instances)
    };
    let pixels = drawn(vec![sheet(1e4, RED)], &shot);
    for (index, &pixel) in pixels.iter().enumerate() {
        // the horizon is the middle, and what is 10 km away lies within a pixel of it
        let row = index / WIDTH;
        if row.abs_diff(HEIGHT / 2) > 1 {
            assert_eq!(is_red(pixel), row > HEIGHT / 2, "pixel {index}");
        }
    }
}

#[test]
fn a_ball_casts_its_shadow_on_the_floor_away_from_the_light() {
    let key = crate::shade::KEY;
    let instances = [at(0, [0.0, 0.0, 0.3])];
    let with = Shot {
        floor: Some([-0.2, 10.0]),
        ..shot(&instances)
    };
    let without = Shot {
        instances: &[],
        ..with.clone()
    };
    let meshes = || vec![ball(0.15, 24, RED)];
    let (with, without) = (drawn(meshes(), &with), drawn(meshes(), &without));
    let darkness = |[x, y]: [f64; 2]| {
        let [column, row, _] = view().project([x, y, -0.2]);
        let pixel = row as usize * WIDTH + column as usize;
        i32::from(without[pixel][1]) - i32::from(with[pixel][1])
    };
    // from the ball half a metre down along the light
    let below = [-0.5 * key[0] / key[2], -0.5 * key[1] / key[2]];
    assert!(darkness(below) > 25, "{}", darkness(below));
    assert_eq!(darkness([below[0] + 0.4, below[1]]), 0);
    assert_eq!(darkness([below[0], below[1] - 0.35]), 0);
}

#[test]
fn a_ghost_shows_what_is_behind_it() {
    let mut ghost = at(0, [0.4, -0.3, 0.2]);
    let back = at(1, [0.0; 3]);
    let meshes = || vec![ball(0.3, 24, RED), ball(0.15, 24, BLUE)];
    let middle = HEIGHT / 2 * WIDTH + WIDTH / 2;
    let behind = drawn(meshes(), &shot(&[back]))[middle];
    let before = drawn(meshes(), &shot(&[ghost]))[middle];
    ghost.opacity = 0.4;
    let both = drawn(meshes(), &shot(&[ghost, back]))[middle];
    for part in 0..3 {
        // light adds up, and a byte is its square root
        let light = |pixel: Rgb| f64::from(pixel[part]).powi(2);
        let mixed = (0.4 * light(before) + 0.6 * light(behind)).sqrt();
        // each picture is rounded, and no shadow falls from a ghost
        assert!((f64::from(both[part]) - mixed).abs() < 3.0, "{both:?}");
    }
    ghost.opacity = 0.0;
    assert_eq!(drawn(meshes(), &shot(&[ghost, back]))[middle], behind);
}

#[test]
fn a_line_is_drawn_from_end_to_end_and_fainter_behind_a_surface() {
    let line = |ends| Line {
        ends,
        colour: [0, 255, 0, 255],
        width: 4.0,
    };
    let front = [line([[0.0, -0.5, 0.0], [0.0, 0.5, 0.0]])];
    let open = Shot {
        lines: &front,
        ..shot(&[])
    };
    let hidden = Shot {
        instances: &[at(0, [0.0; 3])],
        ..open.clone()
    };
    let (open, hidden) = (
        drawn(vec![], &open),
        drawn(vec![ball(0.2, 24, RED)], &hidden),
    );
    let pixel = |place: Vector| {
        let [x, y, _] = view().project(place);
        y as usize * WIDTH + x as usize
    };
    for y in [-0.45, 0.0, 0.45] {
        assert_eq!(open[pixel([0.0, y, 0.0])], [0, 255, 0], "{y}");
    }
    let [red, green, _] = hidden[pixel([0.0; 3])];
    assert!(red > green && green > 100, "{red} {green}");
    assert_eq!(hidden[pixel([0.0, -0.45, 0.0])], [0, 255, 0]);
    // wholly behind the camera
    let behind = [line([[4.0, -3.0, 2.0], [6.0, -3.0, 2.0]])];
    let none = Shot {
        lines: &behind,
        ..shot(&[])
    };
    assert!(drawn(vec![], &none) == drawn(vec![], &shot(&[])));
}

#[test]
fn an_open_surface_is_seen_from_both_sides_and_a_quaternion_turns_it() {
    let mut turned = at(0, [0.0; 3]);
    // a quarter turn about x: the sheet faces the camera, or shows its back
    for side in [1.0, -1.0] {
        turned.pose[3..].copy_from_slice(&[side * 0.5_f64.sqrt(), 0.0, 0.0, 0.5_f64.sqrt()]);
        let pixels = drawn(vec![sheet(0.3, RED)], &shot(&[turned]));
        let corner = |x: f64, z: f64| {
            let [column, row, _] = view().project([x, 0.0, z]);
            pixels[row as usize * WIDTH + column as usize]
        };
        for (x, z) in [(0.28, 0.28), (-0.28, 0.28), (0.28, -0.28), (-0.28, -0.28)] {
            assert!(is_red(corner(x, z)), "{side} ({x}, {z})");
        }
        assert!(!is_red(corner(0.33, 0.33)) && !is_red(corner(-0.33, 0.0)));
    }
}

#[test]
fn without_perspective_near_and_far_are_as_large() {
    let size = [WIDTH, HEIGHT];
    let corners = [[-1.0, -1.0, 0.0], [1.0, 1.0, 0.0]];
    let view = View::fitted(
        [0.0, 0.0, -1.0],
        [0.0, 1.0, 0.0],
        false,
        size,
        [0.0; 2],
        corners.into_iter(),
    );
    // also behind the point that the view calls its eye
    for height in [-40.0, 0.0, 40.0] {
        let place = [0.3, 0.2, height];
        let instances = [at(0, place)];
        let shot = Shot {
            view,
            ..shot(&instances)
        };
        let pixels = drawn(vec![ball(0.2, 24, RED)], &shot);
        let (area, middle) = spot(&pixels, is_red);
        let [x, y, _] = view.project(place);
        assert!((middle[0] - x).abs() < 0.5 && (middle[1] - y).abs() < 0.5);
        let seen = 0.2 * view.scale;
        let round = std::f64::consts::PI * seen * seen;
        let rim = 0.5 * std::f64::consts::TAU * seen;
        assert!((area - round).abs() < rim, "{area} of {round}");
    }
    // the higher one hides the lower one
    let instances = [at(0, [0.3, 0.2, -1.0]), at(1, [0.3, 0.2, 1.0])];
    let shot = Shot {
        view,
        ..shot(&instances)
    };
    let meshes = vec![ball(0.2, 24, RED), ball(0.25, 24, BLUE)];
    let pixels = drawn(meshes, &shot);
    assert!(spot(&pixels, is_red).0 == 0.0 && spot(&pixels, is_blue).0 > 100.0);
}

#[test]
fn a_backdrop_is_seen_where_nothing_else_is() {
    let backdrop: Vec<Rgb> = (0..WIDTH * HEIGHT)
        .map(|pixel| [(pixel % 251) as u8, (pixel % 241) as u8, 7])
        .collect();
    let instances = [at(0, [0.0; 3])];
    let shot = Shot {
        backdrop: Some(&backdrop),
        ..shot(&instances)
    };
    let pixels = drawn(vec![ball(0.2, 24, RED)], &shot);
    let [x, y, near] = view().project([0.0; 3]);
    let radius = 0.2 * view().scale * near;
    for (index, (pixel, behind)) in pixels.iter().zip(&backdrop).enumerate() {
        let [column, row] = [index % WIDTH, index / WIDTH].map(|k| k as f64 + 0.5);
        let away = (column - x).hypot(row - y);
        // pixels at the rim are mixed
        if away > radius + 2.0 {
            // light is the square of a byte, and back: the same byte
            assert_eq!(pixel, behind, "{index}");
        } else if away < radius - 2.0 {
            assert!(is_red(*pixel), "{index}");
        }
    }
}

#[test]
fn outlines_part_meshes_of_one_colour_and_lie_on_the_nearer_one() {
    let near = at(0, [0.4, -0.3, 0.2]);
    let instances = [near, at(1, [0.0, 0.1, 0.0])];
    let meshes = || vec![ball(0.1, 24, RED), ball(0.4, 24, RED)];
    let plain = shot(&instances);
    let outlined = Shot {
        outlines: true,
        ..plain.clone()
    };
    let (plain, outlined) = (drawn(meshes(), &plain), drawn(meshes(), &outlined));
    let place = |instance: &Instance| {
        let [x, y, z, ..] = instance.pose;
        view().project([x, y, z])
    };
    let [x, y, depth] = place(&near);
    let radius = 0.1 * view().scale * depth;
    let mut dark = 0;
    for (index, (plain, outlined)) in plain.iter().zip(&outlined).enumerate() {
        let [column, row] = [index % WIDTH, index / WIDTH].map(|k| k as f64 + 0.5);
        let away = (column - x).hypot(row - y);
        if away < radius - 2.5 {
            assert_eq!(plain, outlined, "inside: {index}");
        } else if away < radius + 0.5 && outlined[0] < plain[0] / 2 {
            dark += 1;
        } else if away > radius + 1.5 && away < radius + 4.0 {
            assert_eq!(plain, outlined, "on the ball behind: {index}");
        }
    }
    // a line around it, a pixel wide
    assert!(
        f64::from(dark) > 0.6 * std::f64::consts::TAU * radius,
        "{dark}"
    );
}

#[test]
fn a_closed_mesh_that_faces_inwards_looks_the_same() {
    let vertices = [
        [0.3, 0.0, 0.0],
        [-0.2, 0.2, 0.0],
        [-0.2, -0.2, 0.0],
        [0.0, 0.0, 0.3],
    ];
    let faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let inwards = faces.map(|[a, b, c]| [a, c, b]);
    let [out, inside] = [faces, inwards].map(|faces| {
        let mesh = Mesh::new(&vertices, &faces, &[RED; 4]).unwrap();
        drawn(vec![mesh], &shot(&[at(0, [0.0; 3])]))
    });
    let differ = out.iter().zip(&inside).filter(|(a, b)| a != b).count();
    // where samples lie on an edge of two triangles, either may be seen
    assert!(spot(&out, is_red).0 > 500.0 && differ < 20, "{differ}");
}

#[test]
fn triangles_that_are_no_mesh_are_refused() {
    let vertices = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let bad = [[0.0; 3], [f32::NAN, 0.0, 0.0]];
    let face = [[0, 1, 2]];
    assert_eq!(Mesh::new(&bad, &[], &[]).unwrap_err(), MeshError::Vertex(1));
    let beyond = Mesh::new(&vertices, &[[0, 1, 3]], &[RED]);
    assert_eq!(beyond.unwrap_err(), MeshError::Triangle(0));
    let uncoloured = Mesh::new(&vertices, &face, &[]);
    assert_eq!(uncoloured.unwrap_err(), MeshError::Colours);
    // nothing at all is a mesh, and a picture of it one of the sky
    let nothing = Mesh::new(&[], &[], &[]).unwrap();
    let empty = drawn(vec![nothing], &shot(&[at(0, [0.0; 3])]));
    assert!(empty == drawn(vec![], &shot(&[])));
}
