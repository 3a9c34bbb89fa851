//! Inverse dynamics: Newton's and Euler's equations of each body about its own frame's origin (Featherstone 2008, section
//! 5.4). So rounding is relative to the load of a joint, not to its distance from the robot's reference point.
//!
//! ```text
//! ω(b) = ω(parent) + z q̇              α(b) = α(parent) + z q̈ + ω(parent) × z q̇          revolute
//! a(b) = a(parent) + α × r + ω × (ω × r)  … + z q̈ + 2 ω × z q̇                           prismatic
//! F = m (a + α × c + ω × (ω × c))     N = I α + ω × I ω + c × F
//! f(b) = F + Σ f(child)               n(b) = N + Σ n(child) + r × f(child)
//! τ = z · n  or  z · f
//! ```

use super::free_joints;
use crate::constants::params::Param;
use crate::constants::{Body, Motion};
use crate::lane::{Cx, Num};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial, symmetric};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::tendons::armature;
use crate::step::tree::kinematics::from_reference;
use crate::step::{BlockOf, ConstantsOf, gravity, masses, param};

/// Writes the forces that `joint_qdd` needs at this state, to `missing`.
#[inline(always)]
pub(in crate::step) fn inverse_dynamics<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    // `force` holds the acceleration of a body's origin until its force is known
    proper_accelerations(cx, m, b);
    // F and N of each body, sums over its links where masses vary
    for (k, body) in m.bodies.iter().enumerate() {
        let w = &mut b.work;
        let (axes, omega) = (&w.rotation[k], w.velocity[k][ANGULAR]);
        let state = (axes, omega, w.force[k]);
        w.force[k] = if masses::vary(m) {
            // F and N are linear in mass and inertia, so a link's scale multiplies both
            let mut whole = Spatial::zero();
            for part in &body.parts {
                let massed = masses::of_part(m, &b.params, part);
                let center = masses::center(m, &b.params, part);
                let wrench = newton_euler::<C::F>(massed, center, state);
                let scale = masses::scale(m, &b.params, part.link);
                whole = wrench.scale_add(scale.unwrap_or(C::F::c(1.0)), whole);
            }
            whole
        } else {
            let massed = (C::F::k(body.mass), body.inertia.map(C::F::k));
            newton_euler::<C::F>(massed, Vec3::constant(body.center), state)
        };
    }
    // from the leaves: τ = z · n or z · f, then the force goes on to the carrier
    for (k, body) in m.bodies.iter().enumerate().rev() {
        // what body and subtree need, about the origin of the body
        let arm = arm(cx, m, b, k, body);
        let w = &mut b.work;
        let Spatial([force, moment]) = w.force[k];
        let (axes, d) = (w.rotation[k], body.dof);
        let torque = &mut w.missing;
        match body.motion {
            Motion::Revolute => torque[d] = axes[2].dot(moment),
            Motion::Prismatic => torque[d] = axes[2].dot(force),
            Motion::Ball => torque[d..d + 3].copy_from_slice(&*axes.transpose_mul(moment)),
            // the dofs of a free body are those of its centre of mass
            Motion::Free => {
                let center = axes * Vec3::constant(body.center);
                torque[d..d + 3].copy_from_slice(&*force);
                torque[d + 3..d + 6].copy_from_slice(&*(moment - center.cross(force)));
            }
            Motion::Mocap => {}
        }
        // f(parent) += f, n(parent) += n + r × f
        if let Some(parent) = body.parent {
            let carried = w.force[k].moved(arm);
            w.force[parent] = w.force[parent] + carried;
        }
    }
    // the rotor of a drive
    for &j in &m.diagonal_dofs {
        let armature = param(m, &b.params, Param::JointArmature, j, m.dofs[j].armature);
        b.work.missing[j] = armature.fma(cx.get(&b.joint_qdd[j]), b.work.missing[j]);
    }
    free_joints::add_armature_forces(cx, m, b);
    armature::add_armature_forces(cx, m, b);
}

