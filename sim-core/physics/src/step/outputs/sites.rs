//! Sites for output: frames, velocities, and the readings of an inertial measurement unit (gyro and accelerometer) in each.
//!
//! ```text
//! q = p + r             v = v(b) + ω × p                                   in the world
//! q = Rᵀ (p - p')       v = Rᵀ (v - v' - ω' × (p - p'))      ω = Rᵀ (ω - ω')      from a frame R, p', v', ω'
//! gyro = Rᵀ ω           accelerometer = Rᵀ (a(b) + α × s + ω × (ω × s))    a less gravity, s from the body's origin
//! ```
//!
//! p is relative to the reference point r of the robot: a site relative to another of the same robot keeps its digits far from
//! the origin.

use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::site::Mount;
use crate::lane::{Cx, Num, Real};
use crate::math::quat::{self, Quat, conjugate, mul};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::tree::inverse_dynamics::{point_acceleration, proper_accelerations};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Frames and velocities of sites, for output.
pub struct Sites;

impl Stage for Sites {
    const READS: &'static [A] = &[
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Velocity,
        A::Orientation,
    ];
    const WRITES: &'static [A] = &[A::SiteQ, A::SiteQd];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.sites.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        site_q(m, &mut b.work);
    }
}

/// Readings of inertial measurement units in the sites, for output.
pub struct Imu;

impl Stage for Imu {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::JointQdd,
        A::Params,
        A::Rotation,
        A::Velocity,
    ];
    const WRITES: &'static [A] = &[A::Gyro, A::Accelerometer];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.sites.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        imu(cx, m, b);
    }
}

/// Writes frames and velocities of the sites.
#[inline(always)]
fn site_q<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>) {
    for (k, site) in m.sites.iter().enumerate() {
        let mount = &site.mount;
        // position p, orientation and velocity of the site in world axes, p from the reference point of its robot
        let (mut position, mut orientation) = (position(w, mount), orientation(w, mount));
        let mut velocity = velocity(w, mount, position);
        match &site.relative_to {
            // only a position in the world contains the reference point, which may be large
            None => position = position + reference(w, mount),
            Some(other) => {
                // p', orientation, v' and ω' of the frame that the site is relative to
                let (there, from) = (self::position(w, other), self::orientation(w, other));
                let Spatial([linear, angular]) = self::velocity(w, other, there);
                // p - p': on one robot the reference points cancel, so only robots apart subtract them
                position = position - there;
                if mount.tree != other.tree {
                    let apart = reference(w, mount) - reference(w, other);
                    position = position + apart;
                }
                // Rᵀ (v - v' - ω' × (p - p')) and Rᵀ (ω - ω')
                let carried = angular.cross_add(position, linear);
                velocity = Spatial([
                    to_local(w, other, velocity[LINEAR] - carried),
                    to_local(w, other, velocity[ANGULAR] - angular),
                ]);
                // Rᵀ (p - p') last, because the velocity needs p - p' in world axes
                position = to_local(w, other, position);
                orientation = mul(conjugate(from), orientation);
            }
        }
        let (Vec3([px, py, pz]), [qx, qy, qz, qw]) = (position, orientation);
        w.site_q[k] = [px, py, pz, qx, qy, qz, qw];
        w.site_qd[k] = velocity;
    }
}

/// Writes angular velocity and proper acceleration of each site, in its own axes.
#[inline(always)]
fn imu<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    // accelerations less gravity: those of bodies go to `force`, that of a static frame is returned
    let base = proper_accelerations(cx, m, b);
    let w = &mut b.work;
    for (k, site) in m.sites.iter().enumerate() {
        let mount = &site.mount;
        // a(b) + α × s + ω × (ω × s), with s the mount's position from the origin of the body, in world axes
        let (acceleration, omega) = match mount.body {
            Some(body) => {
                let arm = w.rotation[body] * Vec3::constant(mount.position);
                let omega = w.velocity[body][ANGULAR];
                (point_acceleration(w.force[body], omega, arm), omega)
            }
            None => (base, Vec3::zero()),
        };
        // both readings in the axes of the site
        w.gyro[k] = to_local(w, mount, omega);
        w.accelerometer[k] = to_local(w, mount, acceleration);
    }
}

/// Position of a mount, from the reference point of its robot.
#[inline(always)]
pub fn position<F: Num>(w: &Workspace<F>, mount: &Mount<F::Real>) -> Vec3<F> {
    let local = Vec3::constant(mount.position);
    match mount.body {
        Some(body) => w.rotation[body].mul_add(local, w.origin[body]),
        None => local,
    }
}

/// The reference point of a mount's robot.
#[inline(always)]
pub fn reference<F: Num>(w: &Workspace<F>, mount: &Mount<F::Real>) -> Vec3<F> {
    match mount.tree {
        Some(tree) => w.reference[tree],
        None => Vec3::zero(),
    }
}

/// Orientation of a mount in the world.
#[inline(always)]
pub(in crate::step) fn orientation<F: Num>(w: &Workspace<F>, mount: &Mount<F::Real>) -> Quat<F> {
    let local = quat::constant(mount.quat);
    match mount.body {
        Some(body) => mul(w.orientation[body], local),
        None => local,
    }
}

/// Velocity of a mount in world axes, at its own position.
#[inline(always)]
pub(in crate::step) fn velocity<F: Num>(
    w: &Workspace<F>,
    mount: &Mount<F::Real>,
    position: Vec3<F>,
) -> Spatial<F> {
    match mount.body {
        Some(body) => {
            // v + ω × p, with v at the reference point of the robot
            let Spatial([linear, angular]) = w.velocity[body];
            Spatial([linear + angular.cross(position), angular])
        }
        None => Spatial::zero(),
    }
}

/// Axes of a mount in the world, by columns.
#[inline(always)]
pub fn axes<F: Num>(w: &Workspace<F>, mount: &Mount<F::Real>) -> Mat3<F> {
    let local = Mat3::constant(mount.rotation);
    match mount.body {
        Some(body) => {
            let carrier = &w.rotation[body];
            // R A, column by column
            Mat3([carrier * local[0], carrier * local[1], carrier * local[2]])
        }
        None => local,
    }
}

/// A vector of the world in the axes of a mount.
#[inline(always)]
pub(in crate::step) fn to_local<F: Num>(
    w: &Workspace<F>,
    mount: &Mount<F::Real>,
    vector: Vec3<F>,
) -> Vec3<F> {
    let local = Mat3::constant(mount.rotation);
    match mount.body {
        // Aᵀ Rᵀ v: from the world to the body, then to the mount
        Some(body) => local.transpose_mul(w.rotation[body].transpose_mul(vector)),
        None => local.transpose_mul(vector),
    }
}
