//! Shadows of a tree: parallel rays to a light through it.
//!
//! In the frame of the light, (a, b, c), a ray p keeps its a and b. So what a triangle needs of it is linear in these:
//!
//! ```text
//! A = -n·l,  A c = n·(a, b, 0) - h              the ray meets the plane at c
//! A u = (A ũ + (ũ·l) n)·(a, b, 0) + A u₀ - (ũ·l) h       as A v: the signs tell whether it is inside
//! ```
//!
//! Points go down the tree together, as what is over a rectangle. Where they meet more leaves than pays, each goes down by
//! itself.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use super::cast::Origin;
use super::fill::{Waiting, corner, turned, value};
use super::{LEAF, Leaf, Node, Tree};
use crate::lit::Few;
use crate::tile::EDGE;
use crate::vector::{Frame, Vector, three};

/// Most leaves that are met triangle by triangle: so many, and one for each point.
const LEAVES_MAX: usize = 24;
/// Most points that go down one by one at once.
const FEW: usize = 4;

/// What is over a rectangle, as seen from a light: rays inside have products with these directions that are at least so
/// large, in the frame of a tree.
pub(crate) struct Beam {
    sides: [Vector; 5],
    least: [f32; 5],
}

impl Tree {
    /// Shades the points of a tile that its triangles are in the way of; `frame` is its own in that of the light.
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    pub(crate) fn shade(&self, frame: &Frame, waiting: &mut Waiting, few: &mut Few) {
        if self.nodes.is_empty() {
            return;
        }
        let slack = self
            .origin_at(frame.turn_back(three!(k => -frame.pos[k])))
            .slack;
        let beam = Beam::new(frame, slack, few.all, few.deep);
        let most = LEAVES_MAX + few.count;
        if few.count <= FEW || !self.leaves_over(&beam, most, waiting) {
            return self.shade_by_ray(frame, slack, waiting, few);
        }
        for &leaf in &waiting.leaves {
            if self.leaves[leaf as usize].shade(frame, slack, few) && few.is_shaded() {
                return;
            }
        }
    }

    /// Finds the leaves that may be over points; false if there are too many.
    #[inline(always)]
    fn leaves_over(&self, beam: &Beam, most: usize, waiting: &mut Waiting) -> bool {
        let (stack, leaves) = (&mut waiting.stack.0, &mut waiting.leaves);
        leaves.clear();
        let mut count = 1;
        stack[0] = (0.0, 0);
        while count > 0 {
            count -= 1;
            let node = &self.nodes[stack[count].1 as usize];
            let mut bits = beam.boxes(node);
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & 7;
                bits &= bits - 1;
                let child = node.children[lane];
                if child & LEAF == 0 {
                    stack[count] = (0.0, child);
                    count += 1;
                } else if leaves.len() == most {
                    return false;
                } else {
                    leaves.push(child & !LEAF);
                }
            }
        }
        true
    }

    #[inline(never)]
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    fn shade_by_ray(&self, frame: &Frame, slack: f32, waiting: &mut Waiting, few: &mut Few) {
        let direction = frame.rot[2];
        for point in 0..few.count {
            let [a, b, c] = &mut few.groups[point / EDGE % EDGE];
            let lane = point % EDGE;
            if c[lane] == f32::INFINITY {
                continue;
            }
            let place = [a[lane], b[lane], c[lane]];
            let pos = frame.turn_back(three!(k => place[k] - frame.pos[k]));
            let from = Origin { pos, slack };
            if self.stops(&mut waiting.stack, &from, direction) {
                c[lane] = f32::INFINITY;
            }
        }
    }
}

impl Beam {
    #[inline(always)]
    pub(crate) fn new(
        frame: &Frame,
        slack: f32,
        [a_ends, b_ends]: [[f32; 2]; 2],
        deep: f32,
    ) -> Beam {
        let [a, b, c] = frame.rot;
        let sides = [a, three!(k => -a[k]), b, three!(k => -b[k]), c];
        let [x, y, z] = frame.pos;
        let least = [
            a_ends[0] - x,
            x - a_ends[1],
            b_ends[0] - y,
            y - b_ends[1],
            deep - z,
        ];
        Beam {
            sides,
            least: crate::vector::each!(k in 0 1 2 3 4 => {
                least[k] - slack * (sides[k][0].abs() + sides[k][1].abs() + sides[k][2].abs())
            }),
        }
    }

    /// Which boxes of a node are in it.
    #[inline(always)]
    pub(super) fn boxes(&self, node: &Node) -> u32 {
        // boxes of no child are infinite, so that products with them may be NaN
        let mut is_in = F32x8::load(&node.low[0]).lt(F32x8::k(f32::INFINITY));
        for side in 0..5 {
            let most = corner(node, self.sides[side], 1.0);
            is_in = is_in & !most.lt(F32x8::k(self.least[side]));
        }
        F32x8::bits(is_in)
    }
}

