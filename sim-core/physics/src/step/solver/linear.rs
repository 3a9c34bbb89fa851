//! The linear system of an iteration, H x = rhs, with the terms of contacts.

use super::hold::Hold;
use super::rolled::Rolled;
use super::{assembly, contacts, gather, updates};
use crate::arrays::Workspace;
use crate::constants::Constants;
use crate::constants::rolled::RolledSystem;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::factor::{Pattern, solve as solve_linear};
use crate::step::{BlockOf, ConstantsOf};
use crate::when;

/// What is solved for. It takes the place of its right-hand side.
pub(super) enum Unknown<C: Cx> {
    /// The minimum of the model, in which some contacts are held, in `minimum`; contact forces are added to the right-hand side.
    Minimum(Option<Hold<C>>),
    /// A correction of accelerations, in `missing`.
    Missing,
}

/// Where an unknown is kept.
#[derive(Clone, Copy)]
pub(super) enum Target {
    Minimum,
    Missing,
}

impl Target {
    #[inline(always)]
    pub fn values<F: Num>(self, w: &mut Workspace<F>) -> &mut [F] {
        match self {
            Target::Minimum => &mut w.minimum,
            Target::Missing => &mut w.missing,
        }
    }
}

impl<C: Cx> Unknown<C> {
    #[inline(always)]
    fn target(&self) -> Target {
        match self {
            Unknown::Minimum(_) => Target::Minimum,
            Unknown::Missing => Target::Missing,
        }
    }
}

/// Worlds whose contacts couple dofs that the mass matrix does not couple; none if no world has such contacts. `touching` is
/// that of [`contacts::touching`].
#[inline(always)]
pub(super) fn coupling<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    touching: Option<MaskOf<C>>,
) -> Option<MaskOf<C>> {
    if touching.is_none() || !m.contacts.couples() {
        return None;
    }
    // a block without such a contact in any world assembles no larger system
    let some = C::F::c(0.5).lt(contacts::coupling(cx, &m.contacts));
    cx.anywhere(some).then_some(some)
}

/// Solves (M + Jᵀ W J) x = rhs. `hessian` has the rows of joints already; `touching` is that of [`contacts::touching`],
/// `coupling` that of [`coupling`].
///
/// Returns the largest ratio of diagonal entries of H and M: how much stiffer contacts make the system.
#[inline(always)]
pub(super) fn solve_system<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    x: Unknown<C>,
    touching: Option<MaskOf<C>>,
    coupling: Option<MaskOf<C>>,
) -> C::F {
    if C::TAKES_HEAPS
        && let Some(tables) = m.contacts.rolled
    {
        return solve_rolled::<_, TURNS>(cx, m, b, x, tables);
    }
    let stiff_touching = touching.filter(|_| updates::may_be_stiff(cx, &m.contacts));
    let target = x.target();
    // worlds whose matrix turns out to have lost M solve once more, from M and the rows of joints
    if stiff_touching.is_some() {
        b.work.joint_system.copy_from_slice(&b.work.hessian);
    }
    let stiffening = solve_sum::<_, TURNS>(cx, m, b, x, touching, coupling);
    if let Some(touching) = stiff_touching {
        updates::solve_again::<_, TURNS>(cx, m, b, target, (stiffening, touching), coupling);
    }
    without_signs_of_zeros(target.values(&mut b.work));
    stiffening
}

/// [`solve_system`] by loops over a matrix of all dofs.
#[inline(always)]
fn solve_rolled<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    x: Unknown<C>,
    tables: RolledSystem,
) -> C::F {
    let w = &mut b.work;
    let system = Rolled::<C> {
        tables,
        contacts: &m.contacts,
        pattern: &m.pattern,
        mass: &w.mass_matrix,
        with_joints: &w.hessian,
        asks_for_stiffness: asks_for_stiffness(m),
    };
    match x {
        Unknown::Minimum(hold) => {
            system.solve::<TURNS>(cx, &mut w.minimum, Some(&mut b.pull), hold)
        }
        // the right-hand side of a correction is complete: contacts add to H alone
        Unknown::Missing => system.solve::<TURNS>(cx, &mut w.missing, None, None),
    }
}

