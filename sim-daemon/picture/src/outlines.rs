//! Dark lines where what is seen changes from one mesh to another, so that shapes of one colour stay apart.

use crate::Rgb;
use crate::project::{Chunk, Placed, find};
use crate::tile::{FLOOR, NOBODY, Seen};

/// How dark a line is, from 0 to 1.
const INK: f32 = 0.7;

/// What is seen at a sample: which placed mesh, none on the floor and beyond, and how near it is.
#[derive(Clone, Copy)]
pub(crate) struct Surface {
    placed: u32,
    near: f32,
}

impl Surface {
    pub const NONE: Surface = Surface {
        placed: u32::MAX,
        near: f32::NEG_INFINITY,
    };

    /// Whether a line lies on it where it meets another: the nearer one bears it, so that it is one pixel wide.
    fn is_edge(&self, other: &Surface) -> bool {
        self.placed != other.placed && self.near > other.near
    }
}

/// The surfaces of a tile, row by row.
pub(crate) fn surfaces(seen: &Seen<4>, chunks: &[Chunk], placed: &[Placed]) -> Vec<[Surface; 4]> {
    let mut last = (NOBODY, u32::MAX);
    let pixels = seen.who.iter().zip(&seen.near);
    let surface = |(who, near): (&[u32; 4], &[f32; 4])| {
        std::array::from_fn(|k| {
            if matches!(who[k], NOBODY | FLOOR) {
                return Surface::NONE;
            }
            // neighbours mostly see one triangle
            if who[k] != last.0 {
                let piece = find(chunks, who[k]).placed;
                last = (who[k], placed[piece as usize].look);
            }
            Surface {
                placed: last.1,
                near: near[k],
            }
        })
    };
    pixels.map(surface).collect()
}

/// Draws the lines over a picture of this width.
pub(crate) fn draw(pixels: &mut [Rgb], surfaces: &[[Surface; 4]], width: usize) {
    for index in 0..pixels.len() {
        let column = index % width;
        let beside = [
            (column > 0).then(|| index - 1),
            (column + 1 < width).then(|| index + 1),
            index.checked_sub(width),
            (index + width < pixels.len()).then_some(index + width),
        ];
        let surface = &surfaces[index];
        let is_edge = |k: &usize| {
            let mut others = beside.iter().flatten().map(|&other| &surfaces[other][*k]);
            others.any(|other| surface[*k].is_edge(other))
        };
        let share = (0..4).filter(is_edge).count() as f32 / 4.0;
        if share > 0.0 {
            let left = 1.0 - INK * share;
            pixels[index] = pixels[index].map(|part| (f32::from(part) * left + 0.5) as u8);
        }
    }
}
