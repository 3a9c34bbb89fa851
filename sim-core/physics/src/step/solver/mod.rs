//! Primal Newton solver for constrained accelerations (Todorov 2014; MuJoCo documentation,
//! "Computation: solvers").
//!
//! ```text
//! minimise over a    ½ (a - M⁻¹ τ)ᵀ M (a - M⁻¹ τ) + Σ rows s(J a - aref)
//! ```
//!
//! An iteration solves the quadratic model around `a`, whose minimum is `a⁺`:
//!
//! ```text
//! (M + Jᵀ W J) a⁺ = τ + Jᵀ (f + W J a)        f = -s',  W = s''
//! (M + Jᵀ W J) (a⁺ - a) = τ + Jᵀ f - M a       the same, where there are contacts
//! ```
//!
//! If no row changes its piece of cost between `a` and `a⁺`, the model was exact and `a⁺` is the answer. Otherwise an exact
//! line search on the segment finds the next `a` (in `f32` only after three whole steps, or where these may overshoot, as with
//! stiff pyramids). The
//! start is the result of the last step, so mostly one iteration is enough. In `f64`, the reference, the start is chosen as in
//! MuJoCo ([`start`]).
//!
//! # Rows
//!
//! Rows of joints (equalities, dry friction, limits) are known when the model is compiled. Their Jacobians have one or two
//! entries and run unrolled ([`rows`]). Those of ties, which only models from MuJoCo have, follow them ([`ties`]). Contacts are found at run time and lie in lists, one for each class of bodies that
//! the same dofs move ([`contacts`]). The solver needs a law (force, stiffness, piece of the cost) and a Jacobian of each row.
//!
//! # Precision
//!
//! In `f64` the start is MuJoCo's. For models from MuJoCo its iterations and line search are, too ([`newton`]): runs agree
//! with it to rounding even where its options stop it early. In `f32` a whole step is tried three times before a search,
//! unless a dry friction turned, since whole steps then oscillate.
//!
//! Contacts are up to 10⁶ times as stiff as bodies are heavy. So in worlds that touch, an iteration solves for the step
//! a⁺ - a, not for a⁺. It ends where the gain is what rounding alone would promise ([`Line::noise`]). A whole step that found
//! the minimum is followed by one more, unless that could gain less than the tolerance (see [`Progress::plan`]).
//!
//! Stiffer contacts leave no digit of M in the sum M + Jᵀ W J. In worlds with such a sum, contacts are added to the factor of M
//! ([`updates`]). Backends that record code are without unless they are asked for them ([`Cx::updates_factors`]).
//!
//! Where the mass matrix loses too many digits in `f32`, [`refine`] corrects the accelerations by inverse dynamics.
//!
//! # Pauses
//!
//! On the CPU a block pauses when few of its worlds go on ([`crate::arrays::Pause`]). What an iteration leaves to the next is
//! saved ([`Progress`]), with a world's part of the arrays in [`Stage::RESUMES`] and its contacts. A block of worlds from
//! several others resumes; the forces follow in a world's own block. So an iteration may keep nothing else.
//!
//! # What is skipped
//!
//! Where limits and contacts are the only rows and none acts in a block, `f32` skips the solver: the integrator factors a
//! matrix of its own. [`Accelerations`] then finds accelerations for output only.
//!
//! A contact adds Jᵀ W J to the mass matrix. Contacts that couple two trees need a larger pattern. That system is assembled
//! and solved only in worlds that have such a contact, or in blocks of worlds of which one has ([`linear`]).
//!
//! A limit that acts in no world of a block has no row ([`rows::Acting`]).
//!
//! | File | What it has |
//! |---|---|
//! | `linear` | the system of an iteration |
//! | `rows`, `cones` | laws of joint rows and of contacts: force, stiffness, cost |
//! | `rolled` | the system by loops, in recorded programs of models with many dofs |
//! | `spread` | the system, and products with M, where several lanes share a world |
//! | `ties` | sums over constraints with Jacobians found at run time |
//! | `contacts`, `assembly` | sums over contacts, and their Jᵀ W J |
//! | `updates` | contacts added to the factor of M, where they are too stiff for `f32` |
//! | `turning` | laws of contacts with torsional and rolling friction |
//! | `start` | where `f64` starts |
//! | `line` | the line search |
//! | `newton`, `bracket`, `contact_line`, `islands` | MuJoCo's iterations and line search, for its models in `f64` |
//! | `own_rows` | its rows of joints, where several lanes share a world |
//! | `hold` | contacts that slide, and are assumed to stick |
//! | `progress` | which worlds search, which have arrived, and what a pause saves |
//! | `refine` | corrections by inverse dynamics, in `f32` |
//! | `noslip` | forces of friction without regularisation, where a model asks for them |

