//! Resets of worlds.

use super::chunk::{Chunk, Job};
use crate::random::Episode;
use sim_physics::arrays::Array;
use sim_physics::lane::{Lane, Real};

impl<F: Lane> Chunk<F> {
    /// Sets every lane to its start. Lanes past the last world run along from the scene's start.
    pub(super) fn start(&mut self, job: &Job<F>) {
        let lanes = self.worlds.len().next_multiple_of(F::WIDTH);
        for lane in 0..lanes {
            self.start_lane(job, lane, |_| true);
        }
        for world in 0..self.worlds.len() {
            self.draw_start(job, world);
        }
    }

    /// Starts the next episode of the worlds of the mask, or the first one of their new seeds.
    pub(super) fn reset(&mut self, job: &Job<F>, mask: Option<&[bool]>, seeds: Option<&[u64]>) {
        for world in 0..self.worlds.len() {
            let outside = self.worlds.start + world;
            if mask.is_some_and(|mask| !mask[outside]) {
                continue;
            }
            match seeds {
                Some(seeds) => {
                    self.seeds[world] = if let [seed] = seeds {
                        *seed
                    } else {
                        seeds[outside]
                    };
                    self.episodes[world] = 0;
                    self.begin(job, world);
                }
                None => self.begin_next(job, world),
            }
        }
    }

    /// Tells the episodes of its worlds, as far as there is room.
    pub(super) fn episodes(&self, job: &Job<F>, to: &mut [Episode]) {
        for (world, outside) in self.worlds.clone().enumerate() {
            let Some(to) = to.get_mut(outside) else {
                return;
            };
            *to = Episode {
                seed: self.seeds[world],
                world: job.numbering.number(outside),
                episode: self.episodes[world],
            };
        }
    }

    /// Begins the next episode of a world; after 2³² the first comes again.
    pub(super) fn begin_next(&mut self, job: &Job<F>, world: usize) {
        self.episodes[world] = self.episodes[world].wrapping_add(1);
        self.begin(job, world);
    }

    /// Begins the episode of a world.
    fn begin(&mut self, job: &Job<F>, world: usize) {
        self.reset_lane(job, world);
        self.draw_start(job, world);
        self.steps[world] = 0;
        self.status[world] = 0;
        self.left_out[world] = 0;
    }

    /// State and commands of a lane as the scene starts them; parameters stay as they are, but for loads and what is drawn.
    fn reset_lane(&mut self, job: &Job<F>, lane: usize) {
        let params = job.shape.start(Array::Params);
        let starts = job.constants.varying.starts();
        self.start_lane(job, lane, |k| k < params || starts[k - params].0.is_load());
    }

    /// Sets the chosen values of a lane to the scene's start.
    fn start_lane(&mut self, job: &Job<F>, lane: usize, chosen: impl Fn(usize) -> bool) {
        let first = self.place(job.shape, lane, Array::JointQd, 0);
        for (k, &x) in job.start.iter().enumerate().filter(|(k, _)| chosen(*k)) {
            self.state[first + k * F::WIDTH] = x;
        }
    }

    /// Draws the random part of state and parameters.
    fn draw_start(&mut self, job: &Job<F>, world: usize) {
        let shape = job.shape;
        let (seed, episode) = (self.seeds[world], self.episodes[world]);
        let number = job.numbering.number(self.worlds.start + world);
        job.draw
            .draw(seed, number, episode, |field, column, value| {
                let place =
                    self.place(shape, world, crate::backend::state::array_of(field), column);
                self.state[place] = F::Real::from_f64(value);
            });
        job.draw.draw_params(seed, number, episode, |k, value| {
            let place = self.place(shape, world, Array::Params, k);
            self.state[place] = F::Real::from_f64(value);
        });
    }
}
