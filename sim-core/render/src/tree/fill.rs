//! A tile through a tree.
//!
//! All rays of an image begin at one point o. So what a triangle needs of a ray is linear in its direction d, and in the
//! pixel's place:
//!
//! ```text
//! A = -n·d,  G = n·o - h                       the ray meets the plane at G / A
//! u A = ((ũ·o + u₀) (-n) + G ũ)·d              as v A: the signs tell whether it is inside
//! ```
//!
//! A tile goes down the tree as a whole, between the four planes through its edges, to the nearest leaves first. A few
//! leaves are drawn triangle by triangle, a line of eight rays at once. Where there are more of them than pays, each ray
//! goes down by itself.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use super::cast::{Origin, Stack, products};
use super::{LEAF, Leaf, Node, Tree};
use crate::tile::{EDGE, Tile};
use crate::vector::{Frame, Vector, three};

/// Most leaves that are drawn triangle by triangle.
const LEAVES_MAX: usize = 64;

/// Memory for what waits on the way down.
#[derive(Default)]
pub(crate) struct Waiting {
    pub(super) stack: Stack,
    /// Leaves that a tile may see, with their least depths.
    near: Vec<(f32, u32)>,
    /// Leaves that points may be below.
    pub(super) leaves: Vec<u32>,
}

/// Four planes through the camera, beside the rays of a tile, and the direction in which it looks.
pub(crate) struct Bundle {
    sides: [Vector; 4],
    /// Products of the sides and the place of the camera, and how far they may be off.
    heights: [f32; 4],
    slack: [f32; 4],
    forward: Vector,
    height: f32,
}

impl Tree {
    /// Shows its triangles, of number `thing`, in a tile, one of `tiles` that they may be in.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn fill(
        &self,
        frame: &Frame,
        thing: u32,
        tiles: usize,
        waiting: &mut Waiting,
        tile: &mut Tile,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let origin = self.origin_at(frame.turn_back(three!(k => -frame.pos[k])));
        // of leaves that half show their back, a tile has too many for sure
        let are_few = self.leaves.len() <= 2 * LEAVES_MAX * tiles;
        if !are_few || !self.leaves_of(&Bundle::new(frame, &origin, tile), waiting, tile.farthest())
        {
            self.fill_by_ray(frame, &origin, thing, waiting, tile);
            return;
        }
        let mut farthest = f32::INFINITY;
        for &(near, leaf) in &waiting.near {
            if near < farthest && self.leaves[leaf as usize].fill(frame, &origin, thing, tile) {
                farthest = tile.farthest();
            }
        }
    }

    /// Finds the leaves that a tile may see, the nearest first; false if there are too many.
    #[inline(always)]
    fn leaves_of(&self, bundle: &Bundle, waiting: &mut Waiting, farthest: f32) -> bool {
        let (stack, leaves) = (&mut waiting.stack.0, &mut waiting.near);
        leaves.clear();
        let mut count = 1;
        stack[0] = (0.0, 0);
        while count > 0 {
            count -= 1;
            let node = &self.nodes[stack[count].1 as usize];
            let (near, mut bits) = bundle.boxes(node, farthest);
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & 7;
                bits &= bits - 1;
                let (near, child) = (near[lane], node.children[lane]);
                if child & LEAF == 0 {
                    stack[count] = (near, child);
                    count += 1;
                } else if leaves.len() == LEAVES_MAX {
                    return false;
                } else {
                    leaves.push((near, child & !LEAF));
                }
            }
        }
        leaves.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        true
    }

    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    fn fill_by_ray(
        &self,
        frame: &Frame,
        origin: &Origin,
        thing: u32,
        waiting: &mut Waiting,
        tile: &mut Tile,
    ) {
        for line in 0..EDGE {
            let d = tile.directions(frame, line);
            let mut bits = self.may_meet(origin, &d, F32x8::load(&tile.depth[line]));
            let mut lanes = [[0.0; EDGE]; 3];
            for k in 0..3 {
                d[k].store(&mut lanes[k]);
            }
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & (EDGE - 1);
                bits &= bits - 1;
                let direction = three!(k => lanes[k][lane]);
                let limit = tile.depth[line][lane];
                if let Some(met) =
                    self.cast(&mut waiting.stack, origin, direction, tile.near, limit)
                {
                    tile.keep_one([line, lane], met.far, thing, met.number);
                }
            }
        }
    }

    /// Which rays meet the box around all triangles before a limit, in units of their directions: bits.
    #[inline(always)]
    fn may_meet(&self, origin: &Origin, d: &[F32x8; 3], limit: F32x8) -> u32 {
        let (mut enter, mut leave) = (F32x8::k(0.0), limit);
        for k in 0..3 {
            // along a side, far away and not at a NaN
            let tiny = F32x8::k(1e-18);
            let along = F32x8::select(d[k].abs().lt(tiny), tiny, d[k]);
            let (half, pos) = (self.half[k] + origin.slack, origin.pos[k]);
            let a = F32x8::k(-half - pos).div(along);
            let b = F32x8::k(half - pos).div(along);
            enter = a.min(b).max(enter);
            leave = a.max(b).min(leave);
        }
        F32x8::bits(!leave.lt(enter))
    }
}