mod assembly;
mod bracket;
mod cones;
mod contact_line;
mod contacts;
mod hold;
mod islands;
mod line;
mod linear;
mod newton;
mod noslip;
mod own_rows;
mod progress;
mod refine;
mod rolled;
mod rows;
mod spread;
mod start;
mod ties;
mod turning;
mod updates;

pub use noslip::NoSlip;
pub use refine::{Accelerations, Refine};

use super::{BlockOf, ConstantsOf, Stage};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::row;
use crate::constants::ties::TieLaw;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::factor::multiply;
use crate::{break_if, times, when};
use hold::Hold;
use line::{Line, search};
use own_rows::own_rows;
use progress::{Pieces, Plan, Progress, SearchResult};
use rows::{Acting, Jacobian, along_step, assemble, forces, residual};
use spread::Spread;
pub use spread::is_spread;
use start::choose_start;

/// Accelerations and constraint forces. Where a contact has torsional friction, `TURNS` is true: other models run a
/// solver without code for it. In `f64` all models run the one that has it.
pub struct Solver<const TURNS: bool>;

impl<const TURNS: bool> Stage for Solver<TURNS> {
    const READS: &'static [A] = &[
        A::JointQd,
        A::JointQdd,
        A::Unconverged,
        A::Params,
        A::Rotation,
        A::Origin,
        A::MassMatrix,
        A::SmoothForce,
        A::EfcD,
        A::EfcAref,
        A::LimitSide,
        A::RowJacobian,
        A::ContactRows,
    ];
    const WRITES: &'static [A] = &[
        A::JointQdd,
        A::Unconverged,
        A::EfcForce,
        A::ConstraintForce,
        A::ContactForces,
    ];

    const RESUMES: &'static [A] = &[
        A::JointQdd,
        A::Params,
        A::MassMatrix,
        A::SmoothForce,
        A::EfcD,
        A::EfcAref,
        A::LimitSide,
        A::RowJacobian,
        A::SolverProgress,
        A::SolverWork,
    ];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        let mut classes = m.contacts.classes.iter();
        (R::DOUBLE || classes.any(|class| class.turns.is_some())) == TURNS
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // this instance would double the time that the reference takes to compile
        if !TURNS && <<C::F as Num>::Real as Real>::DOUBLE {
            unreachable!("no model needs it in double precision");
        }
        solve::<C, TURNS>(cx, m, b);
    }
}

