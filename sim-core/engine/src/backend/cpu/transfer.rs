//! Out of a block, into the arena: the one place where lane order becomes world-major.

use super::chunk::Chunk;
use crate::backend::gather::gather;
use sim_physics::arrays::Slot;
use sim_physics::constants::Constants;
use sim_physics::lane::Lane;
use sim_physics::lane::memory::Cpu;
use std::ops::Range;

/// The arena of a frame, shared by the threads that write it.
#[derive(Clone, Copy)]
pub struct Arena {
    base: *mut u8,
    bytes: usize,
}

// SAFETY: threads write disjoint rows only (contract of `put` and `export`).
unsafe impl Send for Arena {}
// SAFETY: as above.
unsafe impl Sync for Arena {}

impl Arena {
    pub fn new(words: &mut [u64]) -> Arena {
        Arena {
            base: words.as_mut_ptr().cast(),
            bytes: size_of_val(words),
        }
    }

    /// The elements of a slot that belong to some worlds.
    ///
    /// # Safety
    /// The memory behind the arena lives, and nobody else uses these rows.
    #[inline(always)]
    pub(super) unsafe fn rows<'a, T: Copy>(
        self,
        slot: &Slot,
        worlds: &Range<usize>,
    ) -> &'a mut [T] {
        let elements: usize = slot.shape[1..].iter().product();
        assert!(size_of::<T>() == slot.dtype.bytes() && worlds.end <= slot.shape[0]);
        assert!(slot.offset + slot.bytes <= self.bytes);
        let first = slot.offset + worlds.start * elements * size_of::<T>();
        // SAFETY: inside the arena (asserted), aligned since offsets are multiples of 64 and the base
        // of 8; alive and exclusive by contract.
        unsafe {
            std::slice::from_raw_parts_mut(self.base.add(first).cast(), worlds.len() * elements)
        }
    }

    /// The elements of a slot that belong to a world.
    ///
    /// # Safety
    /// As [`Arena::rows`].
    #[inline(always)]
    pub(super) unsafe fn row<'a, T: Copy>(self, slot: &Slot, world: usize) -> &'a mut [T] {
        // SAFETY: by contract.
        unsafe { self.rows(slot, &(world..world + 1)) }
    }

    /// Writes one number per world.
    ///
    /// # Safety
    /// As [`Arena::rows`].
    #[inline(always)]
    pub unsafe fn put<T: Copy>(
        self,
        slot: &Slot,
        worlds: Range<usize>,
        value: impl Fn(usize) -> T,
    ) {
        // SAFETY: by contract.
        let rows = unsafe { self.rows::<T>(slot, &worlds) };
        for (x, world) in rows.iter_mut().zip(worlds) {
            *x = value(world);
        }
    }
}

/// Writes a field of the worlds of a block.
///
/// # Safety
/// As [`Arena::rows`].
#[inline(always)]
pub(super) unsafe fn export<F: Lane>(
    chunk: &mut Chunk<F>,
    m: &Constants<F::Real>,
    slot: &Slot,
    block: usize,
    arena: Arena,
) {
    let n: usize = slot.shape[1..].iter().product();
    let cx = &mut Cpu::new(&mut chunk.memory, &m.contacts.tables);
    gather(cx, m, &chunk.block, slot.field, &mut chunk.staging[..n]);
    let (lanes, first) = (chunk.lanes_of(block), chunk.worlds.start);
    // rows are disjoint, as the caller promises, only if no world is in two lanes
    assert!(
        chunk.assignment.is_one_to_one(lanes.clone()),
        "the assignment of worlds to lanes is no permutation"
    );
    if let Some(worlds) = chunk.assignment.consecutive(lanes.clone()) {
        let worlds = first + worlds.start..first + worlds.end;
        // SAFETY: by contract.
        let rows = unsafe { arena.rows::<F::Real>(slot, &worlds) };
        unstage(&chunk.staging[..n], &mut chunk.lanes, rows);
        return;
    }
    let numbers = &mut chunk.rows[..n * lanes.len()];
    unstage(&chunk.staging[..n], &mut chunk.lanes, numbers);
    for (place, row) in lanes.zip(numbers.chunks_exact(n.max(1))) {
        // SAFETY: by contract.
        let to = unsafe { arena.row::<F::Real>(slot, first + chunk.assignment.world(place)) };
        to.copy_from_slice(row);
    }
}

/// From one register an element to one row per world, of as many worlds as there are rows; `lanes` is scratch.
#[inline(always)]
fn unstage<F: Lane>(staging: &[F], lanes: &mut [F::Real], rows: &mut [F::Real]) {
    let n = staging.len();
    // four numbers at a time where every lane is a world; number by number this took a twelfth of a step
    let mut first = 0;
    if rows.len() == n * F::WIDTH {
        for four in staging.as_chunks().0 {
            F::store_rows(*four, &mut rows[first..], n);
            first += 4;
        }
    }
    let lanes = &mut lanes[..(n - first) * F::WIDTH];
    for (x, lanes) in staging[first..]
        .iter()
        .zip(lanes.chunks_exact_mut(F::WIDTH))
    {
        x.store(lanes);
    }
    for (lane, row) in rows.chunks_exact_mut(n.max(1)).enumerate() {
        for (x, lanes) in row[first..].iter_mut().zip(lanes.chunks_exact(F::WIDTH)) {
            *x = lanes[lane];
        }
    }
}
