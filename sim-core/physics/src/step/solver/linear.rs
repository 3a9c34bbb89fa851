//! The linear system of an iteration, H x = rhs, with the terms of contacts.

use super::{contacts, gather};
use crate::lane::{Cx, MaskOf, Num};
use crate::math::factor::solve as solve_linear;
use crate::step::{BlockOf, ConstantsOf};
use crate::when;

/// What is solved for. It takes the place of its right-hand side.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Unknown {
    /// The minimum of the model, in `minimum`; contact forces are added to the right-hand side.
    Minimum,
    /// A correction of accelerations, in `missing`.
    Missing,
}

/// Solves (M + Jᵀ W J) x = rhs. `hessian` has the rows of joints already; `touching` is that of [`contacts::touching`].
///
/// A world whose contacts couple dofs that the mass matrix does not couple solves a larger system.
#[inline(always)]
pub(super) fn solve_system<C: Cx, const TURNS: bool>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    x: Unknown,
    touching: Option<MaskOf<C>>,
) {
    let t = &m.contacts;
    let w = &mut b.work;
    let (vector, pulls) = match x {
        Unknown::Minimum => (&mut w.minimum, true),
        Unknown::Missing => (&mut w.missing, false),
    };
    let touches = touching.is_some();
    if touches {
        for (cell, value) in b.system.iter_mut().zip(&w.hessian) {
            cx.put(cell, *value);
        }
        for (cell, value) in b.pull.iter_mut().zip(&*vector) {
            cx.put(cell, *value);
        }
    }
    let couples = touches && t.couples();
    let coupling = contacts::coupling(cx, t);
    let (none, half) = (coupling.lt(C::F::c(0.5)), C::F::c(0.5));
    // a loop, so that assembly and factorisation are compiled once: they are long
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
                    contacts::assemble::<_, TURNS>(cx, t, k, cells, &mut b.pull, pulls);
                }
            }
        }
        when!(cx, solves, {
            if touches {
                gather(cx, cells, matrix);
                gather(cx, &b.pull, vector);
            }
            solve_linear(pattern, matrix, vector);
            for (cell, value) in b.solution.iter_mut().zip(&*vector) {
                cx.set(cell, *value);
            }
        });
    }
    gather(cx, &b.solution, vector);
}

/// The gain of a whole step, ½ gᵀ H⁻¹ g, summed over the parts of the mass matrix with contacts; a part that several classes
/// touch counts several times. Parts without contacts are solved to rounding in any case.
///
/// The step is in `minimum`, the gradient is the right-hand side that it was solved for.
#[inline(always)]
pub(super) fn touched_gain<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) -> C::F {
    let (zero, half) = (C::F::c(0.0), C::F::c(0.5));
    let (step, gains) = (&b.work.minimum, &mut b.work.step);
    for (gain, rows) in gains.iter_mut().zip(m.pattern.parts()) {
        let mut sum = zero;
        for j in rows {
            sum = cx.get(&b.pull[j]).fma(step[j], sum);
        }
        // one part of a coupled system may have a negative gain
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
