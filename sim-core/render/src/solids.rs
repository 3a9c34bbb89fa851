//! Round shapes, boxes and planes: where eight rays from one place enter them.
//!
//! ```text
//! f = o - (b/a) d,  b = o·d,  a = d·d        the point of a ray that is nearest to a centre
//! t = (-b - √(a (r² - f·f))) / a             without the rounding of b² - a c (Haines et al. in "Ray Tracing Gems", 2019)
//! ```
//!
//! A shape is seen from outside alone. So a ray that begins inside passes through, as in renderers.

use std::ops::Range;

use sim_physics::lane::simd::F32x8;
use sim_physics::lane::{Lane, Num};

use crate::tile::Tile;
use crate::vector::{Frame, Vector, three, two};

/// A shape in its own frame; its axis is z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Solid {
    /// z = 0, seen from above, with half edges [m].
    Plane([f32; 2]),
    /// Half edges [m].
    Box(Vector),
    /// Half axes [m].
    Ellipsoid(Vector),
    /// Radius and half height [m].
    Cylinder(f32, f32),
    /// Radius, and half the height between the half spheres [m].
    Capsule(f32, f32),
}

/// Directions of eight rays.
pub(crate) type Directions = [F32x8; 3];

/// Where nothing is met.
pub(crate) const NOWHERE: f32 = f32::INFINITY;

impl Solid {
    /// Half edges of the box around it [m].
    pub(crate) fn half(&self) -> Vector {
        match *self {
            Solid::Plane([x, y]) => [x, y, 0.0],
            Solid::Box(half) | Solid::Ellipsoid(half) => half,
            Solid::Cylinder(radius, half) => [radius, radius, half],
            Solid::Capsule(radius, half) => [radius, radius, half + radius],
        }
    }

    /// Shows it, number `thing`, in lines of a tile.
    #[inline(always)]
    pub(crate) fn fill(&self, frame: &Frame, thing: u32, lines: Range<usize>, tile: &mut Tile) {
        let origin = frame.turn_back(three!(k => -frame.pos[k]));
        for line in lines {
            let far = self.enter(origin, &tile.directions(frame, line));
            tile.keep(line, far, F32x8::all(), thing, 0);
        }
    }

    /// Distances at which rays from `o` enter it, in units of their directions; [`NOWHERE`] where they do not.
    #[inline(always)]
    pub(crate) fn enter(&self, o: Vector, d: &Directions) -> F32x8 {
        match *self {
            Solid::Plane(half) => plane(half, o, d),
            Solid::Box(half) => sides(half, o, d),
            Solid::Ellipsoid(axes) => {
                let scaled = three!(k => d[k] * F32x8::k(1.0 / axes[k]));
                sphere(1.0, three!(k => o[k] / axes[k]), &scaled)
            }
            Solid::Cylinder(radius, half) => cylinder(radius, half, o, d),
            Solid::Capsule(radius, half) => capsule(radius, half, o, d),
        }
    }
}

#[inline(always)]
fn along(o: f32, d: F32x8, t: F32x8) -> F32x8 {
    t.fma(d, F32x8::k(o))
}

#[inline(always)]
fn plane([x, y]: [f32; 2], o: Vector, d: &Directions) -> F32x8 {
    let (zero, nowhere) = (F32x8::k(0.0), F32x8::k(NOWHERE));
    if o[2] <= 0.0 {
        return nowhere;
    }
    let t = F32x8::k(-o[2]).div(d[2]);
    let is_within = |k: usize, half: f32| !F32x8::k(half).lt(along(o[k], d[k], t).abs());
    F32x8::select(
        d[2].lt(zero) & is_within(0, x) & is_within(1, y),
        t,
        nowhere,
    )
}

#[inline(always)]
fn sides(half: Vector, o: Vector, d: &Directions) -> F32x8 {
    let nowhere = F32x8::k(NOWHERE);
    if (0..3).all(|k| o[k].abs() < half[k]) {
        return nowhere;
    }
    let (mut enter, mut leave) = (F32x8::k(0.0), F32x8::k(NOWHERE));
    for k in 0..3 {
        // along a side a ray has no place where it passes it: far away then, and not at a NaN
        let tiny = F32x8::k(1e-18);
        let along = F32x8::select(d[k].abs().lt(tiny), tiny, d[k]);
        let (a, b) = (
            F32x8::k(-half[k] - o[k]).div(along),
            F32x8::k(half[k] - o[k]).div(along),
        );
        enter = a.min(b).max(enter);
        leave = a.max(b).min(leave);
    }
    let is_met = enter.lt(leave) & F32x8::k(0.0).lt(enter);
    F32x8::select(is_met, enter, nowhere)
}

