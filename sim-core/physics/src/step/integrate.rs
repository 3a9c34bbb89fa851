//! Semi-implicit step, implicit in joint damping and drive damping (MuJoCo: `implicitfast`).
//!
//! ```text
//! (M + h diag(damping + kd)) q̈' = smooth + constraint        q̇ += h q̈'        q += h q̇
//! ```
//!
//! In `f32` what a sum q + h q̇ rounds away is kept for the next one (Kahan 1965): an arm that creeps by less than half a
//! rounding of its angle a step would else stand still and say that it moves, and rub along what it holds.
//!
//! A quaternion moves by the turn h ω in the body's axes. A free body is stepped as MuJoCo steps it, by
//! the velocity of its frame's origin and the angular velocity in its own axes:
//!
//! ```text
//! r = R c     v = v(c) - ω × r     a = a(c) - α × r - ω × (ω × r)
//! v += h a    p += h v             ω' = Rᵀω + h Rᵀα        R' = R exp(h ω')
//! ```
//!
//! One that carries nothing that moves is also implicit in its gyroscopic force, to first order, as MuJoCo is since 3.11:
//! so it gains no energy by spinning. With J the inertia about c, A that with drives' inertia and damping, L = J ω:
//!
//! ```text
//! (A + h ∂(ω × L)/∂ω) δ = -h (α × L + ω × J α)       α += δ       a -= h (α × (ω × r) + ω × (α × r))
//! ```

use super::kinematics::read_quat;
use super::{BlockOf, ConstantsOf, param};
use crate::constants::params::Param;
use crate::constants::{Body, Constants, Motion};
use crate::lane::{Cx, Num, Real};
use crate::math::factor::{multiply, solve};
use crate::math::quat::{self, Quat};
use crate::math::spatial::symmetric;
use crate::math::vec3::{
    Mat3, Vec3, add, constant, cross, cross_add, dot, scale, scale_add, sub, transform,
    transform_back, zero,
};

#[inline(always)]
pub(super) fn implicit_fast<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    let dt = C::F::k(m.dt);
    let [acceleration, found, _, inertial] = &mut w.vector;
    // M q̈ is what acts, and without the rounding of stiff forces that cancel
    let mut rounded = None;
    if !<<C::F as Num>::Real as Real>::DOUBLE {
        rounded = super::solver::touching(cx, m);
    }
    if m.damped && rounded.is_some() {
        for j in 0..m.dofs.len() {
            found[j] = cx.get(&b.joint_qdd[j]);
        }
        multiply(&m.pattern, &w.mass_matrix, found, inertial);
    }
    if m.damped {
        // the last stage: nobody needs the mass matrix after it
        for (j, dof) in m.dofs.iter().enumerate() {
            // a clamped drive keeps its damping here, as under MuJoCo's `actfrcrange`
            let mut damping = param(m, &b.params, Param::JointDamping, j, dof.damping);
            // nothing drives a free body
            if m.bodies[dof.body].motion != Motion::Free {
                damping = damping + param(m, &b.params, Param::JointTargetKd, j, dof.kd);
            }
            let diagonal = m.pattern.at(j, j);
            w.mass_matrix[diagonal] = dt.fma(damping, w.mass_matrix[diagonal]);
            acceleration[j] = w.smooth_force[j] + cx.get(&b.constraint_force[j]);
            if let Some(touching) = rounded {
                acceleration[j] = C::F::select(touching, inertial[j], acceleration[j]);
            }
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
            if m.bodies.iter().all(|other| other.parent != Some(k)) {
                let [acceleration, ..] = &mut w.vector;
                gyroscopic::<C>(cx, m, &b.params, body, &rotation, acceleration, &b.joint_qd);
            }
            free::<C>(
                cx,
                body,
                dt,
                &rotation,
                &w.vector[0],
                [&mut b.joint_q, &mut b.joint_q_rest],
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
            advance(cx, &mut b.joint_q[c], &mut b.joint_q_rest[c], qd[0], dt);
        }
    }
}

