//! Primal Newton solver for constrained accelerations (Todorov 2014; MuJoCo documentation,
//! "Computation: solvers").
//!
//! ```text
//! minimise over a    ½ (a - M⁻¹ τ)ᵀ M (a - M⁻¹ τ) + Σ rows s(J a - aref)
//! ```
//!
//! A round solves the quadratic model around `a`, whose minimum is `a⁺`:
//!
//! ```text
//! (M + Jᵀ W J) a⁺ = τ + Jᵀ (f + W J a)        f = -s',  W = s''
//! (M + Jᵀ W J) (a⁺ - a) = τ + Jᵀ f - M a       the same, where there are contacts
//! ```
//!
//! If no row changes its state between `a` and `a⁺` the model was exact and `a⁺` is the answer.
//! Otherwise an exact line search on the segment finds the next `a` (in `f32` only if three whole steps
//! did not get there, or would overshoot). The start is the last step's
//! result, which mostly makes the first round the only one; in `f64`, the reference, it is chosen as
//! MuJoCo does (see [`choose_start`]).

mod contacts;
mod line;
mod refine;
mod rows;

pub(super) use refine::{accelerations, refine};

use super::{BlockOf, ConstantsOf};
use crate::constants::contact::Cone;
use crate::constants::contact::row;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::factor::{multiply, solve as solve_linear};
use crate::{break_if, times, when};
use line::{Line, search};
use rows::{assemble, changes, cost, forces, residual};

