//! Lane assignment: which lane of which block holds a world.
//!
//! A block iterates until few of its worlds are left, and visits every contact that any of its worlds has. So worlds of the same kind
//! (`contact_kinds`) share a block: after each frame a chunk sorts its worlds by the contacts of the last substep (`regroup`).
//! No value of a world depends on its lane or its neighbours.

use super::contact_kinds::Kind;
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
    /// Scratch: the kinds that worlds have, in order.
    distinct: Vec<Kind>,
    /// Scratch: the place there of the kind of each world.
    places: Vec<usize>,
    /// Scratch: for each of them, its lanes that are still to be examined.
    ranges: Vec<Range<usize>>,
}

impl LaneAssignment {
    /// World k in lane k.
    pub fn new(worlds: usize, lanes: usize) -> LaneAssignment {
        LaneAssignment {
            lane: (0..lanes).collect(),
            world: (0..lanes).collect(),
            kinds: vec![0; worlds],
            changed: false,
            distinct: Vec::with_capacity(worlds),
            places: vec![0; worlds],
            ranges: Vec::with_capacity(worlds),
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
        self.distinct.clear();
        self.distinct.extend_from_slice(&self.kinds);
        self.distinct.sort_unstable();
        self.ranges.clear();
        for (lane, kind) in self.distinct.iter().enumerate() {
            match self.ranges.last_mut() {
                Some(range) if self.distinct[range.start] == *kind => range.end = lane + 1,
                _ => self.ranges.push(lane..lane + 1),
            }
        }
        self.distinct.dedup();
        for (place, kind) in self.places.iter_mut().zip(&self.kinds) {
            let place_of_kind = self.distinct.binary_search(kind);
            *place = place_of_kind.expect("it is one of them");
        }
        for kind in 0..self.ranges.len() {
            while !self.ranges[kind].is_empty() {
                let lane = self.ranges[kind].start;
                let kind_here = self.places[self.world[lane]];
                if kind_here == kind {
                    self.ranges[kind].start += 1;
                    continue;
                }
                // there is one, since each kind has as many lanes as worlds
                while self.places[self.world[self.ranges[kind_here].start]] == kind_here {
                    self.ranges[kind_here].start += 1;
                }
                let other = self.ranges[kind_here].start;
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
