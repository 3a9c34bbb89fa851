//! Forward kinematics (Featherstone 2008, section 4.1): frames, motion axes and inertias of all bodies.
//!
//! ```text
//! R(b) = R(parent) E(b) Rz(q)     p(b) = p(parent) + R(parent) r(b)     a joint that turns
//! R(b) = R(parent) E(b)           p(b) = … + z q                        one that slides
//! R(b) = R(parent) E(b) R(q)      p(b) = …                              a ball
//! R(b) = R(q)                     p(b) = -R(b) c                        a free body
//! S = (p × z, z)  or  (z, 0)      linear, angular, at the robot's reference point
//! ```
//!
//! The reference point is the base, or the centre of mass c of a free body, for which S = 1.

use super::{BlockOf, ConstantsOf};
use crate::constants::params::Param;
use crate::constants::{Body, Motion};
use crate::lane::{Cx, Num};
use crate::math::quat;
use crate::math::spatial::place;
use crate::math::vec3::{
    Mat3, Vec3, add, constant, cross, scale, scale_add, sub, transform, transform_add, zero,
};

#[inline(always)]
pub(super) fn kinematics<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    for (t, tree) in m.trees.iter().enumerate() {
        w.reference[t] = constant(tree.base);
    }
    // parents precede children (model/compile.rs sorts them), so one forward pass suffices
    for (k, body) in m.bodies.iter().enumerate() {
        let ([x, y, z], mut origin) = match body.parent {
            Some(parent) => {
                let r = &w.rotation[parent];
                let origin = transform_add(r, constant(body.position), w.origin[parent]);
                (at_rest(r, body), origin)
            }
            None => {
                let [x, y, z] = body.rotation;
                let rest = [constant(x), constant(y), constant(z)];
                (rest, constant(body.position))
            }
        };
        let (c, d) = (body.coord, body.dof);
        let rotation;
        match body.motion {
            Motion::Revolute => {
                let (sin, cos) = cx.get(&b.joint_q[c]).sincos();
                rotation = [
                    scale_add(y, sin, scale(x, cos)),
                    sub(scale(y, cos), scale(x, sin)),
                    z,
                ];
                w.motion[d] = [cross(origin, z), z];
            }
            Motion::Prismatic => {
                origin = scale_add(z, cx.get(&b.joint_q[c]), origin);
                rotation = [x, y, z];
                w.motion[d] = [z, zero()];
            }
            Motion::Ball => {
                let turn = quat::matrix(read_quat(cx, &b.joint_q, c));
                let rest: Mat3<C::F> = [x, y, z];
                rotation = [
                    transform(&rest, turn[0]),
                    transform(&rest, turn[1]),
                    transform(&rest, turn[2]),
                ];
                for i in 0..3 {
                    w.motion[d + i] = [cross(origin, rotation[i]), rotation[i]];
                }
            }
            Motion::Free => {
                rotation = quat::matrix(read_quat(cx, &b.joint_q, c + 3));
                let center = transform(&rotation, constant(body.center));
                origin = sub(zero(), center);
                let position = [
                    cx.get(&b.joint_q[c]),
                    cx.get(&b.joint_q[c + 1]),
                    cx.get(&b.joint_q[c + 2]),
                ];
                w.reference[body.tree] = add(position, center);
                for i in 0..3 {
                    let mut axis = zero();
                    axis[i] = C::F::c(1.0);
                    w.motion[d + i] = [axis, zero()];
                    w.motion[d + 3 + i] = [zero(), axis];
                }
            }
        }
        w.inertia[k] = match m.varying.first(Param::BodyMassScale) {
            None => place::<C::F>(body.mass, body.center, body.inertia, &rotation, origin),
            Some(first) => {
                let mut sum = [C::F::c(0.0); 10];
                for part in &body.parts {
                    let own =
                        place::<C::F>(part.mass, part.center, part.inertia, &rotation, origin);
                    for (sum, own) in sum.iter_mut().zip(own) {
                        *sum = own.fma(b.params[first + part.link], *sum);
                    }
                }
                sum
            }
        };
        w.rotation[k] = rotation;
        w.origin[k] = origin;
    }
}

/// R(parent) E(b); most joints stand at right angles to each other, which costs no product.
#[inline(always)]
fn at_rest<F: Num>(r: &Mat3<F>, body: &Body<F::Real>) -> Mat3<F> {
    match body.exchange {
        Some([x, y, z]) => [exchanged(r, x), exchanged(r, y), exchanged(r, z)],
        None => {
            let [x, y, z] = body.rotation;
            [
                transform(r, constant(x)),
                transform(r, constant(y)),
                transform(r, constant(z)),
            ]
        }
    }
}

#[inline(always)]
fn exchanged<F: Num>(r: &Mat3<F>, (axis, back): (usize, bool)) -> Vec3<F> {
    let [x, y, z] = r[axis];
    if back { [-x, -y, -z] } else { [x, y, z] }
}

/// The quaternion that begins at coordinate `c`.
#[inline(always)]
pub(super) fn read_quat<C: Cx>(cx: &mut C, joint_q: &[C::V], c: usize) -> quat::Quat<C::F> {
    [
        cx.get(&joint_q[c]),
        cx.get(&joint_q[c + 1]),
        cx.get(&joint_q[c + 2]),
        cx.get(&joint_q[c + 3]),
    ]
}
