//! Normals of a field.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use super::Field;
use crate::normals::Points;
use crate::tile::EDGE;
use crate::vector::three;

impl Field {
    /// Normals of triangles and walls by their numbers, of length 1.
    #[inline(always)]
    pub(crate) fn normals(&self, numbers: &[u32; EDGE]) -> Points {
        let (mut x, mut y, mut second) = ([0.0; EDGE], [0.0; EDGE], [0.0; EDGE]);
        let (across, count) = (self.cells[0] as u32, (self.cells[0] * self.cells[1]) as u32);
        let mut is_wall = false;
        for lane in 0..EDGE {
            let cell = numbers[lane] / 2;
            is_wall |= cell >= count;
            x[lane] = (cell % across) as f32;
            y[lane] = (cell / across) as f32;
            second[lane] = (numbers[lane] % 2) as f32;
        }
        let cell = [F32x8::load(&x), F32x8::load(&y)];
        let [low, right, above, both] = self.corners(&cell);
        let is_second = F32x8::k(0.5).lt(F32x8::load(&second));
        let rise_x = F32x8::select(is_second, both - above, right - low);
        let rise_y = F32x8::select(is_second, above - low, both - right);
        let n = [
            -rise_x * F32x8::k(1.0 / self.cell[0]),
            -rise_y * F32x8::k(1.0 / self.cell[1]),
            F32x8::k(1.0),
        ];
        let square = n[0].fma(n[0], n[1].fma(n[1], n[2]));
        let scale = F32x8::k(1.0).div(square.sqrt());
        let normals = three!(k => n[k] * scale);
        match is_wall {
            true => with_walls(&normals, numbers, count),
            false => normals,
        }
    }
}

/// Normals of which some are those of walls or of the bottom.
#[inline(always)]
fn with_walls(normals: &Points, numbers: &[u32; EDGE], count: u32) -> Points {
    let mut lanes = [[0.0; EDGE]; 3];
    for k in 0..3 {
        normals[k].store(&mut lanes[k]);
    }
    for lane in 0..EDGE {
        let cell = numbers[lane] / 2;
        if cell >= count {
            let side = [
                [-1.0, 0.0, 0.0],
                [1.0, 0.0, 0.0],
                [0.0, -1.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, -1.0],
            ][(cell - count).min(4) as usize];
            for k in 0..3 {
                lanes[k][lane] = side[k];
            }
        }
    }
    three!(k => F32x8::load(&lanes[k]))
}
