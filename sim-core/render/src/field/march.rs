//! Eight rays over a field.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use super::{BLOCK, Field, placed};
use crate::normals::Points;
use crate::tile::{EDGE, Tile};
use crate::vector::{Frame, Vector, three, two};

type Mask = <F32x8 as Num>::Mask;

/// By how much a ray may pass beside a triangle and still meet it, relative to the size of coordinates: some roundings [–].
const SLACK: f32 = 4.0 * f32::EPSILON;
const SMALL: f32 = 1e-18;

/// What eight rays meet.
struct Met {
    /// In units of their directions; infinite where they meet nothing.
    far: F32x8,
    /// The cell, or the last cell and what side of the box comes then; and whether it is the second triangle of a cell.
    cell: F32x8,
    second: F32x8,
}

impl Field {
    /// Shows it, number `thing`, in a tile.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn fill(&self, frame: &Frame, thing: u32, tile: &mut Tile) {
        let origin = frame.turn_back(three!(k => -frame.pos[k]));
        let o = three!(k => F32x8::k(origin[k]));
        for line in 0..EDGE {
            let d = tile.directions(frame, line);
            let limit = F32x8::load(&tile.depth[line]);
            let met = self.cast::<false>(&o, &d, tile.near, limit, F32x8::all());
            let is_met = met.far.lt(limit);
            if !F32x8::any(is_met) {
                continue;
            }
            let places = placed(met.cell, met.second);
            tile.keep_each(line, met.far, is_met, thing, places);
        }
    }

    /// Which rays from `o` along `d`, of those that count, it stops.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn stops(&self, o: &Points, d: Vector, counts: Mask) -> Mask {
        let endless = F32x8::k(f32::INFINITY);
        let d = three!(k => F32x8::k(d[k]));
        let met = self.cast::<true>(o, &d, 0.0, endless, counts);
        met.far.lt(endless)
    }

    /// What rays meet first beyond `near` and before `limit`; with `ANY`, only whether they do counts.
    #[inline(always)]
    fn cast<const ANY: bool>(
        &self,
        o: &Points,
        d: &Points,
        near: f32,
        limit: F32x8,
        counts: Mask,
    ) -> Met {
        let (zero, one) = (F32x8::k(0.0), F32x8::k(1.0));
        let endless = F32x8::k(f32::INFINITY);
        let ends = two!(k => self.cells[k] as f32);
        // in cells along x and y
        let scale = two!(k => F32x8::k(ends[k] / (2.0 * self.half[k])));
        let g = [
            (o[0] + F32x8::k(self.half[0])) * scale[0],
            (o[1] + F32x8::k(self.half[1])) * scale[1],
            o[2],
        ];
        let tiny = F32x8::k(SMALL);
        let e = [d[0] * scale[0], d[1] * scale[1], d[2]];
        let e = three!(k => F32x8::select(e[k].abs().lt(tiny), tiny, e[k]));
        let inverse = three!(k => one.div(e[k]));
        // between the sides of the box
        let high = [F32x8::k(ends[0]), F32x8::k(ends[1]), F32x8::k(self.half[2])];
        let low = [zero, zero, F32x8::k(-self.half[2])];
        let first = three!(k => ((low[k] - g[k]) * inverse[k]).min((high[k] - g[k]) * inverse[k]));
        let last = three!(k => ((low[k] - g[k]) * inverse[k]).max((high[k] - g[k]) * inverse[k]));
        let enter = first[0].max(first[1]).max(first[2]);
        let end = last[0].min(last[1]).min(last[2]).min(limit);
        let mut met = Met {
            far: endless,
            cell: zero,
            second: zero,
        };
        let mut t = enter.max(F32x8::k(near));
        let mut active = counts & t.lt(end);
        if !F32x8::any(active) {
            return met;
        }
        let last_cell = two!(k => F32x8::k(ends[k] - 1.0));
        let mut cell = two!(k => floor(t.fma(e[k], g[k])).max(zero).min(last_cell[k]));
        self.walls(
            &mut met,
            [&g, &e],
            &first,
            enter,
            active & F32x8::k(near).lt(enter),
        );
        active = active & !met.far.lt(endless);
        let is_forward = two!(k => zero.lt(e[k]));
        let ahead = two!(k => F32x8::select(is_forward[k], one, zero));
        let step = two!(k => F32x8::select(is_forward[k], one, -one));
        let size = F32x8::k(BLOCK as f32);
        let wide = F32x8::k(self.half[0] + self.half[1] + self.half[2]);
        let slack = F32x8::k(SLACK) * (o[0].abs() + o[1].abs() + o[2].abs() + wide);
        while F32x8::any(active) {
            // blocks that rays pass above, until all are in one that they may meet
            let mut passing = active;
            let mut block;
            loop {
                block = two!(k => floor_within(cell[k] * F32x8::k(1.0 / BLOCK as f32)));
                let exits = two!(k => {
                    ((block[k] + ahead[k]) * size - g[k]) * inverse[k]
                });
                let exit = exits[0].min(exits[1]);
                let across = F32x8::k(self.blocks_across as f32);
                let top = F32x8::gather(&self.block_tops, block[1].fma(across, block[0]));
                let lowest = t.fma(e[2], g[2]).min(exit.min(end).fma(e[2], g[2]));
                passing = passing & top.lt(lowest - slack);
                if !F32x8::any(passing) {
                    break;
                }
                t = F32x8::select(passing, exit.max(t), t);
                let by_x = exits[0].lt(exits[1]);
                for k in 0..2 {
                    let low = block[k] * size;
                    let within = floor(t.fma(e[k], g[k])).max(low).min(low + size - one);
                    let beyond = F32x8::select(is_forward[k], low + size, low - one);
                    let leaves = if k == 0 { by_x } else { !by_x };
                    let next = F32x8::select(leaves, beyond, within);
                    cell[k] = F32x8::select(passing, next, cell[k]);
                }
                active = active & self.holds(&cell) & t.lt(end);
                passing = passing & active;
                if !F32x8::any(passing) {
                    // where others are now
                    block = two!(k => floor_within(cell[k] * F32x8::k(1.0 / BLOCK as f32)));
                    break;
                }
            }
            // cells, until no ray is in its block. Those that left theirs go on meanwhile: where they pass over corners may
            // depend on the other rays of the line, which are of the same image
            let mut inside = active;
            while F32x8::any(inside) {
                let exits = two!(k => (cell[k] + ahead[k] - g[k]) * inverse[k]);
                let exit = exits[0].min(exits[1]).max(t);
                let lowest = t.fma(e[2], g[2]).min(exit.fma(e[2], g[2]));
                let place = cell[1].fma(F32x8::k(self.cells[0] as f32), cell[0]);
                let top = F32x8::gather(&self.cell_tops, place);
                let is_near = active & !top.lt(lowest - slack);
                if F32x8::any(is_near) {
                    let far = self.meet(&mut met, [&g, &e], &cell, [t, exit], slack, is_near);
                    let is_met = is_near & far.lt(end);
                    active = active & !is_met;
                    met.cell = F32x8::select(is_met, place, met.cell);
                    met.far = F32x8::select(is_met, far, met.far);
                }
                t = F32x8::select(active, exit, t);
                let by_x = exits[0].lt(exits[1]);
                cell[0] = F32x8::select(active & by_x, cell[0] + step[0], cell[0]);
                cell[1] = F32x8::select(active & !by_x, cell[1] + step[1], cell[1]);
                active = active & self.holds(&cell) & t.lt(end);
                let low = two!(k => block[k] * size);
                let is_here = two!(k => !cell[k].lt(low[k]) & cell[k].lt(low[k] + size));
                inside = inside & active & is_here[0] & is_here[1];
            }
            if ANY && !F32x8::any(active) {
                break;
            }
        }
        met
    }

    /// Which cells there are.
    #[inline(always)]
    fn holds(&self, cell: &[F32x8; 2]) -> Mask {
        let within = two!(k => {
            F32x8::k(-0.5).lt(cell[k]) & cell[k].lt(F32x8::k(self.cells[k] as f32 - 0.5))
        });
        within[0] & within[1]
    }

    /// Walls and the bottom, which rays may meet where they enter the box.
    #[inline(always)]
    fn walls(
        &self,
        met: &mut Met,
        [g, e]: [&Points; 2],
        first: &Points,
        enter: F32x8,
        enters: Mask,
    ) {
        let by_top = !first[2].lt(enter) & e[2].lt(F32x8::k(0.0));
        let enters = enters & !by_top;
        if !F32x8::any(enters) {
            return;
        }
        let zero = F32x8::k(0.0);
        let by_z = !first[2].lt(enter);
        let by_x = !by_z & !first[0].lt(enter);
        let place = two!(k => enter.fma(e[k], g[k]).max(zero).min(F32x8::k(self.cells[k] as f32)));
        let height = self.height_at(&place);
        let is_below = !height.lt(enter.fma(e[2], g[2]));
        let is_met = enters & (by_z | is_below);
        // from low x, high x, low y, high y, and below
        let one = F32x8::k(1.0);
        let side_x = F32x8::select(zero.lt(e[0]), zero, one);
        let side_y = F32x8::select(zero.lt(e[1]), one + one, F32x8::k(3.0));
        let side = F32x8::select(by_x, side_x, side_y);
        let side = F32x8::select(by_z, F32x8::k(4.0), side);
        let count = F32x8::k((self.cells[0] * self.cells[1]) as f32);
        met.far = F32x8::select(is_met, enter, met.far);
        met.cell = F32x8::select(is_met, count + side, met.cell);
    }

    /// Heights of the four corners of cells: at low x and y, high x, high y, and both high.
    #[inline(always)]
    pub(super) fn corners(&self, cell: &[F32x8; 2]) -> [F32x8; 4] {
        let columns = F32x8::k(self.columns as f32);
        let low = cell[1].fma(columns, cell[0]);
        let (one, high) = (F32x8::k(1.0), low + columns);
        [
            F32x8::gather(&self.heights, low),
            F32x8::gather(&self.heights, low + one),
            F32x8::gather(&self.heights, high),
            F32x8::gather(&self.heights, high + one),
        ]
    }

    /// Heights at places in cells along x and y.
    #[inline(always)]
    fn height_at(&self, place: &[F32x8; 2]) -> F32x8 {
        let last = two!(k => F32x8::k(self.cells[k] as f32 - 1.0));
        let cell = two!(k => floor(place[k]).max(F32x8::k(0.0)).min(last[k]));
        let [low, x, y, both] = self.corners(&cell);
        let (u, v) = (place[0] - cell[0], place[1] - cell[1]);
        let first = u.fma(x - low, v.fma(both - x, low));
        let second = u.fma(both - y, v.fma(y - low, low));
        F32x8::select(u.lt(v), second, first)
    }

    /// Where rays meet the triangles of cells between two places.
    #[inline(always)]
    fn meet(
        &self,
        met: &mut Met,
        [g, e]: [&Points; 2],
        cell: &[F32x8; 2],
        [from, to]: [F32x8; 2],
        slack: F32x8,
        is_near: Mask,
    ) -> F32x8 {
        let endless = F32x8::k(f32::INFINITY);
        let [low, x, y, both] = self.corners(cell);
        let start = two!(k => g[k] - cell[k]);
        // where u = v
        let (apart, along) = (start[0] - start[1], e[0] - e[1]);
        let tiny = F32x8::k(SMALL);
        let along = F32x8::select(along.abs().lt(tiny), tiny, along);
        let middle = (-apart).div(along);
        let is_later = F32x8::k(0.0).lt(along);
        let (late, early) = ([from.max(middle), to], [from, to.min(middle)]);
        let mut nearest = endless;
        for second in 0..2 {
            let slope = match second {
                0 => [x - low, both - x],
                _ => [both - y, y - low],
            };
            let is_late = if second == 0 { is_later } else { !is_later };
            let ends = two!(k => F32x8::select(is_late, late[k], early[k]));
            // how far the ray is above the plane: height + t fall
            let height = start[0].fnma(slope[0], start[1].fnma(slope[1], g[2] - low));
            let fall = e[0].fnma(slope[0], e[1].fnma(slope[1], e[2]));
            let t = (-height).div(fall);
            let is_met = is_near
                & fall.lt(F32x8::k(0.0))
                & !ends[1].lt(ends[0])
                & (-slack).lt(ends[0].fma(fall, height))
                & ends[1].fma(fall, height).lt(slack);
            let t = F32x8::select(is_met, t.max(ends[0]).min(ends[1]), endless);
            let is_first = t.lt(nearest);
            met.second = F32x8::select(is_first, F32x8::k(second as f32), met.second);
            nearest = t.min(nearest);
        }
        nearest
    }
}

/// The largest whole number that is not larger; at whole numbers perhaps the one before.
#[inline(always)]
fn floor(x: F32x8) -> F32x8 {
    (x - F32x8::k(0.5)).round()
}

/// Of whole numbers over the size of a block.
#[inline(always)]
fn floor_within(x: F32x8) -> F32x8 {
    (x - F32x8::k(0.5 - 0.5 / BLOCK as f32)).round()
}
