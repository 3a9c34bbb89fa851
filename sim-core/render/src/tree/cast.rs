//! A ray through a tree.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use super::{LEAF, Leaf, Node, STACK, Tree};
use crate::vector::{Vector, dot, three};

/// Rounding of a sum of three products, relative to their size, and then some.
pub(super) const ROUNDING: f32 = 4.0 * f32::EPSILON;

/// Where rays of one camera begin in the frame of a tree, and how far roundings reach there.
#[derive(Clone, Copy)]
pub(crate) struct Origin {
    pub(crate) pos: Vector,
    /// By how much coordinates of points on triangles may be off [m].
    pub(crate) slack: f32,
}

/// Children that wait on the way down, each with the distance at which a ray enters it.
pub(crate) struct Stack(pub(super) [(f32, u32); STACK]);

impl Default for Stack {
    fn default() -> Stack {
        Stack([(0.0, 0); STACK])
    }
}

/// What a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Met {
    /// Distance in units of the direction.
    pub(crate) far: f32,
    /// The triangle.
    pub(crate) number: u32,
}

impl Tree {
    /// Rays from here.
    #[inline(always)]
    pub(crate) fn origin_at(&self, pos: Vector) -> Origin {
        Origin {
            pos,
            slack: ROUNDING * (2.0 * length(pos) + length(self.half)),
        }
    }

    /// The first triangle that a ray meets from its front beyond `near` and before `limit`, in units of the direction.
    #[inline(always)]
    pub(crate) fn cast(
        &self,
        stack: &mut Stack,
        from: &Origin,
        direction: Vector,
        near: f32,
        limit: f32,
    ) -> Option<Met> {
        self.walk::<false>(stack, from, direction, near, limit)
    }

    /// Whether a ray meets any triangle from its front beyond 0.
    #[inline(always)]
    pub(super) fn stops(&self, stack: &mut Stack, from: &Origin, direction: Vector) -> bool {
        let endless = f32::INFINITY;
        self.walk::<true>(stack, from, direction, 0.0, endless)
            .is_some()
    }

    /// What a ray meets first; with `ANY`, the first that is come upon.
    #[inline(always)]
    fn walk<const ANY: bool>(
        &self,
        stack: &mut Stack,
        from: &Origin,
        direction: Vector,
        near: f32,
        limit: f32,
    ) -> Option<Met> {
        if self.nodes.is_empty() {
            return None;
        }
        let ray = Ray::new(from, direction, near);
        let stack = &mut stack.0;
        let (mut waiting, mut at) = (0, 0_u32);
        let (mut nearest, mut met) = (limit, None);
        loop {
            if at & LEAF == 0 {
                let (near, mask) = ray.boxes(&self.nodes[at as usize], nearest);
                let children = &self.nodes[at as usize].children;
                let mut bits = mask;
                let first = waiting;
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize & 7;
                    bits &= bits - 1;
                    // the nearest child ends on top, if it matters
                    let mut place = waiting;
                    while !ANY && place > first && stack[place - 1].0 < near[lane] {
                        stack[place] = stack[place - 1];
                        place -= 1;
                    }
                    stack[place] = (near[lane], children[lane]);
                    waiting += 1;
                }
            } else {
                let leaf = &self.leaves[(at & !LEAF) as usize];
                let (far, mut bits) = ray.triangles(leaf, nearest);
                while bits != 0 {
                    let lane = bits.trailing_zeros() as usize & 7;
                    bits &= bits - 1;
                    if far[lane] < nearest {
                        nearest = far[lane];
                        met = Some((at & !LEAF, lane));
                    }
                }
                if ANY && met.is_some() {
                    waiting = 0;
                }
            }
            loop {
                if waiting == 0 {
                    let (leaf, lane) = met?;
                    let leaf = &self.leaves[leaf as usize];
                    return Some(Met {
                        far: nearest,
                        number: leaf.number[lane],
                    });
                }
                waiting -= 1;
                if stack[waiting].0 < nearest {
                    at = stack[waiting].1;
                    break;
                }
            }
        }
    }
}

