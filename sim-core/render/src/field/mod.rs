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
mod open;

use sim_model::geometry::HeightField;
use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::normals::Points;
use crate::paint::{Color, Paint};
use crate::tile::EDGE;
use crate::vector::{Vector, three};

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
    /// Cells from which nothing of the field hides the light; none if that is not known.
    open: Vec<bool>,
}

/// Places in a tile: numbers of cells, or of walls after them, from 1 on; negative for the second triangle of a cell.
#[inline(always)]
fn placed(cell: F32x8, second: F32x8) -> F32x8 {
    let place = cell + F32x8::k(1.0);
    F32x8::select(F32x8::k(0.5).lt(second), -place, place)
}

/// The number of a triangle, two of each cell, from its place in a tile.
#[inline(always)]
fn number(place: f32) -> usize {
    2 * (place.abs() - 1.0) as usize + usize::from(place < 0.0)
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
            open: Vec::new(),
        };
        (field, center)
    }

    /// Colours of triangles and walls, by their places in a tile, and which are of open cells: bits.
    #[inline(always)]
    pub(crate) fn colors(&self, places: &[f32; EDGE]) -> (Points, u32) {
        let (mut colors, mut open, last) = ([[0.0; EDGE]; 3], 0, self.tones.len() - 1);
        for lane in 0..EDGE {
            let number = number(places[lane]);
            let tone = match self.chosen.get(number) {
                Some(&tone) => self.tones[usize::from(tone)],
                None => self.tones[last],
            };
            for k in 0..3 {
                colors[k][lane] = tone[k];
            }
            open |= u32::from(self.open.get(number / 2) == Some(&true)) << lane;
        }
        (three!(k => F32x8::load(&colors[k])), open)
    }
}
