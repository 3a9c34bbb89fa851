//! Which lane of which block a world sits in.
//!
//! A block takes as long as the slowest of its worlds, and walks contacts that any of them has. So worlds whose bodies
//! touch alike sit side by side: after a frame a chunk groups its worlds by the classes of contacts that they had in its last substep.
//! No number of a world depends on where it sits, nor on its neighbours.

use super::chunk::{Chunk, Job};
use sim_physics::constants::Constants;
use sim_physics::lane::Lane;
use std::ops::Range;

/// A bit for every class of contacts that a world has, modulo the bits there are.
pub(super) type Touches = u8;
const BITS: usize = Touches::BITS as usize;
/// How many different ones there are.
const KINDS: usize = 1 << BITS;

/// The seats of a chunk: lanes, counted from its first block on.
pub(super) struct Seats {
    /// The seat of each world; those past the last world are their own.
    of_world: Vec<usize>,
    /// Who sits there.
    world: Vec<usize>,
    /// What each world touched.
    touches: Vec<Touches>,
    /// Has a world changed what it touches since they were seated?
    changed: bool,
}

impl Seats {
    /// Every world in its own place.
    pub fn new(worlds: usize, lanes: usize) -> Seats {
        Seats {
            of_world: (0..lanes).collect(),
            world: (0..lanes).collect(),
            touches: vec![0; worlds],
            changed: false,
        }
    }

    /// The seat of a world, counted from the chunk's first.
    #[inline(always)]
    pub fn of(&self, world: usize) -> usize {
        self.of_world[world]
    }

    /// Who sits there.
    #[inline(always)]
    pub fn world(&self, seat: usize) -> usize {
        self.world[seat]
    }

    /// The worlds of some seats if they follow each other.
    pub fn side_by_side(&self, seats: Range<usize>) -> Option<Range<usize>> {
        let worlds = &self.world[seats];
        let &first = worlds.first()?;
        let follows = worlds.iter().zip(first..).all(|(&world, k)| world == k);
        follows.then(|| first..first + worlds.len())
    }

    fn note(&mut self, world: usize, touches: Touches) {
        self.changed |= self.touches[world] != touches;
        self.touches[world] = touches;
    }

    /// Seats worlds that touch alike side by side. `swap` is told each two seats whose worlds change places.
    ///
    /// A world that sits among its like stays there.
    fn group(&mut self, mut swap: impl FnMut(usize, usize)) {
        if !std::mem::take(&mut self.changed) {
            return;
        }
        let mut ends = [0; KINDS];
        for &touches in &self.touches {
            ends[usize::from(touches)] += 1;
        }
        // the next seat of each kind to look at
        let mut next = [0; KINDS];
        let mut seats = 0;
        for (next, end) in next.iter_mut().zip(&mut ends) {
            *next = seats;
            seats += *end;
            *end = seats;
        }
        for kind in 0..KINDS {
            while next[kind] < ends[kind] {
                let seat = next[kind];
                let own = usize::from(self.touches[self.world[seat]]);
                if own == kind {
                    next[kind] += 1;
                    continue;
                }
                // there is one, since as many seats as worlds are of each kind
                while usize::from(self.touches[self.world[next[own]]]) == own {
                    next[own] += 1;
                }
                let other = next[own];
                self.world.swap(seat, other);
                self.of_world[self.world[seat]] = seat;
                self.of_world[self.world[other]] = other;
                swap(seat, other);
            }
        }
    }
}

impl<F: Lane> Chunk<F> {
    /// Notes which classes of contacts the worlds of a block have now.
    #[inline(always)]
    pub(super) fn note_touches(&mut self, m: &Constants<F::Real>, block: usize) {
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
        for seat in self.seats_of(block) {
            let world = self.seats.world(seat);
            self.seats.note(world, touches[seat % F::WIDTH]);
        }
    }

    /// Seats worlds that touch alike side by side, their numbers with them.
    pub(super) fn group_worlds(&mut self, job: &Job<F>) {
        let numbers = job.shape.total();
        let place = |seat: usize| (seat / F::WIDTH) * numbers * F::WIDTH + seat % F::WIDTH;
        let state = &mut self.state;
        self.seats.group(|one, other| {
            let (one, other) = (place(one), place(other));
            for k in 0..numbers {
                state.swap(one + k * F::WIDTH, other + k * F::WIDTH);
            }
        });
    }

    /// The seats of a block that have a world.
    #[inline(always)]
    pub(super) fn seats_of(&self, block: usize) -> Range<usize> {
        let first = block * F::WIDTH;
        first..(first + F::WIDTH).min(self.worlds.len())
    }
}