#[inline(always)]
pub(super) fn solve<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let n = m.dofs.len();
    let (zero, half, one) = (C::F::c(0.0), C::F::c(0.5), C::F::c(1.0));
    if <<C::F as Num>::Real as Real>::DOUBLE {
        choose_start(cx, m, b);
    }
    let acts = acts(cx, m, &b.efc_weight);
    let [_, _, weight, aref] = &mut b.work.row;
    gather(cx, &b.efc_weight, weight);
    gather(cx, &b.efc_aref, aref);
    let t = &m.contacts;
    // contacts are so stiff that M is lost in the rounding of H a⁺; of H (a⁺ - a) less is asked
    let corrects = contacts::touching(cx, t);
    // A factor of rows a million times as stiff as M leaves a step its first digits only: one more round finds the rest
    let polished = match corrects {
        Some(corrects) => C::F::select(corrects, zero, one),
        None => one,
    };
    let mut calm = cx.var(polished);
    let mut busy = cx.var(C::F::select(acts, one, zero));
    let mut round = cx.var(zero);
    let mut last_gain = cx.var(C::F::c(2.0 * UNKNOWN));
    times!(cx, m.solver.iterations, {
        if may_idle::<C>(m) {
            break_if!(cx, C::F::not(acts));
        }
        let w = &mut b.work;
        let [a, minimum, _, pull] = &mut w.vector;
        let [jar, _, weight, aref] = &mut w.row;
        for j in 0..n {
            a[j] = cx.get(&b.joint_qdd[j]);
            minimum[j] = w.smooth_force[j];
        }
        if let Some(corrects) = corrects {
            multiply(&m.pattern, &w.mass_matrix, a, pull);
            for j in 0..n {
                minimum[j] = C::F::select(corrects, minimum[j] - pull[j], minimum[j]);
            }
        }
        w.hessian.copy_from_slice(&w.mass_matrix);
        residual(m, &w.limit_side, aref, a, jar);
        assemble(
            m,
            &b.params,
            &w.limit_side,
            weight,
            aref,
            jar,
            &mut w.hessian,
            minimum,
            corrects,
        );
        if corrects.is_some() {
            contacts::residual(cx, t, a, row::JAR);
        }
        solve_system(cx, m, b, MINIMUM, true, corrects);
        let gain = match corrects {
            Some(corrects) if !<<C::F as Num>::Real as Real>::DOUBLE => {
                C::F::select(corrects, touched_gain(cx, m, b), C::F::c(UNKNOWN))
            }
            _ => C::F::c(UNKNOWN),
        };
        let w = &mut b.work;
        let [a, minimum, step, pull] = &mut w.vector;
        if let Some(corrects) = corrects {
            for j in 0..n {
                minimum[j] = C::F::select(corrects, a[j] + minimum[j], minimum[j]);
            }
        }
        let [jar, jar_minimum, weight, aref] = &mut w.row;
        residual(m, &w.limit_side, aref, minimum, jar_minimum);
        let [sum, turned] = changes(m, &b.params, weight, jar, jar_minimum);
        let mut moved = cx.var(sum);
        // a whole step overshoots where a contact slides, and where a dry friction turns, which it may do for ever
        let mut curved = cx.var(turned);
        if corrects.is_some() {
            contacts::residual(cx, t, minimum, row::AHEAD);
            contacts::changes(cx, t, &mut moved, &mut curved);
        }
        let changed = half.lt(cx.get(&moved));
        let later = half.lt(cx.get(&round));
        let early = cx.get(&round).lt(C::F::c(trusted_rounds::<C::F>()));
        let mut trusted = C::F::and(early, cx.get(&curved).lt(half));
        // and where a pyramid's edges are too stiff for their factor
        if let (Some(corrects), Cone::Pyramidal) = (corrects, t.cone) {
            trusted = C::F::and(trusted, C::F::not(corrects));
        }
        // what bodies that touch would gain by another round is less than the tolerance already
        let quiet = C::F::and(C::F::not(changed), gain.lt(C::F::k(m.solver.tolerance)));
        let searches = C::F::and(C::F::or(changed, later), C::F::not(trusted));
        let searches = C::F::and(searches, C::F::not(quiet));
        let mut length = cx.var(one);
        let mut settled = cx.var(zero);
        when!(cx, searches, {
            for j in 0..n {
                step[j] = minimum[j] - a[j];
            }
            multiply(&m.pattern, &w.mass_matrix, step, pull);
            let (mut curvature, mut power) = (zero, zero);
            for j in 0..n {
                curvature = step[j].fma(pull[j], curvature);
                power = power + (w.smooth_force[j] * a[j]).abs();
            }
            for r in 0..m.rows() {
                jar_minimum[r] = jar_minimum[r] - jar[r];
            }
            let rows = [&weight[..], jar, jar_minimum, aref];
            let line = Line::new(cx, m, &b.params, curvature, power, rows, corrects);
            search::<C>(cx, m, &line, &mut length);
            // The model promises a gain of ½ |p'(0)|. Below the tolerance the step is not taken, as in
            // MuJoCo, but for the first; below what rounding makes it is the last that can help. In `f32` it is the last
            // too if Newton's next one, of which the gain shrinks with the square, would be below the tolerance.
            let gain = half * line.descent;
            let small = C::F::and(later, gain.lt(C::F::k(m.solver.tolerance)));
            let mut last = gain.lt(line.noise);
            if let Some(corrects) = corrects {
                let before = cx.get(&last_gain);
                // Newton's gains shrink fast; one that does not, and is hardly more than rounding, is rounding
                let stalls = (C::F::c(STALLED) * before).lt(gain);
                let is_small = gain.lt(line.noise * C::F::c(DOUBTED));
                let mut ends = C::F::and(stalls, is_small);
                if !<<C::F as Num>::Real as Real>::DOUBLE {
                    let next = gain * gain;
                    let is_enough = next.lt(C::F::k(m.solver.tolerance) * before);
                    let off = (cx.get(&length) - one).abs();
                    let is_newtons = C::F::and(off.lt(C::F::c(0.25)), before.lt(C::F::c(UNKNOWN)));
                    ends = C::F::or(ends, C::F::and(is_enough, is_newtons));
                }
                last = C::F::or(last, C::F::and(corrects, ends));
                cx.set(&mut last_gain, gain);
            }
            cx.set(&mut settled, C::F::select(C::F::or(small, last), one, zero));
            let alpha = cx.get(&length);
            cx.set(&mut length, C::F::select(small, zero, alpha));
        });
        let alpha = cx.get(&length);
        for j in 0..n {
            let moved = alpha.fma(minimum[j] - a[j], a[j]);
            cx.set(
                &mut b.joint_qdd[j],
                C::F::select(searches, moved, minimum[j]),
            );
        }
        let is_calm = C::F::or(half.lt(cx.get(&calm)), quiet);
        let ends = C::F::and(C::F::not(changed), is_calm);
        let done = C::F::or(ends, half.lt(cx.get(&settled)));
        if let Some(corrects) = corrects {
            let again = C::F::and(corrects, changed);
            cx.set(&mut calm, C::F::select(again, zero, one));
        }
        cx.set(&mut busy, C::F::select(done, zero, one));
        break_if!(cx, done);
        let rounds = cx.get(&round) + one;
        cx.set(&mut round, rounds);
    });
    let unconverged = cx.get(&b.unconverged[0]).max(cx.get(&busy));
    cx.set(&mut b.unconverged[0], unconverged);

    if may_idle::<C>(m) {
        for force in b.efc_force.iter_mut().chain(&mut b.constraint_force) {
            cx.set(force, zero);
        }
        when!(cx, acts, {
            constraint_forces(cx, m, b);
        });
    } else {
        constraint_forces(cx, m, b);
    }
}

