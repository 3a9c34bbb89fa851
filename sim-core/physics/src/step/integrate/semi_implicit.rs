//! Semi-implicit step, implicit in joint damping and drive damping (MuJoCo: `implicitfast`).
//!
//! ```text
//! (M + h diag(damping + kd)) q̈' = smooth + constraint        q̇ += h q̈'        q += h q̇
//! ```
//!
//! Damping that grows with the speed counts with its derivative ([`crate::step::forces::curves`]).
//!
//! In `f32` the rounding error of q + h q̇ is kept and added to the next step (compensated summation, Kahan 1965). Without it an
//! arm that moves by less than half a rounding of its angle per step would stand still with a velocity, and slip on an object
//! that it holds.
//!
//! A quaternion is rotated by h ω in the body's axes. A free body is stepped as in MuJoCo, by the velocity of its frame's origin
//! and the angular velocity in its own axes:
//!
//! ```text
//! r = R c     v = v(c) - ω × r     a = a(c) - α × r - ω × (ω × r)
//! v += h a    p += h v             ω' = Rᵀω + h Rᵀα        R' = R exp(h ω')
//! ```
//!
//! A free body without moving children is also implicit in its gyroscopic force, to first order, as in MuJoCo since 3.11: it
//! gains no energy by spinning. With J the inertia about c, A the same with armature and damping, and L = J ω:
//!
//! ```text
//! (A + h ∂(ω × L)/∂ω) δ = -h (α × L + ω × J α)       α += δ       a -= h (α × (ω × r) + ω × (α × r))
//! ```

use crate::arrays::Array as A;
use crate::constants::actuators::Activation;
use crate::constants::options::Integrator;
use crate::constants::params::Param;
use crate::constants::{Body, Constants, Motion};
use crate::lane::{Cx, Num, Real};
use crate::math::factor::{multiply, solve};
use crate::math::quat::{self, Quat};
use crate::math::spatial::symmetric;
use crate::math::vec3::{Mat3, Vec3};
use crate::step::forces::{actuators, curves, damping, delays, ellipsoid_fluid, fluid, plasticity};
use crate::step::tree::free_joints;
use crate::step::tree::generalized::keep_accelerations;
use crate::step::tree::kinematics::read_quat;
use crate::step::{BlockOf, ConstantsOf, Stage, masses, param};

/// The next state.
pub struct Integrate;

impl Stage for Integrate {
    const READS: &'static [A] = &[
        A::Params,
        A::Ctrl,
        A::ControlHistory,
        A::DelayedControl,
        A::Act,
        A::ActDot,
        A::ActuatorMoment,
        A::PlasticRest,
        A::TenLength,
        A::TenMoment,
        A::TenVelocity,
        A::ActuatorLength,
        A::ActuatorVelocity,
        A::ActuatorForce,
        A::Rotation,
        A::Origin,
        A::Inertia,
        A::Motion,
        A::Velocity,
        A::JointQ,
        A::JointQRest,
        A::JointQd,
        A::JointQdd,
        A::MassMatrix,
        A::SmoothForce,
        A::ConstraintForce,
    ];
    // the last stage of a step: the mass matrix is not read after it
    const WRITES: &'static [A] = &[
        A::JointQ,
        A::JointQRest,
        A::JointQd,
        A::JointQdd,
        A::Act,
        A::ControlHistory,
        A::PlasticRest,
        A::MassMatrix,
    ];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        matches!(m.integrator, Integrator::ImplicitFast | Integrator::Euler)
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // q̈' with implicit damping, or the solver's q̈
        if m.damped {
            implicit_acceleration(cx, m, b);
        } else {
            for j in 0..m.dofs.len() {
                b.work.acceleration[j] = cx.get(&b.joint_qdd[j]);
            }
        }
        advance(cx, m, b);
    }
}