/// Newton's method, from the last step's accelerations to the minimum of the cost.
#[inline(always)]
fn solve<C: Cx, const TURNS: bool>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    // D and aref of all rows but those of contacts, as values of this stage
    gather(cx, &b.efc_weight, &mut b.work.row_weight);
    gather(cx, &b.efc_aref, &mut b.work.row_aref);
    let acting = Acting::find(cx, m, &b.work.row_weight);
    // as MuJoCo: from M⁻¹ τ where that costs less than the last step's result
    if <<C::F as Num>::Real as Real>::DOUBLE {
        choose_start::<C, TURNS>(cx, m, b, acting);
    }
    let acts = acts(cx, m, &b.efc_weight);
    // contacts are so stiff that M is lost in the rounding of H a⁺:
    // worlds with contacts solve for the correction a⁺ - a
    let corrects = contacts::touching(cx, &m.contacts);
    let coupling = linear::coupling(cx, m, corrects);
    // a constant first: precisions that never run this are compiled without it
    if <<C::F as Num>::Real as Real>::DOUBLE
        && let Some(search) = m.prescribed_search()
    {
        let problem = newton::Problem {
            search,
            acting,
            corrects,
            coupling,
        };
        newton::solve::<C, TURNS>(cx, m, b, &problem);
        constraint_forces::<C, TURNS>(cx, m, b, acting);
        return;
    }
    // where lanes share a world, H is spread over them by columns; torsional friction has no such system
    let spread = match corrects {
        Some(_) if !TURNS => Spread::new(cx, m, &b.work.mass_matrix),
        _ => None,
    };
    let spread = spread.as_ref();
    let pause = b.pause;
    let mut progress = match pause.resumes {
        false => Progress::new(cx, acts, corrects),
        true => Progress::load(cx, &b.solver_progress),
    };
    // whether the rows at a are those at the last a⁺
    let mut rows_known = false;
    // Newton's iterations, until each world has arrived or has none left
    times!(cx, m.solver.iterations, {
        if may_idle::<C>(m) {
            break_if!(cx, !acts);
        }
        if pause.resumes {
            let goes_on = progress.goes_on(cx, m);
            break_if!(cx, !goes_on);
        }
        cx.tally(&mut b.solver_work[0], &mut b.solver_block_work[0]);
        // the cost at a: residuals of the rows, H = M + Jᵀ W J and the right-hand side
        model_cost::<C, TURNS>(cx, m, b, acting, corrects, spread, rows_known);
        // its minimum a⁺, what bodies that touch gain by going there, and how much stiffer than M it is
        let hold = progress.hold(cx, m);
        let gain = minimize_model::<C, TURNS>(cx, m, b, corrects, coupling, spread, hold);
        // rows that are on another piece of their cost at a⁺
        let pieces = Pieces::compare::<TURNS>(cx, m, b, acting, corrects);
        // the worlds that search the segment from a to a⁺
        let plan = progress.plan(cx, m, &pieces, gain, corrects);
        // where on it the cost is least
        let result =
            search_segment::<C, TURNS>(cx, m, b, &mut progress, &plan, acting, corrects, spread);
        // the next a, and the worlds that have arrived
        advance(cx, b, &plan, &result);
        rows_known = !cx.anywhere(plan.searches);
        let done = progress.note(cx, &plan, &result, corrects);
        break_if!(cx, done);
        progress.count(cx);
        // so few worlds go on with others, elsewhere
        if pause.few > 0 && cx.are_few(pause.few) {
            break_if!(cx, C::F::c(0.0).lt(C::F::c(1.0)));
        }
    });
    if pause.few > 0 || pause.iterates {
        let goes_on = progress.goes_on(cx, m);
        if pause.iterates || cx.anywhere(goes_on) {
            progress.save(cx, &mut b.solver_progress);
            b.pause.paused = true;
            return;
        }
    }
    // worlds that are still busy used up their iterations
    progress.report(cx, b);

    // worlds in which nothing acts have no constraint force; the others evaluate theirs at the last a
    if may_idle::<C>(m) {
        for force in b.efc_force.iter_mut().chain(&mut b.constraint_force) {
            cx.set(force, C::F::c(0.0));
        }
        when!(cx, acts, {
            constraint_forces::<C, TURNS>(cx, m, b, acting);
        });
    } else {
        constraint_forces::<C, TURNS>(cx, m, b, acting);
    }
}

/// Writes H and the right-hand side at `a`: τ + Jᵀ (f + W J a), or τ + Jᵀ f - M a in worlds that solve for a correction.
/// [`linear::solve_system`] adds the terms of contacts.
#[inline(always)]
fn model_cost<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    acting: Acting,
    corrects: Option<MaskOf<C>>,
    spread: Option<&Spread<C::F>>,
    rows_known: bool,
) {
    let w = &mut b.work;
    // a, and τ on the right-hand side, whose place the solution takes
    for j in 0..m.dofs.len() {
        w.start[j] = cx.get(&b.joint_qdd[j]);
        w.minimum[j] = w.smooth_force[j];
    }
    // worlds that solve for a⁺ - a have τ - M a instead
    if let Some(corrects) = corrects {
        match spread {
            None => multiply(&m.pattern, &w.mass_matrix, &w.start, &mut w.joint_force),
            Some(spread) => spread.multiply(cx, &w.start, &mut w.joint_force),
        }
        for j in 0..m.dofs.len() {
            let less = w.minimum[j] - w.joint_force[j];
            w.minimum[j] = C::F::select(corrects, less, w.minimum[j]);
        }
    }
    // H = M; a spread system keeps its own M, and adds the terms of joints to it
    match spread {
        None => w.hessian.copy_from_slice(&w.mass_matrix),
        Some(_) => w.hessian.fill(C::F::c(0.0)),
    }
    // jar of joint rows and ties; then Jᵀ W J in H, and their pull on the right-hand side
    if rows_known {
        w.jar.copy_from_slice(&w.jar_minimum);
    } else {
        residual(
            m,
            Jacobian::new(acting, &w.limit_side, &w.row_jacobian),
            &w.row_aref,
            &w.start,
            &mut w.jar,
        );
    }
    assemble(m, &b.params, w, acting, corrects);
    // contacts have jar alone here: their Jᵀ W J is assembled when the system is solved
    if corrects.is_some() && rows_known {
        contacts::step_ahead::<_, TURNS>(cx, &m.contacts);
    } else if corrects.is_some() {
        contacts::residual::<_, TURNS>(cx, &m.contacts, &w.start, row::JAR);
    }
}

