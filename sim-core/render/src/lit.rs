//! Points of a tile in the frame of a light.
//!
//! All rays to a light from far off are parallel. In a frame whose z points to it, (a, b, c), a ray keeps its a and b. So
//! what may be in the way of points is over the rectangle of their a and b.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::tile::EDGE;
use crate::vector::{each, two};

/// By how much rays begin nearer to the light, relative to the depth: more than the rounding of places.
const AHEAD: f32 = 2e-5;
/// Points of a tile in the frame of a light.
pub(crate) struct Lit {
    /// Coordinates across the light [m].
    pub(crate) a: [[f32; EDGE]; EDGE],
    pub(crate) b: [[f32; EDGE]; EDGE],
    /// Along it [m]; infinite where the light does not arrive, or nothing is seen.
    pub(crate) c: [[f32; EDGE]; EDGE],
}

impl Lit {
    pub(crate) const NONE: Lit = Lit {
        a: [[0.0; EDGE]; EDGE],
        b: [[0.0; EDGE]; EDGE],
        c: [[f32::INFINITY; EDGE]; EDGE],
    };

    /// Keeps the points of a line, `p` in the frame of the light.
    #[inline(always)]
    pub(crate) fn keep(
        &mut self,
        line: usize,
        p: &[F32x8; 3],
        depth: F32x8,
        is_lit: <F32x8 as Num>::Mask,
    ) {
        p[0].store(&mut self.a[line]);
        p[1].store(&mut self.b[line]);
        let ahead = depth.fma(F32x8::k(AHEAD), p[2]);
        F32x8::select(is_lit, ahead, F32x8::k(f32::INFINITY)).store(&mut self.c[line]);
    }

    /// Bounds of the points of each column that the light may reach; none where it reaches no point.
    #[inline(always)]
    pub(crate) fn columns(&self) -> Option<Columns> {
        let endless = F32x8::k(f32::INFINITY);
        let (mut low, mut high) = ([endless; 2], [-endless; 2]);
        let (mut deep, mut lines) = (endless, 0);
        for line in 0..EDGE {
            let c = F32x8::load(&self.c[line]);
            let is_lit = c.lt(endless);
            lines |= u32::from(F32x8::any(is_lit)) << line;
            deep = c.min(deep);
            let places = [F32x8::load(&self.a[line]), F32x8::load(&self.b[line])];
            for k in 0..2 {
                low[k] = F32x8::select(is_lit, places[k], endless).min(low[k]);
                high[k] = F32x8::select(is_lit, places[k], -endless).max(high[k]);
            }
        }
        (lines != 0).then_some(Columns {
            low,
            high,
            deep,
            lines,
        })
    }

    /// Marks points of a line as shaded.
    #[inline(always)]
    pub(crate) fn shade(&mut self, line: usize, is_shaded: <F32x8 as Num>::Mask) {
        let c = F32x8::load(&self.c[line]);
        F32x8::select(is_shaded, F32x8::k(f32::INFINITY), c).store(&mut self.c[line]);
    }
}

/// Least and largest a and b, and least c, of the points of each column of a tile.
pub(crate) struct Columns {
    low: [F32x8; 2],
    high: [F32x8; 2],
    deep: F32x8,
    /// Lines with such points: bits.
    pub(crate) lines: u32,
}

impl Columns {
    /// Whether a box may be over points of any column, between the least and the largest a and b, and up to a c.
    #[inline(always)]
    pub(crate) fn are_below(&self, low: [f32; 2], high: [f32; 2], top: f32) -> bool {
        let is_below = self.low[0].lt(F32x8::k(high[0]))
            & F32x8::k(low[0]).lt(self.high[0])
            & self.low[1].lt(F32x8::k(high[1]))
            & F32x8::k(low[1]).lt(self.high[1])
            & self.deep.lt(F32x8::k(top));
        F32x8::any(is_below)
    }

