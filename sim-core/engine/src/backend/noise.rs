//! Noise of commands and sensors.
//!
//! Noise is drawn on the host in `f64`, as a function of (seed, world, episode, `step`, stream, column). So it does not depend on the lanes,
//! only rounding depends on the precision, and two frames of one state show the same noise. Command noise is drawn before a frame. Field
//! noise is added after the fields were written into the arena. A value with a standard deviation of 0 keeps its bits, and
//! nothing is drawn for it.

use crate::random::{Draw, Stream};
use sim_model::Model;
use sim_physics::arrays::Field;
use sim_physics::constants::Motion;
use sim_physics::constants::params::{COMMAND_NOISES, Param};
use sim_physics::lane::Real;
use sim_physics::math::quat::{self, Quat};
use sim_physics::math::vec3::Vec3;

/// A field that has noise, its stream, and the place of its first standard deviation.
pub(super) type FieldNoise = (Field, Stream, usize);

/// Where the standard deviations are among the parameters of a world.
pub(super) struct Noise {
    /// Of each command: its stream, and the place of that of its first dof.
    pub commands: [(Stream, Option<usize>); 3],
    fields: Vec<FieldNoise>,
    /// Joints, by their first dof and coordinate.
    joints: Vec<(Motion, usize, usize)>,
}

impl Noise {
    pub fn new(model: &Model) -> Noise {
        let m = model.constants();
        let first = |param| m.varying.first(param);
        let streams = [
            Stream::ForceNoise,
            Stream::TargetNoise,
            Stream::TargetRateNoise,
        ];
        let fields = [
            (
                Field::JointQMeasured,
                Stream::PositionNoise,
                Param::JointQNoise,
            ),
            (
                Field::JointQdMeasured,
                Stream::VelocityNoise,
                Param::JointQdNoise,
            ),
            (
                Field::JointTorque,
                Stream::TorqueNoise,
                Param::JointTorqueNoise,
            ),
            (Field::SiteQ, Stream::SitePoseNoise, Param::SiteQNoise),
            (Field::SiteQd, Stream::SiteVelocityNoise, Param::SiteQdNoise),
            (Field::Gyro, Stream::GyroNoise, Param::GyroNoise),
            (
                Field::Accelerometer,
                Stream::AccelerometerNoise,
                Param::AccelerometerNoise,
            ),
            (
                Field::ContactSensor,
                Stream::ContactSensorNoise,
                Param::ContactSensorNoise,
            ),
        ];
        let fields = fields.into_iter();
        Noise {
            commands: std::array::from_fn(|k| (streams[k], first(COMMAND_NOISES[k]))),
            fields: fields
                .filter_map(|(field, stream, param)| Some((field, stream, first(param)?)))
                .collect(),
            joints: m
                .bodies
                .iter()
                .map(|b| (b.motion, b.dof, b.coord))
                .collect(),
        }
    }
}

impl Noise {
    /// The noise of a field, if it has some.
    pub fn for_field(&self, field: Field) -> Option<&FieldNoise> {
        self.fields.iter().find(|(noisy, ..)| *noisy == field)
    }
}

/// A sample of noise; 0 if its standard deviation is 0.
pub(super) fn sample(draw: &Draw, index: usize, deviation: f64) -> f64 {
    if deviation > 0.0 {
        draw.normal(index as u32, 0.0, deviation)
    } else {
        0.0
    }
}

impl Noise {
    /// Adds noise to a world's row of a field, as the table has it; `deviation` gives a standard deviation, by its number among
    /// the parameters of the world.
    pub fn add_to<R: Real>(
        &self,
        &(field, _, first): &FieldNoise,
        row: &mut [R],
        draw: &Draw,
        deviation: impl Fn(usize) -> f64,
    ) {
        let sampled = |index: usize, number: usize| sample(draw, index, deviation(first + number));
        match field {
            Field::JointQMeasured => {
                for &(motion, dof, coord) in &self.joints {
                    add_to_joint(motion, &mut row[coord..], |k| sampled(dof + k, dof + k));
                }
            }
            Field::SiteQ => {
                for (site, pose) in row.chunks_exact_mut(7).enumerate() {
                    let noise = |k: usize| sampled(6 * site + k, 2 * site + k / 3);
                    (0..3).for_each(|k| add(&mut pose[k], noise(k)));
                    turn(&mut pose[3..], [noise(3), noise(4), noise(5)], false);
                }
            }
            _ => {
                // columns that share a standard deviation
                let shared = match field {
                    Field::JointQdMeasured | Field::JointTorque => 1,
                    _ => 3,
                };
                for (k, x) in row.iter_mut().enumerate() {
                    add(x, sampled(k, k / shared));
                }
            }
        }
    }
}

/// Adds noise, one sample per dof, to the coordinates of a joint.
fn add_to_joint<R: Real>(motion: Motion, q: &mut [R], noise: impl Fn(usize) -> f64) {
    match motion {
        Motion::Revolute | Motion::Prismatic => add(&mut q[0], noise(0)),
        Motion::Ball => turn(&mut q[..4], [noise(0), noise(1), noise(2)], false),
        Motion::Mocap => {}
        Motion::Free => {
            (0..3).for_each(|k| add(&mut q[k], noise(k)));
            turn(&mut q[3..7], [noise(3), noise(4), noise(5)], true);
        }
    }
}

fn add<R: Real>(x: &mut R, noise: f64) {
    // what has no noise keeps its bits
    if noise != 0.0 {
        *x = R::from_f64(x.to_f64() + noise);
    }
}

/// Rotates a quaternion by a rotation vector, in world axes or in its own.
fn turn<R: Real>(quat: &mut [R], vector: [f64; 3], in_world: bool) {
    if vector == [0.0; 3] {
        return;
    }
    let here: Quat<f64> = std::array::from_fn(|k| quat[k].to_f64());
    let turn = quat::exp(Vec3(vector));
    let turned = match in_world {
        true => quat::mul(turn, here),
        false => quat::mul(here, turn),
    };
    for (x, turned) in quat.iter_mut().zip(turned) {
        *x = R::from_f64(turned);
    }
}
