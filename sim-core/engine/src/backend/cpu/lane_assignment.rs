//! Lane assignment: which lane of which block holds a world.
//!
//! A block takes as long as its slowest world, and visits every contact that any of its worlds has. So worlds of the same kind
//! (`contact_kinds`) share a block: after each frame a chunk sorts its worlds by the contacts of the last substep (`regroup`).
//! No value of a world depends on its lane or its neighbours.

use super::contact_kinds::{KINDS, Kind};
use std::ops::Range;

/// Lanes of a chunk, counted from its first block.
pub(super) struct LaneAssignment {
    /// The lane of each world. Lanes past the last world map to themselves.
    lane: Vec<usize>,
    /// The world in each lane.
    world: Vec<usize>,
    /// The kind of each world.
    kinds: Vec<Kind>,
    /// Whether the kind of a world changed since the last assignment.
    changed: bool,
}

impl LaneAssignment {
    /// World k in lane k.
    pub fn new(worlds: usize, lanes: usize) -> LaneAssignment {
        LaneAssignment {
            lane: (0..lanes).collect(),
            world: (0..lanes).collect(),
            kinds: vec![0; worlds],
            changed: false,
        }
    }

    /// The lane of a world, which is counted from the chunk's first.
    #[inline(always)]
    pub fn lane(&self, world: usize) -> usize {
        self.lane[world]
    }

    /// The world in a lane.
    #[inline(always)]
    pub fn world(&self, lane: usize) -> usize {
        self.world[lane]
    }

    /// Whether each of some lanes has a world, which is in that lane alone, as in a permutation.
    #[inline(always)]
    pub fn is_one_to_one(&self, mut lanes: Range<usize>) -> bool {
        let worlds = self.kinds.len();
        lanes.all(|lane| self.lane[..worlds].get(self.world[lane]) == Some(&lane))
    }

    /// The worlds of some lanes, if they are consecutive.
    pub fn consecutive(&self, lanes: Range<usize>) -> Option<Range<usize>> {
        let worlds = &self.world[lanes];
        let &first = worlds.first()?;
        let follows = worlds.iter().zip(first..).all(|(&world, k)| world == k);
        follows.then(|| first..first + worlds.len())
    }

    /// Sets the kind of a world.
    pub fn note(&mut self, world: usize, kind: Kind) {
        self.changed |= self.kinds[world] != kind;
        self.kinds[world] = kind;
    }

    /// Assigns neighbouring lanes to worlds of the same kind. Calls `swap` for each pair of lanes that exchange worlds.
    ///
    /// A world that is in the range of its kind already stays there.
    pub fn group(&mut self, mut swap: impl FnMut(usize, usize)) {
        if !std::mem::take(&mut self.changed) {
            return;
        }
        let mut ends = [0_usize; KINDS];
        for &kind in &self.kinds {
            ends[usize::from(kind)] += 1;
        }
        // the next lane of each kind to examine
        let mut next = [0; KINDS];
        let mut lanes = 0;
        for (next, end) in next.iter_mut().zip(&mut ends) {
            *next = lanes;
            lanes += *end;
            *end = lanes;
        }
        for kind in 0..KINDS {
            while next[kind] < ends[kind] {
                let lane = next[kind];
                let kind_here = usize::from(self.kinds[self.world[lane]]);
                if kind_here == kind {
                    next[kind] += 1;
                    continue;
                }
                // there is one, since each kind has as many lanes as worlds
                while usize::from(self.kinds[self.world[next[kind_here]]]) == kind_here {
                    next[kind_here] += 1;
                }
                let other = next[kind_here];
                self.world.swap(lane, other);
                self.lane[self.world[lane]] = lane;
                self.lane[self.world[other]] = other;
                swap(lane, other);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_grouped_assignment_is_one_to_one_and_a_damaged_one_is_not() {
        let mut assignment = LaneAssignment::new(13, 16);
        for world in 0..13 {
            assignment.note(world, (world * 7 % 3) as Kind);
        }
        assignment.group(|_, _| {});
        assert!(assignment.is_one_to_one(0..13));
        assert!(!assignment.is_one_to_one(12..14), "lane 13 has no world");
        assert_ne!(assignment.world, (0..16).collect::<Vec<_>>());
        // two lanes of one world
        assignment.world[4] = assignment.world[9];
        assert!(!assignment.is_one_to_one(0..8));
        assert!(assignment.is_one_to_one(8..13));
        assignment.world[4] = usize::MAX;
        assert!(!assignment.is_one_to_one(0..8));
    }
}
