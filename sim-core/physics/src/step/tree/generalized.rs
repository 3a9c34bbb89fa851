//! Velocities, accelerations and forces as MuJoCo has them.
//!
//! They differ for a free body: MuJoCo takes the velocity of its frame's origin in world axes and the angular velocity in the
//! body's axes, where we take the velocity of the centre of mass c and the angular velocity in world axes. With r = R c:
//!
//! ```text
//! v' = v - ω × r      ω' = Rᵀ ω      a' = a - α × r - ω × (ω × r)      α' = Rᵀ α
//! f' = f              τ' = Rᵀ (τ + r × f)      c' = T (c + M s),  s = ω × (ω × r): what a has at a' = 0
//! ```

use super::free_joints;
use crate::arrays::Workspace;
use crate::constants::{Constants, Motion};
use crate::lane::{Cx, Num};
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf};

/// Writes the velocities, `(dofs,)`.
#[inline(always)]
pub fn velocities<C: Cx>(cx: &C, m: &ConstantsOf<C>, b: &BlockOf<C>, to: &mut [C::F]) {
    // other joints have MuJoCo's velocities
    for (x, cell) in to.iter_mut().zip(&b.joint_qd) {
        *x = cx.get(cell);
    }
    for (k, dof) in free_bodies(m) {
        // v' = v - ω × r and ω' = Rᵀ ω
        let [linear, angular] = halves(&to[dof..]);
        // the reference point is the centre of mass, so the origin is -r
        let linear = angular.cross_add(b.work.origin[k], linear);
        to[dof..dof + 3].copy_from_slice(&linear.0);
        let local_spin = b.work.rotation[k].transpose_mul(angular);
        to[dof + 3..dof + 6].copy_from_slice(&local_spin.0);
    }
}

/// Writes the accelerations, `(dofs,)`.
#[inline(always)]
pub fn accelerations<C: Cx>(cx: &C, m: &ConstantsOf<C>, b: &BlockOf<C>, to: &mut [C::F]) {
    for (x, cell) in to.iter_mut().zip(&b.joint_qdd) {
        *x = cx.get(cell);
    }
    for (k, dof) in free_bodies(m) {
        let (linear, angular) = accelerations_of(cx, b, k, dof);
        to[dof..dof + 3].copy_from_slice(&linear.0);
        to[dof + 3..dof + 6].copy_from_slice(&angular.0);
    }
}

/// Turns `joint_qdd` into MuJoCo's accelerations: the next solve starts from these at another pose and velocity.
#[inline(always)]
pub fn keep_accelerations<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for (k, dof) in free_bodies(m) {
        let (linear, angular) = accelerations_of(cx, b, k, dof);
        set_accelerations(cx, b, dof, linear, angular);
    }
}

/// Turns MuJoCo's accelerations that [`keep_accelerations`] left in `joint_qdd` into those of the pose and velocity of now.
#[inline(always)]
pub fn take_accelerations<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for (k, dof) in free_bodies(m) {
        let [linear, angular, spin] = motion_of(cx, b, dof);
        // α = R α' and a = a' - α × o - ω × (ω × o), with the frame's origin o = -r
        let origin = b.work.origin[k];
        let angular = b.work.rotation[k] * angular;
        let swing = spin.cross(spin.cross(origin)) + angular.cross(origin);
        set_accelerations(cx, b, dof, linear - swing, angular);
    }
}

/// Linear and angular acceleration of a free body, and its angular velocity.
#[inline(always)]
fn motion_of<C: Cx>(cx: &C, b: &BlockOf<C>, dof: usize) -> [Vec3<C::F>; 3] {
    let linear = Vec3(std::array::from_fn(|i| cx.get(&b.joint_qdd[dof + i])));
    let angular = Vec3(std::array::from_fn(|i| cx.get(&b.joint_qdd[dof + 3 + i])));
    let spin = Vec3(std::array::from_fn(|i| cx.get(&b.joint_qd[dof + 3 + i])));
    [linear, angular, spin]
}

/// MuJoCo's linear and angular acceleration of a free body.
#[inline(always)]
fn accelerations_of<C: Cx>(
    cx: &C,
    b: &BlockOf<C>,
    body: usize,
    dof: usize,
) -> (Vec3<C::F>, Vec3<C::F>) {
    let [linear, angular, spin] = motion_of(cx, b, dof);
    // a' = a + α × o + ω × (ω × o) with the frame's origin o = -r, and α' = Rᵀ α
    let origin = b.work.origin[body];
    let swing = spin.cross_add(spin.cross(origin), linear);
    let linear = angular.cross_add(origin, swing);
    (linear, b.work.rotation[body].transpose_mul(angular))
}

#[inline(always)]
fn set_accelerations<C: Cx>(
    cx: &mut C,
    b: &mut BlockOf<C>,
    dof: usize,
    linear: Vec3<C::F>,
    angular: Vec3<C::F>,
) {
    for i in 0..3 {
        cx.set(&mut b.joint_qdd[dof + i], linear.0[i]);
        cx.set(&mut b.joint_qdd[dof + 3 + i], angular.0[i]);
    }
}

/// Converts forces of dofs, `(dofs,)`.
#[inline(always)]
pub fn turn_forces<F: Num>(m: &Constants<F::Real>, w: &Workspace<F>, forces: &mut [F]) {
    for (k, dof) in free_bodies(m) {
        // τ' = Rᵀ (τ + r × f), about the frame's origin in the body's axes
        let [force, torque] = halves(&forces[dof..]);
        // the reference point is the centre of mass, so the origin is -r
        let moved = torque - w.origin[k].cross(force);
        let local_torque = w.rotation[k].transpose_mul(moved);
        forces[dof + 3..dof + 6].copy_from_slice(&local_torque.0);
    }
}

/// Writes the bias forces, `(dofs,)`.
#[inline(always)]
pub fn bias<C: Cx>(cx: &C, m: &ConstantsOf<C>, b: &BlockOf<C>, to: &mut [C::F]) {
    let w = &b.work;
    to.copy_from_slice(&w.bias_force);
    // c + M s with s = ω × (ω × r), the acceleration a at a' = 0
    for (k, dof) in free_bodies(m) {
        let spin = Vec3(std::array::from_fn(|i| cx.get(&b.joint_qd[dof + 3 + i])));
        let swing = spin.cross(w.origin[k].cross(spin));
        // M s by the columns of the linear dofs, where entries that the pattern lacks are 0
        for (row, force) in to.iter_mut().enumerate() {
            for i in 0..3 {
                if let Some(place) = m.pattern.find(row, dof + i) {
                    *force = w.mass_matrix[place].fma(swing[i], *force);
                }
            }
        }
    }
    // MuJoCo's have no armature
    free_joints::add_swing_forces(cx, m, b, -1.0, to);
    // torques about the frame's origin, in the body's axes
    turn_forces(m, w, to);
}

/// Free bodies, each with its first dof.
pub fn free_bodies<R>(m: &Constants<R>) -> impl Iterator<Item = (usize, usize)> {
    let bodies = m.bodies.iter().enumerate();
    let free = bodies.filter(|(_, body)| body.motion == Motion::Free);
    free.map(|(k, body)| (k, body.dof))
}

/// The linear and the angular part of six scalars.
#[inline(always)]
pub fn halves<F: Num>(six: &[F]) -> [Vec3<F>; 2] {
    [
        Vec3([six[0], six[1], six[2]]),
        Vec3([six[3], six[4], six[5]]),
    ]
}
