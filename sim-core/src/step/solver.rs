//! Primal Newton solver for constrained accelerations (Todorov 2014; MuJoCo documentation,
//! "Computation: solvers").
//!
//!     minimise over a    ½ (a - M⁻¹ τ)ᵀ M (a - M⁻¹ τ) + Σ rows s(J a - aref)
//!
//! A round solves the quadratic model around `a`, whose minimum is `a⁺`:
//!
//!     (M + Jᵀ W J) a⁺ = τ + Jᵀ (f + W J a)        f = -s',  W = s''
//!
//! If no row changes its state between `a` and `a⁺` the model was exact and `a⁺` is the answer.
//! Otherwise an exact line search on the segment finds the next `a`. The start is the last step's
//! result, which mostly makes the first round the only one.

use super::{BlockOf, ConstantsOf};
use crate::lane::{Cx, Num, Real};
use crate::math::factor::{factor, multiply, solve as back_substitute, tri};
use crate::model::constants::Constants;
use crate::{break_if, times, when};

#[inline(always)]
pub(super) fn solve<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let n = m.dofs.len();
    let (zero, half, one) = (C::F::c(0.0), C::F::c(0.5), C::F::c(1.0));
    let w = &mut b.work;
    let mut busy = cx.var(one);
    times!(cx, m.solver.iterations, {
        let [a, minimum, slope, curve] = &mut w.vector;
        let [jar, jar_minimum] = &mut w.row;
        for j in 0..n {
            a[j] = cx.get(&b.joint_qdd[j]);
            minimum[j] = w.smooth_force[j];
        }
        w.hessian.copy_from_slice(&w.mass_matrix);
        residual(m, &w.limit_side, &w.efc_aref, a, jar);
        assemble(m, &w.limit_side, &w.efc_weight, &w.efc_aref, jar, &mut w.hessian, minimum);
        factor(&m.pattern, &mut w.hessian);
        back_substitute(&m.pattern, &w.hessian, minimum);
        residual(m, &w.limit_side, &w.efc_aref, minimum, jar_minimum);

        let changed = half.lt(changes(m, &w.efc_weight, jar, jar_minimum));
        let mut length = cx.var(one);
        let mut settled = cx.var(zero);
        when!(cx, changed, {
            // p(α) = cost at a + α (a⁺ - a):  p'(α) = slope + α curve - Σ f(jar + α jv) jv
            for j in 0..n {
                slope[j] = minimum[j] - a[j];
            }
            multiply(&m.pattern, &w.mass_matrix, slope, curve);
            let mut curvature = zero;
            for j in 0..n {
                curvature = slope[j].fma(curve[j], curvature);
            }
            let mut start = zero;
            multiply(&m.pattern, &w.mass_matrix, a, curve);
            for j in 0..n {
                start = slope[j].fma(curve[j] - w.smooth_force[j], start);
            }
            for r in 0..m.rows() {
                jar_minimum[r] = jar_minimum[r] - jar[r];
            }
            let line = Line { start, curvature, weight: &w.efc_weight, jar, jv: jar_minimum };
            let descent = line.derivative(m, zero);
            search::<C>(cx, m, &line, &mut length);
            // what is left to gain is about ½ |p'(0)|; below the rounding of p' there is nothing to find
            let gain = half * descent.slope.abs();
            let floor = descent.size * C::F::c(<<C::F as Num>::Real as Real>::EPSILON);
            let small = C::F::or(gain.lt(C::F::k(m.solver.tolerance)), gain.lt(floor));
            cx.set(&mut settled, C::F::select(small, one, zero));
        });
        let alpha = cx.get(&length);
        for j in 0..n {
            let moved = alpha.fma(minimum[j] - a[j], a[j]);
            cx.set(&mut b.joint_qdd[j], C::F::select(changed, moved, minimum[j]));
        }
        let done = C::F::or(C::F::not(changed), half.lt(cx.get(&settled)));
        cx.set(&mut busy, C::F::select(done, zero, one));
        break_if!(cx, done);
    });
    let unconverged = cx.get(&b.unconverged[0]).max(cx.get(&busy));
    cx.set(&mut b.unconverged[0], unconverged);

    let [a, force, ..] = &mut w.vector;
    for j in 0..n {
        a[j] = cx.get(&b.joint_qdd[j]);
        force[j] = zero;
    }
    let [jar, _] = &mut w.row;
    residual(m, &w.limit_side, &w.efc_aref, a, jar);
    forces(m, &w.limit_side, &w.efc_weight, jar, &mut w.efc_force, force);
    w.constraint_force.copy_from_slice(force);
}