    /// Bounds of all: ends of a and b, and the least c.
    #[inline(always)]
    pub(crate) fn all(&self) -> ([[f32; 2]; 2], f32) {
        let ends = two!(k => [least(self.low[k]), -least(-self.high[k])]);
        (ends, least(self.deep))
    }
}

#[inline(always)]
fn least(x: F32x8) -> f32 {
    let mut lanes = [0.0; EDGE];
    x.store(&mut lanes);
    let [a, b, c, d] = each!(k in 0 1 2 3 => lanes[k].min(lanes[k + 4]));
    a.min(b).min(c.min(d))
}

/// Points that a tree may shade, close together.
pub(crate) struct Few {
    pub(crate) count: usize,
    /// Coordinates as those of [`Lit`], of groups of eight; what is behind the last point has an infinite c.
    pub(crate) groups: [[[f32; EDGE]; 3]; EDGE],
    /// Least and largest a and b of each group, and of all.
    pub(crate) bounds: [[[f32; 2]; 2]; EDGE],
    pub(crate) all: [[f32; 2]; 2],
    pub(crate) deep: f32,
    /// Where the points are in the tile.
    places: [u8; EDGE * EDGE],
}

impl Default for Few {
    fn default() -> Few {
        Few {
            count: 0,
            groups: [[[0.0; EDGE]; 3]; EDGE],
            bounds: [[[0.0; 2]; 2]; EDGE],
            all: [[0.0; 2]; 2],
            deep: 0.0,
            places: [0; EDGE * EDGE],
        }
    }
}

impl Few {
    /// Groups in use.
    #[inline(always)]
    pub(crate) fn in_use(&self) -> usize {
        self.count.div_ceil(EDGE)
    }

    /// Whether all are.
    #[inline(always)]
    pub(crate) fn is_shaded(&self) -> bool {
        let endless = F32x8::k(f32::INFINITY);
        let mut least = endless;
        for group in 0..self.in_use() {
            least = F32x8::load(&self.groups[group][2]).min(least);
        }
        !F32x8::any(least.lt(endless))
    }

    #[inline(always)]
    pub(crate) fn gather(&mut self, lit: &Lit, chosen: &[u32; EDGE]) {
        const NONE: [[f32; 2]; 2] = [[f32::INFINITY, f32::NEG_INFINITY]; 2];
        (self.count, self.all, self.deep) = (0, NONE, f32::INFINITY);
        let mut ends = NONE;
        for line in 0..EDGE {
            let mut bits = chosen[line];
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & (EDGE - 1);
                bits &= bits - 1;
                let (at, place) = (self.count / EDGE % EDGE, self.count % EDGE);
                let group = &mut self.groups[at];
                let point = [lit.a[line][lane], lit.b[line][lane], lit.c[line][lane]];
                if place == 0 {
                    // what is behind the last point is as the first, and shaded
                    *group = [[point[0]; EDGE], [point[1]; EDGE], [f32::INFINITY; EDGE]];
                    ends = NONE;
                }
                for k in 0..3 {
                    group[k][place] = point[k];
                }
                ends = two!(k => [ends[k][0].min(point[k]), ends[k][1].max(point[k])]);
                self.deep = self.deep.min(point[2]);
                self.bounds[at] = ends;
                self.places[self.count % (EDGE * EDGE)] = (EDGE * line + lane) as u8;
                self.count += 1;
            }
        }
        for group in 0..self.in_use() {
            let ends = self.bounds[group];
            self.all = two!(k => [
                self.all[k][0].min(ends[k][0]),
                self.all[k][1].max(ends[k][1]),
            ]);
        }
    }

    /// Marks those that are shaded now.
    #[inline(always)]
    pub(crate) fn scatter(&self, lit: &mut Lit) {
        for point in 0..self.count {
            let place = usize::from(self.places[point % (EDGE * EDGE)]);
            let c = self.groups[point / EDGE % EDGE][2][point % EDGE];
            lit.c[place / EDGE % EDGE][place % EDGE] = c;
        }
    }
}
