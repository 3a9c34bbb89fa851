//! Armature of tendons: inertia along their lengths (MuJoCo: `mj_tendonArmature`, `mj_tendonBias`).
//!
//! ```text
//! M += Jᵀ a J           bias += Jᵀ a J̇ q̇
//! J̇ q̇ = Σ S ((v² - (u · v)²)/l + u · w)       of the straight pieces of a spatial tendon, with direction u and length l
//! ```
//!
//! v and w are velocity and acceleration of one end relative to the other at zero joint acceleration. As in MuJoCo, M has
//! products of dofs on one path to the root alone, and tendons that bend around shapes have no armature.

use super::{apart, line, swing_of};
use crate::arrays::{Array as A, Workspace};
use crate::constants::site::Mount;
use crate::constants::springs::Tendon;
use crate::constants::tendons::SpatialTendon;
use crate::constants::{Constants, Motion};
use crate::lane::{Cx, Num, Real};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial};
use crate::math::vec3::Vec3;
use crate::step::forces::damping::shared;
use crate::step::outputs::sites::{position, velocity};
use crate::step::tree::bias::accelerations_at_rest;
use crate::step::tree::inverse_dynamics::point_acceleration;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Armature of tendons.
pub struct Armature;

impl Stage for Armature {
    const READS: &'static [A] = &[
        A::JointQd,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Arm,
        A::Motion,
        A::TenMoment,
        A::BiasForce,
        A::MassMatrix,
    ];
    const WRITES: &'static [A] = &[A::BiasForce, A::MassMatrix, A::Velocity, A::TenBias];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        with_armature(m).next().is_some()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // those of points that stand still are 0
        accelerations_at_rest(cx, m, b, Vec3::zero());
        for tendon in with_armature(m) {
            let w = &mut b.work;
            if let Some(k) = tendon.length.tendon {
                add_bias(m, w, &m.tendons[k], C::F::k(tendon.armature));
            }
            // the matrix keeps its lower triangle: each pair of dofs once
            for i in 0..dofs(m, tendon) {
                // a J of the pair's first dof
                let scaled = C::F::k(tendon.armature) * moment(m, &w.ten_moment, tendon, i);
                for k in 0..i + 1 {
                    if let Some(place) = shared(m, dof(m, tendon, i), dof(m, tendon, k)) {
                        let other = moment(m, &w.ten_moment, tendon, k);
                        w.mass_matrix[place] = scaled.fma(other, w.mass_matrix[place]);
                    }
                }
            }
        }
    }
}

/// Number of dofs that change the length of a tendon.
#[inline(always)]
fn dofs<R>(m: &Constants<R>, tendon: &Tendon<R>) -> usize {
    match tendon.length.tendon {
        Some(k) => m.tendons[k].dofs.len(),
        None => tendon.length.terms.len(),
    }
}

/// One of these dofs, by its place among them.
#[inline(always)]
fn dof<R>(m: &Constants<R>, tendon: &Tendon<R>, place: usize) -> usize {
    match tendon.length.tendon {
        Some(k) => m.tendons[k].dofs[place],
        None => tendon.length.terms[place].dof,
    }
}

/// Its moment.
#[inline(always)]
fn moment<F: Num>(
    m: &Constants<F::Real>,
    ten_moment: &[F],
    tendon: &Tendon<F::Real>,
    place: usize,
) -> F {
    match tendon.length.tendon {
        Some(k) => ten_moment[m.tendons[k].first + place],
        None => F::k(tendon.length.terms[place].coefficient),
    }
}

/// Tendons that have armature.
#[inline(always)]
fn with_armature<R: Real>(m: &Constants<R>) -> impl Iterator<Item = &Tendon<R>> {
    let tendons = m.springs.tendons.iter();
    tendons.filter(|tendon| tendon.armature.to_f64() != 0.0)
}