/// Safeguarded Newton on p'(α) = 0: the exact minimum on the segment, and beyond it.
#[inline(always)]
fn search<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    line: &Line<'_, C::F>,
    length: &mut C::V,
) {
    let zero = C::F::c(0.0);
    let resolution = C::F::c(4.0 * <<C::F as Num>::Real as Real>::EPSILON);
    let mut low = cx.var(zero);
    let mut high = cx.var(C::F::c(1.0e10));
    times!(cx, m.solver.ls_iterations, {
        let alpha = cx.get(length);
        let d = line.derivative(m, alpha);
        let below = C::F::select(d.slope.lt(zero), alpha, cx.get(&low));
        let above = C::F::select(d.slope.lt(zero), cx.get(&high), alpha);
        let found = d.slope.abs().lt(d.size * resolution);
        break_if!(cx, C::F::or(found, (above - below).lt(above * resolution)));
        cx.set(&mut low, below);
        cx.set(&mut high, above);
        let newton = alpha - d.slope.div(d.curvature);
        let inside = C::F::and(below.lt(newton), newton.lt(above));
        let middle = C::F::c(0.5) * (below + above);
        cx.set(length, C::F::select(inside, newton, middle));
    });
}

/// The cost along a segment.
struct Line<'a, F> {
    /// Slope of the smooth part at α = 0.
    start: F,
    /// Its curvature.
    curvature: F,
    weight: &'a [F],
    jar: &'a [F],
    jv: &'a [F],
}

/// First and second derivative of the cost along a line, and the size of the terms they sum.
struct Derivative<F> {
    slope: F,
    curvature: F,
    size: F,
}

impl<F: Num> Line<'_, F> {
    #[inline(always)]
    fn derivative(&self, m: &Constants<F::Real>, alpha: F) -> Derivative<F> {
        let smooth = self.curvature * alpha;
        let mut d = Derivative {
            slope: self.start + smooth,
            curvature: self.curvature,
            size: self.start.abs() + smooth.abs(),
        };
        let (frictions, limits) = (m.equalities.len(), m.equalities.len() + m.frictions.len());
        for r in 0..m.rows() {
            let (jv, weight) = (self.jv[r], self.weight[r]);
            let jar = alpha.fma(jv, self.jar[r]);
            let law = if r < frictions {
                equality(jar, weight)
            } else if r < limits {
                let friction = &m.frictions[r - frictions];
                dry_friction(jar, weight, F::k(friction.zone), F::k(friction.loss))
            } else {
                one_sided(jar, weight)
            };
            let power = law.force * jv;
            d.slope = d.slope - power;
            d.size = d.size + power.abs();
            d.curvature = (law.stiffness * jv).fma(jv, d.curvature);
        }
        d
    }
}

/// What a row does at `jar`: force -s', stiffness s'', and which piece of s it is on.
struct Law<F> {
    force: F,
    stiffness: F,
    state: F,
}

/// s = ½ D jar²
#[inline(always)]
fn equality<F: Num>(jar: F, weight: F) -> Law<F> {
    Law { force: -(weight * jar), stiffness: weight, state: F::c(0.0) }
}

/// s = ½ D jar² within the zone R × loss, beyond it a line of slope ± loss (Huber).
#[inline(always)]
fn dry_friction<F: Num>(jar: F, weight: F, zone: F, loss: F) -> Law<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let (below, above) = (jar.lt(-zone), zone.lt(jar));
    let slides = F::or(below, above);
    let bound = F::select(below, loss, -loss);
    Law {
        force: F::select(slides, bound, -(weight * jar)),
        stiffness: F::select(slides, zero, weight),
        state: F::select(below, -one, F::select(above, one, zero)),
    }
}

/// s = ½ D jar² where jar < 0, else 0. A row of weight 0 is never active.
#[inline(always)]
fn one_sided<F: Num>(jar: F, weight: F) -> Law<F> {
    let zero = F::c(0.0);
    let push = -(weight * jar);
    let active = zero.lt(push);
    Law {
        force: F::select(active, push, zero),
        stiffness: F::select(active, weight, zero),
        state: F::select(active, F::c(1.0), zero),
    }
}

