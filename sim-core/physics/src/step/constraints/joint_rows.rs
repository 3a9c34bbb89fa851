//! Constraint rows of joints: stiffness D and reference acceleration of each (Todorov 2014; MuJoCo
//! documentation, "Computation: constraint model").
//!
//! ```text
//! aref = -b v - k d(r) r          R = (1 - d) / d × inverse weight,  D = 1 / R
//! ```
//!
//! Rows are in MuJoCo's order: equalities, frictions, limits. Their Jacobians have one or two entries, known when the model
//! is compiled. Only the side of a limit is found at run time.

use crate::arrays::Array as A;
use crate::constants::contact::WEIGHT_MIN;
use crate::constants::params::Param;
use crate::constants::{Constants, FAR, Impedance, Limit, Soft};
use crate::lane::{Cx, Num, Real};
use crate::step::{BlockOf, ConstantsOf, Stage};
use crate::when;

/// Constraint rows of joints: stiffness and reference acceleration.
pub struct Constraint;

impl Stage for Constraint {
    const READS: &'static [A] = &[A::JointQ, A::JointQd, A::Params];
    const WRITES: &'static [A] = &[A::EfcD, A::EfcAref, A::LimitSide];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        rows(cx, m, b);
    }
}

/// Writes D and aref of every row, and the side of every limit.
#[inline(always)]
fn rows<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let mut row = 0;
    // equalities: r = q(follower) - multiplier q(leader) - offset
    for equality in &m.equalities {
        let multiplier = C::F::k(equality.multiplier);
        let (f, l) = (equality.follower, equality.leader);
        let (leading, following) = (m.dofs[l].coord, m.dofs[f].coord);
        let position = multiplier.fnma(cx.get(&b.joint_q[leading]), cx.get(&b.joint_q[following]))
            - C::F::k(equality.offset);
        let velocity = multiplier.fnma(cx.get(&b.joint_qd[l]), cx.get(&b.joint_qd[f]));
        let inverse_weight = C::F::k(equality.soft.inverse_weight);
        let (weight, aref) = soft_row(&equality.soft, inverse_weight, position, velocity);
        cx.set(&mut b.efc_weight[row], weight);
        cx.set(&mut b.efc_aref[row], aref);
        row += 1;
    }
    // dry friction has no position: aref = -b v, and D is a constant
    for friction in &m.frictions {
        let aref = -(cx.get(&b.joint_qd[friction.dof]) * C::F::k(friction.damping));
        cx.set(&mut b.efc_weight[row], C::F::k(friction.weight));
        cx.set(&mut b.efc_aref[row], aref);
        row += 1;
    }
    // limits: r is the distance to the nearer bound, and rows begin without force
    let distance = &mut w.limit_distance;
    let mut nearest = zero;
    for (n, limit) in m.limits.iter().enumerate() {
        let q = cx.get(&b.joint_q[m.dofs[limit.dof].coord]);
        let [lower, upper] = range(m, &b.params, limit);
        let (above, below) = (q - lower, upper - q);
        w.limit_side[n] = C::F::select(above.lt(below), one, -one);
        distance[n] = above.min(below);
        nearest = nearest.min(distance[n]);
        cx.set(&mut b.efc_weight[row + n], zero);
        cx.set(&mut b.efc_aref[row + n], zero);
    }
    // most blocks have no world at a limit
    when!(cx, nearest.lt(zero), {
        for (n, limit) in m.limits.iter().enumerate() {
            // side × q̇ is the rate of r
            let velocity = w.limit_side[n] * cx.get(&b.joint_qd[limit.dof]);
            let inverse_weight = match m.varying.first(Param::DofInvweight0) {
                Some(first) => b.params[first + limit.dof].max(C::F::c(WEIGHT_MIN)),
                None => C::F::k(limit.soft.inverse_weight),
            };
            let (weight, aref) = soft_row(&limit.soft, inverse_weight, distance[n], velocity);
            // other worlds of the block may be inside their range
            let active = distance[n].lt(zero);
            cx.set(
                &mut b.efc_weight[row + n],
                C::F::select(active, weight, zero),
            );
            cx.set(&mut b.efc_aref[row + n], C::F::select(active, aref, zero));
        }
    });
}