/// [`solve_system`] by the sum of M and the terms of all rows.
///
/// A world whose contacts couple dofs that the mass matrix does not couple solves a larger system. A block in lockstep solves it
/// for all of its worlds.
#[inline(always)]
fn solve_sum<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    x: Unknown<C>,
    touching: Option<MaskOf<C>>,
    coupling: Option<MaskOf<C>>,
) -> C::F {
    let t = &m.contacts;
    let w = &mut b.work;
    // the right-hand side of a correction is complete: contacts add to H alone
    let (vector, pulls, hold) = match x {
        Unknown::Minimum(hold) => (&mut w.minimum, true, hold),
        Unknown::Missing => (&mut w.missing, false, None),
    };
    let touches = touching.is_some();
    // matrix and right-hand side as cells, since the loops over contacts add to cells
    if touches {
        cx.put_values(&w.hessian, &mut b.system);
        for (cell, value) in b.pull.iter_mut().zip(&*vector) {
            cx.put(cell, *value);
        }
    }
    // of the worlds that are still solved for
    let couples = match coupling {
        Some(some) => cx.anywhere(some),
        None => false,
    };
    // the larger system has the same solution where nothing couples: a block in lockstep solves one of the two
    let solves_both = couples && !C::LOCKSTEP;
    let mut stiffening = cx.var(C::F::c(1.0));
    // a loop, so that assembly and factorisation are compiled once: they are long
    for larger in [false, true] {
        if larger && !couples {
            break;
        }
        // the larger system takes over what the smaller one has: M, joint rows, contacts that couple nothing
        if let (true, Some(some)) = (larger, coupling) {
            when!(cx, some, {
                let smaller = &*cx.cells(&mut w.hessian, &mut b.system);
                let cells = cx.cells(&mut w.coupled_hessian, &mut b.coupled_system);
                widen(cx, &m.coupled.places, smaller, cells);
            });
        }
        // M's pattern, or the one with couplings
        let coupled = (&mut w.coupled_hessian, &mut b.coupled_system);
        let (pattern, (matrix, system)) = match larger {
            true => (&m.coupled.pattern, coupled),
            false => (&m.pattern, (&mut w.hessian, &mut b.system)),
        };
        // Jᵀ W J and Jᵀ f of contacts whose entries lie in M's pattern, then in the larger system of the others
        if touches {
            let cells = cx.cells(matrix, system);
            for k in (0..t.classes.len()).filter(|&k| t.classes[k].couples == larger) {
                assembly::assemble::<_, TURNS>(cx, t, k, cells, &mut b.pull, pulls, hold);
            }
        }
        // each world solves the smallest system that has all of its contacts, and leaves x in `solution`
        if let (true, Some(some)) = (solves_both, coupling) {
            let solves = if larger { some } else { !some };
            when!(cx, solves, {
                cx.get_values(matrix, system);
                gather(cx, &b.pull, vector);
                let ratio = stiffening_of(m, pattern, matrix, &w.mass_matrix);
                cx.set(&mut stiffening, ratio);
                solve_linear(pattern, matrix, vector);
                for (cell, value) in b.solution.iter_mut().zip(&*vector) {
                    cx.set(cell, *value);
                }
            });
        } else if larger == couples {
            if touches {
                cx.get_values(matrix, system);
                gather(cx, &b.pull, vector);
                let ratio = stiffening_of(m, pattern, matrix, &w.mass_matrix);
                cx.put(&mut stiffening, ratio);
            }
            solve_linear(pattern, matrix, vector);
        }
    }
    // each world's x, from whichever system it solved
    if solves_both {
        gather(cx, &b.solution, vector);
    }
    cx.get(&stiffening)
}

/// A 0 that a larger system was solved for may have another sign: all become +0.
#[inline(always)]
fn without_signs_of_zeros<F: Num>(vector: &mut [F]) {
    for x in vector {
        *x = *x + F::c(0.0);
    }
}

/// Copies a system to the places that it has in a larger one, which is 0 elsewhere.
#[inline(always)]
pub(super) fn widen<C: Cx>(cx: &mut C, places: &[usize], smaller: &[C::V], larger: &mut [C::V]) {
    for cell in &mut *larger {
        cx.put(cell, C::F::c(0.0));
    }
    for (cell, &place) in smaller.iter().zip(places) {
        let value = cx.get(cell);
        cx.put(&mut larger[place], value);
    }
}

/// Is the ratio of H(j,j) and M(j,j) of use? It scales the rounding of the step, which inverse dynamics corrects if the model has
/// refinements; it also tells whether H has lost M.
#[inline(always)]
fn asks_for_stiffness<R: Real>(m: &Constants<R>) -> bool {
    !R::DOUBLE && (m.solver.refinements == 0 || m.contacts.are_stiff)
}

/// The largest ratio of diagonal entries of H and M; 1 where it is of no use.
#[inline(always)]
fn stiffening_of<F: Num>(
    m: &Constants<F::Real>,
    pattern: &Pattern,
    hessian: &[F],
    mass_matrix: &[F],
) -> F {
    let mut largest = F::c(1.0);
    if asks_for_stiffness(m) {
        for j in 0..m.dofs.len() {
            let ratio = hessian[pattern.at(j, j)].div(mass_matrix[m.pattern.at(j, j)]);
            largest = ratio.max(largest);
        }
    }
    largest
}

/// The gain of a whole step, ½ gᵀ H⁻¹ g, summed over the parts of the mass matrix with contacts; a part that several classes
/// touch counts several times. Parts without contacts are solved to rounding in any case.
///
/// The step is in `minimum`, the gradient is the right-hand side that it was solved for.
#[inline(always)]
pub(super) fn touched_gain<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) -> C::F {
    let (zero, half) = (C::F::c(0.0), C::F::c(0.5));
    let (step, gains) = (&b.work.minimum, &mut b.work.step);
    // ½ g · x of each part of the mass matrix, with x = H⁻¹ g
    for (gain, rows) in gains.iter_mut().zip(m.pattern.parts()) {
        let mut sum = zero;
        for j in rows {
            sum = cx.get(&b.pull[j]).fma(step[j], sum);
        }
        // one part of a coupled system may have a negative gain
        *gain = half * sum.abs();
    }
    let mut sum = zero;
    // parts that contacts of a class touch, in the worlds that have some now
    for (k, class) in m.contacts.classes.iter().enumerate() {
        let at = cx.at(k);
        let touches = half.lt(cx.load(m.contacts.memory.counts, at, 0));
        for &part in &class.parts {
            sum = sum + C::F::select(touches, gains[part], zero);
        }
    }
    sum
}
