//! Semi-implicit step, implicit in joint damping and drive damping (MuJoCo: `implicitfast`).
//!
//! ```text
//! (M + h diag(damping + kd)) q̈' = smooth + constraint        q̇ += h q̈'        q += h q̇
//! ```
//!
//! A quaternion moves by the turn h ω in the body's axes. A free body is stepped as MuJoCo steps it, by
//! the velocity of its frame's origin and the angular velocity in its own axes:
//!
//! ```text
//! r = R c     v = v(c) - ω × r     a = a(c) - α × r - ω × (ω × r)
//! v += h a    p += h v             ω' = Rᵀω + h Rᵀα        R' = R exp(h ω')
//! ```

use super::kinematics::read_quat;
use super::{BlockOf, ConstantsOf};
use crate::lane::{Cx, Num};
use crate::math::factor::solve;
use crate::math::quat::{self, Quat};
use crate::math::vec3::{
    Mat3, add, constant, cross, scale_add, sub, transform, transform_back, zero,
};
use crate::model::constants::{Body, Motion};

#[inline(always)]
pub(super) fn implicit_fast<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    let dt = C::F::k(m.dt);
    let [acceleration, ..] = &mut w.vector;
    if m.damped {
        // the last stage: nobody needs the mass matrix after it
        for (j, dof) in m.dofs.iter().enumerate() {
            // a clamped drive keeps its damping here, as under MuJoCo's `actfrcrange`
            let damping = C::F::k(dof.damping) + C::F::k(dof.kd);
            let diagonal = m.pattern.at(j, j);
            w.mass_matrix[diagonal] = dt.fma(damping, w.mass_matrix[diagonal]);
            acceleration[j] = w.smooth_force[j] + cx.get(&b.constraint_force[j]);
        }
        solve(&m.pattern, &mut w.mass_matrix, acceleration);
    } else {
        for j in 0..m.dofs.len() {
            acceleration[j] = cx.get(&b.joint_qdd[j]);
        }
    }
    for (k, body) in m.bodies.iter().enumerate() {
        if body.motion == Motion::Free {
            let rotation = w.rotation[k];
            free::<C>(
                cx,
                body,
                dt,
                &rotation,
                &w.vector[0],
                &mut b.joint_q,
                &mut b.joint_qd,
            );
            continue;
        }
        let c = body.coord;
        let mut qd = zero();
        for (qd, d) in qd.iter_mut().zip(body.dofs()) {
            *qd = dt.fma(w.vector[0][d], cx.get(&b.joint_qd[d]));
            cx.set(&mut b.joint_qd[d], *qd);
        }
        if body.motion == Motion::Ball {
            let turned = quat::turned(read_quat(cx, &b.joint_q, c), qd, dt);
            write_quat(cx, &mut b.joint_q, c, turned);
        } else {
            let q = dt.fma(qd[0], cx.get(&b.joint_q[c]));
            cx.set(&mut b.joint_q[c], q);
        }
    }
}

#[inline(always)]
fn free<C: Cx>(
    cx: &mut C,
    body: &Body<<C::F as Num>::Real>,
    dt: C::F,
    rotation: &Mat3<C::F>,
    acceleration: &[C::F],
    joint_q: &mut [C::V],
    joint_qd: &mut [C::V],
) {
    let (c, d) = (body.coord, body.dof);
    let (mut velocity, mut spin, mut linear, mut angular) = (zero(), zero(), zero(), zero());
    for i in 0..3 {
        velocity[i] = cx.get(&joint_qd[d + i]);
        spin[i] = cx.get(&joint_qd[d + 3 + i]);
        linear[i] = acceleration[d + i];
        angular[i] = acceleration[d + 3 + i];
    }
    let arm = transform(rotation, constant(body.center));
    let swing = cross(spin, arm);
    let origin = sub(velocity, swing);
    let pull = sub(sub(linear, cross(angular, arm)), cross(spin, swing));
    let origin = scale_add(pull, dt, origin);
    let own = scale_add(
        transform_back(rotation, angular),
        dt,
        transform_back(rotation, spin),
    );
    for i in 0..3 {
        let position = dt.fma(origin[i], cx.get(&joint_q[c + i]));
        cx.set(&mut joint_q[c + i], position);
    }
    let turned = quat::turned(read_quat(cx, joint_q, c + 3), own, dt);
    write_quat(cx, joint_q, c + 3, turned);
    let rotation = quat::matrix(turned);
    let spin = transform(&rotation, own);
    let velocity = add(
        origin,
        cross(spin, transform(&rotation, constant(body.center))),
    );
    for i in 0..3 {
        cx.set(&mut joint_qd[d + i], velocity[i]);
        cx.set(&mut joint_qd[d + 3 + i], spin[i]);
    }
}

#[inline(always)]
fn write_quat<C: Cx>(cx: &mut C, joint_q: &mut [C::V], c: usize, q: Quat<C::F>) {
    for i in 0..4 {
        cx.set(&mut joint_q[c + i], q[i]);
    }
}
