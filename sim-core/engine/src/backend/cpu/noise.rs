//! Noise of commands and sensors, block by block.

use super::chunk::{Chunk, Job};
use crate::backend::noise::{FieldNoise, sample};
use crate::backend::state::Shape;
use crate::random::{Draw, Stream};
use sim_physics::arrays::Array;
use sim_physics::lane::{Lane, Real};

impl<F: Lane> Chunk<F> {
    /// Draws what is added to the commands of the frame.
    pub(super) fn draw_command_noise(&mut self, job: &Job<F>, block: usize) {
        let shape = job.shape;
        for (k, &(stream, first)) in job.noise.commands.iter().enumerate() {
            let Some(first) = first else { continue };
            for dof in 0..shape.dofs {
                self.lanes[..F::WIDTH].fill(F::Real::default());
                for (lane, place) in self.lanes_of(block).enumerate() {
                    let world = self.assignment.world(place);
                    let std = self.deviation(shape, world, first + dof);
                    if std > 0.0 {
                        let noise = sample(&self.draw(job, world, stream), dof, std);
                        self.lanes[lane] = F::Real::from_f64(noise);
                    }
                }
                self.block.command_noise[k * shape.dofs + dof] = F::load(&self.lanes);
            }
        }
    }

    /// Adds noise to a field of a world, as the table has it.
    pub(super) fn add_noise(
        &self,
        job: &Job<F>,
        noise: &FieldNoise,
        world: usize,
        row: &mut [F::Real],
    ) {
        let shape = job.shape;
        let draw = self.draw(job, world, noise.1);
        let deviation = |number| self.deviation(shape, world, number);
        job.noise.add_to(noise, row, &draw, deviation);
    }

    fn draw(&self, job: &Job<F>, world: usize, stream: Stream) -> Draw {
        let number = job.numbering.number(self.worlds.start + world);
        let (seed, episode) = (self.seeds[world], self.episodes[world]);
        Draw::at_step(seed, number, episode, self.steps[world], stream)
    }

    /// A standard deviation, by its number among the parameters of a world.
    fn deviation(&self, shape: Shape, world: usize, number: usize) -> f64 {
        self.state[self.place(shape, world, Array::Params, number)].to_f64()
    }
}