/// The next state by the accelerations of this step, which are in `acceleration`.
#[inline(always)]
pub(super) fn advance<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    // the next solve starts from MuJoCo's accelerations: `acceleration` has what this step needs
    if m.prescribed_search().is_some() {
        keep_accelerations(cx, m, b);
    }
    // free bodies that carry nothing and were not solved apart: implicit in their gyroscopic force here
    for &body in &m.gyroscopic_bodies {
        gyroscopic(cx, m, b, body);
    }
    // q̇ += h q̈', then q by the new q̇ (clients place mocap bodies)
    for (k, body) in m.bodies.iter().enumerate() {
        if body.motion == Motion::Free {
            integrate_free(cx, m, b, k);
        } else if body.motion != Motion::Mocap {
            integrate_joint(cx, m, b, body);
        }
    }
    // activations, as far as ȧ reaches in a step, clamped to their ranges
    for activation in activations(m) {
        let act = cx.get(&b.act[activation.place]);
        let act = actuators::next(activation, act, b.work.act_dot[activation.place]);
        cx.set(&mut b.act[activation.place], act);
    }
    delays::append(cx, m, b);
    plasticity::follow(cx, m, b);
}

/// The activations of actuators.
pub(in crate::step) fn activations<R>(m: &Constants<R>) -> impl Iterator<Item = &Activation<R>> {
    let actuators = m.actuators.all.iter();
    actuators.filter_map(|actuator| actuator.activation.as_ref())
}

/// Writes M + h D to the mass matrix, and τ + Jᵀ f to `acceleration`. D has the damping of joints and drives on its diagonal, and
/// what is symmetric of that of other forces.
#[inline(always)]
pub(super) fn damped_system<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let (w, dt) = (&mut b.work, C::F::k(m.dt));
    // M q̈ equals the forces, without the rounding of stiff contact forces that cancel
    let mut rounded = None;
    if !<<C::F as Num>::Real as Real>::DOUBLE {
        rounded = crate::step::solver::touching(cx, m);
    }
    // M q̈ in place of the forces, where a world of the block has contacts
    if rounded.is_some() {
        for j in 0..m.dofs.len() {
            w.start[j] = cx.get(&b.joint_qdd[j]);
        }
        multiply(&m.pattern, &w.mass_matrix, &w.start, &mut w.joint_force);
    }
    // M + h D
    for &j in &m.diagonal_dofs {
        let dof = &m.dofs[j];
        // a clamped drive keeps its damping here, as under MuJoCo's `actfrcrange`
        let mut damping = param(m, &b.params, Param::JointDamping, j, dof.damping);
        damping = curves::slope(damping, dof.damping_curve, cx.get(&b.joint_qd[j]));
        // nothing drives a free body
        if m.bodies[dof.body].motion != Motion::Free {
            damping = damping + param(m, &b.params, Param::JointTargetKd, j, dof.kd);
        }
        let diagonal = m.pattern.at(j, j);
        w.mass_matrix[diagonal] = dt.fma(damping, w.mass_matrix[diagonal]);
    }
    // right-hand side, by a select: worlds without contacts take the sum of their forces
    for j in 0..m.dofs.len() {
        w.acceleration[j] = w.smooth_force[j] + cx.get(&b.constraint_force[j]);
        if let Some(touching) = rounded {
            w.acceleration[j] = C::F::select(touching, w.joint_force[j], w.acceleration[j]);
        }
    }
    // all but Euler's step have the derivatives of actuators, tendons and the medium as well
    if m.integrator != Integrator::Euler {
        damping::add_damping(cx, m, b);
        fluid::add_damping::<C>(m, b);
    }
    // damping of free joints, which is not diagonal in our velocities
    free_joints::add_damping(cx, m, b);
}

/// (M + h D) a = τ + Jᵀ f
#[inline(always)]
fn implicit_acceleration<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    damped_system(cx, m, b);
    // h N is not symmetric: these bodies are solved apart, while their block of the matrix is there
    for &body in &m.solved_bodies {
        let mut system = free_joints::system(cx, m, b, body);
        ellipsoid_fluid::add_to_system::<C>(m, b, body, &mut system);
        free_joints::solve::<C>(m, b, body, system);
    }
    // the other bodies, then the entries of those that were solved apart
    let w = &mut b.work;
    solve(&m.pattern, &mut w.mass_matrix, &mut w.acceleration);
    for &body in &m.solved_bodies {
        free_joints::take(m, b, body);
    }
}

