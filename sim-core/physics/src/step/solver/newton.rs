//! Newton's method with MuJoCo's steps and ends, for its models in `f64`: runs that its options stop early end as MuJoCo's.
//!
//! ```text
//! s = -H⁻¹ g        g = M a - τ - Jᵀ f        c = 1 / tr M
//! ends where  c |g| and c ½ gᵀ H⁻¹ g are below the tolerance; after a step where one of them is, or c times its gain (≥ 0)
//! a += α s          |p'(α)| < tolerance ls_tolerance |s| / c        see `bracket`
//! ```
//!
//! Each island has its own α and ends on its own (see [`islands`]). H does not couple islands, so one factorisation gives the
//! steps of all.

use super::bracket::{Segment, search};
use super::contact_line::{self, Island};
use super::islands::{dot, find, force_norm, is_island, norm, trace};
use super::rows::{Acting, Jacobian, residual};
use super::{constraint_forces, minimize_model, model_cost};
use crate::constants::options::Search;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::factor::multiply;
use crate::step::{BlockOf, ConstantsOf};
use crate::{break_if, times, when};

/// A step below which MuJoCo does not search a line.
const STEP_MIN: f64 = 1e-15;

/// What holds for a whole solve.
pub(super) struct Problem<'a, C: Cx> {
    pub search: &'a Search<<C::F as Num>::Real>,
    pub acting: Acting,
    pub corrects: Option<MaskOf<C>>,
    pub coupling: Option<MaskOf<C>>,
}

/// Moves `joint_qdd` from its start to where MuJoCo's solver ends. `minimum` has M⁻¹ τ.
#[inline(always)]
pub(super) fn solve<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    problem: &Problem<'_, C>,
) {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let dofs = m.dofs.len();
    // trees that no constraint acts on end at M⁻¹ τ, the others begin at the chosen start.
    // An island is marked busy at its first dof
    find(cx, m, problem.search, b, problem.acting);
    for j in 0..dofs {
        let constrained = b.work.island[j].lt(C::F::c(dofs as f64));
        let start = cx.get(&b.joint_qdd[j]);
        let start = C::F::select(constrained, start, b.work.minimum[j]);
        cx.set(&mut b.joint_qdd[j], start);
        let is_first = is_island(b.work.island[j], C::F::c(j as f64));
        cx.set(&mut b.busy[j], C::F::select(is_first, one, zero));
    }
    let mut iteration = cx.var(zero);
    // iterations, until no island of any world is busy
    times!(cx, m.solver.iterations, {
        cx.tally(&mut b.solver_work[0], &mut b.solver_block_work[0]);
        // Jᵀ f at a, then the quadratic model and its minimum a⁺
        constraint_forces::<C, TURNS>(cx, m, b, problem.acting);
        model_cost::<C, TURNS>(cx, m, b, problem.acting, problem.corrects, None, false);
        minimize_model::<C, TURNS>(cx, m, b, problem.corrects, problem.coupling, None, None);
        let w = &mut b.work;
        // M a - τ, the gradient g = M a - τ - Jᵀ f, and s = a⁺ - a
        multiply(&m.pattern, &w.mass_matrix, &w.start, &mut w.gauss_gradient);
        for j in 0..dofs {
            w.gauss_gradient[j] = w.gauss_gradient[j] - w.smooth_force[j];
            w.missing[j] = w.gauss_gradient[j] - cx.get(&b.constraint_force[j]);
            w.step[j] = w.minimum[j] - w.start[j];
        }
        // along the steps of all islands: none is coupled to another one
        multiply(&m.pattern, &w.mass_matrix, &w.step, &mut w.joint_force);
        // J s of all rows: how jar changes along the step; with aref = 0 the residual is J s
        w.row_force.fill(zero);
        let jacobian = Jacobian::new(problem.acting, &w.limit_side, &w.row_jacobian);
        residual(m, jacobian, &w.row_force, &w.step, &mut w.jar_minimum);
        contact_line::changes::<_, TURNS>(cx, &m.contacts, &w.step);
        // each busy island searches its own line and moves on it
        let later = C::F::c(0.5).lt(cx.get(&iteration));
        let mut busy = zero;
        for first in problem.search.islands_of(dofs) {
            let goes_on = C::F::c(0.5).lt(cx.get(&b.busy[first]));
            when!(cx, goes_on, {
                step::<C, TURNS>(cx, m, b, problem, first, later);
            });
            busy = busy.max(cx.get(&b.busy[first]));
        }
        break_if!(cx, busy.lt(C::F::c(0.5)));
        let count = cx.get(&iteration) + one;
        cx.set(&mut iteration, count);
    });
    // at a tolerance of 0 MuJoCo iterates to the end, wherever it is: that tells nothing
    if problem.search.tolerance.to_f64() > 0.0 {
        let mut unconverged = cx.get(&b.unconverged[0]);
        for busy in &b.busy {
            unconverged = unconverged.max(cx.get(busy));
        }
        cx.set(&mut b.unconverged[0], unconverged);
    }
}

