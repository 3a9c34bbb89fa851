//! Height fields: a grid of elevations, without triangles in memory.
//!
//! Rays go from cell to cell, and skip blocks of cells whose highest corner is below them. Each cell has two triangles, as
//! `HeightField` says. In a cell, u and v are 0 to 1 along x and y:
//!
//! ```text
//! z = z₀₀ + u (z₁₀ - z₀₀) + v (z₁₁ - z₁₀)   where u ≥ v,        z = z₀₀ + u (z₁₁ - z₀₁) + v (z₀₁ - z₀₀)   elsewhere
//! ```

mod march;
mod normals;

use sim_model::geometry::HeightField;

use crate::paint::{Color, Paint};
use crate::vector::Vector;

/// Cells along an edge of a block.
const BLOCK: usize = 8;

/// A height field about the centre of the box around it.
#[derive(Debug)]
pub(crate) struct Field {
    /// Samples along x, and cells along x and y.
    columns: usize,
    cells: [usize; 2],
    /// Lengths of a cell [m].
    cell: [f32; 2],
    /// Half edges of the box around it [m].
    pub(crate) half: Vector,
    /// Elevations, row by row [m].
    heights: Vec<f32>,
    /// The highest corner of each cell [m].
    cell_tops: Vec<f32>,
    /// Of each block of cells [m].
    block_tops: Vec<f32>,
    blocks_across: usize,
    /// Colours of triangles, two of each cell, and then that of walls.
    tones: Vec<Color>,
    chosen: Vec<u8>,
}

impl Field {
    /// A field, and the height of the centre of the box around it in its frame [m].
    pub(crate) fn new(field: &HeightField, paint: &Paint) -> (Field, f32) {
        let [_, high] = field.range();
        let center = (0.5 * (field.bottom + high)) as f32;
        let about = f64::from(center);
        let heights: Vec<f32> = field
            .elevations
            .iter()
            .map(|z| (z - about) as f32)
            .collect();
        let cells = [field.columns - 1, field.rows - 1];
        let columns = field.columns;
        let corners =
            |x: usize, y: usize| [0, 1, columns, columns + 1].map(|k| y * columns + x + k);
        let places = (0..cells[1]).flat_map(|y| (0..cells[0]).map(move |x| (x, y)));
        let cell_tops: Vec<f32> = places
            .clone()
            .map(|(x, y)| {
                corners(x, y)
                    .map(|k| heights[k])
                    .into_iter()
                    .fold(f32::MIN, f32::max)
            })
            .collect();
        let blocks = cells.map(|count| count.div_ceil(BLOCK));
        let mut block_tops = vec![f32::MIN; blocks[0] * blocks[1]];
        for (top, (x, y)) in cell_tops.iter().zip(places.clone()) {
            let block = &mut block_tops[y / BLOCK * blocks[0] + x / BLOCK];
            *block = top.max(*block);
        }
        let (mut tones, mut chosen) = (Vec::new(), Vec::new());
        let [dx, dy] = field.cell();
        for (x, y) in places {
            let at = |k: usize| {
                let (i, j) = (x + k % 2, y + k / 2);
                let z = field.elevations[j * columns + i];
                [
                    dx * i as f64 - field.half[0],
                    dy * j as f64 - field.half[1],
                    z,
                ]
            };
            for triangle in [[0, 1, 3], [0, 3, 2]] {
                let tone = paint.on_field(field, &triangle.map(at));
                let same = |other: &Color| other.map(f32::to_bits) == tone.map(f32::to_bits);
                // a field has at most eight
                let place = tones.iter().position(same).unwrap_or_else(|| {
                    tones.push(tone);
                    tones.len() - 1
                });
                chosen.push(place as u8);
            }
        }
        tones.push(paint.wall());
        let lowest = heights
            .iter()
            .copied()
            .fold(field.bottom as f32 - center, f32::min);
        let highest = heights.iter().copied().fold(f32::MIN, f32::max);
        let field = Field {
            columns,
            cells,
            cell: [dx as f32, dy as f32],
            half: [
                field.half[0] as f32,
                field.half[1] as f32,
                highest.max(-lowest),
            ],
            heights,
            cell_tops,
            block_tops,
            blocks_across: blocks[0],
            tones,
            chosen,
        };
        (field, center)
    }

    /// The colour of a triangle or wall.
    #[inline(always)]
    pub(crate) fn tone(&self, number: u32) -> Color {
        let last = self.tones.len() - 1;
        let chosen = self
            .chosen
            .get(number as usize)
            .map(|&tone| usize::from(tone));
        self.tones[chosen.unwrap_or(last)]
    }
}