/// Adds what armature needs for accelerations to the forces of inverse dynamics, `missing`.
#[inline(always)]
pub(in crate::step) fn add_armature_forces<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
) {
    for tendon in with_armature(m) {
        let w = &mut b.work;
        // a J J̇ q̇ is in the bias, too
        if let Some(spatial) = tendon.length.tendon.map(|k| &m.tendons[k]) {
            for (place, &dof) in spatial.dofs.iter().enumerate() {
                w.missing[dof] = w.missing[dof] + w.ten_bias[spatial.first + place];
            }
        }
        // M's part of each pair of dofs, on either of them
        for i in 0..dofs(m, tendon) {
            // rows and columns of the same triangle
            let first = dof(m, tendon, i);
            let scaled = C::F::k(tendon.armature) * moment(m, &w.ten_moment, tendon, i);
            for k in 0..i + 1 {
                let second = dof(m, tendon, k);
                if shared(m, first, second).is_none() {
                    continue;
                }
                // a J J q̈: the pair counts twice, but a dof with itself once
                let product = scaled * moment(m, &w.ten_moment, tendon, k);
                let (qdd, other) = (cx.get(&b.joint_qdd[first]), cx.get(&b.joint_qdd[second]));
                w.missing[first] = product.fma(other, w.missing[first]);
                if first != second {
                    w.missing[second] = product.fma(qdd, w.missing[second]);
                }
            }
        }
    }
}

/// Writes a J J̇ q̇ to `ten_bias`, and adds it to the bias force.
///
/// The products that M leaves out have MuJoCo's acceleration of a free body, which is that of its frame's origin. So J̇ q̇ is
/// without the swing of free bodies that are on another path.
#[inline(always)]
fn add_bias<F: Num>(
    m: &Constants<F::Real>,
    w: &mut Workspace<F>,
    tendon: &SpatialTendon<F::Real>,
    armature: F,
) {
    let turning = turning(m, w, tendon);
    for (place, &dof) in tendon.dofs.iter().enumerate() {
        // of this dof: without the swing of bodies that its path does not have
        let mut rate = turning;
        for &(body, first) in &tendon.free_bodies {
            if shared(m, dof, m.bodies[body].dof).is_none() {
                rate = rate - swing_of(w, tendon, body, first);
            }
        }
        // a force on this dof: its moment times a J̇ q̇
        let at = tendon.first + place;
        w.ten_bias[at] = armature * rate * w.ten_moment[at];
        w.bias_force[dof] = w.bias_force[dof] + w.ten_bias[at];
    }
}

/// J̇ q̇ of a spatial tendon without shapes.
#[inline(always)]
fn turning<F: Num>(m: &Constants<F::Real>, w: &Workspace<F>, tendon: &SpatialTendon<F::Real>) -> F {
    let mut sum = F::c(0.0);
    // d/dt of u · v, with du/dt = (v - u (u · v))/l
    for span in &tendon.spans {
        let (from, to) = (position(w, &span.from), position(w, &span.to));
        let (along, length) = line(apart(w, (&span.to, to), (&span.from, from)));
        let [v, w] = relative(m, w, (&span.from, from), (&span.to, to));
        // how fast it gets longer
        let approach = along.dot(v);
        // a piece without length turns at no rate that counts
        let across = approach.fnma(approach, v.dot(v));
        let has_length = F::c(super::TINY).lt(length);
        let turn = F::select(
            has_length,
            across.div(length.max(F::c(super::TINY))),
            F::c(0.0),
        );
        sum = F::k(span.share).fma(turn + along.dot(w), sum);
    }
    sum
}

/// Velocity and acceleration of the end of a piece relative to its start, at zero joint acceleration.
#[inline(always)]
fn relative<F: Num>(
    m: &Constants<F::Real>,
    w: &Workspace<F>,
    (from, start): (&Mount<F::Real>, Vec3<F>),
    (to, end): (&Mount<F::Real>, Vec3<F>),
) -> [Vec3<F>; 2] {
    // both in the world's axes
    let speed = velocity(w, to, end)[LINEAR] - velocity(w, from, start)[LINEAR];
    let acceleration = acceleration(m, w, to, end) - acceleration(m, w, from, start);
    [speed, acceleration]
}

/// Acceleration of a mount at its position, at zero joint acceleration.
#[inline(always)]
fn acceleration<F: Num>(
    m: &Constants<F::Real>,
    w: &Workspace<F>,
    mount: &Mount<F::Real>,
    position: Vec3<F>,
) -> Vec3<F> {
    let Some(body) = mount.body else {
        return Vec3::zero();
    };
    // from the body's own point: the reference point of a free body, else the origin of its frame
    let arm = match m.bodies[body].motion {
        Motion::Free => position,
        _ => position - w.origin[body],
    };
    // a + α × r + ω × (ω × r)
    let at_rest: Spatial<F> = w.rest_acceleration[body];
    point_acceleration(at_rest, w.velocity[body][ANGULAR], arm)
}
