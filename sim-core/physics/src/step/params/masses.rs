//! Masses and inertias of links, where they vary from world to world.

use super::param;
use crate::arrays::{Block, Workspace};
use crate::constants::outputs::OutputBody;
use crate::constants::params::Param;
use crate::constants::{Body, Constants, Part};
use crate::lane::Num;
use crate::math::quat;
use crate::math::vec3::{Mat3, Vec3};
use crate::step::outputs::sites::{self, axes};

/// Least mass of a body that is divided by (MuJoCo: `mjMINVAL`) [kg].
const MASS_MIN: f64 = 1e-15;

/// Do masses or inertias of links vary?
#[inline(always)]
pub(in crate::step) fn vary<R>(m: &Constants<R>) -> bool {
    let params = [
        Param::BodyMassScale,
        Param::BodyMass,
        Param::BodyInertia,
        Param::BodyCom,
    ];
    params.iter().any(|&param| m.varying.first(param).is_some())
}

/// Mass of a link [kg], and its inertia about its centre of mass in the body's axes [kg·m²], both before their scale.
#[inline(always)]
pub(in crate::step) fn of_part<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    part: &Part<F::Real>,
) -> (F, [F; 6]) {
    let mass = param(m, params, Param::BodyMass, part.link, part.mass);
    let inertia = match (m.varying.first(Param::BodyInertia), part.link_axes) {
        // a client gives it in the link's axes: R I Rᵀ is the same in the body's
        (Some(first), Some(axes)) => {
            let link_inertia = std::array::from_fn(|i| params[first + 6 * part.link + i]);
            turned(&Mat3::constant(axes), link_inertia)
        }
        _ => part.inertia.map(F::k),
    };
    (mass, inertia)
}

/// Centre of mass of a link in the body's frame [m].
#[inline(always)]
pub(in crate::step) fn center<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    part: &Part<F::Real>,
) -> Vec3<F> {
    match (
        m.varying.first(Param::BodyCom),
        part.link_axes,
        part.link_origin,
    ) {
        // a client gives it in the link's axes: R c + o
        (Some(first), Some(axes), Some(origin)) => {
            let given = std::array::from_fn(|i| params[first + 3 * part.link + i]);
            Mat3::constant(axes).mul_add(Vec3(given), Vec3::constant(origin))
        }
        _ => Vec3::constant(part.center),
    }
}

/// Centre of mass of a body in its own frame, where those of links vary; elsewhere it counts as the one that the scene has [m].
#[inline(always)]
pub(in crate::step) fn moved_center<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    body: &Body<F::Real>,
) -> Option<Vec3<F>> {
    m.varying.first(Param::BodyCom)?;
    // Σ s m c / Σ s m over the links, with each link's scale s
    let (mut moment, mut whole) = (Vec3::zero(), F::c(0.0));
    for part in &body.parts {
        let mass = mass(m, params, part.link, part.mass);
        moment = center(m, params, part).scale_add(mass, moment);
        whole = whole + mass;
    }
    Some(moment * F::c(1.0).div(whole.max(F::c(MASS_MIN))))
}

/// As [`center`], of a link by its frame; `fixed` where it does not vary.
#[inline(always)]
pub(in crate::step) fn center_of_frame<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    link: usize,
    fixed: [F::Real; 3],
) -> Vec3<F> {
    let frame = &m.frames[link];
    match m.varying.first(Param::BodyCom) {
        Some(first) => {
            let given = std::array::from_fn(|i| params[first + 3 * link + i]);
            let axes: Mat3<F> = quat::matrix(quat::constant(frame.quat));
            axes.mul_add(Vec3(given), Vec3::constant(frame.position))
        }
        None => Vec3::constant(fixed),
    }
}

/// Centre of mass of a link of a MuJoCo model, from the reference point of its robot [m].
#[inline(always)]
pub(in crate::step) fn position<F: Num, V>(
    m: &Constants<F::Real>,
    b: &Block<F, V>,
    body: &OutputBody<F::Real>,
) -> Vec3<F> {
    let w: &Workspace<F> = &b.work;
    match m.varying.first(Param::BodyCom) {
        Some(first) => {
            let given = std::array::from_fn(|i| b.params[first + 3 * body.link + i]);
            let turn: Mat3<F> = axes(w, &body.frame);
            turn.mul_add(Vec3(given), sites::position(w, &body.frame))
        }
        None => sites::position(w, &body.inertial),
    }
}

/// What mass and inertia of a link are multiplied with; none where that does not vary.
#[inline(always)]
pub(in crate::step) fn scale<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    link: usize,
) -> Option<F> {
    let first = m.varying.first(Param::BodyMassScale)?;
    Some(params[first + link])
}

/// Mass of a link with its scale, `fixed` where it does not vary [kg].
#[inline(always)]
pub(in crate::step) fn mass<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    link: usize,
    fixed: F::Real,
) -> F {
    let unscaled = param(m, params, Param::BodyMass, link, fixed);
    match scale(m, params, link) {
        Some(scale) => unscaled * scale,
        None => unscaled,
    }
}

/// I v in world axes, of a link of a MuJoCo model about its centre of mass.
#[inline(always)]
pub(in crate::step) fn inertia_times<F: Num, V>(
    m: &Constants<F::Real>,
    b: &Block<F, V>,
    body: &OutputBody<F::Real>,
    v: Vec3<F>,
) -> Vec3<F> {
    let w: &Workspace<F> = &b.work;
    let product = match m.varying.first(Param::BodyInertia) {
        // given in the link's axes: R I Rᵀ v
        Some(first) => {
            let turn: Mat3<F> = axes(w, &body.frame);
            let inertia = matrix(std::array::from_fn(|i| b.params[first + 6 * body.link + i]));
            turn.mul_add(inertia * turn.transpose_mul(v), Vec3::zero())
        }
        // along the principal axes, where I is diagonal
        None => {
            let turn: Mat3<F> = axes(w, &body.inertial);
            let Vec3(along) = turn.transpose_mul(v);
            let moment = Vec3([
                along[0] * F::k(body.moments[0]),
                along[1] * F::k(body.moments[1]),
                along[2] * F::k(body.moments[2]),
            ]);
            turn.mul_add(moment, Vec3::zero())
        }
    };
    // the scale of a mass multiplies its inertia, too
    match scale(m, &b.params, body.link) {
        Some(scale) => product * scale,
        None => product,
    }
}

/// A symmetric tensor, xx yy zz xy xz yz, as a matrix.
#[inline(always)]
fn matrix<F: Num>([xx, yy, zz, xy, xz, yz]: [F; 6]) -> Mat3<F> {
    Mat3([Vec3([xx, xy, xz]), Vec3([xy, yy, yz]), Vec3([xz, yz, zz])])
}

/// R I Rᵀ
#[inline(always)]
fn turned<F: Num>(rotation: &Mat3<F>, inertia: [F; 6]) -> [F; 6] {
    let inertia = matrix(inertia);
    // columns of I Rᵀ are I times the rows of R
    let row = |i: usize| Vec3([rotation[0][i], rotation[1][i], rotation[2][i]]);
    let x = rotation * (inertia * row(0));
    let y = rotation * (inertia * row(1));
    let z = rotation * (inertia * row(2));
    // the columns' entries xx yy zz xy xz yz
    [x[0], y[1], z[2], x[1], x[2], y[2]]
}
