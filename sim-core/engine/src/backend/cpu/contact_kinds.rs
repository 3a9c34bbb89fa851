//! Kinds of worlds by their contacts: what a block of worlds has in common.
//!
//! A block visits every contact that any of its worlds has. Whether a world has at least so many contacts of a class is a
//! bit of its kind. Worlds are sorted by their kinds, so each bit saves visits of blocks without it:
//!
//! ```text
//! (1 - (1 - p)^W - p) c        of a bit that is set in the share p of the worlds
//! ```
//!
//! with W lanes in a block and the cost c of a contact of the class. Most contacts of a robot with itself are rare; a block of
//! worlds in any order has many such classes, each in one or two lanes. So the bits that save most are kept, and rare ones are
//! the higher ones: the few worlds that have them stand together, and the others are sorted by the rest. What the bits are is
//! counted anew from time to time, since robots fall and stand up.

/// The bits of a kind.
pub(super) type Kind = u64;
/// Set where contacts couple what the mass matrix does not: a block of which one world has such a contact solves a larger system.
pub(super) const COUPLED: Kind = 1 << (OWN + SHARED);
/// Bits that stand for a class and a count of their own.
const OWN: usize = 60;
/// Lower bits, each of which is set by any of several classes.
const SHARED: usize = 3;
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
    /// Scratch: the bits that may be chosen.
    scores: Vec<Score>,
}

/// What a bit is worth.
struct Score {
    worth: f64,
    /// Share of the worlds that have it [–].
    share: f64,
    /// Its place in the counts.
    place: usize,
}

impl Score {
    fn bit(&self) -> Bit {
        Bit::from_place(self.place)
    }
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

    /// Chooses the bits by what was counted, by the lanes of a block and by what a contact of a class costs, and forgets the counts.
    /// Of equal bits the first is taken.
    pub fn choose(&mut self, lanes: usize, cost: impl Fn(usize) -> usize) {
        let worlds = f64::from(std::mem::take(&mut self.worlds).max(1));
        self.scores.clear();
        for (k, count) in self.counts.iter_mut().enumerate() {
            let share = f64::from(std::mem::take(count)) / worlds;
            let saved = 1.0 - (1.0 - share).powi(lanes as i32) - share;
            let worth = saved * cost(k / LEVELS) as f64;
            self.scores.push(Score {
                worth,
                share,
                place: k,
            });
        }
        self.scores.retain(|score| score.worth > 0.0);
        // a stable sort would allocate
        (self.scores)
            .sort_unstable_by(|a, b| b.worth.total_cmp(&a.worth).then(a.place.cmp(&b.place)));
        let chosen = self.scores.len().min(OWN);
        let (own, others) = self.scores.split_at_mut(chosen);
        own.sort_unstable_by(|a, b| a.share.total_cmp(&b.share).then(a.place.cmp(&b.place)));
        self.bits.clear();
        let unshared = (0..OWN).map(|place| 1 << (SHARED + OWN - 1 - place));
        self.bits.extend(own.iter().map(Score::bit).zip(unshared));
        let others = others.iter().map(Score::bit).filter(|bit| bit.level == 0);
        let shared = (0..SHARED).cycle().map(|place| 1 << place);
        self.bits.extend(others.zip(shared));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Classes of the tests.
    const CLASSES: usize = 70;

    /// Bits after a frame of 64 worlds in blocks of 8, in which `contacts(world, class)` contacts were found.
    fn bits_of(contacts: impl Fn(usize, usize) -> usize) -> Vec<(Bit, Kind)> {
        let mut kinds = ContactKinds::new(CLASSES);
        kinds.count(64, |bit| {
            let has = |&world: &usize| contacts(world, bit.class) > bit.level;
            (0..64).filter(has).count() as u32
        });
        kinds.choose(8, |class| if class == 3 { 2 } else { 1 });
        kinds.bits().to_vec()
    }

    #[test]
    fn the_highest_bits_are_those_of_few_worlds() {
        let bits = bits_of(|world, class| match class {
            0 => 1, // all worlds have it
            5 => usize::from(world == 0),
            7 => 2 * usize::from(world < 32),
            _ => 0,
        });
        let classes: Vec<_> = bits.iter().map(|(bit, _)| (bit.class, bit.level)).collect();
        assert_eq!(classes, [(5, 0), (7, 0), (7, 1)]);
        assert_eq!(bits[0].1, COUPLED / 2);
    }

    #[test]
    fn bits_that_save_less_share_the_lowest() {
        // each class in one world; a contact of class 3 costs more
        let bits = bits_of(|world, class| usize::from(class % 64 == world));
        assert_eq!(bits.len(), CLASSES);
        let mut unshared = bits[..OWN].iter();
        assert!(unshared.any(|(bit, _)| bit.class == 3));
        let shared: Vec<Kind> = bits[OWN..].iter().map(|(_, bit)| *bit).collect();
        assert_eq!(shared[..4], [1, 2, 4, 1]);
        let unshared: Kind = bits[..OWN].iter().map(|(_, bit)| bit).sum();
        assert_eq!(unshared, COUPLED - 8);
    }
}
