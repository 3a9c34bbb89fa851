//! Blocks of worlds from several others.

use super::lane_move::{Move, WIDEST};
use super::space::Space;
use sim_physics::arrays::{Array, Block, Flat, Pause};
use sim_physics::constants::Constants;
use sim_physics::lane::{Lane, Real};

/// Most blocks of a cluster. More of them fill registers better, by 2 % of a step from 4 to 8 and nothing from 8 to 16.
const CLUSTER: usize = 8;
/// Fewest blocks that fill another one: from 3, with at most half of their worlds each, the second pause is seldom worth its moves.
const LEAST: usize = 4;
/// Most memory of the blocks of a cluster [bytes]. One that leaves the caches loses what full registers gain: a humanoid and a G1,
/// whose contacts alone have 2 and 7 MB a block, are as fast without.
const CLUSTER_BYTES: usize = 4 << 20;

/// How many blocks share a cluster, for so many blocks and a register of so many bytes: one where gathering does not pay.
pub(super) fn cluster_size<R: Real>(m: &Constants<R>, blocks: usize, register: usize) -> usize {
    let scalars: usize = Array::ALL.iter().map(|array| array.scalars(m)).sum();
    let space = (scalars + m.contacts.memory.len) * register;
    let most = CLUSTER.min(CLUSTER_BYTES / space.max(1)).min(blocks);
    if most < LEAST || m.contacts.classes.is_empty() {
        return 1;
    }
    // clusters of nearly the same size
    let size = blocks.div_ceil(blocks.div_ceil(most));
    if size < LEAST { 1 } else { size }
}

/// Most spaces that a chunk has, for a register of so many bytes; one where a register is a world.
pub(crate) fn spaces_max<R: Real>(m: &Constants<R>, register: usize) -> usize {
    match cluster_size(m, CLUSTER, register) {
        1 => 1,
        // and two gathered ones
        size => size + 2,
    }
}

/// Most worlds that go on when a block pauses.
pub(super) const fn few(width: usize) -> usize {
    width / 2
}

/// What returns to a world's own block.
pub(super) const RETURNS: [Array; 3] = [Array::JointQdd, Array::SolverProgress, Array::SolverWork];

/// A world of a gathered block, by the place of its own block in the group and its lane there.
#[derive(Clone, Copy)]
pub(super) struct Guest {
    pub block: usize,
    pub lane: usize,
}

/// Worlds that move, with the lanes that they are in.
pub(super) struct Guests {
    worlds: [(usize, Guest); WIDEST],
    count: usize,
}

impl Guests {
    #[inline(always)]
    pub fn new() -> Guests {
        Guests {
            worlds: [(0, Guest { block: 0, lane: 0 }); WIDEST],
            count: 0,
        }
    }

    #[inline(always)]
    pub fn push(&mut self, lane: usize, guest: Guest) {
        self.worlds[self.count] = (lane, guest);
        self.count += 1;
    }

    #[inline(always)]
    pub fn all(&self) -> &[(usize, Guest)] {
        &self.worlds[..self.count]
    }
}

/// A gathered block.
pub(super) struct Gathered<F: Lane> {
    pub space: Space<F>,
    /// The world in each lane, from the first lane on.
    pub guests: Vec<Guest>,
}

/// Two gathered blocks: one that fills, and one that runs and whose last worlds move to the first.
pub(super) struct Gathering<F: Lane> {
    pub fills: Gathered<F>,
    pub runs: Gathered<F>,
}

impl<F: Lane> Gathered<F> {
    /// Of NaN, so that a number which does not move with its world shows in the results.
    fn new(m: &Constants<F::Real>) -> Self {
        let mut space = Space::new(m);
        space.memory.fill(F::c(f64::NAN));
        for &array in Array::ALL {
            let (Flat::Cells(cells) | Flat::Values(cells)) = space.block.array_mut(array);
            cells.fill(F::c(f64::NAN));
        }
        Gathered {
            space,
            guests: Vec::with_capacity(F::WIDTH),
        }
    }

    /// Takes the lanes as empty: their worlds have no contacts, and have arrived.
    #[inline(always)]
    fn clear(&mut self, m: &Constants<F::Real>) {
        self.guests.clear();
        self.space.block.solver_progress[Pause::BUSY] = F::c(0.0);
        let counts = m.contacts.memory.counts;
        for class in 0..m.contacts.classes.len() {
            self.space.memory[counts.base + class * counts.stride] = F::c(0.0);
        }
    }

    /// Takes worlds of a block into free lanes, as many as there are; returns how many.
    #[inline(always)]
    pub fn take(
        &mut self,
        m: &Constants<F::Real>,
        resumes: &[Array],
        (block, memory): (&Block<F, F>, &[F]),
        worlds: &[(usize, Guest)],
    ) -> usize {
        let first = self.guests.len();
        if first == 0 {
            self.clear(m);
        }
        let count = worlds.len().min(F::WIDTH - first);
        let lanes = worlds[..count].iter().map(|(lane, _)| *lane);
        let moved = Move::<F>::new(lanes.zip(first..));
        moved.arrays(block, &mut self.space.block, resumes);
        moved.contacts(m, memory, &mut self.space.memory);
        self.guests
            .extend(worlds[..count].iter().map(|(_, guest)| *guest));
        count
    }
}

impl<F: Lane> Gathering<F> {
    pub fn new(m: &Constants<F::Real>) -> Self {
        Gathering {
            fills: Gathered::new(m),
            runs: Gathered::new(m),
        }
    }
}

/// The lanes whose solve goes on, as bits.
#[inline(always)]
pub(super) fn going_on<F: Lane>(m: &Constants<F::Real>, block: &Block<F, F>) -> u32 {
    let end = F::c(m.solver.iterations as f64 - 0.5);
    let saved = &block.solver_progress;
    F::bits(F::c(0.5).lt(saved[Pause::BUSY]) & saved[Pause::ITERATION].lt(end))
}
