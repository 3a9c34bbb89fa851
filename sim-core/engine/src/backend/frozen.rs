//! Counts of frozen worlds, for people.

/// Worlds that were frozen since the last report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Frozen {
    /// Worlds that were not finite.
    pub not_finite: u64,
    /// Worlds beyond the bounds of the run.
    pub out_of_bounds: u64,
    /// The first of them.
    pub first: Option<FirstFrozen>,
    /// Worlds that are frozen now, if any was frozen since the last report.
    pub now: usize,
}

/// A world that was frozen. The first one has the lowest frame, then the lowest world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FirstFrozen {
    /// Control frame of the run.
    pub frame: u64,
    /// The world.
    pub world: usize,
    /// Its control frames since its reset, all without a fault.
    pub steps: u64,
    /// Whether it was finite, but beyond the bounds.
    pub is_finite: bool,
}

impl Frozen {
    /// Counts a world.
    pub(super) fn count(&mut self, world: FirstFrozen) {
        match world.is_finite {
            true => self.out_of_bounds += 1,
            false => self.not_finite += 1,
        }
        self.keep_first(world);
    }

    /// Adds the counts of other worlds.
    pub(super) fn join(&mut self, others: Frozen) {
        self.not_finite += others.not_finite;
        self.out_of_bounds += others.out_of_bounds;
        others
            .first
            .into_iter()
            .for_each(|world| self.keep_first(world));
    }

    fn keep_first(&mut self, world: FirstFrozen) {
        self.first = Some(self.first.map_or(world, |first| first.min(world)));
    }
}