/// Ends of a range, margin included, of each world where they vary.
#[inline(always)]
pub(in crate::step) fn range<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    limit: &Limit<F::Real>,
) -> [F; 2] {
    let mut ends = [F::k(limit.lower), F::k(limit.upper)];
    let (margin, which) = (
        F::k(limit.margin),
        [Param::JointLimitLower, Param::JointLimitUpper],
    );
    // a row of one side alone keeps its other end out of reach, which `f32` rounds
    let has_lower = limit.lower.to_f64().abs() < 0.5 * FAR;
    let has_upper = limit.upper.to_f64().abs() < 0.5 * FAR;
    if let (Some(first), true) = (m.varying.first(which[0]), has_lower) {
        ends[0] = params[first + limit.dof] + margin;
    }
    if let (Some(first), true) = (m.varying.first(which[1]), has_upper) {
        ends[1] = params[first + limit.dof] - margin;
    }
    ends
}

/// x ≥ 0 to a power of at least 1. The digits of a power that is no whole number become roots.
#[inline(always)]
fn powered<F: Num>(x: F, power: f64) -> F {
    // x to the whole part of the power
    let mut product = x;
    for _ in 1..power as usize {
        product = product * x;
    }
    // times x^½, x^¼ … for the binary digits of the rest
    let (mut digits, mut root) = (power.fract(), x);
    while digits > 0.0 {
        root = root.sqrt();
        digits *= 2.0;
        if digits >= 1.0 {
            product = product * root;
            digits -= 1.0;
        }
    }
    product
}

/// (D, aref) of a row at this position and velocity.
#[inline(always)]
fn soft_row<F: Num>(soft: &Soft<F::Real>, inverse_weight: F, position: F, velocity: F) -> (F, F) {
    // D = d / ((1 - d) × inverse weight)
    let d = impedance(&soft.impedance, position);
    let weight = d.div((F::c(1.0) - d) * inverse_weight);
    // aref = -b v - k d r
    let spring = F::k(soft.stiffness) * d * position;
    (weight, -velocity.fma(F::k(soft.damping), spring))
}

/// d(r): from `d_min` at 0 to `d_max` at `width`, along two powers that meet at the midpoint (MuJoCo: `solimp`).
#[inline(always)]
pub(in crate::step) fn impedance<F: Num>(i: &Impedance<F::Real>, position: F) -> F {
    let (one, midpoint) = (F::c(1.0), i.midpoint.to_f64());
    // |r| as a share of the width, 1 beyond it
    let x = (position.abs() * F::k(i.inverse_width)).min(one);
    let rest = one - x;
    let power = i.power.to_f64();
    // x^p / m^(p-1) up to the midpoint m, 1 - (1 - x)^p / (1 - m)^(p-1) above
    let (rising, falling) = if power == 2.0 {
        let rising = x * x * F::c(1.0 / midpoint);
        (
            rising,
            (rest * rest).fnma(F::c(1.0 / (1.0 - midpoint)), one),
        )
    } else {
        let rising = powered(x, power) * F::c(1.0 / midpoint.powf(power - 1.0));
        let scale = F::c(1.0 / (1.0 - midpoint).powf(power - 1.0));
        (rising, powered(rest, power).fnma(scale, one))
    };
    // d = d_min + y (d_max - d_min)
    let y = F::select(x.lt(F::k(i.midpoint)), rising, falling);
    y.fma(F::k(i.d_max) - F::k(i.d_min), F::k(i.d_min))
}

/// As [`impedance`], between `d_min` and `d_max` with 1 / width and midpoint of each world.
#[inline(always)]
pub(in crate::step) fn impedance_between<F: Num>(
    [d_min, d_max, inverse_width, midpoint]: [F; 4],
    power: f64,
    position: F,
) -> F {
    let one = F::c(1.0);
    let x = (position.abs() * inverse_width).min(one);
    // m (x/m)^p up to the midpoint m, 1 - (1 - m) ((1 - x)/(1 - m))^p above
    let beyond = one - midpoint;
    let rising = midpoint * powered(x.div(midpoint), power);
    let falling = beyond * powered((one - x).div(beyond), power);
    let y = F::select(x.lt(midpoint), rising, one - falling);
    y.fma(d_max - d_min, d_min)
}