/// The worlds that have contacts now; none if no world has.
#[inline(always)]
pub(super) fn touching<C: Cx>(cx: &mut C, m: &ConstantsOf<C>) -> Option<MaskOf<C>> {
    contacts::touching(cx, &m.contacts)
}

/// Forces of the rows at the accelerations found.
#[inline(always)]
fn constraint_forces<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    let [a, joint, ..] = &mut w.vector;
    let [jar, force, weight, aref] = &mut w.row;
    for j in 0..m.dofs.len() {
        a[j] = cx.get(&b.joint_qdd[j]);
        joint[j] = C::F::c(0.0);
    }
    residual(m, &w.limit_side, aref, a, jar);
    forces(m, &b.params, &w.limit_side, weight, jar, force, joint);
    for r in 0..m.rows() {
        cx.set(&mut b.efc_force[r], force[r]);
    }
    for j in 0..m.dofs.len() {
        cx.set(&mut b.constraint_force[j], joint[j]);
    }
    contacts::residual(cx, &m.contacts, a, row::JAR);
    contacts::forces(cx, &m.contacts, &mut b.constraint_force);
}

/// A gain above this share of the last round's is no progress of Newton's method [–].
const STALLED: f64 = 0.25;
/// Without progress, a gain up to this many times [`Line::noise`] is taken for noise [–]. Of 327 states of random piles,
/// both cones, no acceleration is then off by more than 3e-4 in `f32`, where 10,000 times leave 2e-3.
const DOUBTED: f64 = 100.0;

/// No gain is as large [J/s²].
const UNKNOWN: f64 = 1e30;

/// Which of the scratch vectors has the right-hand side of a round, and then its minimum.
const MINIMUM: usize = 1;

/// Solves (M + JᵀWJ) x = rhs in place, in scratch vector `x`; the Hessian has the joint rows already, and the
/// contacts' force is added to the right-hand side if `pulls`. `touching` is that of [`contacts::touching`].
///
/// A world whose contacts couple what the mass matrix does not solves a larger system; the others need not.
#[inline(always)]
fn solve_system<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    x: usize,
    pulls: bool,
    touching: Option<MaskOf<C>>,
) {
    let t = &m.contacts;
    let w = &mut b.work;
    let touches = touching.is_some();
    if touches {
        for (cell, value) in b.system.iter_mut().zip(&w.hessian) {
            cx.put(cell, *value);
        }
        for (cell, value) in b.pull.iter_mut().zip(&w.vector[x]) {
            cx.put(cell, *value);
        }
    }
    let couples = touches && t.couples();
    let coupling = contacts::coupling(cx, t);
    let (none, half) = (coupling.lt(C::F::c(0.5)), C::F::c(0.5));
    // a loop, so that assembly and solver are compiled once: they are long
    for larger in [false, true] {
        if larger && !couples {
            break;
        }
        let solves = if larger { half.lt(coupling) } else { none };
        if larger {
            when!(cx, solves, {
                for cell in &mut b.coupled_system {
                    cx.put(cell, C::F::c(0.0));
                }
                for (cell, &place) in b.system.iter().zip(&m.coupled.places) {
                    let value = cx.get(cell);
                    cx.put(&mut b.coupled_system[place], value);
                }
            });
        }
        let (pattern, cells, matrix) = if larger {
            (
                &m.coupled.pattern,
                &mut b.coupled_system,
                &mut w.coupled_hessian,
            )
        } else {
            (&m.pattern, &mut b.system, &mut w.hessian)
        };
        if touches {
            for k in 0..t.classes.len() {
                if t.classes[k].couples == larger {
                    contacts::assemble(cx, t, k, cells, &mut b.pull, pulls);
                }
            }
        }
        when!(cx, solves, {
            if touches {
                gather(cx, cells, matrix);
                gather(cx, &b.pull, &mut w.vector[x]);
            }
            solve_linear(pattern, matrix, &mut w.vector[x]);
            for (cell, value) in b.solution.iter_mut().zip(&w.vector[x]) {
                cx.set(cell, *value);
            }
        });
    }
    gather(cx, &b.solution, &mut w.vector[x]);
}