/// A ray, in all lanes.
struct Ray {
    origin: [F32x8; 3],
    direction: [F32x8; 3],
    slack: F32x8,
    near: F32x8,
    /// One over the direction, and the origin times that, for the nearer and the farther sides of boxes.
    inverse: [F32x8; 3],
    enter: [F32x8; 3],
    leave: [F32x8; 3],
    is_back: [bool; 3],
}

impl Ray {
    #[inline(always)]
    fn new(from: &Origin, direction: Vector, near: f32) -> Ray {
        // along a side of a box, distances to the side are large and not infinite, so that no NaN comes of them
        let inverse = three!(k => 1.0 / if direction[k].abs() < 1e-18 { 1e-18_f32.copysign(direction[k]) } else { direction[k] });
        let moved = three!(k => -from.pos[k] * inverse[k]);
        Ray {
            origin: three!(k => F32x8::k(from.pos[k])),
            direction: three!(k => F32x8::k(direction[k])),
            slack: F32x8::k(from.slack),
            near: F32x8::k(near),
            inverse: three!(k => F32x8::k(inverse[k])),
            enter: three!(k => F32x8::k(moved[k] - ROUNDING * moved[k].abs())),
            leave: three!(k => F32x8::k(moved[k] + ROUNDING * moved[k].abs())),
            is_back: three!(k => inverse[k] < 0.0),
        }
    }

    /// Where it enters the boxes of a node, and which it does before `limit`.
    #[inline(always)]
    fn boxes(&self, node: &Node, limit: f32) -> ([f32; 8], u32) {
        let (mut near, mut far) = (self.near, F32x8::k(limit));
        for k in 0..3 {
            let (low, high) = (&node.low[k], &node.high[k]);
            let (first, last) = if self.is_back[k] {
                (high, low)
            } else {
                (low, high)
            };
            near = F32x8::load(first)
                .fma(self.inverse[k], self.enter[k])
                .max(near);
            far = F32x8::load(last)
                .fma(self.inverse[k], self.leave[k])
                .min(far);
        }
        let is_outside = far.fma(F32x8::k(1.0 + ROUNDING), F32x8::k(0.0)).lt(near);
        let mut entered = [0.0; 8];
        near.store(&mut entered);
        (entered, !F32x8::bits(is_outside) & 0xff)
    }

    /// Where it meets the triangles of a leaf, and which it does before `limit`.
    #[inline(always)]
    fn triangles(&self, leaf: &Leaf, limit: f32) -> ([f32; 8], u32) {
        let zero = F32x8::k(0.0);
        let against = products(&leaf.normal, &self.direction);
        let above = F32x8::load(&leaf.height) - products(&leaf.normal, &self.origin);
        let far = above.div(against);
        let point = three!(k => far.fma(self.direction[k], self.origin[k]));
        let u = products(&leaf.across[0], &point) + F32x8::load(&leaf.start[0]);
        let v = products(&leaf.across[1], &point) + F32x8::load(&leaf.start[1]);
        let least = u.min(v).min(F32x8::k(1.0) - u - v);
        // a flat angle makes the point's rounding larger
        let slack = self.slack * F32x8::load(&leaf.steep);
        let is_inside = (-slack).lt(least * -against);
        let is_met = against.lt(zero) & is_inside & self.near.lt(far) & far.lt(F32x8::k(limit));
        let mut met = [0.0; 8];
        far.store(&mut met);
        (met, F32x8::bits(is_met))
    }
}

#[inline(always)]
pub(super) fn length(v: Vector) -> f32 {
    dot(v, v).sqrt()
}

/// Scalar products of vectors with one of the same in all lanes.
#[inline(always)]
pub(super) fn products(a: &[[f32; 8]; 3], b: &[F32x8; 3]) -> F32x8 {
    let a = three!(k => F32x8::load(&a[k]));
    a[2].fma(b[2], a[1].fma(b[1], a[0] * b[0]))
}
