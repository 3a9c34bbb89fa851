//! Dry friction of joints and tendons: a force within ± its loss.
//!
//! ```text
//! f⁺ = clamp(f - (J a - aref) / A, ± loss)      A = J M⁻¹ Jᵀ
//! ```

use super::super::rows::bounds;
use super::Part;
use super::rubbing::{DIAGONAL_MIN, gained};
use crate::constants::options::DryRow;
use crate::constants::ties::TieLaw;
use crate::lane::{Cx, Num};
use crate::math::factor::substitute;
use crate::step::{BlockOf, ConstantsOf};

/// One sweep over the rows of a part, in MuJoCo's order; adds what it gains.
#[inline(always)]
pub(super) fn sweep<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    (rows, part): (&[DryRow], Part),
    gain: &mut C::V,
) {
    let zero = C::F::c(0.0);
    for dry in rows {
        // J as a vector of all dofs, in `minimum`; the bound of the force
        let (loss, dof) = read_row::<C>(m, b, dry);
        let here = part.has::<C>(b, dof) & zero.lt(b.work.row_weight[dry.row]);
        // rows of other parts, and those that do not act
        if !cx.anywhere(here) {
            continue;
        }
        // M⁻¹ Jᵀ, the residual J a - aref, and A
        let w = &mut b.work;
        w.step.copy_from_slice(&w.minimum);
        substitute(&m.pattern, &w.hessian, &mut w.step);
        let mut residual = -w.row_aref[dry.row];
        let mut diagonal = zero;
        for j in 0..m.dofs.len() {
            residual = w.minimum[j].fma(cx.get(&b.joint_qdd[j]), residual);
            diagonal = w.minimum[j].fma(w.step[j], diagonal);
        }
        // the force of no residual, within its bounds: f⁺
        let force = cx.get(&b.efc_force[dry.row]);
        let free = force - residual.div(diagonal.max(C::F::c(DIAGONAL_MIN)));
        let bounded = free.max(-loss).min(loss);
        let change = C::F::select(here, bounded - force, zero);
        // f, Jᵀ f, and a by M⁻¹ Jᵀ times the change
        cx.set(&mut b.efc_force[dry.row], force + change);
        for j in 0..m.dofs.len() {
            let a = change.fma(w.step[j], cx.get(&b.joint_qdd[j]));
            cx.set(&mut b.joint_qdd[j], a);
            let joint = change.fma(w.minimum[j], cx.get(&b.constraint_force[j]));
            cx.set(&mut b.constraint_force[j], joint);
        }
        let total = cx.get(gain) + gained(change, diagonal, residual);
        cx.set(gain, total);
    }
}

/// Writes J of a row to `minimum`. Returns the bound of its force, and a dof that it moves.
#[inline(always)]
fn read_row<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>, dry: &DryRow) -> (C::F, usize) {
    let w = &mut b.work;
    w.minimum.fill(C::F::c(0.0));
    match dry.tie {
        None => {
            // J = 1
            let friction = &m.frictions[dry.place];
            w.minimum[friction.dof] = C::F::c(1.0);
            let [_, loss] = bounds(m, &b.params, friction);
            (loss, friction.dof)
        }
        Some(tie) => {
            let tie = &m.ties[tie];
            for (entry, &dof) in w.row_jacobian[tie.jacobian(dry.place)]
                .iter()
                .zip(&tie.dofs)
            {
                w.minimum[dof] = *entry;
            }
            let loss = match tie.law {
                TieLaw::Friction(loss) => C::F::k(loss),
                _ => unreachable!("the model lists rows of dry friction"),
            };
            (loss, tie.dofs[0])
        }
    }
}
