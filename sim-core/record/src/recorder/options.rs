//! Options of a recording.

use crate::recorder::Recorder;
use crate::recorder::state::with;
use std::panic::Location;

impl Recorder {
    /// Has so many threads share the work of a world, a power of two up to 32. Call it before
    /// code that asks for its lanes.
    ///
    /// # Panics
    /// If it is another number.
    #[track_caller]
    pub fn set_lanes(&mut self, lanes: usize) {
        assert!(
            lanes.is_power_of_two() && lanes <= 32,
            "lanes are added in pairs"
        );
        with(Location::caller(), |s| s.lanes = lanes);
    }

    /// Has the solver add stiff contacts to factors, as on the CPU. Call it before code of the solver.
    #[track_caller]
    pub fn update_factors(&mut self) {
        with(Location::caller(), |s| s.updates_factors = true);
    }

    /// What is recorded from now on belongs to this part of the code, such as a stage: see [`Origin`](crate::Origin).
    #[track_caller]
    pub fn begin_part(&mut self, name: &'static str) {
        with(Location::caller(), |s| s.part = name);
    }

    /// From now on, whatever the code asks about outside of blocks and loops ([`Cx::anywhere`]) holds in no world: the
    /// recording is good where [`Recording::assumed`] holds nowhere.
    ///
    /// [`Recording::assumed`]: crate::Recording::assumed
    #[track_caller]
    pub fn assume_nowhere(&mut self) {
        with(Location::caller(), |s| s.assumes = true);
    }
}
