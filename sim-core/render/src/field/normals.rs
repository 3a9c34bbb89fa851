//! Normals of a field.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use super::{Field, number};
use crate::normals::Points;
use crate::tile::EDGE;
use crate::vector::three;

impl Field {
    /// Normals of triangles and walls, by their places in a tile, of length 1.
    #[inline(always)]
    pub(crate) fn normals(&self, places: &[f32; EDGE]) -> Points {
        let one = F32x8::k(1.0);
        let place = F32x8::load(places);
        let number = place.abs() - one;
        let (across, count) = (self.cells[0] as f32, self.cells[0] * self.cells[1]);
        // of whole numbers below 2²⁴ the row may be one too small, and never too large; the rest is exact
        let row = (number.div(F32x8::k(across)) - F32x8::k(0.5)).round();
        let column = row.fnma(F32x8::k(across), number);
        let is_within = column.lt(F32x8::k(across));
        let cell = [
            F32x8::select(is_within, column, column - F32x8::k(across)),
            F32x8::select(is_within, row, row + one),
        ];
        let [low, right, above, both] = self.corners(&cell);
        let is_second = place.lt(F32x8::k(0.0));
        let rise_x = F32x8::select(is_second, both - above, right - low);
        let rise_y = F32x8::select(is_second, above - low, both - right);
        let n = [
            -rise_x * F32x8::k(1.0 / self.cell[0]),
            -rise_y * F32x8::k(1.0 / self.cell[1]),
            one,
        ];
        let square = n[0].fma(n[0], n[1].fma(n[1], n[2]));
        let scale = one.div(square.sqrt());
        let normals = three!(k => n[k] * scale);
        let is_wall = !number.lt(F32x8::k(count as f32));
        match F32x8::any(is_wall) {
            true => with_walls(&normals, places, count),
            false => normals,
        }
    }
}

/// Normals of which some are those of walls or of the bottom.
#[inline(always)]
fn with_walls(normals: &Points, places: &[f32; EDGE], count: usize) -> Points {
    let mut lanes = [[0.0; EDGE]; 3];
    for k in 0..3 {
        normals[k].store(&mut lanes[k]);
    }
    for lane in 0..EDGE {
        let cell = number(places[lane]) / 2;
        if cell >= count {
            let side = [
                [-1.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, -1.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, -1.0],
            ][(cell - count).min(4)];
            for k in 0..3 {
                lanes[k][lane] = side[k];
            }
        }
    }
    three!(k => F32x8::load(&lanes[k]))
}
