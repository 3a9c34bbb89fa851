//! The way of a tendon on the inner side of a circle, which touches at one point (MuJoCo: `wrap_inside`).
//!
//! Both lines meet the circle of radius r there under the same angle α. With the ends a and b from the centre, and seen from
//! there under the angle γ:
//!
//! ```text
//! asin(r sin α / a) + asin(r sin α / b) - 2 α + γ = 0
//! ```
//!
//! MuJoCo solves it for sin α, which `f32` rounds where the lines graze the circle.

use super::flat::{
    Arc, Flat, TINY, angle, asin, cross, dot, norm, scale, scale_add, select, sub, unit,
};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::{break_if, times, when};

/// Where Newton's method begins: MuJoCo's sin α is 1 - 1e-7 there [rad].
const START: f64 = 1.570_349_113_2;
/// How often it iterates at most.
const ITERATIONS: usize = 20;
/// Which rest of the equation ends it, one step later, as in MuJoCo [rad].
const REST_MAX: f64 = 1e-6;
/// The same in `f32`: some roundings of its four angles [rad].
const REST_MAX_SINGLE: f64 = 2e-6;

/// The equation for α.
struct Equation<F> {
    /// r / a
    first: F,
    /// r / b
    second: F,
    gamma: F,
}

impl<F: Num> Equation<F> {
    /// How far its left side is from 0, and the derivative of that.
    #[inline(always)]
    fn at(&self, alpha: F) -> [F; 2] {
        let (sine, cosine) = alpha.sincos();
        let (first, second) = (self.first * sine, self.second * sine);
        let rest = F::c(2.0).fnma(alpha, asin(first) + asin(second)) + self.gamma;
        let outer = self.first.div(cosine_of(first)) + self.second.div(cosine_of(second));
        [rest, outer.fma(cosine, F::c(-2.0))]
    }
}

/// Cosine of the angle with this sine, at least a tiny one.
#[inline(always)]
fn cosine_of<F: Num>(sine: F) -> F {
    let one = F::c(1.0);
    ((one - sine) * (one + sine)).max(F::c(TINY * TINY)).sqrt()
}

/// Where a tendon between two points outside of the circle touches it, in the worlds of the mask.
#[inline(always)]
pub(super) fn inner<C: Cx>(
    cx: &mut C,
    [first, last]: [Flat<C::F>; 2],
    radius: C::F,
    asked: MaskOf<C>,
) -> Arc<C::F> {
    let (zero, one, tiny) = (C::F::c(0.0), C::F::c(1.0), C::F::c(TINY));
    let (a, b) = (norm(first), norm(last));
    let outside = radius.lt(a) & radius.lt(b);
    // the straight line goes through the circle, and touches nothing
    let along = sub(last, first);
    let long = dot(along, along);
    let is_long = tiny.lt(long);
    let part = (-dot(along, first)).div(C::F::select(is_long, long, one));
    let near = norm(scale_add(along, part, first));
    let goes_through = is_long & zero.lt(part) & part.lt(one) & !radius.lt(near);
    // selects: worlds with an end inside divide by 1
    let (a, b) = (C::F::select(outside, a, one), C::F::select(outside, b, one));
    let (sine, cosine) = (cross(first, last), dot(first, last));
    let size = a * b;
    let is_opposite = cosine.lt(size * C::F::c(TINY - 1.0));
    let touches = asked & outside & !goes_through & !is_opposite;
    let equation = Equation {
        first: radius.div(a),
        second: radius.div(b),
        gamma: angle(sine.abs(), cosine),
    };
    let is_turned = cosine.lt(size * C::F::c(1.0 - TINY));
    let alpha = solve(cx, &equation, touches & is_turned);
    let is_found = zero.lt(alpha);
    // from the end that comes first against the clock, by α - asin(r sin α / a)
    let rises = zero.lt(sine);
    let ratio = C::F::select(rises, equation.first, equation.second);
    let (sine, _) = alpha.sincos();
    let (sin, cos) = (alpha - asin(ratio * sine)).sincos();
    let [x, y] = unit(select(rises, first, last));
    let turned = [y.fnma(sin, x * cos), x.fma(sin, y * cos)];
    // where there is no answer, in the middle
    let middle = unit(scale_add(first, one, last));
    let point = scale(select(is_found, turned, middle), radius);
    Arc {
        touches,
        length: zero,
        meets: point,
        leaves: point,
    }
}

/// α in the worlds of the mask; 0 where there is none.
#[inline(always)]
fn solve<C: Cx>(cx: &mut C, equation: &Equation<C::F>, solves: MaskOf<C>) -> C::F {
    let (zero, most) = (C::F::c(0.0), C::F::c(START));
    let small = match <<C::F as Num>::Real as Real>::DOUBLE {
        true => C::F::c(REST_MAX),
        false => C::F::c(REST_MAX_SINGLE),
    };
    let (mut alpha, mut answer) = (cx.var(most), cx.var(zero));
    // the left side falls from one end to the other: nothing is above at the start
    let mut above_max = cx.var(zero);
    when!(cx, solves, {
        times!(cx, ITERATIONS, {
            let guess = cx.get(&alpha);
            let [rest, slope] = equation.at(guess);
            let is_lost = cx.get(&above_max).lt(rest);
            break_if!(cx, is_lost);
            // a select: a slope of 0 has no next point
            let falls = slope.lt(C::F::c(-TINY));
            let next = guess - rest.div(C::F::select(falls, slope, C::F::c(-1.0)));
            let next = C::F::select(falls, next.max(zero).min(most), guess);
            cx.set(&mut answer, next);
            break_if!(cx, !small.lt(rest.abs()));
            cx.set(&mut alpha, next);
            cx.set(&mut above_max, C::F::c(std::f64::consts::PI));
        });
    });
    cx.get(&answer)
}