/// Moves an island along its step, and ends it where that has arrived.
fn step<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    problem: &Problem<'_, C>,
    first: usize,
    later: MaskOf<C>,
) {
    let (zero, half) = (C::F::c(0.0), C::F::c(0.5));
    let tolerance = C::F::k(problem.search.tolerance);
    let w = &b.work;
    let island = Island {
        search: problem.search,
        labels: &w.island,
        label: C::F::c(first as f64),
    };
    // -g · s = gᵀ H⁻¹ g, tr M = 1 / c, |g| and |s|, the last three in MuJoCo's velocities
    let descent = -dot(cx, &island, &w.step, &w.missing);
    let trace = trace(cx, m, w, &island);
    let gradient = force_norm(cx, m, w, &island, &w.missing);
    let length = norm(cx, m, w, &island, &w.step);
    // arrived where both measures are below the tolerance, after a step where one is, or where s is too short
    let small = (half * descent).div(trace).lt(tolerance);
    let flat = gradient.div(trace).lt(tolerance);
    let near = (small & flat) | (later & (small | flat));
    let arrived = near | length.lt(C::F::c(STEP_MIN));
    let goes_on = !arrived;
    let mut ends = cx.var(C::F::c(1.0));
    when!(cx, goes_on, {
        cx.tally(&mut b.solver_work[1], &mut b.solver_block_work[1]);
        // slope s · (M a - τ) and curvature sᵀ M s of the smooth term; the slope at which the search ends
        let gauss =
            [&w.gauss_gradient, &w.joint_force].map(|terms| dot(cx, &island, &w.step, terms));
        let bound = tolerance * C::F::k(problem.search.ls_tolerance) * length * trace;
        let line = Segment {
            params: &b.params,
            w,
            acting: problem.acting,
            island,
            gauss,
            bound,
        };
        // α of the least cost, and what it gains
        let counts = (&mut b.solver_work[2], &mut b.solver_block_work[2]);
        let answer = search::<C, TURNS>(cx, m, &line, counts);
        let (alpha, cost) = (cx.get(&answer.alpha), cx.get(&answer.cost));
        // a += α s, in the trees of this island
        for segment in problem.search.segments() {
            let here = island.has(segment.start);
            if cx.anywhere(here) {
                for j in segment {
                    let before = cx.get(&b.joint_qdd[j]);
                    let moved = alpha.fma(w.step[j], before);
                    cx.set(&mut b.joint_qdd[j], C::F::select(here, moved, before));
                }
            }
        }
        // no point costs less than the start
        let stays = !zero.lt(alpha.abs());
        // a step that lost is followed by another one
        let gains_little = !zero.lt(cost) & (-cost).div(trace).lt(tolerance);
        let ended = C::F::select(stays | gains_little, C::F::c(1.0), zero);
        cx.set(&mut ends, ended);
    });
    let busy = C::F::c(1.0) - cx.get(&ends);
    cx.set(&mut b.busy[first], busy);
}
