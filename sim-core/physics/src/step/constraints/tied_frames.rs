//! Frames that are tied together: where they are to each other, the Jacobian of that, and J̇ q̇.
//!
//! ```text
//! r = x₁ - x₂                   J q̇ = ẋ₁ - ẋ₂                 J̇ q̇ = ẍ₁ - ẍ₂ at q̈ = 0
//! r = s v, (v, w) = q₂⁻¹ q₁     J q̇ = ½ s (w a + a × v)       a = R₂ᵀ (ω₁ - ω₂)
//!                               J̇ q̇ = ½ s (w ȧ + ȧ × v - ½ |a|² v)    ȧ = R₂ᵀ (α₁ - α₂ - ω₂ × (ω₁ - ω₂))
//! ```
//!
//! A row's reference acceleration is that of r̈ = J q̈ + J̇ q̇ (MuJoCo 3.17).

use super::ties::Measured;
use crate::arrays::Workspace;
use crate::constants::site::Mount;
use crate::constants::ties::{Frames, Tie};
use crate::constants::{Constants, Motion};
use crate::lane::{Cx, Num};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::outputs::sites;
use crate::step::tree::inverse_dynamics::point_acceleration;
use crate::step::{BlockOf, ConstantsOf};

/// Where a frame is, and how it is turned.
pub(in crate::step) struct Placed<F> {
    /// From the reference point of its tree [m].
    pub point: Vec3<F>,
    /// In the world [m].
    pub reference: Vec3<F>,
    /// By columns [–].
    pub rotation: Mat3<F>,
}

#[inline(always)]
pub(in crate::step) fn placed<F: Num>(w: &Workspace<F>, mount: &Mount<F::Real>) -> Placed<F> {
    let local = Mat3::constant(mount.rotation);
    Placed {
        point: sites::position(w, mount),
        reference: sites::reference(w, mount),
        // R(body) R(mount)
        rotation: match mount.body {
            Some(body) => {
                let carrier = &w.rotation[body];
                Mat3([carrier * local[0], carrier * local[1], carrier * local[2]])
            }
            None => local,
        },
    }
}

#[inline(always)]
pub(in crate::step) fn of_frames<C: Cx>(
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    tie: &Tie<<C::F as Num>::Real>,
    frames: &Frames<<C::F as Num>::Real>,
) -> Measured<C::F> {
    let mounts = [&frames.first, &frames.second];
    // r = x₁ - x₂, reference points on their own: in `f32` far positions are rounded
    let first = placed(&b.work, mounts[0]);
    let second = placed(&b.work, mounts[1]);
    let apart = (first.point - second.point) + (first.reference - second.reference);
    let mut measured = Measured::at(&apart.0);
    // J̇ q̇ = ẍ₁ - ẍ₂ at q̈ = 0
    let one = moving(m, &b.work, mounts[0], &first);
    let other = moving(m, &b.work, mounts[1], &second);
    measured.swing[..3].copy_from_slice(&*(one.acceleration[LINEAR] - other.acceleration[LINEAR]));
    // r = s v with (v, w) = q₂⁻¹ q₁, and its J̇ q̇. The Jacobian needs ½ s
    let turned = frames.torque_scale.map(|scale| {
        let quat = between(&first.rotation, &second.rotation);
        let Measured { position, swing } = &mut measured;
        let scale = C::F::k(scale);
        let turning = turning(&second.rotation, &one, &other, quat);
        for i in 0..3 {
            position[3 + i] = quat[i] * scale;
            swing[3 + i] = turning[i] * scale;
        }
        (scale * C::F::c(0.5), quat)
    });
    let w = &mut b.work;
    // J: the first frame's velocity less the second's, of those that the dof carries
    for (column, &dof) in tie.dofs.iter().enumerate() {
        let Spatial([linear, angular]) = w.motion[dof];
        let moves = |mount: &Mount<<C::F as Num>::Real>| carries(m, mount.body, dof);
        let mut axis = Vec3::zero();
        for (mount, point, sign) in [
            (mounts[0], first.point, 1.0),
            (mounts[1], second.point, -1.0),
        ] {
            if !moves(mount) {
                continue;
            }
            let sign = C::F::c(sign);
            // ẋ = v + ω × x of the frame's origin, per unit of q̇
            let moved = angular.cross_add(point, linear);
            for i in 0..3 {
                let place = tie.jacobian(i).start + column;
                w.row_jacobian[place] = moved[i].fma(sign, w.row_jacobian[place]);
            }
            axis = angular.scale_add(sign, axis);
        }
        // ½ s (w a + a × v) with a = R₂ᵀ (ω₁ - ω₂)
        if let Some((scale, [x, y, z, real])) = turned {
            let axis = second.rotation.transpose_mul(axis);
            let rate = axis.cross_add(Vec3([x, y, z]), axis * real) * scale;
            for i in 0..3 {
                w.row_jacobian[tie.jacobian(3 + i).start + column] = rate[i];
            }
        }
    }
    measured
}

/// How a frame moves at zero joint acceleration.
struct Moving<F> {
    omega: Vec3<F>,
    /// Of its origin, and angular.
    acceleration: Spatial<F>,
}

