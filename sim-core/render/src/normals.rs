//! Normals of shapes at points on their surfaces, for eight rays, and the arithmetic of eight points.

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::solids::Solid;
use crate::vector::{Frame, Vector, each, three};

/// Coordinates of eight points or directions.
pub(crate) type Points = [F32x8; 3];

/// A direction of its parent's frame, in this one.
#[inline(always)]
pub(crate) fn turned_back(frame: &Frame, v: &Points) -> Points {
    let rot = &frame.rot;
    three!(k => {
        v[2].fma(F32x8::k(rot[2][k]), v[1].fma(F32x8::k(rot[1][k]), v[0] * F32x8::k(rot[0][k])))
    })
}

/// The lanes of bits.
#[inline(always)]
pub(crate) fn mask(bits: u32) -> <F32x8 as Num>::Mask {
    let lanes = each!(lane in 0 1 2 3 4 5 6 7 => (bits >> lane & 1) as f32);
    F32x8::k(0.5).lt(F32x8::load(&lanes))
}

impl Solid {
    /// Normals at points `p` on its surface, of length 1, in its own frame.
    #[inline(always)]
    pub(crate) fn normals(&self, p: &Points) -> Points {
        let (zero, one) = (F32x8::k(0.0), F32x8::k(1.0));
        match *self {
            Solid::Plane(_) => [zero, zero, one],
            Solid::Box(half) => {
                // how far a point is inside of each pair of sides: it is on the one where it is least
                let depth = three!(k => F32x8::k(half[k]) - p[k].abs());
                let is_x = depth[0].lt(depth[1]) & depth[0].lt(depth[2]);
                let is_y = !is_x & depth[1].lt(depth[2]);
                let is_z = !is_x & !is_y;
                [side(is_x, p[0]), side(is_y, p[1]), side(is_z, p[2])]
            }
            Solid::Ellipsoid(axes) => unit(three!(k => p[k] * F32x8::k(1.0 / (axes[k] * axes[k])))),
            Solid::Cylinder(radius, half) => {
                let across = p[1].fma(p[1], p[0] * p[0]).sqrt();
                let is_end = (F32x8::k(half) - p[2].abs()).lt(F32x8::k(radius) - across);
                let scale = F32x8::select(is_end, zero, one.div(across));
                [p[0] * scale, p[1] * scale, side(is_end, p[2])]
            }
            Solid::Capsule(_, half) => {
                let on_axis = p[2].max(F32x8::k(-half)).min(F32x8::k(half));
                unit([p[0], p[1], p[2] - on_axis])
            }
        }
    }
}

/// The normal of the side that a coordinate is on, along its axis; 0 elsewhere.
#[inline(always)]
fn side(is_on: <F32x8 as Num>::Mask, p: F32x8) -> F32x8 {
    let (zero, one) = (F32x8::k(0.0), F32x8::k(1.0));
    F32x8::select(is_on, F32x8::select(p.lt(zero), -one, one), zero)
}

#[inline(always)]
fn unit(v: Points) -> Points {
    let square = v[2].fma(v[2], v[1].fma(v[1], v[0] * v[0]));
    let scale = F32x8::k(1.0).div(square.sqrt());
    three!(k => v[k] * scale)
}

/// Products of eight vectors with one.
#[inline(always)]
pub(crate) fn products(a: &Points, b: Vector) -> F32x8 {
    a[2].fma(
        F32x8::k(b[2]),
        a[1].fma(F32x8::k(b[1]), a[0] * F32x8::k(b[0])),
    )
}

/// Squares of the lengths of eight vectors.
#[inline(always)]
pub(crate) fn squares(a: &Points) -> F32x8 {
    a[2].fma(a[2], a[1].fma(a[1], a[0] * a[0]))
}
