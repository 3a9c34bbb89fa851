//! How bias forces change with velocities (MuJoCo: `mjd_rne_vel`), by composite rigid bodies as the mass matrix.
//!
//! ```text
//! K(i,j) = ∂c(i)/∂q̇(j) = S(i) · f(j)             i on the path from j to the root
//! f(j) = Iᶜ A(j) + 2 (e × p, W e)                 e: angular part of S(j)
//! K(i,j) = Iᶜ S(i) · A(j) + g(i) · e(j)           j on the path from i to the root
//! g(i) = 2 (p × u + Wᵀ e)                         S(i) = (u, e)
//! A(j) = w × S(j)                                 w: velocity of the body, plus that of its carrier there
//! ```
//!
//! p is the momentum of a subtree, and W e = Σ m r × (e × ṙ) over its points: turning faster by e adds the forces 2 m e × ṙ of
//! Coriolis. About a point at `arm` from the old one, W e grows by r × (e × p). Of one body, with velocity v, ω of its point:
//!
//! ```text
//! p = m v + ω × h        W e = h × (e × v) + ω × (I e) - tr(I)/2 ω × e
//! ```
//!
//! MuJoCo's bias is that at zero acceleration of a free body's frame. Its translations change nothing, and a rotation e is about
//! the frame's origin o: S = (o × e, e), carried by the velocity of o. So K is that in our coordinates of MuJoCo's derivative.

use super::bias::along;
use super::kinematics::inertia;
use crate::constants::{Constants, Motion};
use crate::lane::{Cx, Num};
use crate::math::spatial::{ANGULAR, Inertia, LINEAR, Spatial};
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf};

/// Adds h K to a matrix: its lower triangle to the mass matrix, what is above to `hessian`, transposed.
#[inline(always)]
pub(in crate::step) fn add_bias_slope<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    // A(j) of all dofs, p and W of each body alone
    for k in 0..m.bodies.len() {
        carry_motions::<C>(m, b, k);
        whirl_alone::<C>(m, b, k);
    }
    // children follow their parents: a subtree is complete when its root is reached
    for (k, body) in m.bodies.iter().enumerate().rev() {
        for dof in body.dofs() {
            add_dof::<C>(m, b, k, dof);
        }
        // p(parent) += p, W(parent) += W about the carrier's point
        if let Some(parent) = body.parent {
            let w = &mut b.work;
            let (momentum, arm) = (w.subtree_momentum[k], w.arm[k]);
            w.subtree_momentum[parent] = w.subtree_momentum[parent] + momentum;
            for j in 0..3 {
                let moved = arm.cross_add(axis(j).cross(momentum), w.subtree_whirl[k][j]);
                w.subtree_whirl[parent][j] = w.subtree_whirl[parent][j] + moved;
            }
        }
    }
}

/// A unit vector.
#[inline(always)]
fn axis<F: Num>(j: usize) -> Vec3<F> {
    let mut axis = Vec3::zero();
    axis[j] = F::c(1.0);
    axis
}

/// S of a dof about the point of its body.
#[inline(always)]
fn at_point<F: Num>(motion: Motion, axis: &Spatial<F>) -> Spatial<F> {
    match motion {
        // a free body's point is the reference point, which its motions are about
        Motion::Prismatic | Motion::Free => *axis,
        _ => Spatial([Vec3::zero(), axis[ANGULAR]]),
    }
}

/// Writes A(j) of the dofs of a body, about its point.
#[inline(always)]
fn carry_motions<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>, k: usize) {
    let (body, w) = (&m.bodies[k], &mut b.work);
    let (velocity, origin) = (w.velocity[k], w.origin[k]);
    if body.motion == Motion::Free {
        // v' = v + ω × o of the frame's origin carries the rotations, whose axes the body turns
        let pace = velocity[ANGULAR].cross_add(origin, velocity[LINEAR]);
        let carrier = Spatial([velocity[LINEAR] + pace, velocity[ANGULAR]]);
        for j in 0..3 {
            let turn = Spatial([origin.cross(axis(j)), axis(j)]);
            w.carried_motion[body.dof + j] = Spatial::zero();
            w.carried_motion[body.dof + 3 + j] = carrier.carry(turn);
        }
        return;
    }
    // both velocities at the frame's origin, the body's point
    let carrier = match body.parent {
        Some(parent) => w.velocity[parent] + velocity,
        None => velocity,
    };
    let pace = carrier[ANGULAR].cross_add(origin, carrier[LINEAR]);
    let carrier = Spatial([pace, carrier[ANGULAR]]);
    for dof in body.dofs() {
        w.carried_motion[dof] = carrier.carry(at_point(body.motion, &w.motion[dof]));
    }
}