/// jar = J a - aref
#[inline(always)]
fn residual<F: Num>(m: &Constants<F::Real>, side: &[F], aref: &[F], a: &[F], jar: &mut [F]) {
    let mut r = 0;
    for e in &m.equalities {
        jar[r] = F::k(e.multiplier).fnma(a[e.leader], a[e.follower]) - aref[r];
        r += 1;
    }
    for f in &m.frictions {
        jar[r] = a[f.dof] - aref[r];
        r += 1;
    }
    for (l, side) in m.limits.iter().zip(side) {
        jar[r] = side.fma(a[l.dof], -aref[r]);
        r += 1;
    }
}

/// Adds Jᵀ W J to the Hessian and Jᵀ (f + W J a) to the right-hand side.
#[inline(always)]
fn assemble<F: Num>(
    m: &Constants<F::Real>,
    side: &[F],
    weight: &[F],
    aref: &[F],
    jar: &[F],
    hessian: &mut [F],
    rhs: &mut [F],
) {
    let mut r = 0;
    for e in &m.equalities {
        let law = equality(jar[r], weight[r]);
        let pull = law.stiffness.fma(jar[r] + aref[r], law.force);
        let (f, l, ratio) = (e.follower, e.leader, F::k(e.multiplier));
        let shared = law.stiffness * ratio;
        hessian[tri(f, f)] = hessian[tri(f, f)] + law.stiffness;
        hessian[tri(l, l)] = shared.fma(ratio, hessian[tri(l, l)]);
        let coupling = tri(f.max(l), f.min(l));
        hessian[coupling] = hessian[coupling] - shared;
        rhs[f] = rhs[f] + pull;
        rhs[l] = ratio.fnma(pull, rhs[l]);
        r += 1;
    }
    for f in &m.frictions {
        let law = dry_friction(jar[r], weight[r], F::k(f.zone), F::k(f.loss));
        let diagonal = tri(f.dof, f.dof);
        hessian[diagonal] = hessian[diagonal] + law.stiffness;
        rhs[f.dof] = rhs[f.dof] + law.stiffness.fma(jar[r] + aref[r], law.force);
        r += 1;
    }
    for (l, side) in m.limits.iter().zip(side) {
        let law = one_sided(jar[r], weight[r]);
        let diagonal = tri(l.dof, l.dof);
        hessian[diagonal] = hessian[diagonal] + law.stiffness;
        let pull = law.stiffness.fma(jar[r] + aref[r], law.force);
        rhs[l.dof] = side.fma(pull, rhs[l.dof]);
        r += 1;
    }
}

/// How many rows are on another piece of their cost.
#[inline(always)]
fn changes<F: Num>(m: &Constants<F::Real>, weight: &[F], jar: &[F], other: &[F]) -> F {
    let mut sum = F::c(0.0);
    let mut r = m.equalities.len();
    for f in &m.frictions {
        let (zone, loss) = (F::k(f.zone), F::k(f.loss));
        let before = dry_friction(jar[r], weight[r], zone, loss).state;
        let after = dry_friction(other[r], weight[r], zone, loss).state;
        sum = sum + (before - after).abs();
        r += 1;
    }
    for _ in &m.limits {
        let before = one_sided(jar[r], weight[r]).state;
        let after = one_sided(other[r], weight[r]).state;
        sum = sum + (before - after).abs();
        r += 1;
    }
    sum
}

/// Force of every row, and their sum in joint space.
#[inline(always)]
fn forces<F: Num>(
    m: &Constants<F::Real>,
    side: &[F],
    weight: &[F],
    jar: &[F],
    force: &mut [F],
    joint: &mut [F],
) {
    let mut r = 0;
    for e in &m.equalities {
        force[r] = equality(jar[r], weight[r]).force;
        joint[e.follower] = joint[e.follower] + force[r];
        joint[e.leader] = F::k(e.multiplier).fnma(force[r], joint[e.leader]);
        r += 1;
    }
    for f in &m.frictions {
        force[r] = dry_friction(jar[r], weight[r], F::k(f.zone), F::k(f.loss)).force;
        joint[f.dof] = joint[f.dof] + force[r];
        r += 1;
    }
    for (l, side) in m.limits.iter().zip(side) {
        force[r] = one_sided(jar[r], weight[r]).force;
        joint[l.dof] = side.fma(force[r], joint[l.dof]);
        r += 1;
    }
}