/// q += h v
#[inline(always)]
fn advance<C: Cx>(cx: &mut C, q: &mut C::V, rest: &mut C::V, v: C::F, dt: C::F) {
    let before = cx.get(q);
    if <<C::F as Num>::Real as Real>::DOUBLE {
        cx.set(q, dt.fma(v, before));
        return;
    }
    let change = dt.fma(v, cx.get(rest));
    let after = before + change;
    // exact where q is the larger of the two, and else a rounding of the change off
    cx.set(rest, change - (after - before));
    cx.set(q, after);
}

/// Makes the accelerations of a free body implicit in its gyroscopic force.
#[inline(always)]
fn gyroscopic<C: Cx>(
    cx: &C,
    m: &ConstantsOf<C>,
    params: &[C::F],
    body: &Body<<C::F as Num>::Real>,
    rotation: &Mat3<C::F>,
    acceleration: &mut [C::F],
    joint_qd: &[C::V],
) {
    let d = body.dof;
    let dt = C::F::k(m.dt);
    let (mut spin, mut angular) = (zero(), zero());
    for i in 0..3 {
        spin[i] = cx.get(&joint_qd[d + 3 + i]);
        angular[i] = acceleration[d + 3 + i];
    }
    // relative to the trace, so that determinants of small bodies stay within f32
    let trace: f64 = body.inertia[..3].iter().map(|x| x.to_f64()).sum();
    let unit = C::F::c(1.0 / trace);
    let momentum = scale(turned(m, params, body, rotation, spin), unit);
    let mut columns = [zero(); 3];
    for (i, column) in columns.iter_mut().enumerate() {
        let mut axis = zero();
        axis[i] = C::F::c(1.0);
        let inertia = scale(turned(m, params, body, rotation, axis), unit);
        let rate = cross_add(axis, momentum, cross(spin, inertia));
        *column = scale_add(rate, dt, inertia);
        let (j, dof) = (d + 3 + i, &m.dofs[d + 3 + i]);
        let damping = param(m, params, Param::JointDamping, j, dof.damping);
        let armature = param(m, params, Param::JointArmature, j, dof.armature);
        let driven = dt.fma(damping, armature);
        column[i] = driven.fma(unit, column[i]);
    }
    let inertia = scale(turned(m, params, body, rotation, angular), unit);
    let rate = cross_add(angular, momentum, cross(spin, inertia));
    let change = scale(rate, -dt);
    let [x, y, z] = columns;
    let minors = [cross(y, z), cross(z, x), cross(x, y)];
    let determinant = dot(x, minors[0]);
    for i in 0..3 {
        angular[i] = angular[i] + dot(minors[i], change).div(determinant);
    }
    let arm = transform(rotation, constant(body.center));
    let swing = cross_add(angular, cross(spin, arm), cross(spin, cross(angular, arm)));
    for i in 0..3 {
        // of the centre of mass: the origin's, which the step takes, lags behind it by so much
        acceleration[d + i] = dt.fnma(swing[i], acceleration[d + i]);
        acceleration[d + 3 + i] = angular[i];
    }
}

/// J v in world axes, J the inertia about the centre of mass; of links whose masses vary, each about its own.
#[inline(always)]
fn turned<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    body: &Body<F::Real>,
    rotation: &Mat3<F>,
    v: Vec3<F>,
) -> Vec3<F> {
    let v = transform_back(rotation, v);
    let own = match m.varying.first(Param::BodyMassScale) {
        None => symmetric(body.inertia, v),
        Some(first) => {
            let mut sum = zero();
            for part in &body.parts {
                let scale = params[first + part.link];
                // about the centre that the scene has
                let arm = sub(constant(part.center), constant(body.center));
                let swing = cross(arm, cross(v, arm));
                let own = scale_add(swing, F::k(part.mass), symmetric(part.inertia, v));
                sum = scale_add(own, scale, sum);
            }
            sum
        }
    };
    transform(rotation, own)
}

#[inline(always)]
fn free<C: Cx>(
    cx: &mut C,
    body: &Body<<C::F as Num>::Real>,
    dt: C::F,
    rotation: &Mat3<C::F>,
    acceleration: &[C::F],
    [joint_q, rests]: [&mut [C::V]; 2],
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
        advance(cx, &mut joint_q[c + i], &mut rests[c + i], origin[i], dt);
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