impl Bundle {
    #[inline(always)]
    pub(crate) fn new(frame: &Frame, origin: &Origin, tile: &Tile) -> Bundle {
        let ([left, right], [top, bottom]) =
            ([tile.x[0], tile.x[EDGE - 1]], [tile.y[0], tile.y[EDGE - 1]]);
        // rays inside have positive products with them
        let sides = [
            [1.0, 0.0, -left],
            [-1.0, 0.0, right],
            [0.0, 1.0, -top],
            [0.0, -1.0, bottom],
        ];
        let sides = [
            frame.turn_back(sides[0]),
            frame.turn_back(sides[1]),
            frame.turn_back(sides[2]),
            frame.turn_back(sides[3]),
        ];
        let (mut heights, mut slack) = ([0.0; 4], [0.0; 4]);
        for side in 0..4 {
            heights[side] = crate::vector::dot(sides[side], origin.pos);
            slack[side] =
                origin.slack * (sides[side][0].abs() + sides[side][1].abs() + sides[side][2].abs());
        }
        let forward = frame.rot[2];
        Bundle {
            sides,
            heights,
            slack,
            forward,
            height: crate::vector::dot(forward, origin.pos),
        }
    }

    /// Least depths of the boxes of a node, and which may be seen.
    #[inline(always)]
    pub(super) fn boxes(&self, node: &Node, farthest: f32) -> ([f32; 8], u32) {
        let least = corner(node, self.forward, -1.0) - F32x8::k(self.height);
        let mut is_outside = F32x8::k(farthest).lt(least);
        for side in 0..4 {
            let most = corner(node, self.sides[side], 1.0);
            is_outside = is_outside | most.lt(F32x8::k(self.heights[side] - self.slack[side]));
        }
        let mut near = [0.0; 8];
        least.store(&mut near);
        // boxes of no child are infinite, so that products with them may be NaN
        let is_box = F32x8::load(&node.low[0]).lt(F32x8::k(f32::INFINITY));
        (near, F32x8::bits(is_box & !is_outside))
    }
}

/// The largest products of a vector and the corners of boxes; with the sign -1, the smallest.
#[inline(always)]
pub(super) fn corner(node: &Node, v: Vector, sign: f32) -> F32x8 {
    let bounds = |k: usize| {
        if sign * v[k] < 0.0 {
            &node.low[k]
        } else {
            &node.high[k]
        }
    };
    let [x, y, z] = [bounds(0), bounds(1), bounds(2)];
    F32x8::load(z).fma(
        F32x8::k(v[2]),
        F32x8::load(y).fma(F32x8::k(v[1]), F32x8::load(x) * F32x8::k(v[0])),
    )
}

/// Numbers of eight triangles, in the frame of the camera: factors of x, y and 1.
struct Drawn {
    against: [[f32; 8]; 3],
    u: [[f32; 8]; 3],
    v: [[f32; 8]; 3],
    height: [f32; 8],
    slack: [f32; 8],
}