#[inline(always)]
fn moving<F: Num>(
    m: &Constants<F::Real>,
    w: &Workspace<F>,
    mount: &Mount<F::Real>,
    placed: &Placed<F>,
) -> Moving<F> {
    // a frame of the world rests
    let Some(body) = mount.body else {
        return Moving {
            omega: Vec3::zero(),
            acceleration: Spatial::zero(),
        };
    };
    let (omega, acceleration) = (w.velocity[body][ANGULAR], w.rest_acceleration[body]);
    // from the body's own point, see `kinematics`
    let arm = match m.bodies[body].motion {
        Motion::Free => placed.point,
        _ => placed.point - w.origin[body],
    };
    // a + α × r + ω × (ω × r)
    let linear = point_acceleration(acceleration, omega, arm);
    Moving {
        omega,
        acceleration: Spatial([linear, acceleration[ANGULAR]]),
    }
}

/// J̇ q̇ of a rotation, without its scale.
#[inline(always)]
fn turning<F: Num>(axes: &Mat3<F>, one: &Moving<F>, other: &Moving<F>, quat: [F; 4]) -> Vec3<F> {
    let [x, y, z, real] = quat;
    let half = F::c(0.5);
    // ω₁ - ω₂, and R₂ ȧ = α₁ - α₂ - ω₂ × (ω₁ - ω₂)
    let spin = one.omega - other.omega;
    let swung = (one.acceleration[ANGULAR] - other.acceleration[ANGULAR]) - other.omega.cross(spin);
    // ½ (w ȧ + ȧ × v - ½ |a|² v)
    let rate = axes.transpose_mul(swung);
    let twice = rate.cross_add(Vec3([x, y, z]), rate * real);
    Vec3([x, y, z]).scale_add(-(spin.dot(spin) * half), twice) * half
}

/// Torque on the first of two frames from the forces of their rows of rotation, Jᵀ f: R₂ ½ s (w f + v × f).
#[inline(always)]
pub(in crate::step) fn torque<F: Num>(
    w: &Workspace<F>,
    frames: &Frames<F::Real>,
    scale: F::Real,
    force: Vec3<F>,
) -> Vec3<F> {
    // q₂⁻¹ q₁ = (v, w), as in `of_frames`
    let first = sites::axes(w, &frames.first);
    let second = sites::axes(w, &frames.second);
    let [x, y, z, real] = between(&first, &second);
    // w f + v × f in the axes of the second frame, then R₂ ½ s
    let local_torque = Vec3([x, y, z]).cross_add(force, force * real);
    second.mul_add(local_torque * (F::k(scale) * F::c(0.5)), Vec3::zero())
}

/// Does a dof move a body?
pub(in crate::step) fn carries<R>(m: &Constants<R>, body: Option<usize>, dof: usize) -> bool {
    // a dof moves what its body carries: from the body towards the root
    let mut next = body;
    while let Some(body) = next {
        if m.bodies[body].dofs().contains(&dof) {
            return true;
        }
        next = m.bodies[body].parent;
    }
    false
}

/// The rotation from `b` to `a` in the axes of `b`, as a quaternion (x, y, z, w).
///
/// Of the four ways to divide by one of its entries, the one with the largest is taken (Shepperd 1978).
#[inline(always)]
pub(in crate::step) fn between<F: Num>(a: &Mat3<F>, b: &Mat3<F>) -> [F; 4] {
    // entries of R = R(b)ᵀ R(a), their symmetric and their antisymmetric parts
    let r = |i: usize, j: usize| b[i].dot(a[j]);
    let (one, two) = (F::c(1.0), F::c(2.0));
    let [xx, yy, zz] = [r(0, 0), r(1, 1), r(2, 2)];
    let sums = [r(2, 1) + r(1, 2), r(0, 2) + r(2, 0), r(1, 0) + r(0, 1)];
    let turns = [r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1)];
    // four times the square of each entry, and the products of one with the others
    let ways = [
        (
            (xx - yy) - zz,
            [None, Some(sums[2]), Some(sums[1]), Some(turns[0])],
        ),
        (
            (yy - zz) - xx,
            [Some(sums[2]), None, Some(sums[0]), Some(turns[1])],
        ),
        (
            (zz - xx) - yy,
            [Some(sums[1]), Some(sums[0]), None, Some(turns[2])],
        ),
        (
            (xx + yy) + zz,
            [Some(turns[0]), Some(turns[1]), Some(turns[2]), None],
        ),
    ];
    // w first, then z, y, x where their square is larger
    let mut best = ways[3].0;
    let mut quat = [F::c(0.0); 4];
    for (k, (square, products)) in ways.into_iter().rev().enumerate() {
        // twice the entry. The largest is at least 1, so `safe` bounds only ways that are not taken
        let largest = (square + one).max(F::c(0.0)).sqrt();
        let safe = largest.max(F::c(1e-6));
        let scale = one.div(two * safe);
        let better = best.lt(square);
        // the entry itself, and the others from their products with it
        for i in 0..4 {
            let entry = match products[i] {
                None => largest * F::c(0.5),
                Some(product) => product * scale,
            };
            quat[i] = match k {
                0 => entry,
                _ => F::select(better, entry, quat[i]),
            };
        }
        best = best.max(square);
    }
    quat
}
