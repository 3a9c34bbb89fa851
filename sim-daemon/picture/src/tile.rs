//! Who is seen in a tile: the nearest triangle at each of four samples a pixel, and the nearest translucent one before it.

use crate::cover::{SUB, cover};
use crate::project::{Chunk, TILE, Triangle};

/// Samples of a pixel in 16ths of it: no two share a row or a column, so that edges of any slope are smooth.
pub(crate) const SAMPLES: [[i64; 2]; 4] = [[6, 2], [14, 6], [2, 10], [10, 14]];
/// One sample, in the middle.
pub(crate) const MIDDLE: [[i64; 2]; 1] = [[8, 8]];

/// Nothing is seen.
pub(crate) const NOBODY: u32 = u32::MAX;
/// The floor is.
pub(crate) const FLOOR: u32 = u32::MAX - 1;

/// The nearest triangles of the pixels of a tile, row by row.
#[derive(Clone)]
pub(crate) struct Seen<const COUNT: usize> {
    pub near: Vec<[f32; COUNT]>,
    pub who: Vec<[u32; COUNT]>,
}

impl<const COUNT: usize> Seen<COUNT> {
    pub fn new() -> Seen<COUNT> {
        Seen {
            near: vec![[f32::NEG_INFINITY; COUNT]; TILE * TILE],
            who: vec![[NOBODY; COUNT]; TILE * TILE],
        }
    }

    /// Draws a triangle where it is nearer than what is seen; `corner` is the tile's first pixel.
    pub fn draw(
        &mut self,
        number: u32,
        triangle: &Triangle,
        corner: [usize; 2],
        samples: &[[i64; 2]; COUNT],
    ) {
        let [left, top] = corner.map(|pixel| pixel as i64);
        let side = TILE as i64;
        let [first, right, down] = triangle.near;
        let [low, high] = triangle.range;
        let [from_x, from_y] = triangle.corners[0].map(i64::from);
        // how near each sample is to the right and below of a pixel's corner
        let within = samples.map(|[x, y]| right * (x - from_x) as f32 + down * (y - from_y) as f32);
        let corners = triangle.corners.map(|corner| corner.map(i64::from));
        cover(
            &corners,
            samples,
            left..left + side,
            top..top + side,
            |x, y, inside, _, _| {
                let pixel = ((y - top) * side + x - left) as usize;
                let at = first + right * (x * SUB) as f32 + down * (y * SUB) as f32;
                let (near, who) = (&mut self.near[pixel], &mut self.who[pixel]);
                for k in 0..COUNT {
                    let here = (at + within[k]).max(low).min(high);
                    let nearer = inside[k] & (here > near[k]);
                    near[k] = if nearer { here } else { near[k] };
                    who[k] = if nearer { number } else { who[k] };
                }
            },
        );
    }
}

/// The nearest of all triangles, the opaque ones and the others apart; the second only if there are any.
pub(crate) fn seen<const COUNT: usize>(
    mut opaque: Seen<COUNT>,
    chunks: &[Chunk],
    tile: usize,
    corner: [usize; 2],
    samples: &[[i64; 2]; COUNT],
) -> (Seen<COUNT>, Option<Seen<COUNT>>) {
    let mut through: Option<Seen<COUNT>> = None;
    for chunk in chunks {
        for (number, triangle) in chunk.of_tile(tile) {
            let layer = if triangle.translucent {
                through.get_or_insert_with(Seen::new)
            } else {
                &mut opaque
            };
            layer.draw(number, triangle, corner, samples);
        }
    }
    (opaque, through)
}
