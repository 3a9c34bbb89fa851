//! Command delay: the commands of earlier frames are part of the state.
//!
//! A command acts after its delay, which is a parameter of each world [substeps]. `Stage::Command` selects per dof the newest command that
//! is old enough. The state, and so a snapshot, holds as many earlier frames of commands as `command_delay_max` needs.

use super::chunk::{Chunk, Job};
use sim_physics::arrays::Array;
use sim_physics::arrays::status::FROZEN;
use sim_physics::lane::Lane;
use std::ops::Range;

impl<F: Lane> Chunk<F> {
    /// Moves the commands of this frame into the history, in the worlds that are not frozen; `state` is the block's.
    ///
    /// The evaluation that follows shows what acts next if no command is sent.
    #[inline(always)]
    pub(super) fn age_commands(&mut self, job: &Job<F>, block: usize, state: Range<usize>) {
        let shape = job.shape;
        if shape.len(Array::CommandHistory) == 0 {
            return;
        }
        let numbers = &mut self.state[state];
        let first = shape.start(Array::CommandHistory) * F::WIDTH;
        let sent = shape.start(Array::JointF) * F::WIDTH;
        let frame = 3 * shape.dofs * F::WIDTH;
        let end = first + shape.len(Array::CommandHistory) * F::WIDTH;
        let status = &self.status;
        let assignment = &self.assignment;
        let stays = |lane: usize| {
            status
                .get(assignment.world(block * F::WIDTH + lane))
                .is_some_and(|&status| status & FROZEN != 0)
        };
        if (0..F::WIDTH).any(stays) {
            // from the oldest on, since each value moves to the place of an older one
            for place in (first..end).rev().filter(|place| !stays(place % F::WIDTH)) {
                let from = if place < first + frame {
                    place - first + sent
                } else {
                    place - frame
                };
                numbers[place] = numbers[from];
            }
        } else {
            numbers.copy_within(first..end - frame, first + frame);
            numbers.copy_within(sent..sent + frame, first);
        }
        let history = numbers[first..end].chunks_exact(F::WIDTH);
        for (x, from) in self.block.command_history.iter_mut().zip(history) {
            *x = F::load(from);
        }
        self.block.substep[0] = F::c(0.0);
    }
}