/// Where rays enter a round shape: |f|² and a of the components that count, and b/a.
#[inline(always)]
fn round(radius: f32, apart: F32x8, a: F32x8, nearest: F32x8) -> F32x8 {
    let inside = F32x8::k(radius * radius) - apart;
    let zero = F32x8::k(0.0);
    let t = -nearest - inside.max(zero).div(a).sqrt();
    F32x8::select(zero.lt(inside) & zero.lt(t), t, F32x8::k(NOWHERE))
}

#[inline(always)]
fn sphere(radius: f32, o: Vector, d: &Directions) -> F32x8 {
    if o[0] * o[0] + o[1] * o[1] + o[2] * o[2] < radius * radius {
        return F32x8::k(NOWHERE);
    }
    let a = d[2].fma(d[2], d[1].fma(d[1], d[0] * d[0]));
    let b = d[2].fma(
        F32x8::k(o[2]),
        d[1].fma(F32x8::k(o[1]), d[0] * F32x8::k(o[0])),
    );
    let nearest = b.div(a);
    let f = three!(k => nearest.fnma(d[k], F32x8::k(o[k])));
    round(
        radius,
        f[2].fma(f[2], f[1].fma(f[1], f[0] * f[0])),
        a,
        nearest,
    )
}

/// Where rays enter a cylinder without ends, and how high.
#[inline(always)]
fn tube(radius: f32, o: Vector, d: &Directions) -> (F32x8, F32x8) {
    if o[0] * o[0] + o[1] * o[1] < radius * radius {
        return (F32x8::k(NOWHERE), F32x8::k(NOWHERE));
    }
    // along the axis a ray enters nowhere: it is far from it, then
    let a = d[1].fma(d[1], d[0] * d[0]).max(F32x8::k(1e-30));
    let nearest = d[1].fma(F32x8::k(o[1]), d[0] * F32x8::k(o[0])).div(a);
    let f = two!(k => nearest.fnma(d[k], F32x8::k(o[k])));
    let t = round(radius, f[1].fma(f[1], f[0] * f[0]), a, nearest);
    (t, along(o[2], d[2], t))
}

#[inline(always)]
fn cylinder(radius: f32, half: f32, o: Vector, d: &Directions) -> F32x8 {
    let (zero, nowhere) = (F32x8::k(0.0), F32x8::k(NOWHERE));
    let (side, height) = tube(radius, o, d);
    let mut t = F32x8::select(F32x8::k(half).lt(height.abs()), nowhere, side);
    if o[2].abs() >= half {
        // the end that faces the rays
        let end = F32x8::k(half.copysign(o[2]) - o[2]).div(d[2]);
        let p = two!(k => along(o[k], d[k], end));
        let apart = p[1].fma(p[1], p[0] * p[0]);
        let is_met = zero.lt(end) & !F32x8::k(radius * radius).lt(apart) & end.lt(nowhere);
        t = F32x8::select(is_met, end.min(t), t);
    }
    t
}

#[inline(always)]
fn capsule(radius: f32, half: f32, o: Vector, d: &Directions) -> F32x8 {
    let nowhere = F32x8::k(NOWHERE);
    let beyond = o[2] - o[2].clamp(-half, half);
    if o[0] * o[0] + o[1] * o[1] + beyond * beyond < radius * radius {
        return nowhere;
    }
    let (side, height) = tube(radius, o, d);
    let mut t = F32x8::select(F32x8::k(half).lt(height.abs()), nowhere, side);
    for end in [half, -half] {
        let ball = sphere(radius, [o[0], o[1], o[2] - end], d);
        let height = along(o[2], d[2], ball) * F32x8::k(end.signum());
        t = F32x8::select(height.lt(F32x8::k(half)), t, ball.min(t));
    }
    t
}
