//! Lengths, their rates, and what acts along them.
//!
//! ```text
//! l = Σ c q + L      v = Σ c q̇ + L̇      ∂l̇/∂q̇ = c of a term, the moment of a spatial tendon
//! ```

use crate::arrays::Workspace;
use crate::constants::lengths::Length;
use crate::lane::{Cx, Num};
use crate::step::{BlockOf, ConstantsOf};

/// Constants of a context's precision.
type LengthOf<C> = Length<<<C as Cx>::F as Num>::Real>;

/// l
#[inline(always)]
pub(in crate::step) fn length<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    of: &LengthOf<C>,
) -> C::F {
    // Σ c q of joints, and L
    let mut length = C::F::c(0.0);
    for term in &of.terms {
        let q = cx.get(&b.joint_q[m.dofs[term.dof].coord]);
        length = q.fma(C::F::k(term.coefficient), length);
    }
    match of.tendon {
        Some(tendon) => length + b.work.ten_length[tendon],
        None => length,
    }
}

/// v
#[inline(always)]
pub(in crate::step) fn rate<C: Cx>(cx: &mut C, b: &BlockOf<C>, of: &LengthOf<C>) -> C::F {
    // Σ c q̇ of joints, and L̇
    let mut rate = C::F::c(0.0);
    for term in &of.terms {
        let qd = cx.get(&b.joint_qd[term.dof]);
        rate = qd.fma(C::F::k(term.coefficient), rate);
    }
    match of.tendon {
        Some(tendon) => rate + b.work.ten_velocity[tendon],
        None => rate,
    }
}

/// Calls `act` with each dof on which a length depends, and its moment, which spatial tendons have in `ten_moment`.
#[inline(always)]
pub(in crate::step) fn moments<C: Cx>(
    m: &ConstantsOf<C>,
    ten_moment: &[C::F],
    of: &LengthOf<C>,
    mut act: impl FnMut(usize, C::F),
) {
    for term in &of.terms {
        act(term.dof, C::F::k(term.coefficient));
    }
    if let Some(tendon) = of.tendon {
        let tendon = &m.tendons[tendon];
        for (&dof, moment) in tendon.dofs.iter().zip(&ten_moment[tendon.first..]) {
            act(dof, *moment);
        }
    }
}

/// What MuJoCo's acceleration of a length has more than the moments times our joint accelerations.
#[inline(always)]
pub(in crate::step) fn swing<F: Num>(w: &Workspace<F>, of: &Length<F::Real>) -> F {
    match of.tendon {
        Some(tendon) => w.ten_swing[tendon],
        None => F::c(0.0),
    }
}