/// Velocity first, then the position by the new velocity.
#[inline(always)]
fn integrate_joint<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    body: &Body<<C::F as Num>::Real>,
) {
    let (c, dt) = (body.coord, C::F::k(m.dt));
    // q̇ += h q̈'
    let mut qd = Vec3::zero();
    for (qd, d) in qd.iter_mut().zip(body.dofs()) {
        *qd = dt.fma(b.work.acceleration[d], cx.get(&b.joint_qd[d]));
        cx.set(&mut b.joint_qd[d], *qd);
    }
    // q exp(h ω), ω in the body's axes, or q + h q̇
    if body.motion == Motion::Ball {
        let turned = quat::turned(read_quat(cx, &b.joint_q, c), qd, dt);
        write_quat(cx, &mut b.joint_q, c, turned);
    } else {
        add_compensated(cx, &mut b.joint_q[c], &mut b.joint_q_rest[c], qd[0], dt);
    }
}

/// q += h v, compensated in `f32`.
#[inline(always)]
pub(in crate::step) fn add_compensated<C: Cx>(
    cx: &mut C,
    q: &mut C::V,
    rest: &mut C::V,
    v: C::F,
    dt: C::F,
) {
    let before = cx.get(q);
    // double precision keeps no rounding error
    if <<C::F as Num>::Real as Real>::DOUBLE {
        cx.set(q, dt.fma(v, before));
        return;
    }
    // this step's change and what rounding left of the last
    let change = dt.fma(v, cx.get(rest));
    let after = before + change;
    // exact where |q| is larger than the change, otherwise off by a rounding of the change
    cx.set(rest, change - (after - before));
    cx.set(q, after);
}

/// Makes the acceleration of a free body implicit in its gyroscopic force.
#[inline(always)]
fn gyroscopic<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>, k: usize) {
    let (body, dt) = (&m.bodies[k], C::F::k(m.dt));
    let (d, params, joint_qd) = (body.dof, &b.params, &b.joint_qd);
    let (rotation, acceleration) = (&b.work.rotation[k], &mut b.work.acceleration);
    // the centre of mass, which may be another one than that of the body's velocity
    let scene_center = Vec3::constant(body.center);
    let moved = masses::moved_center(m, params, body);
    let center = moved.unwrap_or(scene_center);
    // ω, and α before the correction
    let (mut spin, mut angular) = (Vec3::zero(), Vec3::zero());
    for i in 0..3 {
        spin[i] = cx.get(&joint_qd[d + 3 + i]);
        angular[i] = acceleration[d + 3 + i];
    }
    // relative to the trace, so that determinants of small bodies stay within f32
    let trace: f64 = body.inertia[..3].iter().map(|x| x.to_f64()).sum();
    let unit = C::F::c(1.0 / trace);
    // L = J ω
    let momentum = rotated_inertia(m, params, body, rotation, center, spin) * unit;
    let mut columns = [Vec3::zero(); 3];
    // columns of A + h ∂(ω × L)/∂ω: J e + h (e × L + ω × J e)
    for (i, column) in columns.iter_mut().enumerate() {
        let mut axis = Vec3::zero();
        axis[i] = C::F::c(1.0);
        let inertia = rotated_inertia(m, params, body, rotation, center, axis) * unit;
        let rate = axis.cross_add(momentum, spin.cross(inertia));
        *column = rate.scale_add(dt, inertia);
        // A has armature and h damping on the diagonal
        let (j, dof) = (d + 3 + i, &m.dofs[d + 3 + i]);
        let damping = param(m, params, Param::JointDamping, j, dof.damping);
        let armature = param(m, params, Param::JointArmature, j, dof.armature);
        let driven = dt.fma(damping, armature);
        column[i] = driven.fma(unit, column[i]);
    }
    // -h (α × L + ω × J α)
    let inertia = rotated_inertia(m, params, body, rotation, center, angular) * unit;
    let rate = angular.cross_add(momentum, spin.cross(inertia));
    let change = rate * -dt;
    // Cramer's rule: the rows of the inverse are cross products of columns over the determinant
    let [x, y, z] = columns;
    let minors = [y.cross(z), z.cross(x), x.cross(y)];
    let determinant = x.dot(minors[0]);
    let before = angular;
    for i in 0..3 {
        angular[i] = angular[i] + minors[i].dot(change).div(determinant);
    }
    // S(α) = α × (ω × r) + ω × (α × r) with r = R c
    let arm = rotation * center;
    let swing = angular.cross_add(spin.cross(arm), spin.cross(angular.cross(arm)));
    // a(c') = a(c) + α × d + ω × (ω × d) changes by α where the centre c' is d away from c
    if moved.is_some() {
        let apart = rotation * (center - scene_center);
        let turned = (angular - before).cross(apart);
        for i in 0..3 {
            acceleration[d + i] = acceleration[d + i] - turned[i];
        }
    }
    for i in 0..3 {
        // acceleration of the centre of mass; the step takes that of the origin, which differs by the swing
        acceleration[d + i] = dt.fnma(swing[i], acceleration[d + i]);
        acceleration[d + 3 + i] = angular[i];
    }
}