/// Solves for the minimum a⁺ of the model. Returns the gain of bodies in contact, where it is known, and the largest ratio of
/// diagonal entries of H and M.
#[inline(always)]
fn minimize_model<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    corrects: Option<MaskOf<C>>,
    coupling: Option<MaskOf<C>>,
    spread: Option<&Spread<C::F>>,
    hold: Option<Hold<C>>,
) -> (C::F, C::F) {
    // H x = rhs with the terms of contacts; x is a⁺, or a⁺ - a in worlds that correct
    let stiffening = match spread {
        None => {
            let unknown = linear::Unknown::Minimum(hold);
            linear::solve_system::<_, TURNS>(cx, m, b, unknown, corrects, coupling)
        }
        Some(spread) => {
            let w = &mut b.work;
            spread.solve(cx, m, &w.hessian, &mut w.minimum, Some(&mut b.pull), hold)
        }
    };
    // ½ gᵀ H⁻¹ g of bodies in contact, for `f32` alone: the reference goes on, as MuJoCo does
    let gain = match corrects {
        Some(corrects) if !<<C::F as Num>::Real as Real>::DOUBLE => {
            C::F::select(corrects, linear::touched_gain(cx, m, b), C::F::c(UNKNOWN))
        }
        _ => C::F::c(UNKNOWN),
    };
    let w = &mut b.work;
    // a⁺ = a + x where a correction was solved for
    if let Some(corrects) = corrects {
        for j in 0..m.dofs.len() {
            let whole = w.start[j] + w.minimum[j];
            w.minimum[j] = C::F::select(corrects, whole, w.minimum[j]);
        }
    }
    (gain, stiffening)
}

/// Moves to the minimum of the model, or to the point of the segment that was found.
#[inline(always)]
fn advance<C: Cx>(cx: &mut C, b: &mut BlockOf<C>, plan: &Plan<C>, result: &SearchResult<C>) {
    let (w, alpha) = (&b.work, cx.get(&result.length));
    for (j, qdd) in b.joint_qdd.iter_mut().enumerate() {
        let moved = alpha.fma(w.minimum[j] - w.start[j], w.start[j]);
        cx.set(qdd, C::F::select(plan.searches, moved, w.minimum[j]));
    }
}

