//! Forces that make given accelerations: Newton's and Euler's equations of each body about its own frame's origin
//! (Featherstone 2008, section 5.4), so that rounding is relative to what a joint carries, not to how far
//! it is from the robot's reference point.
//!
//! ```text
//! ω(b) = ω(parent) + z q̇              α(b) = α(parent) + z q̈ + ω(parent) × z q̇          a joint that turns
//! a(b) = a(parent) + α × r + ω × (ω × r)  … + z q̈ + 2 ω × z q̇                           one that slides
//! F = m (a + α × c + ω × (ω × c))     N = I α + ω × I ω + c × F
//! f(b) = F + Σ f(child)               n(b) = N + Σ n(child) + r × f(child)
//! τ = z · n  or  z · f
//! ```

use super::{BlockOf, ConstantsOf, gravity, param};
use crate::constants::params::Param;
use crate::constants::{Body, Motion};
use crate::lane::{Cx, Num};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial, symmetric};
use crate::math::vec3::{Mat3, Vec3};

/// The forces of `joint_qdd` at this state, into `missing`.
#[inline(always)]
pub(super) fn inverse_dynamics<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    // `force` holds the acceleration of a body's origin until its force is known
    proper_accelerations(cx, m, b);
    for (k, body) in m.bodies.iter().enumerate() {
        let w = &mut b.work;
        let (axes, omega) = (&w.rotation[k], w.velocity[k][ANGULAR]);
        w.force[k] = match m.varying.first(Param::BodyMassScale) {
            None => held::<C::F>(
                body.mass,
                body.center,
                body.inertia,
                axes,
                omega,
                w.force[k],
            ),
            Some(first) => {
                let mut whole = Spatial::zero();
                for part in &body.parts {
                    let own = held::<C::F>(
                        part.mass,
                        part.center,
                        part.inertia,
                        axes,
                        omega,
                        w.force[k],
                    );
                    whole = own.scale_add(b.params[first + part.link], whole);
                }
                whole
            }
        };
    }
    for (k, body) in m.bodies.iter().enumerate().rev() {
        let arm = arm(cx, b, k, body);
        let w = &mut b.work;
        let Spatial([force, moment]) = w.force[k];
        let (axes, d) = (w.rotation[k], body.dof);
        let torque = &mut w.missing;
        match body.motion {
            Motion::Revolute => torque[d] = axes[2].dot(moment),
            Motion::Prismatic => torque[d] = axes[2].dot(force),
            Motion::Ball => torque[d..d + 3].copy_from_slice(&*axes.transpose_mul(moment)),
            Motion::Free => {
                let center = axes * Vec3::constant(body.center);
                torque[d..d + 3].copy_from_slice(&*force);
                torque[d + 3..d + 6].copy_from_slice(&*(moment - center.cross(force)));
            }
        }
        if let Some(parent) = body.parent {
            let carried = Spatial([force, arm.cross_add(force, moment)]);
            w.force[parent] = w.force[parent] + carried;
        }
    }
    for (j, dof) in m.dofs.iter().enumerate() {
        let driven = param(m, &b.params, Param::JointArmature, j, dof.armature);
        b.work.missing[j] = driven.fma(cx.get(&b.joint_qdd[j]), b.work.missing[j]);
    }
}

/// Accelerations of the origins of all bodies less gravity, and angular ones, into `force`; that of what stands still.
#[inline(always)]
pub(super) fn proper_accelerations<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
) -> Vec3<C::F> {
    let base = Spatial([-gravity(m, &b.params), Vec3::zero()]);
    for (k, body) in m.bodies.iter().enumerate() {
        let arm = arm(cx, b, k, body);
        let w = &mut b.work;
        let (above, spin) = match body.parent {
            Some(parent) => (w.force[parent], w.velocity[parent][ANGULAR]),
            None => (base, Vec3::zero()),
        };
        let carried = [carried_along(above, spin, arm), above[ANGULAR]];
        let axes = w.rotation[k];
        let z = axes[2];
        let d = body.dof;
        w.force[k] = Spatial(match body.motion {
            Motion::Revolute => {
                let turn = z * cx.get(&b.joint_qd[d]);
                let own = z.scale_add(cx.get(&b.joint_qdd[d]), spin.cross(turn));
                [carried[LINEAR], carried[ANGULAR] + own]
            }
            Motion::Prismatic => {
                let slide = z * (cx.get(&b.joint_qd[d]) * C::F::c(2.0));
                let own = z.scale_add(cx.get(&b.joint_qdd[d]), spin.cross(slide));
                [carried[LINEAR] + own, carried[ANGULAR]]
            }
            Motion::Ball => {
                let turn = axes * read::<C>(cx, &b.joint_qd, d);
                let own = axes.mul_add(read::<C>(cx, &b.joint_qdd, d), spin.cross(turn));
                [carried[LINEAR], carried[ANGULAR] + own]
            }
            Motion::Free => {
                let (linear, angular) = (
                    read::<C>(cx, &b.joint_qdd, d),
                    read::<C>(cx, &b.joint_qdd, d + 3),
                );
                let center = Spatial([base[LINEAR] + linear, angular]);
                let back = Vec3::zero() - axes * Vec3::constant(body.center);
                let omega = w.velocity[k][ANGULAR];
                [carried_along(center, omega, back), angular]
            }
        });
    }
    base[LINEAR]
}

/// The force that gives a mass its acceleration, and its moment about the origin of the frame that carries it.
#[inline(always)]
fn held<F: Num>(
    mass: F::Real,
    center: [F::Real; 3],
    inertia: [F::Real; 6],
    axes: &Mat3<F>,
    omega: Vec3<F>,
    acceleration: Spatial<F>,
) -> Spatial<F> {
    let center = axes * Vec3::constant(center);
    let force = carried_along(acceleration, omega, center) * F::k(mass);
    let (spin, turn) = (
        axes.transpose_mul(omega),
        axes.transpose_mul(acceleration[ANGULAR]),
    );
    let own = spin.cross_add(symmetric(inertia, spin), symmetric(inertia, turn));
    Spatial([force, axes.mul_add(own, center.cross(force))])
}

/// Acceleration of a point `arm` away on a body that moves so: a + α × r + ω × (ω × r).
#[inline(always)]
pub(super) fn carried_along<F: Num>(origin: Spatial<F>, omega: Vec3<F>, arm: Vec3<F>) -> Vec3<F> {
    let swing = origin[ANGULAR].cross_add(arm, origin[LINEAR]);
    omega.cross_add(omega.cross(arm), swing)
}

/// From the origin of the carrier to that of body `k`; the difference of their origins would round as these do.
#[inline(always)]
fn arm<C: Cx>(
    cx: &mut C,
    b: &BlockOf<C>,
    k: usize,
    body: &Body<<C::F as Num>::Real>,
) -> Vec3<C::F> {
    let w = &b.work;
    let rest = match body.parent {
        Some(parent) => w.rotation[parent] * Vec3::constant(body.position),
        None => Vec3::constant(body.position),
    };
    match body.motion {
        Motion::Prismatic => w.rotation[k][2].scale_add(cx.get(&b.joint_q[body.coord]), rest),
        Motion::Revolute | Motion::Ball | Motion::Free => rest,
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
