//! Semi-implicit step, implicit in joint damping and drive damping (MuJoCo: `implicitfast`).
//!
//! ```text
//! (M + h diag(damping + kd)) q̈' = smooth + constraint        q̇ += h q̈'        q += h q̇
//! ```

use super::{BlockOf, ConstantsOf};
use crate::lane::{Cx, Num, Real};
use crate::math::factor::{factor, solve};

#[inline(always)]
pub(super) fn implicit_fast<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    let dt = C::F::k(m.dt);
    let [acceleration, ..] = &mut w.vector;
    if m.dofs
        .iter()
        .any(|dof| dof.damping.to_f64() + dof.kd.to_f64() > 0.0)
    {
        w.hessian.copy_from_slice(&w.mass_matrix);
        for (j, dof) in m.dofs.iter().enumerate() {
            // a clamped drive keeps its damping here, as under MuJoCo's `actfrcrange`
            let damping = C::F::k(dof.damping) + C::F::k(dof.kd);
            let diagonal = m.pattern.at(j, j);
            w.hessian[diagonal] = dt.fma(damping, w.hessian[diagonal]);
            acceleration[j] = w.smooth_force[j] + w.constraint_force[j];
        }
        factor(&m.pattern, &mut w.hessian);
        solve(&m.pattern, &w.hessian, acceleration);
    } else {
        for j in 0..m.dofs.len() {
            acceleration[j] = cx.get(&b.joint_qdd[j]);
        }
    }
    for j in 0..m.dofs.len() {
        let qd = dt.fma(acceleration[j], cx.get(&b.joint_qd[j]));
        let q = dt.fma(qd, cx.get(&b.joint_q[j]));
        cx.set(&mut b.joint_qd[j], qd);
        cx.set(&mut b.joint_q[j], q);
    }
}
