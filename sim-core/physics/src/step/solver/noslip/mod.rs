//! Forces of friction that stop slow slip (MuJoCo documentation, "Solver parameters: noslip"; `mj_solNoSlip`).
//!
//! The solver softens each row by R = 1/D, so bodies that rub slip a little under load. Sweeps over the rows of friction find
//! the forces without R, while all other forces stay. They minimise the dual cost, row by row (projected Gauss-Seidel):
//!
//! ```text
//! ½ fᵀ A f + fᵀ (J M⁻¹ τ - aref)      A = J M⁻¹ Jᵀ      |f| ≤ loss of a dry friction, ≤ μ f₀ of a contact
//! J a - aref                           its slope along f, at a = M⁻¹ (τ + Jᵀ f)
//! ```
//!
//! An island ends where a sweep gains less than tolerance × tr M. As in MuJoCo, ½ Σ R f² of its rows is a gain of the first one.
//! In `f32` a world ends as a whole.
//!
//! | File | What it has |
//! |---|---|
//! | `dry` | rows of dry friction of joints and tendons |
//! | `rubbing` | contacts in MuJoCo's order, and the change of a direction's force |
//! | `cone`, `pyramid` | the forces of a contact in its cone |
//! | `ball` | the least of a quadratic in a ball |

mod ball;
mod cone;
mod dry;
mod pyramid;
mod rubbing;

use super::contact_line::Island;
use super::gather;
use super::islands::{find, is_island, trace};
use super::rows::Acting;
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::Cone;
use crate::constants::options::NoSlip as Options;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::factor::{decompose, solve};
use crate::step::{BlockOf, ConstantsOf, Stage};
use crate::{break_if, times, when};

/// Forces of friction without their softness.
pub struct NoSlip;

impl Stage for NoSlip {
    const READS: &'static [A] = &[
        A::JointQdd,
        A::Params,
        A::Rotation,
        A::Origin,
        A::MassMatrix,
        A::SmoothForce,
        A::EfcD,
        A::EfcAref,
        A::RowJacobian,
        A::EfcForce,
        A::ConstraintForce,
        A::ContactRows,
        A::ContactForces,
    ];
    const WRITES: &'static [A] = &[
        A::JointQdd,
        A::EfcForce,
        A::ConstraintForce,
        A::ContactForces,
    ];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.solver.noslip.is_some()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        if let Some(options) = &m.solver.noslip {
            sweep_islands(cx, m, b, options);
        }
    }
}

type OptionsOf<C> = Options<<<C as Cx>::F as Num>::Real>;

/// Sweeps the rows of each island until it ends.
#[inline(always)]
fn sweep_islands<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    options: &OptionsOf<C>,
) {
    // D and aref of all rows but those of contacts
    gather(cx, &b.efc_weight, &mut b.work.row_weight);
    gather(cx, &b.efc_aref, &mut b.work.row_aref);
    factor(cx, m, b);
    // the normal forces of opposite edges, which sweeps keep
    if m.contacts.cone == Cone::Pyramidal {
        pyramid::keep_sums(cx, &m.contacts);
    }
    // a constant first: precisions that never run this are compiled without it
    if <<C::F as Num>::Real as Real>::DOUBLE
        && let Some(search) = m.prescribed_search()
    {
        // which trees constraints couple
        let acting = Acting::find(cx, m, &b.work.row_weight);
        find(cx, m, search, b, acting);
        for first in search.islands_of(m.dofs.len()) {
            // an island has the number of its first dof
            let exists = is_island(b.work.island[first], C::F::c(first as f64));
            when!(cx, exists, {
                let island = Island {
                    search,
                    labels: &b.work.island,
                    label: C::F::c(first as f64),
                };
                // a gain is measured by tr M
                let trace = trace(cx, m, &b.work, &island);
                let least = trace * C::F::k(options.tolerance);
                sweep_part(cx, m, b, options, Part(Some(first)), least);
            });
        }
        return;
    }
    sweep_part(cx, m, b, options, Part(None), C::F::k(options.least_gain));
}

