//! Shadows of the key light: how far it reaches, from a small picture of the scene as the light sees it.

use crate::project::{Chunk, Lens, Placed, TILE, project};
use crate::threads;
use crate::tile::{MIDDLE, Seen, seen};

/// Texels along a side.
pub(crate) const SIDE: usize = 1024;

/// How near to the light the nearest surface is, texel by texel.
pub(crate) struct Shadow {
    /// From the world, relative to the picture's eye, to texels and `near`: rows of a matrix, the translation last.
    pub rows: [[f32; 4]; 3],
    /// Width of a texel [m].
    pub texel: f32,
    near: Vec<f32>,
}

impl Shadow {
    /// Of meshes as a light sees them that looks at a square of this half width [m].
    pub fn new(placed: &[Placed], world: [[f32; 4]; 3], half: f32, threads: usize) -> Shadow {
        let lens = Lens {
            width: SIDE,
            height: SIDE,
            half: 0.5 * SIDE as f32,
            perspective: false,
            nearest: 0.0,
        };
        let chunks = project(placed, &lens, threads);
        let columns = lens.columns();
        let tiles = threads::map(threads, lens.tiles(), |tile| {
            let corner = [tile % columns * TILE, tile / columns * TILE];
            is_met(&chunks, tile).then(|| seen(Seen::new(), &chunks, tile, corner, &MIDDLE).0.near)
        });
        let mut near = vec![f32::NEG_INFINITY; SIDE * SIDE];
        for (tile, texels) in tiles.iter().enumerate() {
            let corner = tile / columns * TILE * SIDE + tile % columns * TILE;
            for (row, texels) in texels.iter().flat_map(|t| t.chunks_exact(TILE)).enumerate() {
                let start = corner + row * SIDE;
                near[start..start + TILE].copy_from_slice(texels.as_flattened());
            }
        }
        // as `Lens::screen` without perspective
        let scale = 0.5 * SIDE as f32;
        let [x, y, z] = world;
        let rows = [
            [
                scale * x[0],
                scale * x[1],
                scale * x[2],
                scale * x[3] + scale,
            ],
            [
                -scale * y[0],
                -scale * y[1],
                -scale * y[2],
                scale - scale * y[3],
            ],
            z.map(|part| -part),
        ];
        Shadow {
            rows,
            texel: 2.0 * half / SIDE as f32,
            near,
        }
    }

    /// Which part of the light reaches a point, given relative to the picture's eye; `slack` is how much deeper than the
    /// surface that the light sees it may lie [m].
    pub fn light(&self, point: [f32; 3], slack: f32) -> f32 {
        let [x, y, near] = crate::project::transformed(&self.rows, point);
        let (x, y, near) = (x - 0.5, y - 0.5, near + slack);
        let inside = 1.0..(SIDE - 3) as f32;
        if !inside.contains(&x) || !inside.contains(&y) {
            return 1.0;
        }
        let (column, row) = (x as usize, y as usize);
        let (right, down) = (x - column as f32, y - row as f32);
        let start = (row - 1) * SIDE + column - 1;
        // the mean over a square of three texels around the point: of the 4 × 4 that it meets, the outer ones in part
        let across = [1.0 - right, 1.0, 1.0, right];
        let along = [1.0 - down, 1.0, 1.0, down];
        let mut sum = 0.0;
        for (line, weight) in along.into_iter().enumerate() {
            let texels = &self.near[start + line * SIDE..][..4];
            let lit: f32 = (0..4)
                .map(|k| if texels[k] <= near { across[k] } else { 0.0 })
                .sum();
            sum += weight * lit;
        }
        sum / 9.0
    }
}

fn is_met(chunks: &[Chunk], tile: usize) -> bool {
    chunks
        .iter()
        .any(|chunk| chunk.of_tile(tile).next().is_some())
}

const _: () = assert!(SIDE.is_multiple_of(TILE));
