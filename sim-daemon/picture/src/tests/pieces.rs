//! Large meshes: pieces that are as coarse as their own distance allows, without gaps between them.

use super::{HEIGHT, RED, WIDTH, at, drawn, is_red, shot};
use crate::mesh::Shading;
use crate::{Mesh, View};

/// Cells along a side: more triangles than a mesh of one piece has.
const CELLS: u32 = 360;
/// Side of a cell [m].
const CELL: f32 = 0.1;

/// Waves of this height [m] on a square about the origin.
fn waves(height: f32) -> Mesh {
    let samples = (0..=CELLS).flat_map(|row| (0..=CELLS).map(move |column| [column, row]));
    let vertices: Vec<[f32; 3]> = samples
        .map(|place| {
            let [x, y] = place.map(|k| CELL * (k as f32 - 0.5 * CELLS as f32));
            [x, y, height * (3.0 * x).sin() * (2.0 * y).cos()]
        })
        .collect();
    let mut faces = Vec::new();
    for row in 0..CELLS {
        for column in 0..CELLS {
            let a = row * (CELLS + 1) + column;
            let (b, c) = (a + 1, a + CELLS + 1);
            faces.extend([[a, c + 1, c], [a, b, c + 1]]);
        }
    }
    Mesh::shaded(&vertices, &faces, &vec![RED; faces.len()], Shading::Flat).unwrap()
}

#[test]
fn a_piece_near_the_camera_is_fine_while_one_far_off_is_coarse() {
    let mesh = waves(0.2);
    assert!(mesh.pieces.len() > 4);
    let faces = mesh.pieces.iter().map(|piece| piece.levels[0].faces.len());
    assert_eq!(faces.sum::<usize>(), 2 * (CELLS * CELLS) as usize);
    for piece in &mesh.pieces {
        assert!(piece.radius < 0.5 * CELLS as f32 * CELL);
        assert!(piece.level(0.0) < piece.level(10.0));
    }
}

#[test]
fn nothing_is_seen_through_the_rims_of_pieces() {
    let mut shot = shot(&[]);
    let instances = [at(0, [0.0; 3])];
    shot.instances = &instances;
    shot.reach = 30.0;
    // from above one corner towards the other: near pieces are fine, far ones coarse
    let eye = [-12.0, -12.0, 6.0];
    shot.view = View::looking(eye, [0.0, 0.0, -3.0], [0.0, 0.0, 1.0], 0.5, [WIDTH, HEIGHT]);
    let pixels = drawn(vec![waves(0.05)], &shot);
    let lower = &pixels[WIDTH * HEIGHT / 2..];
    assert_eq!(lower.iter().filter(|&&pixel| !is_red(pixel)).count(), 0);
}