/// The part of a world that sweeps visit: the island that begins with a dof, or all of it.
#[derive(Clone, Copy)]
struct Part(Option<usize>);

impl Part {
    /// The worlds in which a dof is of the part.
    #[inline(always)]
    fn has<C: Cx>(self, b: &BlockOf<C>, dof: usize) -> MaskOf<C> {
        match self.0 {
            Some(first) => is_island(b.work.island[dof], C::F::c(first as f64)),
            None => C::F::c(0.0).lt(C::F::c(1.0)),
        }
    }
}

/// Factors M into `hessian`. In `f64` a becomes M⁻¹ (τ + Jᵀ f), as exactly as MuJoCo has it. In `f32` it keeps the digits that
/// the solver and its refinement gave it.
#[inline(always)]
fn factor<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    w.hessian.copy_from_slice(&w.mass_matrix);
    if !<<C::F as Num>::Real as Real>::DOUBLE {
        decompose(&m.pattern, &mut w.hessian);
        return;
    }
    // τ + Jᵀ f; solving for a leaves the factor of M
    for j in 0..m.dofs.len() {
        w.start[j] = w.smooth_force[j] + cx.get(&b.constraint_force[j]);
    }
    solve(&m.pattern, &mut w.hessian, &mut w.start);
    for (qdd, a) in b.joint_qdd.iter_mut().zip(&w.start) {
        cx.set(qdd, *a);
    }
}

/// Sweeps the rows of a part until a sweep gains less than `least`.
#[inline(always)]
fn sweep_part<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    options: &OptionsOf<C>,
    part: Part,
    least: C::F,
) {
    // what the first sweep gains by leaving out R
    let mut gain = cx.var(C::F::c(0.0));
    softness(cx, m, b, part, &mut gain);
    times!(cx, options.iterations, {
        // joints and tendons, then contacts, each by the newest a
        dry::sweep(cx, m, b, (&options.dry_rows, part), &mut gain);
        rubbing::sweep(cx, m, b, part, &mut gain);
        let ends = cx.get(&gain).lt(least);
        break_if!(cx, ends);
        cx.set(&mut gain, C::F::c(0.0));
    });
}

/// Adds ½ Σ R f² of the rows of a part.
#[inline(always)]
fn softness<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &BlockOf<C>, part: Part, sum: &mut C::V) {
    let (zero, half) = (C::F::c(0.0), C::F::c(0.5));
    for r in 0..m.rows() {
        // a row of a part moves dofs of it alone, so any of them tells
        let dof = first_dof(m, r);
        let weight = b.work.row_weight[r];
        let counts = part.has::<C>(b, dof) & zero.lt(weight);
        // ½ f² / D
        let force = cx.get(&b.efc_force[r]);
        let cost = half * (force * force).div(C::F::select(counts, weight, C::F::c(1.0)));
        let total = cx.get(sum) + C::F::select(counts, cost, zero);
        cx.set(sum, total);
    }
    // contacts move dofs of one part alone, too
    for (k, class) in m.contacts.classes.iter().enumerate() {
        if let Some(column) = class.columns.first() {
            let here = part.has::<C>(b, column.dof);
            when!(cx, here, {
                rubbing::softness(cx, &m.contacts, k, sum);
            });
        }
    }
}

/// A dof that a row moves.
#[inline(always)]
fn first_dof<R: Real>(m: &Constants<R>, row: usize) -> usize {
    // rows are in MuJoCo's order: equalities, frictions, limits, then ties
    let (equalities, joints) = (m.equalities.len(), m.joint_rows());
    let frictions = equalities + m.frictions.len();
    match row {
        r if r < equalities => m.equalities[r].follower,
        r if r < frictions => m.frictions[r - equalities].dof,
        r if r < joints => m.limits[r - frictions].dof,
        r => m.ties[m.tie_of_row[r - joints]].dofs[0],
    }
}
