//! Lengths of actuators whose moments change with the state (MuJoCo: `mj_transmission`).
//!
//! ```text
//! ball    l = gear · θ                                     θ: rotation vector
//! free    l = 0         force = gear, torque = gear        at its frame's origin
//! site    l = 0         force = R gear, torque = R gear    at the site
//! site    l = gear · (R'ᵀ (x - x'), θ)                     to a second site with R', x'; θ from its axes to those of the first
//! tendon  l = gear L                                      of a spatial tendon
//! slider  l = gear (a · d - √((a · d)² + r² - d²))        d: from the slider to the crank, a: the slider's axis, r: the rod
//! ```
//!
//! A moment is ∂l̇/∂q̇ of a dof. As in MuJoCo, dofs that move both sites have none.

use crate::arrays::Workspace;
use crate::constants::Constants;
use crate::constants::actuators::{LengthKind, Sites, SliderCrank, TurningLength};
use crate::lane::{Cx, Num};
use crate::math::quat;
use crate::math::spatial::Spatial;
use crate::math::vec3::Vec3;
use crate::step::constraints::tied_frames::{between, carries, placed};
use crate::step::tree::kinematics::read_quat;
use crate::step::{BlockOf, ConstantsOf};

/// Writes the moments of a length, and returns it.
#[inline(always)]
pub(in crate::step) fn measure<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    length: &TurningLength<<C::F as Num>::Real>,
) -> C::F {
    // gears of translations, then of rotations
    let [x, y, z, u, v, w] = length.gear.map(C::F::k);
    let (along, about) = (Vec3([x, y, z]), Vec3([u, v, w]));
    match &length.kind {
        LengthKind::Ball { coord, in_parent } => {
            let turned = read_quat(cx, &b.joint_q, *coord);
            // into the ball's axes, in which its dofs are
            let gear = match in_parent {
                true => quat::matrix(turned).transpose_mul(along),
                false => along,
            };
            // l = gear · θ, and the moments are the gear itself, as in MuJoCo
            moments(&mut b.work, length)[..3].copy_from_slice(&*gear);
            quat::log(turned).dot(gear)
        }
        LengthKind::Free { body, in_parent } => {
            let work = &mut b.work;
            // R gear, or the gear itself where it is in world axes
            let torque = match in_parent {
                true => about,
                false => work.rotation[*body] * about,
            };
            // at the centre of mass; the frame's origin is kept relative to it
            let torque = work.origin[*body].cross_add(along, torque);
            moments(work, length).copy_from_slice(&Spatial([along, torque]).scalars());
            C::F::c(0.0)
        }
        LengthKind::Site(sites) => of_sites(m, &mut b.work, length, sites, [along, about]),
        LengthKind::Tendon(tendon) => {
            // gear L, and its moments
            let first = m.tendons[*tendon].first;
            for k in 0..length.dofs.len() {
                b.work.actuator_moment[length.first + k] = b.work.ten_moment[first + k] * x;
            }
            b.work.ten_length[*tendon] * x
        }
        LengthKind::SliderCrank(crank) => of_slider(m, &mut b.work, length, crank, x),
    }
}

/// The moments of a length, one for each of its dofs.
#[inline(always)]
pub(in crate::step) fn moments<'a, F: Num>(
    w: &'a mut Workspace<F>,
    length: &TurningLength<F::Real>,
) -> &'a mut [F] {
    let end = length.first + length.dofs.len();
    &mut w.actuator_moment[length.first..end]
}

/// Where the rod cannot reach, the length is a · d.
#[inline(always)]
fn of_slider<F: Num>(
    m: &Constants<F::Real>,
    w: &mut Workspace<F>,
    length: &TurningLength<F::Real>,
    parts: &SliderCrank<F::Real>,
    gear: F,
) -> F {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let slider = placed(w, &parts.slider);
    let crank = placed(w, &parts.crank);
    let axis = slider.rotation[2];
    let apart = (crank.point - slider.point) + (crank.reference - slider.reference);
    // a · d, and the root of what is left of the rod
    let along = apart.dot(axis);
    let rod = F::k(parts.rod);
    let left = along.fma(along, rod * rod) - apart.dot(apart);
    let reaches = zero.lt(left);
    let root = F::select(reaches, left, one).sqrt();
    // ∂l/∂d = a (1 - a·d / root) + d / root, and ∂l/∂a = d (1 - a·d / root)
    let inverse = F::select(reaches, one.div(root), zero);
    let share = along.fnma(inverse, one);
    let push = (axis * share + apart * inverse) * gear;
    let turn = axis.cross(apart * share) * gear;
    for (k, &dof) in length.dofs.iter().enumerate() {
        let Spatial([linear, angular]) = w.motion[dof];
        let mut moment = zero;
        if carries(m, parts.crank.body, dof) {
            moment = angular.cross_add(crank.point, linear).dot(push);
        }
        if carries(m, parts.slider.body, dof) {
            let carried = angular.cross_add(slider.point, linear).dot(push);
            moment = moment - carried + angular.dot(turn);
        }
        w.actuator_moment[length.first + k] = moment;
    }
    gear * (along - F::select(reaches, root, zero))
}

#[inline(always)]
fn of_sites<F: Num>(
    m: &Constants<F::Real>,
    w: &mut Workspace<F>,
    length: &TurningLength<F::Real>,
    sites: &Sites<F::Real>,
    [along, about]: [Vec3<F>; 2],
) -> F {
    // R gear is the force and the torque of a unit, R that of the second site if there is one
    let site = placed(w, &sites.site);
    let reference = sites.reference.as_ref().map(|mount| placed(w, mount));
    let axes = &reference.as_ref().unwrap_or(&site).rotation;
    let push = Spatial([axes * along, axes * about]);
    // moment of a dof: force · ẋ + torque · ω of the site, less those of the reference
    for (k, &dof) in length.dofs.iter().enumerate() {
        let Spatial([linear, angular]) = w.motion[dof];
        let mut moment = F::c(0.0);
        // the velocity of each that the dof carries
        let carried = [
            (Some(&sites.site), Some(&site), 1.0),
            (sites.reference.as_ref(), reference.as_ref(), -1.0),
        ];
        for (mount, placed, sign) in carried {
            let (Some(mount), Some(placed)) = (mount, placed) else {
                continue;
            };
            if carries(m, mount.body, dof) {
                // v + ω × p at the site, per unit of q̇
                let velocity = Spatial([angular.cross_add(placed.point, linear), angular]);
                moment = F::c(sign).fma(velocity.dot(push), moment);
            }
        }
        w.actuator_moment[length.first + k] = moment;
    }
    // without a second site there is nothing to measure
    let Some(reference) = reference else {
        return F::c(0.0);
    };
    // R'ᵀ (x - x'): reference points of trees are subtracted on their own, since f32 rounds far positions
    let apart = (site.point - reference.point) + (site.reference - reference.reference);
    let apart = reference.rotation.transpose_mul(apart);
    // θ, from the axes of the second site to those of the first
    let turned = quat::log(between(&site.rotation, &reference.rotation));
    apart.dot(along) + turned.dot(about)
}
