//! Link frames in the world, for output.
//!
//! Orientations are quaternions along the chain of joints: they stay unit up to rounding, and need no case distinction, which
//! a conversion from matrices needs.

use crate::arrays::Array as A;
use crate::constants::Motion;
use crate::lane::{Cx, Num};
use crate::math::quat::{self, mul, turn_z};
use crate::math::vec3::Vec3;
use crate::step::tree::kinematics::{from_reference, mocap_quat, read_quat};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Link frames for output.
pub struct Poses;

impl Stage for Poses {
    const READS: &'static [A] = &[
        A::JointQ,
        A::Params,
        A::MocapQuat,
        A::Rotation,
        A::Origin,
        A::Reference,
    ];
    const WRITES: &'static [A] = &[A::BodyQ, A::Orientation];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for (k, body) in m.bodies.iter().enumerate() {
            // orientation before the joint moves: that of the parent, then the rest rotation
            let rest = quat::constant(body.quat);
            let carried = match body.parent {
                Some(parent) => mul(b.work.orientation[parent], rest),
                None => rest,
            };
            // the rotation of the joint follows; a free or mocap body has its orientation in the world
            b.work.orientation[k] = match body.motion {
                Motion::Revolute => {
                    // (0, 0, sin q/2, cos q/2) from the right
                    let half = from_reference(cx, m, b, body) * C::F::c(0.5);
                    let (sin, cos) = half.sincos();
                    turn_z(carried, sin, cos)
                }
                Motion::Prismatic => carried,
                Motion::Ball => mul(carried, read_quat(cx, &b.joint_q, body.coord)),
                Motion::Free => read_quat(cx, &b.joint_q, body.coord + 3),
                Motion::Mocap => mocap_quat(&b.mocap_quat, body.coord),
            };
        }
        let w = &mut b.work;
        for (k, frame) in m.frames.iter().enumerate() {
            // frames of links: R p + o from the reference point of the tree, which comes last
            let (position, rest) = (Vec3::constant(frame.position), quat::constant(frame.quat));
            let (position, orientation) = match frame.body {
                Some(body) => (
                    w.rotation[body].mul_add(position, w.origin[body]),
                    mul(w.orientation[body], rest),
                ),
                None => (position, rest),
            };
            let Vec3([px, py, pz]) = position + w.reference[frame.tree];
            let [qx, qy, qz, qw] = orientation;
            w.body_q[k] = [px, py, pz, qx, qy, qz, qw];
        }
    }
}