/// The gain of a whole step, ½ gᵀ H⁻¹ g, of the parts of the mass matrix in which bodies touch; more where contacts
/// of several classes touch one part. The others are solved to rounding, however far they go.
///
/// The step is in scratch vector [`MINIMUM`], the gradient is the right-hand side that it was solved for.
#[inline(always)]
fn touched_gain<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) -> C::F {
    let (zero, half) = (C::F::c(0.0), C::F::c(0.5));
    let [_, step, gains, _] = &mut b.work.vector;
    for (gain, rows) in gains.iter_mut().zip(m.pattern.parts()) {
        let mut sum = zero;
        for j in rows {
            sum = cx.get(&b.pull[j]).fma(step[j], sum);
        }
        // alone, a part of what contacts couple may lose
        *gain = half * sum.abs();
    }
    let mut sum = zero;
    for (k, class) in m.contacts.classes.iter().enumerate() {
        let at = cx.at(k);
        let touches = half.lt(cx.load(m.contacts.memory.counts, at, 0));
        for &part in &class.parts {
            sum = sum + C::F::select(touches, gains[part], zero);
        }
    }
    sum
}

/// The values of cells.
#[inline(always)]
fn gather<C: Cx>(cx: &mut C, cells: &[C::V], to: &mut [C::F]) {
    for (x, cell) in to.iter_mut().zip(cells) {
        *x = cx.get(cell);
    }
}

/// Can the solver pass over a world in which no constraint acts?
///
/// Without constraints a = M⁻¹ τ. If a drive is damped only the outside reads that: the integrator factors
/// a matrix of its own, and the next solve can start from anywhere. So a block of worlds that stay inside
/// their limits saves the solver, a quarter of its step. In `f64` the start is MuJoCo's.
fn may_idle<C: Cx>(m: &ConstantsOf<C>) -> bool {
    let only_limits = m.equalities.is_empty() && m.frictions.is_empty();
    !<<C::F as Num>::Real as Real>::DOUBLE && only_limits && m.damped
}

/// The worlds that the solver may not pass over.
#[inline(always)]
fn acts<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, weight: &[C::V]) -> MaskOf<C> {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let mut stiffest = zero;
    if may_idle::<C>(m) {
        for weight in weight {
            stiffest = stiffest.max(cx.get(weight));
        }
        stiffest = stiffest.max(contacts::count(cx, &m.contacts));
    } else {
        stiffest = one;
    }
    zero.lt(stiffest)
}

/// Rounds that take the whole step without a line search, which costs as much as two rounds.
///
/// Newton's method on a piecewise quadratic mostly ends by itself in two or three; a world that goes
/// on after these searches. The reference always searches, since MuJoCo does.
fn trusted_rounds<F: Num>() -> f64 {
    if F::Real::DOUBLE { -1.0 } else { 2.5 }
}

/// Starts from M⁻¹ τ where that costs less than the last step's result (MuJoCo: `mj_warmstart`).
///
/// The minimum is the same; where the tolerance stops the solver short of it depends on the start by
/// up to 5e-4 in q̈, which the reference must reproduce. In `f32` it is not worth a factor and the
/// extra rounds: a start without constraints changes the state of more rows.
#[inline(always)]
fn choose_start<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let n = m.dofs.len();
    let w = &mut b.work;
    let [warm, smooth, ahead, pull] = &mut w.vector;
    let [jar, jar_smooth, weight, aref] = &mut w.row;
    gather(cx, &b.efc_weight, weight);
    gather(cx, &b.efc_aref, aref);
    w.hessian.copy_from_slice(&w.mass_matrix);
    smooth.copy_from_slice(&w.smooth_force);
    solve_linear(&m.pattern, &mut w.hessian, smooth);
    for j in 0..n {
        warm[j] = cx.get(&b.joint_qdd[j]);
        ahead[j] = warm[j] - smooth[j];
    }
    residual(m, &w.limit_side, aref, warm, jar);
    residual(m, &w.limit_side, aref, smooth, jar_smooth);
    multiply(&m.pattern, &w.mass_matrix, ahead, pull);
    let mut gauss = C::F::c(0.0);
    for j in 0..n {
        gauss = ahead[j].fma(pull[j], gauss);
    }
    let mut cost_warm = cx.var(gauss.fma(C::F::c(0.5), cost(m, &b.params, weight, jar)));
    let mut cost_smooth = cx.var(cost(m, &b.params, weight, jar_smooth));
    contacts::residual(cx, &m.contacts, warm, row::JAR);
    contacts::residual(cx, &m.contacts, smooth, row::AHEAD);
    contacts::cost(cx, &m.contacts, row::JAR, &mut cost_warm);
    contacts::cost(cx, &m.contacts, row::AHEAD, &mut cost_smooth);
    let cheaper = cx.get(&cost_smooth).lt(cx.get(&cost_warm));
    for j in 0..n {
        cx.set(
            &mut b.joint_qdd[j],
            C::F::select(cheaper, smooth[j], warm[j]),
        );
    }
}
