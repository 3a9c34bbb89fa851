//! Lengths and moments of spatial tendons (MuJoCo: `mj_tendon`).
//!
//! ```text
//! L = Σ |x' - x| / divisor              over the straight pieces, and arcs on surfaces
//! ∂L̇/∂q̇ = Σ S · (u, x × u)              u: unit of force at each end of a piece, on what the dof moves
//! ```
//!
//! A tendon that is pulled by a unit pulls its bodies with these forces. Where it bends around a shape, the shape has a force
//! at either end of the arc. Moments are then as those of any forces: those that move together cancel.

pub mod armature;
mod flat;
mod inner;
mod outer;
mod wrap;

use super::forces::link_forces;
use super::outputs::sites::{axes, position, reference};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::site::Mount;
use crate::constants::tendons::{Span, SpatialTendon};
use crate::lane::{Cx, Num, Real};
use crate::math::spatial::{ANGULAR, Spatial};
use crate::math::vec3::{Vec3, select};
use crate::step::{BlockOf, ConstantsOf, Stage};
use flat::TINY;
use wrap::bend;

/// Lengths, rates and moments of spatial tendons.
pub struct Tendons;

impl Stage for Tendons {
    const READS: &'static [A] = &[
        A::JointQd,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Motion,
        A::Velocity,
    ];
    const WRITES: &'static [A] = &[A::TenLength, A::TenVelocity, A::TenMoment, A::TenSwing];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.tendons.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for (k, tendon) in m.tendons.iter().enumerate() {
            b.work.ten_length[k] = stretch(cx, &mut b.work, tendon);
            // moments, and L̇ = Σ moment q̇
            let mut velocity = C::F::c(0.0);
            for (place, &dof) in tendon.dofs.iter().enumerate() {
                let moment = moment(&b.work, tendon, place);
                b.work.ten_moment[tendon.first + place] = moment;
                velocity = cx.get(&b.joint_qd[dof]).fma(moment, velocity);
            }
            b.work.ten_velocity[k] = velocity;
            b.work.ten_swing[k] = swing(m, &b.work, tendon);
        }
    }
}

/// L of a tendon, and in `force` those on its bodies of a unit along it.
#[inline(always)]
pub(in crate::step) fn stretch<C: Cx>(
    cx: &mut C,
    w: &mut Workspace<C::F>,
    tendon: &SpatialTendon<<C::F as Num>::Real>,
) -> C::F {
    for &body in &tendon.bodies {
        w.force[body] = Spatial::zero();
    }
    // L = Σ share · length of a piece
    let mut length = C::F::c(0.0);
    for span in &tendon.spans {
        length = measure(cx, w, span).fma(C::F::k(span.share), length);
    }
    length
}

/// ∂L̇/∂q̇ of the dof at a place of a tendon's dofs, by the forces that [`stretch`] left.
#[inline(always)]
pub(in crate::step) fn moment<F: Num>(
    w: &Workspace<F>,
    tendon: &SpatialTendon<F::Real>,
    place: usize,
) -> F {
    // S · Σ force of the bodies that the dof moves
    let mut wrench = Spatial::zero();
    for &body in &tendon.moved[place] {
        wrench = wrench + w.force[body];
    }
    w.motion[tendon.dofs[place]].dot(wrench)
}

/// Adds the forces of a piece, and returns how long it is.
#[inline(always)]
fn measure<C: Cx>(cx: &mut C, w: &mut Workspace<C::F>, span: &Span<<C::F as Num>::Real>) -> C::F {
    let share = C::F::k(span.share);
    let (from, to) = (position(w, &span.from), position(w, &span.to));
    let (straight, length) = line(apart(w, (&span.to, to), (&span.from, from)));
    let Some(around) = &span.wrap else {
        pull(w, &span.from, from, straight * -share);
        pull(w, &span.to, to, straight * share);
        return length;
    };
    // in the frame of the shape
    let (rotation, center) = (axes(w, &around.at), position(w, &around.at));
    let first = rotation.transpose_mul(apart(w, (&span.from, from), (&around.at, center)));
    let last = rotation.transpose_mul(apart(w, (&span.to, to), (&around.at, center)));
    let side = match &around.side {
        Some(side) => {
            let offset = apart(w, (side, position(w, side)), (&around.at, center));
            Some(rotation.transpose_mul(offset))
        }
        None => None,
    };
    let bent = bend(cx, around, [first, last], side);
    // the lines to the surface and from it; where it does not touch, the forces on the shape cancel
    let meets = rotation.mul_add(bent.meets, center);
    let leaves = rotation.mul_add(bent.leaves, center);
    let (first, before) = line(apart(w, (&around.at, meets), (&span.from, from)));
    let (last, after) = line(apart(w, (&span.to, to), (&around.at, leaves)));
    let first = select(bent.touches, first, straight) * share;
    let last = select(bent.touches, last, straight) * share;
    pull(w, &span.from, from, -first);
    pull(w, &around.at, select(bent.touches, meets, center), first);
    pull(w, &around.at, select(bent.touches, leaves, center), -last);
    pull(w, &span.to, to, last);
    C::F::select(bent.touches, before + bent.arc + after, length)
}

/// x - x', where robots apart subtract their reference points on their own: `f32` rounds far positions.
#[inline(always)]
fn apart<F: Num>(
    w: &Workspace<F>,
    (mount, point): (&Mount<F::Real>, Vec3<F>),
    (other, there): (&Mount<F::Real>, Vec3<F>),
) -> Vec3<F> {
    let mut apart = point - there;
    if mount.tree != other.tree {
        apart = apart + (reference(w, mount) - reference(w, other));
    }
    apart
}

/// Direction and length of a line; that of a line without a length is x.
#[inline(always)]
fn line<F: Num>(along: Vec3<F>) -> (Vec3<F>, F) {
    let one = F::c(1.0);
    let length = along.dot(along).sqrt();
    let is_point = length.lt(F::c(TINY));
    // a select: points divide by 1
    let inverse = one.div(F::select(is_point, one, length));
    let zero = F::c(0.0);
    (
        select(is_point, Vec3([one, zero, zero]), along * inverse),
        length,
    )
}

/// Adds a force at a point of a mount, if that moves.
#[inline(always)]
fn pull<F: Num>(w: &mut Workspace<F>, at: &Mount<F::Real>, point: Vec3<F>, force: Vec3<F>) {
    if let Some(body) = at.body {
        link_forces::add(w, body, point, force, Vec3::zero());
    }
}

/// MuJoCo's acceleration of a free body is that of its frame's origin, which differs from that of its centre of mass by
/// ω × (ω × o).
#[inline(always)]
fn swing<F: Num>(m: &Constants<F::Real>, w: &Workspace<F>, tendon: &SpatialTendon<F::Real>) -> F {
    let mut swing = F::c(0.0);
    for &(body, place) in &tendon.free_bodies {
        debug_assert_eq!(tendon.dofs[place], m.bodies[body].dof);
        swing = swing + swing_of(w, tendon, body, place);
    }
    swing
}

/// The same of one free body, whose dofs begin at `place`.
#[inline(always)]
fn swing_of<F: Num>(
    w: &Workspace<F>,
    tendon: &SpatialTendon<F::Real>,
    body: usize,
    place: usize,
) -> F {
    let mut swing = F::c(0.0);
    // the frame's origin is kept relative to the centre of mass
    let omega = w.velocity[body][ANGULAR];
    let acceleration = omega.cross(omega.cross(w.origin[body]));
    for i in 0..3 {
        let moment = w.ten_moment[tendon.first + place + i];
        swing = moment.fma(acceleration[i], swing);
    }
    swing
}
