//! Forward kinematics (Featherstone 2008, section 4.1): frames, motion axes and inertias of all bodies.
//!
//! ```text
//! R(b) = R(parent) E(b) Rz(q)     p(b) = p(parent) + R(parent) r(b)     revolute
//! R(b) = R(parent) E(b)           p(b) = … + z q                        prismatic
//! R(b) = R(parent) E(b) R(q)      p(b) = …                              ball
//! R(b) = R(q)                     p(b) = -R(b) c                        free
//! R(b), p(b) as clients set them                                        mocap
//! S = (p × z, z)  or  (z, 0)      linear, angular, at the robot's reference point
//! ```
//!
//! The reference point is the base, or the centre of mass c of a free body, for which S = 1.
//!
//! Inertias are about a point of each body: the origin of its frame, or the reference point for a free body. About the
//! reference point of a long arm, m p² of a light wrist is thousands of times the wrist's own inertia, which `f32` then
//! loses. An arm leads from the point of a body's carrier to that of the body.

use crate::arrays::{Array as A, Block};
use crate::constants::params::Param;
use crate::constants::{Body, Constants, Motion};
use crate::lane::{Cx, Num};
use crate::math::quat;
use crate::math::spatial::{Inertia, Spatial};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::params::moved_by;
use crate::step::{BlockOf, ConstantsOf, Stage, masses};

/// Frames, motion axes and inertias in the world.
pub struct Kinematics;

impl Stage for Kinematics {
    const READS: &'static [A] = &[A::JointQ, A::Params, A::MocapPos, A::MocapQuat];
    const WRITES: &'static [A] = &[
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Arm,
        A::Motion,
        A::Inertia,
    ];

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // every tree begins at its base, then free and mocap bodies set the reference points of theirs
        place_bases(m, b);
        // parents precede children (sim-model sorts them), so one forward pass suffices
        for (k, body) in m.bodies.iter().enumerate() {
            let place = place_body(cx, m, b, k);
            let origin = b.work.origin[k];
            // origin from the body's own point: 0 except of a free body, whose point is the reference point
            let from_point = match body.motion {
                Motion::Free => origin,
                _ => Vec3::zero(),
            };
            // from the carrier's point to the body's, or of a root from the reference point
            b.work.arm[k] = match body.parent {
                // its point is the reference point
                Some(parent) if m.bodies[parent].motion == Motion::Free => origin,
                Some(_) => place,
                None => origin - from_point,
            };
            let rotation = b.work.rotation[k];
            b.work.inertia[k] = inertia(m, &b.params, body, &rotation, from_point);
        }
    }
}

/// Writes the reference points of robots that are fixed to the world.
#[inline(always)]
pub fn place_bases<F: Num, V>(m: &Constants<F::Real>, b: &mut Block<F, V>) {
    for (t, tree) in m.trees.iter().enumerate() {
        b.work.reference[t] = Vec3::constant(tree.base);
    }
}

/// Writes the frame and the motion axes of a body whose parent is placed. Returns its origin from that of its carrier, or from
/// the base.
#[inline(always)]
pub fn place_body<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    k: usize,
) -> Vec3<C::F> {
    let body = &m.bodies[k];
    // the pose at q = 0, then the joint's slide, then its rotation
    let (rest, place) = at_zero(b, body);
    let place = slid(cx, m, b, body, rest, place);
    // R(parent) r(b) stays apart for the arm: p(b) - p(parent) would have the rounding of both
    let origin = match body.parent {
        Some(parent) => b.work.origin[parent] + place,
        None => place,
    };
    let (rotation, origin) = moved(cx, m, b, body, rest, origin);
    b.work.rotation[k] = rotation;
    b.work.origin[k] = origin;
    place
}

/// Axes of a body whose joint is at 0, and its origin from that of its carrier, or from the base.
#[inline(always)]
fn at_zero<F: Num, V>(b: &Block<F, V>, body: &Body<F::Real>) -> (Mat3<F>, Vec3<F>) {
    // R(parent) E(b) and R(parent) r(b)
    let place = Vec3::constant(body.position);
    match body.parent {
        Some(parent) => {
            let r = &b.work.rotation[parent];
            (rest_rotation(r, body), r * place)
        }
        None => (Mat3::constant(body.rotation), place),
    }
}

/// The same origin after the joint's slide.
#[inline(always)]
fn slid<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    body: &Body<<C::F as Num>::Real>,
    rest: Mat3<C::F>,
    place: Vec3<C::F>,
) -> Vec3<C::F> {
    // + z q along the axis at rest
    match body.motion {
        Motion::Prismatic => rest[2].scale_add(from_reference(cx, m, b, body), place),
        _ => place,
    }
}

/// Position of a hinge or a slide, less what its reference has moved by where that varies [rad or m].
#[inline(always)]
pub(in crate::step) fn from_reference<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    body: &Body<<C::F as Num>::Real>,
) -> C::F {
    let q = cx.get(&b.joint_q[body.coord]);
    match moved_by(m, &b.params, Param::JointRef, body.dof) {
        Some(moved) => q - moved,
        None => q,
    }
}