/// Searches the segment from a to a⁺ for the least cost, and judges whether that ends the solve.
#[inline(always)]
#[expect(clippy::too_many_arguments)] // the parts of an iteration
fn search_segment<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    progress: &mut Progress<C>,
    plan: &Plan<C>,
    acting: Acting,
    corrects: Option<MaskOf<C>>,
    spread: Option<&Spread<C::F>>,
) -> SearchResult<C> {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    // worlds that do not search go all the way to a⁺: α = 1
    let mut result = SearchResult {
        length: cx.var(one),
        settled: cx.var(zero),
    };
    when!(cx, plan.searches, {
        cx.tally(&mut b.solver_work[1], &mut b.solver_block_work[1]);
        let w = &mut b.work;
        // s = a⁺ - a and M s: the quadratic term of p along the segment
        for j in 0..m.dofs.len() {
            w.step[j] = w.minimum[j] - w.start[j];
        }
        match spread {
            None => multiply(&m.pattern, &w.mass_matrix, &w.step, &mut w.joint_force),
            Some(spread) => spread.multiply(cx, &w.step, &mut w.joint_force),
        }
        // sᵀ M s, and Σ |τ a|: the share of smooth forces in the rounding of the gradient
        let (mut curvature, mut power) = (zero, zero);
        for j in 0..m.dofs.len() {
            curvature = w.step[j].fma(w.joint_force[j], curvature);
            power = power + (w.smooth_force[j] * w.start[j]).abs();
        }
        along_step(m, acting, &w.jar, &mut w.jar_minimum);
        // p at α = 0: its descent, and the rounding in it
        let lane_rows = own_rows(cx, m, &b.params, &b.work);
        let line = Line::new::<C, TURNS>(
            cx,
            m,
            &b.params,
            [curvature, power],
            &b.work,
            &lane_rows,
            acting,
            corrects,
        );
        // α where p'(α) = 0, and whether the gain ends the solve
        let counts = (&mut b.solver_work[2], &mut b.solver_block_work[2]);
        search::<C, TURNS>(cx, m, &line, &mut result.length, counts);
        progress.judge(cx, m, &line, &mut result, plan, corrects);
    });
    result
}

/// The worlds that have contacts now; none if no world has.
#[inline(always)]
pub(super) fn touching<C: Cx>(cx: &mut C, m: &ConstantsOf<C>) -> Option<MaskOf<C>> {
    contacts::touching(cx, &m.contacts)
}

/// Forces of the rows at the accelerations found.
#[inline(always)]
fn constraint_forces<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    acting: Acting,
) {
    let w = &mut b.work;
    let (a, joint) = (&mut w.start, &mut w.joint_force);
    let (jar, force) = (&mut w.jar, &mut w.row_force);
    let (weight, aref) = (&w.row_weight, &w.row_aref);
    // a, and Jᵀ f from 0
    for j in 0..m.dofs.len() {
        a[j] = cx.get(&b.joint_qdd[j]);
        joint[j] = C::F::c(0.0);
    }
    // f = -s'(J a - aref) of joint rows and ties, with their Jᵀ f
    residual(
        m,
        Jacobian::new(acting, &w.limit_side, &w.row_jacobian),
        aref,
        a,
        jar,
    );
    forces(
        m,
        &b.params,
        Jacobian::new(acting, &w.limit_side, &w.row_jacobian),
        [weight, jar],
        force,
        joint,
    );
    // into cells, to which the loops over contacts add their Jᵀ f
    for r in 0..m.rows() {
        cx.set(&mut b.efc_force[r], force[r]);
    }
    for j in 0..m.dofs.len() {
        cx.set(&mut b.constraint_force[j], joint[j]);
    }
    contacts::residual::<_, TURNS>(cx, &m.contacts, a, row::JAR);
    contacts::forces::<_, TURNS>(cx, &m.contacts, &mut b.constraint_force);
}

/// A gain that is not known [J/s²]: larger than any.
const UNKNOWN: f64 = 1e30;

/// The values of cells.
#[inline(always)]
fn gather<C: Cx>(cx: &mut C, cells: &[C::V], to: &mut [C::F]) {
    for (x, cell) in to.iter_mut().zip(cells) {
        *x = cx.get(cell);
    }
}

/// Can the solver skip a world in which no constraint acts?
///
/// Without constraints a = M⁻¹ τ. With damping only outputs read it: the integrator factors a matrix of its own, and the next
/// solve may start from anywhere. A block of worlds inside their limits then saves the solver, a quarter of its step. `f64` does
/// not skip: its start is MuJoCo's.
fn may_idle<C: Cx>(m: &ConstantsOf<C>) -> bool {
    let mut ties = m.ties.iter();
    // equalities and dry friction act at any position, ranges only past their bounds
    let only_limits = m.equalities.is_empty()
        && m.frictions.is_empty()
        && ties.all(|tie| matches!(tie.law, TieLaw::Range(_)));
    !<<C::F as Num>::Real as Real>::DOUBLE && only_limits && m.damped
}

/// The worlds that the solver must not skip.
#[inline(always)]
fn acts<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, weight: &[C::V]) -> MaskOf<C> {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let mut stiffest = zero;
    // above 0 where a row has a stiffness or a contact exists; in a model that may not idle all worlds act
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
