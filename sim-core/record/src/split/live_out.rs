//! Live-out analysis: the variables and lists that a piece leaves for others, since they may be read before they are set again.

use super::items::{Item, Pieces};
use super::order::Part;
use std::collections::{BTreeSet, HashMap};

/// What a piece does to variables and lists.
pub(super) struct Names<'a> {
    /// Read, or changed in part: what they were before matters.
    pub loaded: &'a BTreeSet<u32>,
    pub changed: &'a BTreeSet<u32>,
}

/// Names that each piece changes and whose value is used after it.
pub(super) fn live_out(pieces: &Pieces, names: &[Names]) -> Vec<BTreeSet<u32>> {
    let mut paths = Paths {
        pieces,
        next: vec![BTreeSet::new(); names.len()],
        exits: HashMap::new(),
    };
    paths.link(&pieces.order, BTreeSet::new(), 0);
    // names that are used before they start anew, from each piece on
    let mut used: Vec<BTreeSet<u32>> = names.iter().map(|n| n.loaded.clone()).collect();
    let after = |used: &[BTreeSet<u32>], p: usize| -> BTreeSet<u32> {
        let next = paths.next[p].iter();
        next.flat_map(|q| used[*q].iter().copied()).collect()
    };
    loop {
        let mut grown = false;
        for p in (0..names.len()).rev() {
            for name in after(&used, p) {
                let starts = names[p].changed.contains(&name) && !names[p].loaded.contains(&name);
                grown |= !starts && used[p].insert(name);
            }
        }
        if !grown {
            break;
        }
    }
    (0..names.len())
        .map(|p| &after(&used, p) & names[p].changed)
        .collect()
}

/// Which pieces may come after which.
struct Paths<'a> {
    pieces: &'a Pieces,
    next: Vec<BTreeSet<usize>>,
    /// What comes after a region.
    exits: HashMap<usize, BTreeSet<usize>>,
}

impl Paths<'_> {
    /// Links parts, `depth` regions deep, before what comes `after` them; returns the pieces that may come first.
    fn link(&mut self, parts: &[Part], after: BTreeSet<usize>, depth: usize) -> BTreeSet<usize> {
        let mut next = after;
        for part in parts.iter().rev() {
            next = match part {
                Part::Kernel(p) => {
                    for item in &self.pieces.pieces[*p].items {
                        if let Item::Leave(region, _) = item {
                            let exits = self.exits[region].clone();
                            self.next[*p].extend(exits);
                        }
                    }
                    self.next[*p].extend(&next);
                    BTreeSet::from([*p])
                }
                Part::Repeat { parts, .. } => {
                    if let Some(region) = first(parts).and_then(|p| self.region(p, depth)) {
                        self.exits.insert(region, next.clone());
                    }
                    // the last piece of an iteration is followed by the first of the next one
                    let again = first(parts);
                    let after = next.iter().copied().chain(again).collect();
                    // a world may pass the region by
                    &self.link(parts, after, depth + 1) | &next
                }
            };
        }
        next
    }

    fn region(&self, piece: usize, depth: usize) -> Option<usize> {
        self.pieces.pieces[piece].regions.get(depth).copied()
    }
}

/// The first kernel of parts: every region begins with one, which enters what comes after it.
fn first(parts: &[Part]) -> Option<usize> {
    match parts.first()? {
        Part::Kernel(p) => Some(*p),
        Part::Repeat { parts, .. } => first(parts),
    }
}
