//! Draws the images of frames, on all threads.

use sim_engine::backend::BackendError;
use sim_engine::random::Episode;
use sim_engine::simulation::Simulation;
use sim_engine::workers::Workers;

use super::images::{Images, parts};
use super::memory::{Memory, State};
use super::part::Part;
use super::sight::Eye;
use crate::error::DaemonError;

/// The cameras of a group of worlds.
pub(crate) struct Eyes {
    images: Images,
    /// None without images.
    parts: Vec<Part>,
    workers: Option<Workers>,
    /// Of each world, where a camera is random or repeats images.
    episodes: Vec<Episode>,
    /// Whether worlds are reset after a fault.
    resets: bool,
}

impl Eyes {
    /// No cameras.
    pub(crate) fn none(simulation: &Simulation) -> Eyes {
        Eyes {
            images: Images::none(simulation.layout()),
            parts: Vec::new(),
            workers: None,
            episodes: Vec::new(),
            resets: false,
        }
    }

    /// The cameras of groups of worlds, each with these images, which share threads. `resets` where worlds are reset after a
    /// fault.
    ///
    /// # Errors
    /// A camera of worlds that are not there, and threads that the system does not start.
    pub(crate) fn of_groups(
        images: &Images,
        threads: usize,
        groups: usize,
        resets: bool,
    ) -> Result<Vec<Eyes>, DaemonError> {
        let worlds = images.seen.as_ref().map_or(1, |seen| seen.steps.shape[0]);
        images.check_worlds(worlds * groups)?;
        // one world is drawn by one thread
        let threads = threads.min(worlds.saturating_mul(groups));
        let workers = workers(images, threads, groups)?;
        let eyes = (0..groups).map(|group| {
            let (images, workers) = (images.clone(), workers.clone());
            Eyes::new(images, group * worlds, threads, workers, resets)
        });
        Ok(eyes.collect())
    }

    /// The cameras of a simulation that shares no threads, whose first world has this number.
    ///
    /// # Errors
    /// Threads that the system does not start.
    pub(crate) fn alone(
        images: &Images,
        simulation: &Simulation,
        first_world: usize,
        resets: bool,
    ) -> Result<Eyes, DaemonError> {
        let threads = simulation.threads().min(simulation.worlds());
        let workers = workers(images, threads, 1)?;
        Ok(Eyes::new(
            images.clone(),
            first_world,
            threads,
            workers,
            resets,
        ))
    }

    fn new(
        images: Images,
        first_world: usize,
        threads: usize,
        workers: Option<Workers>,
        resets: bool,
    ) -> Eyes {
        let mut eyes = Eyes {
            images,
            parts: Vec::new(),
            workers,
            episodes: Vec::new(),
            resets,
        };
        let Some(seen) = &eyes.images.seen else {
            return eyes;
        };
        let worlds = seen.steps.shape[0];
        let count = parts(threads, worlds);
        let parts = (0..count).map(|part| {
            let worlds = part * worlds / count..(part + 1) * worlds / count;
            Part::new(seen, &eyes.images, worlds, first_world)
        });
        eyes.parts = parts.collect();
        let depends = |eye: &Eye| eye.chance.is_random() || eye.every > 1;
        if seen.sight.eyes.iter().any(depends) {
            eyes.episodes = vec![Episode::default(); worlds];
        }
        eyes
    }

    /// What frames have of them.
    pub(crate) fn images(&self) -> &Images {
        &self.images
    }

    /// Lets all cameras draw in the next frame: nothing that it shows then depends on what came before.
    pub(crate) fn forget(&mut self) {
        self.parts.iter_mut().for_each(Part::forget);
    }

    /// Draws the images of a frame, which has the arrays of this simulation already. Later frames may repeat them if it
    /// `keeps` them, which those of [`Images::unkept`] are not. Without cameras it does nothing.
    ///
    /// # Panics
    /// The arena is smaller than [`Images::arena_bytes`].
    pub(crate) fn draw(&mut self, simulation: &Simulation, arena: &mut [u64], keeps: bool) {
        let (Some(seen), Some(workers)) = (&self.images.seen, &self.workers) else {
            return;
        };
        let room = size_of_val(arena);
        assert!(room >= self.images.arena_bytes(), "no room for images");
        simulation.episodes(&mut self.episodes);
        let (state, images) = arena.split_at_mut(seen.words);
        let images = Memory::new(images, size_of_val(state));
        let state = State {
            bytes: bytemuck::cast_slice(state),
            bodies: &seen.bodies,
            steps: &seen.steps,
            episodes: &self.episodes,
            faults: self.resets.then_some(&seen.statuses),
        };
        let fields = self.images.fields();
        workers.for_each(&mut self.parts, |part| {
            part.draw(&seen.sight, fields, &state, images, keeps);
        });
    }
}

/// The threads that draw images, if there are any.
fn workers(images: &Images, threads: usize, groups: usize) -> Result<Option<Workers>, DaemonError> {
    let workers = images.seen.as_ref().map(|_| {
        let failed = |reason| BackendError::Threads { threads, reason };
        Workers::new(threads, groups).map_err(failed)
    });
    Ok(workers.transpose()?)
}