/// Axes and origin of a body turned by its joint; writes the joint's motion axes.
#[inline(always)]
fn moved<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    body: &Body<<C::F as Num>::Real>,
    rest: Mat3<C::F>,
    origin: Vec3<C::F>,
) -> (Mat3<C::F>, Vec3<C::F>) {
    let Mat3([x, y, z]) = rest;
    let (c, d) = (body.coord, body.dof);
    match body.motion {
        Motion::Revolute => {
            // E Rz(q) rotates x and y in their plane and leaves z, S = (p × z, z)
            let (sin, cos) = from_reference(cx, m, b, body).sincos();
            b.work.motion[d] = Spatial([origin.cross(z), z]);
            let columns = [y.scale_add(sin, x * cos), y * cos - x * sin, z];
            (Mat3(columns), origin)
        }
        Motion::Prismatic => {
            // S = (z, 0)
            b.work.motion[d] = Spatial([z, Vec3::zero()]);
            (rest, origin)
        }
        Motion::Ball => {
            // R(parent) E R(q), and an axis of S along each of its columns
            let Mat3([x, y, z]) = quat::matrix(read_quat(cx, &b.joint_q, c));
            let rotation = Mat3([rest * x, rest * y, rest * z]);
            for i in 0..3 {
                b.work.motion[d + i] = Spatial([origin.cross(rotation[i]), rotation[i]]);
            }
            (rotation, origin)
        }
        Motion::Free => {
            // R(q) in world axes, with R c from the frame's origin to the centre of mass
            let rotation = quat::matrix(read_quat(cx, &b.joint_q, c + 3));
            let center = rotation * Vec3::constant(body.center);
            let position = Vec3([
                cx.get(&b.joint_q[c]),
                cx.get(&b.joint_q[c + 1]),
                cx.get(&b.joint_q[c + 2]),
            ]);
            // the reference point is the centre of mass, about which S = 1
            b.work.reference[body.tree] = position + center;
            for i in 0..3 {
                let mut axis = Vec3::zero();
                axis[i] = C::F::c(1.0);
                b.work.motion[d + i] = Spatial([axis, Vec3::zero()]);
                b.work.motion[d + 3 + i] = Spatial([Vec3::zero(), axis]);
            }
            (rotation, Vec3::zero() - center)
        }
        Motion::Mocap => {
            // the client's position is the reference point, so the origin is 0
            b.work.reference[body.tree] = Vec3(std::array::from_fn(|i| b.mocap_pos[3 * c + i]));
            (quat::matrix(mocap_quat(&b.mocap_quat, c)), Vec3::zero())
        }
    }
}

/// Least norm of a quaternion that turns (MuJoCo: `mjMINVAL`) [–].
const NORM_MIN: f64 = 1e-15;

/// The orientation that clients gave to mocap body `k`, as a quaternion (x, y, z, w). One without direction is no rotation,
/// as in MuJoCo.
#[inline(always)]
pub(in crate::step) fn mocap_quat<F: Num>(all: &[F], k: usize) -> quat::Quat<F> {
    // clients give (w, x, y, z) of any length
    let [w, x, y, z] = std::array::from_fn(|i| all[4 * k + i]);
    // |q|², and where it is too small for a direction
    let square = w.fma(w, x.fma(x, y.fma(y, z * z)));
    let still = square.lt(F::c(NORM_MIN * NORM_MIN));
    // lanes without direction divide by 1: a select, since other lanes of the block have one
    let scale = F::c(1.0).div(F::select(still, F::c(1.0), square).sqrt());
    let [zero, one] = [F::c(0.0), F::c(1.0)];
    // unit length, or (0, 0, 0, 1) without direction
    let turned = [x * scale, y * scale, z * scale, w * scale];
    let [x, y, z, w] = turned;
    [
        F::select(still, zero, x),
        F::select(still, zero, y),
        F::select(still, zero, z),
        F::select(still, one, w),
    ]
}

/// Inertia of a body about a point, from which its origin is given; where masses vary, the sum of those of its links.
#[inline(always)]
pub(super) fn inertia<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    body: &Body<F::Real>,
    rotation: &Mat3<F>,
    origin: Vec3<F>,
) -> Inertia<F> {
    // the whole body at once, with its constant mass
    if !masses::vary(m) {
        let (mass, inertia) = (F::k(body.mass), body.inertia.map(F::k));
        let center = Vec3::constant(body.center);
        return Inertia::placed(mass, center, inertia, rotation, origin);
    }
    // I(b) = Σ s I(link), all about the same point, with each link's scale s
    let mut sum = Inertia::zero();
    for part in &body.parts {
        let (mass, inertia) = masses::of_part(m, params, part);
        let center = masses::center(m, params, part);
        let link_inertia = Inertia::placed(mass, center, inertia, rotation, origin);
        let scale = masses::scale(m, params, part.link);
        for (sum, entry) in sum.iter_mut().zip(*link_inertia) {
            *sum = entry.fma(scale.unwrap_or(F::c(1.0)), *sum);
        }
    }
    sum
}

/// R(parent) E(b). Most joints are at right angles to each other: E only permutes axes then, which needs no product.
#[inline(always)]
fn rest_rotation<F: Num>(r: &Mat3<F>, body: &Body<F::Real>) -> Mat3<F> {
    match body.exchange {
        // columns of R, exchanged and negated, which rounds nothing
        Some([x, y, z]) => Mat3([permuted(r, x), permuted(r, y), permuted(r, z)]),
        None => {
            let [x, y, z] = body.rotation;
            Mat3([
                r * Vec3::constant(x),
                r * Vec3::constant(y),
                r * Vec3::constant(z),
            ])
        }
    }
}

/// A column of R, negated where it is reversed.
#[inline(always)]
fn permuted<F: Num>(r: &Mat3<F>, (axis, is_reversed): (usize, bool)) -> Vec3<F> {
    if is_reversed { -r[axis] } else { r[axis] }
}

/// The quaternion that begins at coordinate `c`.
#[inline(always)]
pub(in crate::step) fn read_quat<C: Cx>(
    cx: &mut C,
    joint_q: &[C::V],
    c: usize,
) -> quat::Quat<C::F> {
    [
        cx.get(&joint_q[c]),
        cx.get(&joint_q[c + 1]),
        cx.get(&joint_q[c + 2]),
        cx.get(&joint_q[c + 3]),
    ]
}
