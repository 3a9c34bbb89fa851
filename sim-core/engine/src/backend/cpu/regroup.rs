//! Moves worlds between lanes, so that those with the same contacts share a block.

use super::chunk::{Chunk, Job};
use super::contact_kinds::{Bit, COUPLED, ContactKinds, Kind};
use sim_physics::constants::Constants;
use sim_physics::lane::Lane;

impl<F: Lane> Chunk<F> {
    /// Records of which kind the worlds of a block are now.
    #[inline(always)]
    pub(super) fn note_contacts(&mut self, m: &Constants<F::Real>, block: usize) {
        let is_one_block = self.worlds.len() <= F::WIDTH;
        if m.contacts.classes.is_empty() || is_one_block || F::WIDTH == 1 {
            return;
        }
        let (counts, memory, lanes) =
            (m.contacts.memory.counts, &self.memory, self.lanes_of(block));
        let set = |bit: Bit| {
            let count = memory[counts.base + bit.class * counts.stride];
            F::bits(F::c(bit.threshold()).lt(count))
        };
        if ContactKinds::is_due(self.frames) {
            // the last block may have lanes without a world
            let inhabited = (1u64 << lanes.len()) - 1;
            self.kinds.count(lanes.len(), |bit| {
                (u64::from(set(bit)) & inhabited).count_ones()
            });
        }
        let mut kinds: [Kind; 64] = [0; 64];
        for (of, bit) in self.kinds.bits() {
            let worlds = set(*of);
            if worlds == 0 {
                continue;
            }
            for (lane, kind) in kinds[..F::WIDTH].iter_mut().enumerate() {
                *kind |= (worlds >> lane & 1) as Kind * bit;
            }
        }
        let classes = m.contacts.classes.iter().enumerate();
        let coupled = classes.filter(|(_, class)| class.couples);
        let coupled = coupled.fold(0, |worlds, (class, _)| {
            worlds | set(Bit { class, level: 0 })
        });
        for (lane, kind) in kinds[..F::WIDTH].iter_mut().enumerate() {
            *kind |= (coupled >> lane & 1) as Kind * COUPLED;
        }
        for lane in lanes {
            let world = self.assignment.world(lane);
            self.assignment.note(world, kinds[lane % F::WIDTH]);
        }
    }

    /// Moves worlds of the same kind into neighbouring lanes, with their state.
    pub(super) fn regroup(&mut self, job: &Job<F>) {
        if ContactKinds::is_due(self.frames) {
            let classes = &job.constants.contacts.classes;
            self.kinds
                .choose(F::WIDTH, |class| classes[class].columns.len().pow(2));
        }
        let numbers = job.shape.total();
        let place = |lane: usize| (lane / F::WIDTH) * numbers * F::WIDTH + lane % F::WIDTH;
        let state = &mut self.state;
        self.assignment.group(|lane, other| {
            let (first, other) = (place(lane), place(other));
            for k in 0..numbers {
                state.swap(first + k * F::WIDTH, other + k * F::WIDTH);
            }
        });
    }
}
