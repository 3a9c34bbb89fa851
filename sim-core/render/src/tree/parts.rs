//! A tree of solids that do not move: which of them a tile, or what is below a light, may meet.

use super::cast::{Origin, ROUNDING, length};
use super::fill::Bundle;
use super::shade::Beam;
use super::{LEAF, Node};
use crate::vector::{Frame, Vector};

/// Boxes around solids in the world.
#[derive(Debug)]
pub(crate) struct PartTree {
    pub(super) nodes: Vec<Node>,
    /// Numbers of solids.
    pub(super) leaves: Vec<Vec<usize>>,
    /// The largest coordinate [m].
    pub(super) reach: f32,
}

impl PartTree {
    /// Rays from here in the world.
    #[inline(always)]
    pub(crate) fn origin_at(&self, pos: Vector) -> Origin {
        Origin {
            pos,
            slack: ROUNDING * (2.0 * length(pos) + 2.0 * self.reach),
        }
    }

    /// How far roundings reach in the frame of a light, in which this is the frame of the world.
    #[inline(always)]
    pub(crate) fn slack_in(&self, frame: &Frame) -> f32 {
        self.origin_at(frame.pos).slack
    }
}

/// A way through a tree, from leaf to leaf.
#[derive(Default)]
pub(crate) struct Walk(Vec<(f32, u32)>);

impl Walk {
    /// From the root.
    #[inline(always)]
    pub(crate) fn start(&mut self) {
        self.0.clear();
        self.0.push((f32::NEG_INFINITY, 0));
    }

    /// The next leaf that a tile may see up to a depth, about the nearest first.
    #[inline(always)]
    pub(crate) fn next_seen<'a>(
        &mut self,
        tree: &'a PartTree,
        bundle: &Bundle,
        farthest: f32,
    ) -> Option<&'a [usize]> {
        while let Some((near, at)) = self.0.pop() {
            if near > farthest {
                continue;
            }
            if at & LEAF != 0 {
                return Some(&tree.leaves[(at & !LEAF) as usize]);
            }
            let node = &tree.nodes[at as usize];
            let (near, mut bits) = bundle.boxes(node, farthest);
            let first = self.0.len();
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & 7;
                bits &= bits - 1;
                self.0.push((near[lane], node.children[lane]));
                // the nearest child ends on top
                let mut place = self.0.len() - 1;
                while place > first && self.0[place - 1].0 < self.0[place].0 {
                    self.0.swap(place - 1, place);
                    place -= 1;
                }
            }
        }
        None
    }

    /// The next leaf that may be over points.
    #[inline(always)]
    pub(crate) fn next_over<'a>(&mut self, tree: &'a PartTree, beam: &Beam) -> Option<&'a [usize]> {
        while let Some((_, at)) = self.0.pop() {
            if at & LEAF != 0 {
                return Some(&tree.leaves[(at & !LEAF) as usize]);
            }
            let node = &tree.nodes[at as usize];
            let mut bits = beam.boxes(node);
            while bits != 0 {
                let lane = bits.trailing_zeros() as usize & 7;
                bits &= bits - 1;
                self.0.push((0.0, node.children[lane]));
            }
        }
        None
    }
}
