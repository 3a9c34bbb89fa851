//! Sensors of positions and velocities.
//!
//! ```text
//! x = p + r            v = v(b) + ω × p                                  in the world
//! x = Rᵀ (p - p')      v = Rᵀ (v - v' - ω' × (p - p'))     ω = Rᵀ (ω - ω')     from a frame R, p', v', ω'
//! ```

use super::{has, put};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::sensors::{FramePart, FrameSensor, SensorKind, SubtreePart};
use crate::constants::site::Mount;
use crate::lane::{Cx, Num, Real};
use crate::math::quat::{conjugate, mul};
use crate::math::spatial::{ANGULAR, LINEAR};
use crate::math::vec3::Vec3;
use crate::step::lengths::{length, rate};
use crate::step::outputs::sites::{axes, orientation, position, reference, to_local, velocity};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Sensors of coordinates, frames, tendons and actuators.
pub struct States;

impl Stage for States {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Velocity,
        A::Orientation,
        A::TenLength,
        A::TenVelocity,
        A::ActuatorLength,
        A::ActuatorVelocity,
        A::Sensordata,
    ];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        use SensorKind::*;
        has(m, |kind| {
            matches!(
                kind,
                Vector(..)
                    | Length(_)
                    | Rate(_)
                    | ActuatorLength(_)
                    | ActuatorRate(_)
                    | BallQuat(_)
                    | BallRate(_)
                    | Frame(_)
            )
        })
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for sensor in &m.sensors.all {
            let scalars: &[C::F] = match &sensor.kind {
                SensorKind::Vector(mount, vector) => {
                    &to_local(&b.work, mount, Vec3::constant(*vector)).0
                }
                SensorKind::Length(of) => &[length(cx, m, b, of)],
                SensorKind::Rate(of) => &[rate(cx, b, of)],
                SensorKind::ActuatorLength(k) => &[b.work.actuator_length[*k]],
                SensorKind::ActuatorRate(k) => &[b.work.actuator_velocity[*k]],
                SensorKind::BallQuat(coord) => {
                    // (w, x, y, z) as in MuJoCo
                    let q = |k: usize| cx.get(&b.joint_q[coord + k]);
                    &[q(3), q(0), q(1), q(2)]
                }
                SensorKind::BallRate(dof) => {
                    &std::array::from_fn::<_, 3, _>(|k| cx.get(&b.joint_qd[dof + k]))
                }
                SensorKind::Frame(frame) => match frame.part {
                    FramePart::Quat => &quat(&b.work, frame),
                    _ => &property(&b.work, frame).0,
                },
                _ => continue,
            };
            put(&mut b.work.sensordata, sensor, scalars);
        }
    }
}

/// Orientation of a frame, (w, x, y, z).
#[inline(always)]
fn quat<F: Num>(w: &Workspace<F>, frame: &FrameSensor<F::Real>) -> [F; 4] {
    // q, or q'⁻¹ q as seen from another frame
    let world_quat = orientation(w, &frame.of);
    let [x, y, z, real] = match &frame.from {
        Some(from) => mul(conjugate(orientation(w, from)), world_quat),
        None => world_quat,
    };
    [real, x, y, z]
}

/// A property of a frame that is a vector.
#[inline(always)]
fn property<F: Num>(w: &Workspace<F>, frame: &FrameSensor<F::Real>) -> Vec3<F> {
    let (of, from) = (&frame.of, frame.from.as_ref());
    let place = position(w, of);
    let vector = match frame.part {
        // p - p' between frames, or p + r in the world
        FramePart::Position => match from {
            Some(from) => from_there(w, of, from),
            None => place + reference(w, of),
        },
        FramePart::Axis(k) => axes(w, of)[k],
        // v - v' - ω' × (p - p')
        FramePart::Velocity => {
            let linear = velocity(w, of, place)[LINEAR];
            match from {
                Some(from) => {
                    let there = velocity(w, from, position(w, from));
                    let carried = there[ANGULAR].cross_add(from_there(w, of, from), there[LINEAR]);
                    linear - carried
                }
                None => linear,
            }
        }
        // ω - ω'; quaternions have a function of their own
        FramePart::Spin | FramePart::Quat => {
            let spin = velocity(w, of, place)[ANGULAR];
            match from {
                Some(from) => spin - velocity(w, from, position(w, from))[ANGULAR],
                None => spin,
            }
        }
    };
    // in the axes of the other frame, or of the frame itself
    match from {
        Some(from) => to_local(w, from, vector),
        None if frame.is_local => to_local(w, of, vector),
        None => vector,
    }
}

/// From the origin of a frame to that of another one.
#[inline(always)]
fn from_there<F: Num>(w: &Workspace<F>, of: &Mount<F::Real>, from: &Mount<F::Real>) -> Vec3<F> {
    let apart = position(w, of) - position(w, from);
    // within a tree reference points cancel
    if of.tree == from.tree {
        return apart;
    }
    apart + (reference(w, of) - reference(w, from))
}

/// Sensors of subtrees.
pub struct Subtrees;

impl Stage for Subtrees {
    const READS: &'static [A] = &[
        A::SubtreeCom,
        A::SubtreeLinvel,
        A::SubtreeAngmom,
        A::Sensordata,
    ];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        has(m, |kind| matches!(kind, SensorKind::Subtree(..)))
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let w = &mut b.work;
        for sensor in &m.sensors.all {
            let SensorKind::Subtree(body, part) = sensor.kind else {
                continue;
            };
            let vector = match part {
                SubtreePart::Center => w.subtree_com[body],
                SubtreePart::Velocity => w.subtree_linvel[body],
                SubtreePart::AngularMomentum => w.subtree_angmom[body],
            };
            put(&mut w.sensordata, sensor, &vector.0);
        }
    }
}
