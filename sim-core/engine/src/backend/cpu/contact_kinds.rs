//! Kinds of worlds by their contacts: what a block of worlds has in common.
//!
//! A block visits every contact that any of its worlds has. Whether a world has at least so many contacts of a class is a
//! bit of its kind. There are many such bits, so a kind has those that tell most worlds apart, weighed by what a contact of the
//! class costs; the other classes share a few lower bits. Which ones these are is counted anew from time to time, since robots
//! fall and stand up.

/// The bits of a kind.
pub(super) type Kind = u16;
/// Bits that stand for a class and a count of their own: 4096 worlds of 8 lanes are as many blocks as these tell apart.
const OWN: usize = 9;
/// Lower bits, each of which is set by any of several classes.
const SHARED: usize = 3;
/// Number of different kinds.
pub(super) const KINDS: usize = 1 << (OWN + SHARED);
/// Contacts of a class that are distinguished: none, one, …, this many or more.
const LEVELS: usize = 4;
/// Control frames after which the bits are chosen anew; sooner after the start, when robots fall.
const PERIOD: u64 = 32;

/// Whether a world has at least `level` + 1 contacts of a class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bit {
    pub class: usize,
    pub level: usize,
}

impl Bit {
    /// The bit with this place in the counts.
    fn from_place(place: usize) -> Bit {
        let (class, level) = (place / LEVELS, place % LEVELS);
        Bit { class, level }
    }

    /// A count above which it is set [–].
    pub fn threshold(self) -> f64 {
        self.level as f64 + 0.5
    }
}

/// The bits of kinds, and the counts that they are chosen by.
pub(super) struct ContactKinds {
    /// What sets a bit, and the bit.
    bits: Vec<(Bit, Kind)>,
    /// Worlds in which a bit would be set. `(classes, LEVELS)`
    counts: Vec<u32>,
    /// Worlds that were counted.
    worlds: u32,
    /// Scratch: what a bit is worth, and its place in the counts.
    scores: Vec<(f64, usize)>,
}

impl ContactKinds {
    /// Of a model with so many contact classes.
    pub fn new(classes: usize) -> ContactKinds {
        let places = classes * LEVELS;
        ContactKinds {
            bits: Vec::with_capacity(places),
            counts: vec![0; places],
            worlds: 0,
            scores: Vec::with_capacity(places),
        }
    }

    /// Is it time to count?
    pub fn is_due(frame: u64) -> bool {
        frame.is_power_of_two() || frame.is_multiple_of(PERIOD)
    }

    /// What sets a bit, and the bit.
    pub fn bits(&self) -> &[(Bit, Kind)] {
        &self.bits
    }

    /// Counts the worlds of a block; `set` says in how many of them a bit is set.
    pub fn count(&mut self, worlds: usize, set: impl Fn(Bit) -> u32) {
        for (k, count) in self.counts.iter_mut().enumerate() {
            *count += set(Bit::from_place(k));
        }
        self.worlds += worlds as u32;
    }

    /// Chooses the bits by what was counted and what a contact of a class costs, and forgets the counts. Of equal bits the
    /// first is taken.
    pub fn choose(&mut self, cost: impl Fn(usize) -> usize) {
        let worlds = f64::from(std::mem::take(&mut self.worlds).max(1));
        self.scores.clear();
        for (k, count) in self.counts.iter_mut().enumerate() {
            let share = f64::from(std::mem::take(count)) / worlds;
            let worth = share * (1.0 - share) * cost(k / LEVELS) as f64;
            self.scores.push((worth, k));
        }
        self.scores.retain(|(score, _)| *score > 0.0);
        // a stable sort would allocate
        self.scores
            .sort_unstable_by(|(score, k), (other, l)| other.total_cmp(score).then(k.cmp(l)));
        self.bits.clear();
        let ranked = self.scores.iter().map(|(_, k)| Bit::from_place(*k));
        let unshared = (0..OWN).map(|place| 1 << (SHARED + OWN - 1 - place));
        self.bits.extend(ranked.clone().zip(unshared));
        let others = ranked.skip(OWN).filter(|bit| bit.level == 0);
        let shared = (0..SHARED).cycle().map(|place| 1 << place);
        self.bits.extend(others.zip(shared));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bits after a frame of 8 worlds, in which `counts[world][class]` contacts were found.
    fn bits_of(counts: &[[usize; 12]; 8]) -> Vec<(Bit, Kind)> {
        let mut kinds = ContactKinds::new(12);
        kinds.count(8, |bit| {
            let has = |world: &&[usize; 12]| world[bit.class] > bit.level;
            counts.iter().filter(has).count() as u32
        });
        kinds.choose(|class| if class == 3 { 2 } else { 1 });
        kinds.bits().to_vec()
    }

    #[test]
    fn the_highest_bit_is_what_tells_most_worlds_apart() {
        let mut counts = [[0; 12]; 8];
        for (world, counts) in counts.iter_mut().enumerate() {
            counts[0] = 1; // all worlds have it
            counts[5] = usize::from(world == 0);
            counts[7] = 2 * usize::from(world < 4);
        }
        let bits = bits_of(&counts);
        let ranked: Vec<_> = bits.iter().map(|(bit, _)| (bit.class, bit.level)).collect();
        assert_eq!(ranked, [(7, 0), (7, 1), (5, 0)]);
        assert_eq!(bits[0].1, KINDS as Kind / 2);
    }

    #[test]
    fn a_contact_that_costs_more_counts_for_more() {
        let mut counts = [[0; 12]; 8];
        counts[0] = [1; 12];
        assert_eq!(bits_of(&counts)[0].0, Bit { class: 3, level: 0 });
    }

    #[test]
    fn classes_without_a_bit_of_their_own_share_the_lowest() {
        let mut counts = [[0; 12]; 8];
        counts[0] = [1; 12];
        let bits = bits_of(&counts);
        assert_eq!(bits.len(), 12);
        let shared: Vec<Kind> = bits[OWN..].iter().map(|(_, bit)| *bit).collect();
        assert_eq!(shared, [1, 2, 4]);
        let unshared: Kind = bits[..OWN].iter().map(|(_, bit)| bit).sum();
        assert_eq!(usize::from(unshared), KINDS - 8);
    }
}
