//! Colours of the pixels of a tile, by the equations of `light`.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::light::{BRIGHT, HIGH, HORIZON, Lights, SKY};
use crate::normals::{Points, products, squares};
use crate::scene::Scene;
use crate::shadow::Casters;
use crate::shown::Shown;
use crate::tile::{EDGE, Tile};
use crate::tree::Waiting;
use crate::vector::{Frame, each, three};

impl Lights {
    /// Finds what a tile shows and where light arrives, from the frames of all things and what casts shadows.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn fall(
        &self,
        scene: &Scene,
        frames: &[Frame],
        casters: &mut Casters,
        waiting: &mut Waiting,
        tile: &Tile,
        shown: &mut Shown,
    ) {
        shown.look(self, scene, frames, tile);
        for line in 0..EDGE {
            let facing = F32x8::load(&shown.facing[line]);
            let is_lit = F32x8::k(0.0).lt(facing) & tile.is_seen(line);
            if !F32x8::any(is_lit) {
                shown.lit.c[line] = [f32::INFINITY; EDGE];
                continue;
            }
            let depth = F32x8::load(&tile.depth[line]);
            let towards = tile.directions(&self.key, line);
            let place = three!(k => towards[k] * depth);
            shown.lit.keep(line, &place, depth, is_lit);
        }
        if self.shadows {
            casters.shade(scene, waiting, tile, shown);
        }
    }

    /// Colours of a line of a tile.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn line(&self, tile: &Tile, shown: &Shown, line: usize) -> [[u8; 3]; EDGE] {
        let (zero, one) = (F32x8::k(0.0), F32x8::k(1.0));
        let mut shares = [zero; 3];
        if shown.seen[line] != 0xff {
            let d = tile.rays(line);
            let sine = products(&d, self.up).div(squares(&d).sqrt());
            let t = (sine * F32x8::k(1.0 / HIGH)).max(zero).min(one);
            let share = t * t * (F32x8::k(3.0) - t - t);
            shares = three!(k => {
                let light = share.fma(F32x8::k(SKY[k] - HORIZON[k]), F32x8::k(HORIZON[k]));
                light.sqrt()
            });
        }
        if shown.seen[line] != 0 {
            let arrives = F32x8::load(&shown.lit.c[line]).lt(F32x8::k(f32::INFINITY));
            let facing = F32x8::select(arrives, F32x8::load(&shown.facing[line]), zero);
            // √(colour² amount)
            let around = F32x8::load(&shown.around[line]);
            let root = facing.fma(F32x8::k(BRIGHT), around).sqrt();
            let seen = three!(k => F32x8::load(&shown.colors[line][k]) * root);
            shares = match shown.seen[line] {
                0xff => seen,
                _ => three!(k => F32x8::select(tile.is_seen(line), seen[k], shares[k])),
            };
        }
        bytes(&shares)
    }
}

/// From here on, floats are the whole numbers, in order: the last bits of a sum with it are those of the rounded number.
const WHOLE: f32 = 8_388_608.0;

/// Bytes of shares of the brightest, the same on every processor.
#[inline(always)]
fn bytes(shares: &Points) -> [[u8; 3]; EDGE] {
    let mut lanes = [[0.0; EDGE]; 3];
    for k in 0..3 {
        let share = shares[k].max(F32x8::k(0.0)).min(F32x8::k(1.0));
        share
            .fma(F32x8::k(255.0), F32x8::k(WHOLE))
            .store(&mut lanes[k]);
    }
    each!(lane in 0 1 2 3 4 5 6 7 => three!(k => lanes[k][lane].to_bits() as u8))
}
