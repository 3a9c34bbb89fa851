//! Moves worlds between lanes, so that those with the same contact classes share a block.

use super::chunk::{Chunk, Job};
use super::lane_assignment::{BITS, Touches};
use sim_physics::constants::Constants;
use sim_physics::lane::Lane;

impl<F: Lane> Chunk<F> {
    /// Records which contact classes the worlds of a block have now.
    #[inline(always)]
    pub(super) fn note_contact_classes(&mut self, m: &Constants<F::Real>, block: usize) {
        let classes = m.contacts.classes.len();
        if classes == 0 || F::WIDTH == 1 {
            return;
        }
        let mut touches = [0; 64];
        let counts = m.contacts.memory.counts;
        for class in 0..classes {
            let count = self.memory[counts.base + class * counts.stride];
            let bits = F::bits(F::c(0.5).lt(count));
            for (lane, touches) in touches[..F::WIDTH].iter_mut().enumerate() {
                *touches |= ((bits >> lane & 1) as Touches) << (class % BITS);
            }
        }
        for lane in self.lanes_of(block) {
            let world = self.assignment.world(lane);
            self.assignment.note(world, touches[lane % F::WIDTH]);
        }
    }

    /// Moves worlds with the same contact classes into neighbouring lanes, with their state.
    pub(super) fn regroup(&mut self, job: &Job<F>) {
        let numbers = job.shape.total();
        let place = |lane: usize| (lane / F::WIDTH) * numbers * F::WIDTH + lane % F::WIDTH;
        let state = &mut self.state;
        self.assignment.group(|one, other| {
            let (one, other) = (place(one), place(other));
            for k in 0..numbers {
                state.swap(one + k * F::WIDTH, other + k * F::WIDTH);
            }
        });
    }
}
