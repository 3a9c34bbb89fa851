//! Moves worlds from lanes of one block to lanes of another.

use sim_physics::arrays::{Array, Block, Flat};
use sim_physics::constants::Constants;
use sim_physics::constants::contact::{Class, row, turning};
use sim_physics::lane::{Lane, Real};
use std::ops::Range;

/// Lanes of the widest register.
pub(super) const WIDEST: usize = 16;

/// Lanes of a block, and where they go.
pub(super) struct Move<F: Lane> {
    /// For each lane of the target, the lane that it takes.
    from: [u32; WIDEST],
    /// The lanes of the target that take one.
    to: F::Mask,
}

impl<F: Lane> Move<F> {
    /// Pairs of lanes: from which, and to which.
    #[inline(always)]
    pub fn new(pairs: impl Iterator<Item = (usize, usize)>) -> Move<F> {
        const { assert!(F::WIDTH <= WIDEST) };
        let mut from = [0; WIDEST];
        let mut taken = [0_u32; WIDEST];
        for (source, target) in pairs {
            from[target] = source as u32;
            taken[target] = 1;
        }
        let mut lanes = [F::Real::default(); WIDEST];
        for (lane, taken) in lanes.iter_mut().zip(taken) {
            *lane = F::Real::from_f64(f64::from(taken));
        }
        Move {
            from,
            to: F::c(0.5).lt(F::load(&lanes)),
        }
    }

    #[inline(always)]
    fn cells(&self, source: &[F], target: &mut [F]) {
        F::take_lanes(target, source, &self.from, self.to);
    }

    /// Arrays of a block.
    #[inline(always)]
    pub fn arrays(&self, source: &Block<F, F>, target: &mut Block<F, F>, arrays: &[Array]) {
        for &array in arrays {
            let (Flat::Cells(from) | Flat::Values(from)) = source.array(array);
            let (Flat::Cells(to) | Flat::Values(to)) = target.array_mut(array);
            self.cells(from, to);
        }
    }

    /// The rows of contacts, as the solver reads them.
    #[inline(always)]
    pub fn contacts(&self, m: &Constants<F::Real>, source: &[F], target: &mut [F]) {
        let memory = &m.contacts.memory;
        for (k, class) in m.contacts.classes.iter().enumerate() {
            let at = memory.counts.base + k * memory.counts.stride;
            self.cells(&source[at..at + 1], &mut target[at..at + 1]);
            let count = F::select(self.to, target[at], F::c(0.0));
            let parts = solved_parts(class);
            for r in 0..class.capacity {
                if !F::any(F::c(r as f64 + 0.5).lt(count)) {
                    break;
                }
                let first = memory.rows.base + (class.first + r) * memory.rows.stride;
                for part in parts.clone() {
                    let cells = first + part.start..first + part.end;
                    self.cells(&source[cells.clone()], &mut target[cells]);
                }
            }
        }
    }
}

/// The parts of a contact's row that an iteration reads before it writes them.
#[inline(always)]
fn solved_parts<R>(class: &Class<R>) -> [Range<usize>; 4] {
    let columns = 3 * class.columns.len();
    let block = class
        .turns
        .map_or(0..0, |block| block..block + turning::JACOBIAN + columns);
    [
        row::STIFFNESS..row::JAR,
        row::SOFT..row::STATE + 1,
        row::SQUARES..row::JACOBIAN + columns,
        block,
    ]
}

/// Sets the Jacobians of contacts that some worlds of a block lack to -0 there, as [`sim_physics::lane::Cx::or_nothing`] does: sums
/// over contacts rely on it.
#[inline(always)]
pub(super) fn clear_absent_rows<F: Lane>(m: &Constants<F::Real>, memory: &mut [F]) {
    let t = &m.contacts.memory;
    for (k, class) in m.contacts.classes.iter().enumerate() {
        let count = memory[t.counts.base + k * t.counts.stride];
        let columns = 3 * class.columns.len();
        for r in 0..class.capacity {
            let has = F::c(r as f64 + 0.5).lt(count);
            if !F::any(has) {
                break;
            }
            if !F::any(!has) {
                continue;
            }
            let first = t.rows.base + (class.first + r) * t.rows.stride;
            let second = class.turns.map(|block| block + turning::JACOBIAN);
            for place in [Some(row::JACOBIAN), second].into_iter().flatten() {
                for cell in &mut memory[first + place..first + place + columns] {
                    *cell = F::select(has, *cell, F::c(-0.0));
                }
            }
        }
    }
}
