//! Noise of commands and sensors.
//!
//! A number of it is a function of seed, world, episode, `step`, stream and column, so that it is the same in every width and
//! precision (rounded). Two frames of the same state show the same noise.

use super::chunk::{Chunk, Job};
use super::state::{Shape, StateField};
use crate::random::{Draw, Stream};
use sim_core::batch::Field;
use sim_core::lane::{Lane, Real};
use sim_core::math::quat::{self, Quat};
use sim_core::model::Model;
use sim_core::model::constants::Motion;
use sim_core::model::params::{COMMAND_NOISES, Param};
use std::ops::Range;

/// A field that has noise, its stream, and the place of its first standard deviation.
pub(super) type FieldNoise = (Field, Stream, usize);

/// Where the standard deviations are among the parameters of a world.
pub(super) struct Noise {
    /// Of each command: its stream, and the place of that of its first dof.
    commands: [(Stream, Option<usize>); 3],
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
    pub fn of(&self, field: Field) -> Option<&FieldNoise> {
        self.fields.iter().find(|(noisy, ..)| *noisy == field)
    }
}

impl<F: Lane> Chunk<F> {
    /// Draws what is added to the commands of the frame.
    pub(super) fn draw_command_noise(&mut self, job: &Job<F>, block: usize) {
        let shape = Shape::of(&job.constants);
        for (k, &(stream, first)) in job.noise.commands.iter().enumerate() {
            let Some(first) = first else { continue };
            for dof in 0..shape.dofs {
                self.lanes[..F::WIDTH].fill(F::Real::default());
                for (lane, world) in self.worlds_of(block).enumerate() {
                    let std = self.deviation(shape, world, first + dof);
                    if std > 0.0 {
                        let noise = self.draw(job, world, stream).normal(dof as u32, 0.0, std);
                        self.lanes[lane] = F::Real::of(noise);
                    }
                }
                self.block.command_noise[k * shape.dofs + dof] = F::load(&self.lanes);
            }
        }
    }

    /// Adds noise to a field, as the table has it: `numbers` are those of the worlds of `rows`.
    pub(super) fn add_noise(
        &self,
        job: &Job<F>,
        &(field, stream, first): &FieldNoise,
        rows: Range<usize>,
        numbers: &mut [F::Real],
    ) {
        let columns = numbers.len() / rows.len().max(1);
        if columns == 0 {
            return;
        }
        let shape = Shape::of(&job.constants);
        for (outside, row) in rows.zip(numbers.chunks_exact_mut(columns)) {
            let world = outside - self.worlds.start;
            let draw = self.draw(job, world, stream);
            let of = |index: usize, number: usize| {
                let std = self.deviation(shape, world, first + number);
                if std > 0.0 {
                    draw.normal(index as u32, 0.0, std)
                } else {
                    0.0
                }
            };
            match field {
                Field::JointQMeasured => {
                    for &(motion, dof, coord) in &job.noise.joints {
                        add_to_joint(motion, &mut row[coord..], |k| of(dof + k, dof + k));
                    }
                }
                Field::SiteQ => {
                    for (site, pose) in row.chunks_exact_mut(7).enumerate() {
                        let noise = |k: usize| of(6 * site + k, 2 * site + k / 3);
                        (0..3).for_each(|k| add(&mut pose[k], noise(k)));
                        turn(&mut pose[3..], [noise(3), noise(4), noise(5)], false);
                    }
                }
                _ => {
                    // numbers of a column, and columns that share a deviation
                    let shared = match field {
                        Field::JointQdMeasured | Field::JointTorque => 1,
                        _ => 3,
                    };
                    for (k, x) in row.iter_mut().enumerate() {
                        add(x, of(k, k / shared));
                    }
                }
            }
        }
    }

    fn draw(&self, job: &Job<F>, world: usize, stream: Stream) -> Draw {
        let number = job.draws.number(self.worlds.start + world);
        let (seed, episode) = (self.seeds[world], self.episodes[world]);
        Draw::at_step(seed, number, episode, self.steps[world], stream)
    }

    /// A standard deviation, by its number among the parameters of a world.
    fn deviation(&self, shape: Shape, world: usize, number: usize) -> f64 {
        self.state[self.place(shape, world, StateField::Params, number)].to_f64()
    }
}

/// Adds noise, one a dof, to the coordinates of a joint.
fn add_to_joint<R: Real>(motion: Motion, q: &mut [R], noise: impl Fn(usize) -> f64) {
    match motion {
        Motion::Revolute | Motion::Prismatic => add(&mut q[0], noise(0)),
        Motion::Ball => turn(&mut q[..4], [noise(0), noise(1), noise(2)], false),
        Motion::Free => {
            (0..3).for_each(|k| add(&mut q[k], noise(k)));
            turn(&mut q[3..7], [noise(3), noise(4), noise(5)], true);
        }
    }
}

fn add<R: Real>(x: &mut R, noise: f64) {
    // what has no noise keeps its bits
    if noise != 0.0 {
        *x = R::of(x.to_f64() + noise);
    }
}

/// Turns a quaternion by a rotation vector, in world axes or in its own.
fn turn<R: Real>(quat: &mut [R], vector: [f64; 3], in_world: bool) {
    if vector == [0.0; 3] {
        return;
    }
    let here: Quat<f64> = std::array::from_fn(|k| quat[k].to_f64());
    let turn = quat::exp(vector);
    let turned = match in_world {
        true => quat::mul(turn, here),
        false => quat::mul(here, turn),
    };
    for (x, turned) in quat.iter_mut().zip(turned) {
        *x = R::of(turned);
    }
}