/// Writes the accelerations of all body origins less gravity, and the angular ones, to `force`. Returns that of a static body.
#[inline(always)]
pub(in crate::step) fn proper_accelerations<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
) -> Vec3<C::F> {
    // gravity as an acceleration of the base by -g
    let base = Spatial([-gravity(m, &b.params), Vec3::zero()]);
    for (k, body) in m.bodies.iter().enumerate() {
        let arm = arm(cx, m, b, k, body);
        let w = &mut b.work;
        // of the carrier: a, α and ω
        let (above, spin) = match body.parent {
            Some(parent) => (w.force[parent], w.velocity[parent][ANGULAR]),
            None => (base, Vec3::zero()),
        };
        // what the carrier alone gives the body: a + α × r + ω × (ω × r), and α
        let carried = [point_acceleration(above, spin, arm), above[ANGULAR]];
        let axes = w.rotation[k];
        let z = axes[2];
        let d = body.dof;
        w.force[k] = Spatial(match body.motion {
            Motion::Revolute => {
                // α += z q̈ + ω × z q̇
                let turn = z * cx.get(&b.joint_qd[d]);
                let relative = z.scale_add(cx.get(&b.joint_qdd[d]), spin.cross(turn));
                [carried[LINEAR], carried[ANGULAR] + relative]
            }
            Motion::Prismatic => {
                // a += z q̈ + 2 ω × z q̇
                let slide = z * (cx.get(&b.joint_qd[d]) * C::F::c(2.0));
                let relative = z.scale_add(cx.get(&b.joint_qdd[d]), spin.cross(slide));
                [carried[LINEAR] + relative, carried[ANGULAR]]
            }
            Motion::Ball => {
                // α += R q̈ + ω × R q̇, the dofs of a ball being about its own axes
                let turn = axes * read::<C>(cx, &b.joint_qd, d);
                let relative = axes.mul_add(read::<C>(cx, &b.joint_qdd, d), spin.cross(turn));
                [carried[LINEAR], carried[ANGULAR] + relative]
            }
            Motion::Free => {
                // q̈ is of the centre of mass, from which the frame's origin is at -R c
                let (linear, angular) = (
                    read::<C>(cx, &b.joint_qdd, d),
                    read::<C>(cx, &b.joint_qdd, d + 3),
                );
                let center = Spatial([base[LINEAR] + linear, angular]);
                let back = Vec3::zero() - axes * Vec3::constant(body.center);
                let omega = w.velocity[k][ANGULAR];
                [point_acceleration(center, omega, back), angular]
            }
            Motion::Mocap => base.0,
        });
    }
    base[LINEAR]
}

/// The force of a mass under its acceleration, and its moment about the origin of its body.
#[inline(always)]
fn newton_euler<F: Num>(
    (mass, inertia): (F, [F; 6]),
    center: Vec3<F>,
    (axes, omega, acceleration): (&Mat3<F>, Vec3<F>, Spatial<F>),
) -> Spatial<F> {
    // F = m (a + α × c + ω × (ω × c))
    let center = axes * center;
    let force = point_acceleration(acceleration, omega, center) * mass;
    // N = I α + ω × I ω + c × F: the first two in the body's axes, where I is constant
    let (spin, turn) = (
        axes.transpose_mul(omega),
        axes.transpose_mul(acceleration[ANGULAR]),
    );
    let moment = spin.cross_add(symmetric(inertia, spin), symmetric(inertia, turn));
    Spatial([force, axes.mul_add(moment, center.cross(force))])
}

/// Acceleration of a point of a body at `arm` from its origin: a + α × r + ω × (ω × r).
#[inline(always)]
pub(in crate::step) fn point_acceleration<F: Num>(
    origin: Spatial<F>,
    omega: Vec3<F>,
    arm: Vec3<F>,
) -> Vec3<F> {
    let swing = origin[ANGULAR].cross_add(arm, origin[LINEAR]);
    omega.cross_add(omega.cross(arm), swing)
}

/// From the origin of the parent to that of body `k`. The difference of their positions would have the rounding of these.
#[inline(always)]
fn arm<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    k: usize,
    body: &Body<<C::F as Num>::Real>,
) -> Vec3<C::F> {
    let w = &b.work;
    // r at q = 0 in world axes, then a slide along z
    let rest = match body.parent {
        Some(parent) => w.rotation[parent] * Vec3::constant(body.position),
        None => Vec3::constant(body.position),
    };
    match body.motion {
        Motion::Prismatic => {
            let slide = from_reference(cx, m, b, body);
            w.rotation[k][2].scale_add(slide, rest)
        }
        Motion::Revolute | Motion::Ball | Motion::Free | Motion::Mocap => rest,
    }
}

/// Three cells from `first` on.
#[inline(always)]
fn read<C: Cx>(cx: &mut C, cells: &[C::V], first: usize) -> Vec3<C::F> {
    Vec3([
        cx.get(&cells[first]),
        cx.get(&cells[first + 1]),
        cx.get(&cells[first + 2]),
    ])
}