impl Leaf {
    /// Shows its triangles in a tile; true if any is seen.
    #[inline(always)]
    fn fill(&self, frame: &Frame, origin: &Origin, thing: u32, tile: &mut Tile) -> bool {
        let Some((drawn, front)) = self.seen_from(frame, origin) else {
            return false;
        };
        let mut is_any = false;
        let x = F32x8::load(&tile.x);
        let bounds = drawn.bounds([tile.x[0], tile.x[EDGE - 1]]);
        for line in 0..EDGE {
            let mut bits = front & bounds.at(tile.y[line]);
            let y = F32x8::k(tile.y[line]);
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & 7;
                bits &= bits - 1;
                let a = value(&drawn.against, lane, x, y);
                let u = value(&drawn.u, lane, x, y);
                let v = value(&drawn.v, lane, x, y);
                let height = F32x8::k(drawn.height[lane]);
                let least = u.min(v).min(a - u - v);
                let is_met = F32x8::k(-drawn.slack[lane]).lt(least)
                    & height.lt(F32x8::load(&tile.depth[line]) * a);
                if F32x8::any(is_met) {
                    tile.keep(line, height.div(a), is_met, thing, self.number[lane]);
                    is_any = true;
                }
            }
        }
        is_any
    }

    /// What the triangles need of rays, and which show their front; none if all show their back.
    #[inline(always)]
    fn seen_from(&self, frame: &Frame, origin: &Origin) -> Option<(Drawn, u32)> {
        let o = three!(k => F32x8::k(origin.pos[k]));
        let normal = three!(k => -F32x8::load(&self.normal[k]));
        let height = products(&self.normal, &o) - F32x8::load(&self.height);
        let front = F32x8::bits(F32x8::k(0.0).lt(height));
        if front == 0 {
            return None;
        }
        let mut drawn = Drawn {
            against: [[0.0; 8]; 3],
            u: [[0.0; 8]; 3],
            v: [[0.0; 8]; 3],
            height: [0.0; 8],
            slack: [0.0; 8],
        };
        turned(frame, &normal, &mut drawn.against);
        for axis in 0..2 {
            let across = &self.across[axis];
            let start = products(across, &o) + F32x8::load(&self.start[axis]);
            let factors = three!(k => start.fma(normal[k], height * F32x8::load(&across[k])));
            turned(
                frame,
                &factors,
                if axis == 0 {
                    &mut drawn.u
                } else {
                    &mut drawn.v
                },
            );
        }
        height.store(&mut drawn.height);
        (F32x8::k(origin.slack) * F32x8::load(&self.steep)).store(&mut drawn.slack);
        Some((drawn, front))
    }
}

/// What a triangle needs of a line of rays.
#[inline(always)]
pub(super) fn value(factors: &[[f32; 8]; 3], lane: usize, x: F32x8, y: F32x8) -> F32x8 {
    let [along, down, fixed] = [factors[0][lane], factors[1][lane], factors[2][lane]];
    x.fma(F32x8::k(along), y.fma(F32x8::k(down), F32x8::k(fixed)))
}

/// The largest values on a line of rays that decide whether triangles are met: factors of y and 1.
struct Bounds {
    down: [F32x8; 3],
    most: [F32x8; 3],
    slack: F32x8,
}

impl Drawn {
    /// Of lines between two places.
    #[inline(always)]
    fn bounds(&self, x: [f32; 2]) -> Bounds {
        let factors = |k: usize| {
            let a = F32x8::load(&self.against[k]);
            let (u, v) = (F32x8::load(&self.u[k]), F32x8::load(&self.v[k]));
            [u, v, a - u - v]
        };
        let (along, down, fixed) = (factors(0), factors(1), factors(2));
        let most = three!(k => {
            let ends = (along[k] * F32x8::k(x[0])).max(along[k] * F32x8::k(x[1]));
            ends + fixed[k]
        });
        // roundings of these sums are below the slack's
        let slack = F32x8::k(-2.0) * F32x8::load(&self.slack);
        Bounds { down, most, slack }
    }
}

impl Bounds {
    /// Which triangles a line at y may meet: bits.
    #[inline(always)]
    fn at(&self, y: f32) -> u32 {
        let value = three!(k => self.down[k].fma(F32x8::k(y), self.most[k]));
        F32x8::bits(self.slack.lt(value[0].min(value[1]).min(value[2])))
    }
}

/// Vectors of a frame in its parent's.
#[inline(always)]
pub(super) fn turned(frame: &Frame, v: &[F32x8; 3], to: &mut [[f32; 8]; 3]) {
    for k in 0..3 {
        let row = frame.rot[k];
        v[2].fma(
            F32x8::k(row[2]),
            v[1].fma(F32x8::k(row[1]), v[0] * F32x8::k(row[0])),
        )
        .store(&mut to[k]);
    }
}
