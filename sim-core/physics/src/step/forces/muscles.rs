//! Muscles (MuJoCo documentation, "Modeling: muscle actuators"; activation by Millard et al. 2013, doi 10.1115/1.4023390).
//!
//! ```text
//! L = r₀ + (l - l₀) / L₀      V = v / (L₀ v_max)                       in units of the optimal length L₀
//! gain = -F FL(L) FV(V)       bias = -F FP(L)                          F: peak force
//! ȧ = (u - a) / τ             τ = τ₁ (½ + ³⁄₂ a) where u > a, else τ₂ / (½ + ³⁄₂ a)
//! ```
//!
//! FL is 1 at L = 1 and 0 outside of [l_min, l_max]. FV is 0 at V = -1, 1 at V = 0, and f_vmax from V = f_vmax - 1 on. FP grows
//! from 0 at L = 1 to f_pmax/2 in the middle to l_max, and on along a line. All are made of parabolas.

use crate::constants::actuators::{Muscle, MuscleRate};
use crate::lane::{Num, Real};

/// The smallest divisor (MuJoCo: `mjMINVAL`).
const TINY: f64 = 1e-15;

/// Force per activation at a length and a velocity.
#[inline(always)]
pub(super) fn gain<F: Num>(muscle: &Muscle<F::Real>, [length, velocity]: [F; 2]) -> F {
    let most = F::k(muscle.peak) * by_length(muscle, length);
    -(most * by_velocity(muscle, velocity))
}

/// Derivative of the gain with the velocity.
#[inline(always)]
pub(super) fn gain_slope<F: Num>(muscle: &Muscle<F::Real>, [length, velocity]: [F; 2]) -> F {
    let (zero, two) = (F::c(0.0), F::c(2.0));
    let v = relative_velocity(muscle, velocity);
    let flat = muscle.fv_max.to_f64() - 1.0;
    // 2 V + 2, then 2 (y - V) / y
    let lengthens = (F::c(flat) - v) * F::c(2.0 / flat.max(TINY));
    let slope = F::select(zero.lt(v), lengthens, two.fma(v, two));
    let is_flat = !F::c(-1.0).lt(v) | F::c(flat).lt(v);
    let slope = F::select(is_flat, zero, slope);
    let most = F::k(muscle.peak) * by_length(muscle, length);
    -(most * slope * F::k(muscle.inverse_speed))
}

/// Passive force.
#[inline(always)]
pub(super) fn bias<F: Num>(muscle: &Muscle<F::Real>, length: F) -> F {
    let (one, half) = (F::c(1.0), F::c(0.5));
    let l = relative_length(muscle, length);
    // half a parabola up to b, then a line
    let b = 0.5 * (1.0 + muscle.l_max.to_f64());
    let inverse = F::c(1.0 / (b - 1.0).max(TINY));
    let (near, far) = ((l - one) * inverse, (l - F::c(b)) * inverse);
    let force = F::select(F::c(b).lt(l), half + far, half * near * near);
    let force = F::select(one.lt(l), force, F::c(0.0));
    -(F::k(muscle.peak) * F::k(muscle.fp_max) * force)
}

/// How fast an activation follows a control.
#[inline(always)]
pub(super) fn rate<F: Num>(rate: &MuscleRate<F::Real>, control: F, act: F) -> F {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let wanted = control.max(zero).min(one);
    let missing = wanted - act;
    // ½ + ³⁄₂ a
    let scale = F::c(1.5).fma(act.max(zero).min(one), F::c(0.5));
    let (rises, falls) = (F::k(rate.rise) * scale, F::k(rate.fall).div(scale));
    let width = rate.width.to_f64();
    let time = if width < TINY {
        F::select(zero.lt(missing), rises, falls)
    } else {
        // from one to the other by 6 x⁵ - 15 x⁴ + 10 x³
        let x = missing.fma(F::c(1.0 / width), F::c(0.5)).max(zero).min(one);
        let inner = x.fma(F::c(6.0), F::c(-15.0)).fma(x, F::c(10.0));
        (rises - falls).fma(x * x * x * inner, falls)
    };
    missing.div(time.max(F::c(TINY)))
}

#[inline(always)]
fn relative_length<F: Num>(muscle: &Muscle<F::Real>, length: F) -> F {
    (length - F::k(muscle.shortest)).fma(F::k(muscle.inverse_optimum), F::k(muscle.l_shortest))
}

#[inline(always)]
fn relative_velocity<F: Num>(muscle: &Muscle<F::Real>, velocity: F) -> F {
    velocity * F::k(muscle.inverse_speed)
}

/// FL
#[inline(always)]
fn by_length<F: Num>(muscle: &Muscle<F::Real>, length: F) -> F {
    let (one, half) = (F::c(1.0), F::c(0.5));
    let l = relative_length(muscle, length);
    let (least, most) = (muscle.l_min.to_f64(), muscle.l_max.to_f64());
    // half-way to the optimum, from either side
    let (a, b) = (0.5 * (least + 1.0), 0.5 * (1.0 + most));
    let over = |distance: f64| F::c(1.0 / distance.max(TINY));
    let below = (l - F::c(least)) * over(a - least);
    let rising = (one - l) * over(1.0 - a);
    let falling = (l - one) * over(b - 1.0);
    let beyond = (F::c(most) - l) * over(most - b);
    let before = F::select(
        F::c(a).lt(l),
        (half * rising).fnma(rising, one),
        half * below * below,
    );
    let after = F::select(
        F::c(b).lt(l),
        half * beyond * beyond,
        (half * falling).fnma(falling, one),
    );
    let factor = F::select(one.lt(l), after, before);
    let is_outside = l.lt(F::c(least)) | F::c(most).lt(l);
    F::select(is_outside, F::c(0.0), factor)
}

/// FV
#[inline(always)]
fn by_velocity<F: Num>(muscle: &Muscle<F::Real>, velocity: F) -> F {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let v = relative_velocity(muscle, velocity);
    let most = muscle.fv_max.to_f64();
    let flat = most - 1.0;
    let shortens = (v + one) * (v + one);
    let missing = F::c(flat) - v;
    let lengthens = (missing * F::c(1.0 / flat.max(TINY))).fnma(missing, F::c(most));
    let factor = F::select(zero.lt(v), lengthens, shortens);
    let factor = F::select(F::c(flat).lt(v), F::c(most), factor);
    F::select(F::c(-1.0).lt(v), factor, zero)
}
