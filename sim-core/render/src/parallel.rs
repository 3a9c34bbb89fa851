//! Where parallel rays enter shapes: those to a light from far off.
//!
//! As `solids`, with one direction of length 1 and eight places. Only whether a ray enters counts.

use sim_physics::lane::Num;
use sim_physics::lane::simd::F32x8;

use crate::normals::{Points, products, squares};
use crate::solids::Solid;
use crate::vector::{Frame, Vector, dot, three};

type Mask = <F32x8 as Num>::Mask;

/// A square of the sine of an angle below which a ray is along an axis [–].
const ALONG: f32 = 1e-12;

/// A box in the frame of a light, in which rays go along z. On a ray through (a, b), it is between the planes of each pair
/// of sides from c = x·(a, b, 1) - w to x·(a, b, 1) + w.
#[derive(Clone, Copy)]
pub(crate) struct Slabs {
    middle: [Vector; 3],
    width: Vector,
}

impl Slabs {
    /// Of the box with these half edges about the origin of a frame.
    #[inline(always)]
    pub(crate) fn new(frame: &Frame, half: Vector) -> Slabs {
        let (rot, start) = (&frame.rot, frame.turn_back(frame.pos));
        // along a side, far away and not at a NaN
        let inverse = three!(k => 1.0 / if rot[2][k].abs() < 1e-18 { 1e-18 } else { rot[2][k] });
        Slabs {
            middle: three!(k => {
                [-rot[0][k] * inverse[k], -rot[1][k] * inverse[k], start[k] * inverse[k]]
            }),
            width: three!(k => (half[k] * inverse[k]).abs()),
        }
    }

    /// Where rays enter the box and leave it.
    #[inline(always)]
    fn ends(&self, a: F32x8, b: F32x8) -> [F32x8; 2] {
        let middle = three!(k => {
            let [x, y, z] = self.middle[k];
            a.fma(F32x8::k(x), b.fma(F32x8::k(y), F32x8::k(z)))
        });
        let enter = three!(k => middle[k] - F32x8::k(self.width[k]));
        let leave = three!(k => middle[k] + F32x8::k(self.width[k]));
        [
            enter[0].max(enter[1]).max(enter[2]),
            leave[0].min(leave[1]).min(leave[2]),
        ]
    }

    /// Which rays meet the box, from inside too.
    #[inline(always)]
    pub(crate) fn hold(&self, a: F32x8, b: F32x8, c: F32x8) -> Mask {
        let [enter, leave] = self.ends(a, b);
        enter.lt(leave) & c.lt(leave)
    }

    /// Which rays enter the box from outside.
    #[inline(always)]
    pub(crate) fn stop(&self, a: F32x8, b: F32x8, c: F32x8) -> Mask {
        let [enter, leave] = self.ends(a, b);
        enter.lt(leave) & c.lt(enter)
    }
}

impl Solid {
    /// Which rays from `o` along `d` enter it from outside.
    #[inline(always)]
    pub(crate) fn stops(&self, o: &Points, d: Vector) -> Mask {
        match *self {
            Solid::Plane(half) => plane(half, o, d),
            // by its slabs, which are quicker
            Solid::Box(_) => F32x8::k(1.0).lt(F32x8::k(0.0)),
            Solid::Ellipsoid(axes) => {
                let d = three!(k => d[k] / axes[k]);
                sphere(1.0, &three!(k => o[k] * F32x8::k(1.0 / axes[k])), d)
            }
            Solid::Cylinder(radius, half) => cylinder(radius, half, o, d),
            Solid::Capsule(radius, half) => {
                let (t, height) = tube(radius, o, d);
                let zero = F32x8::k(0.0);
                let is_side = zero.lt(t) & height.abs().lt(F32x8::k(half));
                let is_outside = !capsule_holds(radius, half, o);
                let low = sphere(radius, &[o[0], o[1], o[2] + F32x8::k(half)], d);
                let high = sphere(radius, &[o[0], o[1], o[2] - F32x8::k(half)], d);
                is_outside & (is_side | low | high)
            }
        }
    }
}

#[inline(always)]
fn plane(half: [f32; 2], o: &Points, d: Vector) -> Mask {
    let zero = F32x8::k(0.0);
    let t = -o[2] * F32x8::k(1.0 / d[2]);
    let (x, y) = (t.fma(F32x8::k(d[0]), o[0]), t.fma(F32x8::k(d[1]), o[1]));
    let is_within = !F32x8::k(half[0]).lt(x.abs()) & !F32x8::k(half[1]).lt(y.abs());
    // casters are planes whose front the rays meet
    zero.lt(o[2]) & is_within
}

/// Which rays enter a sphere from outside.
#[inline(always)]
fn sphere(radius: f32, o: &Points, d: Vector) -> Mask {
    let a = dot(d, d);
    let nearest = products(o, d) * F32x8::k(-1.0 / a);
    let f = three!(k => nearest.fma(F32x8::k(d[k]), o[k]));
    let inside = F32x8::k(radius * radius) - squares(&f);
    let zero = F32x8::k(0.0);
    let t = nearest - (inside.max(zero) * F32x8::k(1.0 / a)).sqrt();
    zero.lt(inside) & zero.lt(t)
}

/// Where rays enter a cylinder without ends, below 0 where they do not, and how high.
#[inline(always)]
fn tube(radius: f32, o: &Points, d: Vector) -> (F32x8, F32x8) {
    let (zero, nowhere) = (F32x8::k(0.0), F32x8::k(-1.0));
    let a = d[1].mul_add(d[1], d[0] * d[0]);
    if a < ALONG {
        return (nowhere, zero);
    }
    let b = o[1].fma(F32x8::k(d[1]), o[0] * F32x8::k(d[0]));
    let nearest = b * F32x8::k(-1.0 / a);
    let x = nearest.fma(F32x8::k(d[0]), o[0]);
    let y = nearest.fma(F32x8::k(d[1]), o[1]);
    let inside = F32x8::k(radius * radius) - y.fma(y, x * x);
    let t = nearest - (inside.max(zero) * F32x8::k(1.0 / a)).sqrt();
    let t = F32x8::select(zero.lt(inside), t, nowhere);
    (t, t.fma(F32x8::k(d[2]), o[2]))
}

#[inline(always)]
fn cylinder(radius: f32, half: f32, o: &Points, d: Vector) -> Mask {
    let zero = F32x8::k(0.0);
    let (t, height) = tube(radius, o, d);
    let mut is_met = zero.lt(t) & height.abs().lt(F32x8::k(half));
    if d[2] * d[2] > ALONG {
        // the end that faces the rays
        let t = (F32x8::k(-half.copysign(d[2])) - o[2]) * F32x8::k(1.0 / d[2]);
        let (x, y) = (t.fma(F32x8::k(d[0]), o[0]), t.fma(F32x8::k(d[1]), o[1]));
        is_met = is_met | zero.lt(t) & !F32x8::k(radius * radius).lt(y.fma(y, x * x));
    }
    is_met
}

/// Which points are inside.
#[inline(always)]
fn capsule_holds(radius: f32, half: f32, o: &Points) -> Mask {
    let z = o[2] - o[2].max(F32x8::k(-half)).min(F32x8::k(half));
    squares(&[o[0], o[1], z]).lt(F32x8::k(radius * radius))
}