/// Writes p and W of a body without those that it carries.
#[inline(always)]
fn whirl_alone<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>, k: usize) {
    let (body, w) = (&m.bodies[k], &mut b.work);
    // the mass matrix has left the inertias of subtrees
    let (origin, from_point) = match body.motion {
        Motion::Free => (Vec3::zero(), w.origin[k]),
        _ => (w.origin[k], Vec3::zero()),
    };
    let alone: Inertia<C::F> = inertia(m, &b.params, body, &w.rotation[k], from_point);
    let moment = alone.first_moment();
    // velocity of the point
    let Spatial([velocity, spin]) = w.velocity[k];
    let velocity = spin.cross_add(origin, velocity);
    w.subtree_momentum[k] = spin.cross_add(moment, velocity * alone[0]);
    // tr(I)/2
    let half = (alone[4] + alone[5] + alone[6]) * C::F::c(0.5);
    for j in 0..3 {
        // h × (e × v) + ω × (I e - tr(I)/2 e)
        let turned = alone.second_moment(axis(j)) - axis(j) * half;
        let pulled = moment.cross(axis::<C::F>(j).cross(velocity));
        w.subtree_whirl[k][j] = spin.cross_add(turned, pulled);
    }
}

/// Adds h K of a dof of body `k` with itself and those before it on its path.
#[inline(always)]
fn add_dof<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>, k: usize, dof: usize) {
    let (w, dt) = (&mut b.work, C::F::k(m.dt));
    let motion = at_point(m.bodies[k].motion, &w.motion[dof]);
    let turn = motion[ANGULAR];
    let (momentum, whirl) = (w.subtree_momentum[k], &w.subtree_whirl[k]);
    // f(j), Iᶜ S(i) and g(i), all times h
    let pull = Spatial([turn.cross(momentum), whirl * turn]) * C::F::c(2.0);
    let mut force = (w.inertia[k] * w.carried_motion[dof] + pull) * dt;
    let mut inertia = w.inertia[k] * motion * dt;
    let gyration = momentum.cross_add(motion[LINEAR], whirl.transpose_mul(turn));
    let gyration = gyration * C::F::c(2.0) * dt;
    // the dof with itself
    let (last, path) = path(m, dof);
    let diagonal = &mut w.mass_matrix[last];
    *diagonal = *diagonal + motion.dot(force);
    // towards the root: forces move to another point only where the body changes
    let mut at = k;
    for entry in path.iter().rev() {
        let body = m.dofs[entry.other].body;
        if body != at {
            force = force.moved(w.arm[at]);
            inertia = inertia.moved(w.arm[at]);
            at = body;
        }
        let other = &w.motion[entry.other];
        // what this dof does to the one before it
        let place = &mut w.hessian[entry.place];
        *place = *place + project(m.bodies[body].motion, other, force);
        // and the other way round
        let back = inertia.dot(w.carried_motion[entry.other]);
        let back = back + gyration.dot(other[ANGULAR]);
        w.mass_matrix[entry.place] = w.mass_matrix[entry.place] + back;
    }
}

/// Place of the diagonal of a dof, and the entries before it on its path.
#[inline(always)]
fn path<R>(m: &Constants<R>, dof: usize) -> (usize, &[crate::constants::MassEntry]) {
    let (start, end) = m.dofs[dof].entries;
    let (last, path) = m.mass_entries[start..end]
        .split_last()
        .expect("a dof meets itself");
    (last.place, path)
}

/// What a force about a body's point does along an axis of its joint.
#[inline(always)]
fn project<F: Num>(motion: Motion, axis: &Spatial<F>, force: Spatial<F>) -> F {
    match motion {
        Motion::Free => axis.dot(force),
        _ => along(motion, axis, force),
    }
}
