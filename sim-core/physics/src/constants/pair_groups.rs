//! Kinds of shapes, pairs of shapes by their kinds, and blocks of them that a GPU tests together.

use super::contact::Contacts;
use std::ops::Range;

/// Kinds of shapes; of a pair, the lower kind is the first. A sphere's size is its radius; a capsule's and a
/// cylinder's radius and half height; a box's and a hull's half extents (those of the box around it); an ellipsoid's radii.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// z ≤ 0.
    Plane,
    /// A row of the table of height fields; always static.
    Field,
    /// Around its centre.
    Sphere,
    /// Along z.
    Capsule,
    /// Along its axes.
    Box,
    /// Along z.
    Cylinder,
    /// About its centre, with radii along its axes.
    Ellipsoid,
    /// A row of the hull table.
    Hull,
}

/// Pairs of kinds that can touch, height fields left out, in the order of their stages.
pub const PAIR_KINDS: [(Kind, Kind); 27] = {
    use Kind::*;
    [
        (Plane, Sphere),
        (Plane, Capsule),
        (Plane, Box),
        (Plane, Cylinder),
        (Plane, Ellipsoid),
        (Plane, Hull),
        (Sphere, Sphere),
        (Sphere, Capsule),
        (Sphere, Box),
        (Sphere, Cylinder),
        (Sphere, Ellipsoid),
        (Sphere, Hull),
        (Capsule, Capsule),
        (Capsule, Box),
        (Capsule, Cylinder),
        (Capsule, Ellipsoid),
        (Capsule, Hull),
        (Box, Box),
        (Box, Cylinder),
        (Box, Ellipsoid),
        (Box, Hull),
        (Cylinder, Cylinder),
        (Cylinder, Ellipsoid),
        (Cylinder, Hull),
        (Ellipsoid, Ellipsoid),
        (Ellipsoid, Hull),
        (Hull, Hull),
    ]
};

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