/// Numbers of eight triangles in the frame of a light: factors of a, b and 1.
struct Cast {
    against: [f32; 8],
    high: [[f32; 8]; 3],
    u: [[f32; 8]; 3],
    v: [[f32; 8]; 3],
    slack: [f32; 8],
}

impl Leaf {
    /// Shades points; true if there were any.
    #[inline(always)]
    fn shade(&self, frame: &Frame, slack: f32, few: &mut Few) -> bool {
        let Some((cast, front)) = self.seen_along(frame, slack) else {
            return false;
        };
        let mut is_any = false;
        for group in 0..few.in_use() {
            if !F32x8::any(F32x8::load(&few.groups[group][2]).lt(F32x8::k(f32::INFINITY))) {
                continue;
            }
            let mut bits = front & cast.over(&few.bounds[group]);
            let [a, b, c] = &mut few.groups[group];
            let (a, b) = (F32x8::load(a), F32x8::load(b));
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & 7;
                bits &= bits - 1;
                let against = F32x8::k(cast.against[lane]);
                let high = value(&cast.high, lane, a, b);
                let u = value(&cast.u, lane, a, b);
                let v = value(&cast.v, lane, a, b);
                let least = u.min(v).min(against - u - v);
                let before = F32x8::load(c);
                let is_met = F32x8::k(-cast.slack[lane]).lt(least) & (before * against).lt(high);
                if F32x8::any(is_met) {
                    F32x8::select(is_met, F32x8::k(f32::INFINITY), before).store(c);
                    is_any = true;
                }
            }
        }
        is_any
    }

    /// What the triangles need of rays, and which these meet from their front; none if they meet none.
    #[inline(always)]
    fn seen_along(&self, frame: &Frame, slack: f32) -> Option<(Cast, u32)> {
        let normal = three!(k => F32x8::load(&self.normal[k]));
        let light = frame.rot[2];
        let along = normal[2].fma(
            F32x8::k(light[2]),
            normal[1].fma(F32x8::k(light[1]), normal[0] * F32x8::k(light[0])),
        );
        let front = F32x8::bits(along.lt(F32x8::k(0.0)));
        if front == 0 {
            return None;
        }

        let mut cast = Cast {
            against: [0.0; 8],
            high: [[0.0; 8]; 3],
            u: [[0.0; 8]; 3],
            v: [[0.0; 8]; 3],
            slack: [0.0; 8],
        };
        // the place of the tree, in its own frame
        let back = frame.turn_back(frame.pos);
        turned(frame, &normal, &mut cast.high);
        let n = three!(k => F32x8::load(&cast.high[k]));
        let against = -n[2];
        let height = from_light(&normal, back, F32x8::load(&self.height));
        (-height).store(&mut cast.high[2]);
        against.store(&mut cast.against);
        for axis in 0..2 {
            let across = three!(k => F32x8::load(&self.across[axis][k]));
            let start = -from_light(&across, back, -F32x8::load(&self.start[axis]));
            let to = if axis == 0 { &mut cast.u } else { &mut cast.v };
            turned(frame, &across, to);
            let along = F32x8::load(&to[2]);
            for k in 0..2 {
                let factor = against.fma(F32x8::load(&to[k]), along * n[k]);
                factor.store(&mut to[k]);
            }
            (against * start - along * height).store(&mut to[2]);
        }
        (F32x8::k(slack) * F32x8::load(&self.steep)).store(&mut cast.slack);
        Some((cast, front))
    }
}

impl Cast {
    /// Which triangles may be over a rectangle: bits.
    #[inline(always)]
    fn over(&self, [a, b]: &[[f32; 2]; 2]) -> u32 {
        let u = three!(k => F32x8::load(&self.u[k]));
        let v = three!(k => F32x8::load(&self.v[k]));
        let against = F32x8::load(&self.against);
        let w = [-u[0] - v[0], -u[1] - v[1], against - u[2] - v[2]];
        let least = most(&u, *a, *b).min(most(&v, *a, *b)).min(most(&w, *a, *b));
        // roundings of these sums are below the slack's
        F32x8::bits((F32x8::k(-2.0) * F32x8::load(&self.slack)).lt(least))
    }
}

/// The largest value over a rectangle.
#[inline(always)]
fn most(factors: &[F32x8; 3], a: [f32; 2], b: [f32; 2]) -> F32x8 {
    let along = (factors[0] * F32x8::k(a[0])).max(factors[0] * F32x8::k(a[1]));
    let down = (factors[1] * F32x8::k(b[0])).max(factors[1] * F32x8::k(b[1]));
    along + down + factors[2]
}

/// Products h with points of a frame, as those with the same points in the frame of a light: h + v·x, where `back` is x.
#[inline(always)]
fn from_light(v: &[F32x8; 3], back: Vector, height: F32x8) -> F32x8 {
    v[2].fma(
        F32x8::k(back[2]),
        v[1].fma(F32x8::k(back[1]), v[0].fma(F32x8::k(back[0]), height)),
    )
}
