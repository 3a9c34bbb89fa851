//! Faults of worlds: reported in `status`; a faulted world keeps the state before the frame.

use super::chunk::{Chunk, Job};
use crate::backend::state::{RECORD, Shape, is_motion};
use crate::backend::{FirstFrozen, Frozen};
use sim_physics::arrays::Flat;
use sim_physics::arrays::status;
use sim_physics::lane::{Lane, Real};
use std::ops::Range;

/// Least square of a quaternion that is still a rotation: steps keep it at 1 to the last bits [–].
const UNIT_LEAST: f64 = 0.5;

impl<F: Lane> Chunk<F> {
    /// Counts a frame and records the faults in it. `state` is the block's before the frame.
    ///
    /// A world faults when a value is not finite, a quaternion has lost its length, or a value is beyond the bounds of the run. The
    /// backend freezes it: the world returns to that state, and its step counter stands still until it is reset.
    #[inline(always)]
    pub(super) fn note_faults(&mut self, job: &Job<F>, block: usize, state: Range<usize>) {
        let (zero, infinity) = (F::c(0.0), F::c(f64::INFINITY));
        let (lost, beyond) = (
            F::c(f64::from(status::NOT_FINITE)),
            F::c(f64::from(status::OUT_OF_BOUNDS)),
        );
        let (mut fault, mut outside) = (zero, zero);
        for (group, bound) in [
            (&self.block.joint_q, job.faults.joint_q_max),
            (&self.block.joint_qd, job.faults.joint_qd_max),
        ] {
            let bound = F::c(bound);
            for x in group {
                // false for NaN too
                fault = F::select(x.abs().lt(infinity), fault, lost);
                outside = F::select(bound.lt(x.abs()), beyond, outside);
            }
        }
        // a rotation that overflows leaves a quaternion of zeros
        for first in job.constants.quaternions() {
            let parts = self.block.joint_q[first..first + 4].iter();
            let square = parts.fold(zero, |sum, &x| x.fma(x, sum));
            fault = F::select(F::c(UNIT_LEAST).lt(square), fault, lost);
        }
        self.flag(block, self.block.unconverged[0], status::NOT_CONVERGED);
        F::select(zero.lt(fault), fault, outside).store(&mut self.lanes);
        let mut frozen = false;
        for (lane, place) in self.lanes_of(block).enumerate() {
            let world = self.assignment.world(place);
            let fault_bits = self.lanes[lane].to_usize() as u32;
            let fault = if self.is_frozen(world) {
                self.status[world]
            } else {
                fault_bits
            };
            if fault & status::FROZEN != 0 {
                if !self.is_frozen(world) {
                    self.count_frozen(world, fault);
                }
                self.status[world] = fault;
                self.lanes[lane] = F::Real::from_f64(1.0);
                frozen = true;
            } else {
                self.steps[world] += 1;
            }
        }
        if frozen {
            self.put_back(job.shape, state);
        }
    }

    /// Freezes the worlds that are not marked, for a command that is not finite.
    pub fn freeze_others(&mut self, good: &[bool]) {
        for world in 0..self.worlds.len() {
            if !good[self.worlds.start + world] && !self.is_frozen(world) {
                self.count_frozen(world, status::NOT_FINITE);
                self.status[world] = status::NOT_FINITE;
            }
        }
    }

    /// Counts a world that has just been frozen.
    #[cold]
    fn count_frozen(&mut self, world: usize, fault: u32) {
        let first = FirstFrozen {
            frame: self.frames,
            world: self.worlds.start + world,
            steps: self.steps[world],
            is_finite: fault & status::NOT_FINITE == 0,
        };
        self.frozen.count(first);
    }

    /// The worlds that were frozen since the last call.
    pub fn take_frozen(&mut self) -> Frozen {
        std::mem::take(&mut self.frozen)
    }

    /// Number of frozen worlds.
    pub fn frozen_now(&self) -> usize {
        let worlds = 0..self.worlds.len();
        worlds.filter(|&world| self.is_frozen(world)).count()
    }

    /// Resets the faulted worlds: their next episode begins.
    pub(super) fn reset_frozen(&mut self, job: &Job<F>) {
        for world in 0..self.worlds.len() {
            if self.is_frozen(world) {
                self.begin_next(job, world);
            }
        }
    }

    /// Restores the state of the worlds whose `lanes` are above 0.
    #[inline(always)]
    fn put_back(&mut self, shape: Shape, state: Range<usize>) {
        let frozen = F::c(0.5).lt(F::load(&self.lanes));
        for array in RECORD.into_iter().filter(is_motion) {
            let first = state.start + shape.start(array) * F::WIDTH;
            let from = self.state[first..].chunks_exact(F::WIDTH);
            let (Flat::Cells(x) | Flat::Values(x)) = self.block.array_mut(array);
            for (x, from) in x.iter_mut().zip(from) {
                *x = F::select(frozen, F::load(from), *x);
            }
        }
    }

    /// Records the contacts that did not fit in a substep, or in the state that is evaluated.
    #[inline(always)]
    pub(super) fn count_left_out(&mut self, block: usize) {
        let left_out = self.block.left_out[0];
        self.flag(block, left_out, status::CONTACTS_LEFT_OUT);
        left_out.store(&mut self.lanes);
        for (lane, place) in self.lanes_of(block).enumerate() {
            let world = self.assignment.world(place);
            let count = self.lanes[lane].to_usize() as u32;
            self.left_out[world] = if self.is_frozen(world) { 0 } else { count };
        }
    }

    /// Sets a bit of the status where a value is above 0, and clears it elsewhere. A frozen world reports no other fault.
    #[inline(always)]
    fn flag(&mut self, block: usize, value: F, bit: u32) {
        value.store(&mut self.lanes);
        for (lane, place) in self.lanes_of(block).enumerate() {
            let world = self.assignment.world(place);
            let is_set = self.lanes[lane] > F::Real::default() && !self.is_frozen(world);
            let status = &mut self.status[world];
            *status = if is_set {
                *status | bit
            } else {
                *status & !bit
            };
        }
    }

    #[inline(always)]
    fn is_frozen(&self, world: usize) -> bool {
        self.status[world] & status::FROZEN != 0
    }
}