/// J v in world axes, J the inertia about a centre; of links whose masses vary, each about its own.
#[inline(always)]
fn rotated_inertia<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    body: &Body<F::Real>,
    rotation: &Mat3<F>,
    center: Vec3<F>,
    v: Vec3<F>,
) -> Vec3<F> {
    // in the body's axes, where J is constant
    let v = rotation.transpose_mul(v);
    if !masses::vary(m) {
        return rotation * symmetric(body.inertia.map(F::k), v);
    }
    // J v = Σ s (J(link) v + m d × (v × d)), d the link's centre from the body's
    let mut sum = Vec3::zero();
    for part in &body.parts {
        let arm = masses::center(m, params, part) - center;
        let swing = arm.cross(v.cross(arm));
        let (mass, inertia) = masses::of_part(m, params, part);
        let product = swing.scale_add(mass, symmetric(inertia, v));
        let scale = masses::scale(m, params, part.link);
        sum = product.scale_add(scale.unwrap_or(F::c(1.0)), sum);
    }
    rotation * sum
}

/// A free body, in MuJoCo's coordinates: velocity of its frame's origin, angular velocity in its own axes.
#[inline(always)]
fn integrate_free<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>, k: usize) {
    let (body, dt) = (&m.bodies[k], C::F::k(m.dt));
    let (c, d) = (body.coord, body.dof);
    let (rotation, acceleration) = (b.work.rotation[k], &b.work.acceleration);
    let (joint_q, rests, joint_qd) = (&mut b.joint_q, &mut b.joint_q_rest, &mut b.joint_qd);
    // v(c), ω, a(c) and α
    let (mut velocity, mut spin, mut linear, mut angular) =
        (Vec3::zero(), Vec3::zero(), Vec3::zero(), Vec3::zero());
    for i in 0..3 {
        velocity[i] = cx.get(&joint_qd[d + i]);
        spin[i] = cx.get(&joint_qd[d + 3 + i]);
        linear[i] = acceleration[d + i];
        angular[i] = acceleration[d + 3 + i];
    }
    // r = R c, v = v(c) - ω × r, a = a(c) - α × r - ω × (ω × r)
    let arm = rotation * Vec3::constant(body.center);
    let swing = spin.cross(arm);
    let origin = velocity - swing;
    let pull = (linear - angular.cross(arm)) - spin.cross(swing);
    // v += h a, and ω' = Rᵀ ω + h Rᵀ α
    let origin = pull.scale_add(dt, origin);
    let local_spin = rotation
        .transpose_mul(angular)
        .scale_add(dt, rotation.transpose_mul(spin));
    // p += h v, R' = R exp(h ω')
    for i in 0..3 {
        add_compensated(cx, &mut joint_q[c + i], &mut rests[c + i], origin[i], dt);
    }
    let turned = quat::turned(read_quat(cx, joint_q, c + 3), local_spin, dt);
    write_quat(cx, joint_q, c + 3, turned);
    // back to ours at the new rotation: ω = R' ω' and v(c) = v + ω × R' c
    let rotation = quat::matrix(turned);
    let spin = rotation * local_spin;
    let velocity = origin + spin.cross(rotation * Vec3::constant(body.center));
    for i in 0..3 {
        cx.set(&mut joint_qd[d + i], velocity[i]);
        cx.set(&mut joint_qd[d + 3 + i], spin[i]);
    }
}

/// Writes the quaternion that begins at coordinate `c`.
#[inline(always)]
pub(in crate::step) fn write_quat<C: Cx>(
    cx: &mut C,
    joint_q: &mut [C::V],
    c: usize,
    q: Quat<C::F>,
) {
    for i in 0..4 {
        cx.set(&mut joint_q[c + i], q[i]);
    }
}
