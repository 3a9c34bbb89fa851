//! Pairs of shapes by their kinds, and blocks of them that a GPU tests together.

use super::contact::{Contacts, Kind};
use std::ops::Range;

/// Pairs of a block.
pub const BLOCK: usize = 8;

/// Pairs of two kinds of shapes.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// The lower kind first.
    pub kinds: (Kind, Kind),
    /// Its first pair.
    pub first: usize,
    /// The pair after its last.
    pub end: usize,
}

impl Group {
    /// How many blocks its pairs make: none of a few pairs, where a block costs more than it saves.
    pub fn blocks(&self) -> usize {
        match self.end - self.first {
            ..=BLOCK => 0,
            pairs => pairs.div_ceil(BLOCK),
        }
    }
}

impl<R> Contacts<R> {
    /// The pairs of two kinds.
    #[inline(always)]
    pub fn group(&self, kinds: (Kind, Kind)) -> Option<&Group> {
        self.groups.iter().find(|group| group.kinds == kinds)
    }

    /// The blocks of a group, as rows of `pair_blocks`; empty where its pairs are tested one by one.
    pub fn blocks(&self, kinds: (Kind, Kind)) -> Range<usize> {
        let before = self.groups.iter().take_while(|group| group.kinds != kinds);
        let first = before.map(Group::blocks).sum();
        first..first + self.group(kinds).map_or(0, Group::blocks)
    }
}
