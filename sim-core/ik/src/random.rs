//! Counted random numbers: each is a function of seed, problem, attempt and index, so it does not depend on lanes or threads.
//!
//! The counter goes through the finalizer of SplitMix64 (Steele, Lea, Flood, "Fast splittable pseudorandom number generators",
//! OOPSLA 2014), once for each part of it.

use std::f64::consts::TAU;

/// Odd number next to 2⁶⁴ over the golden ratio: the increment of SplitMix64.
const INCREMENT: u64 = 0x9e37_79b9_7f4a_7c15;

/// The numbers of one attempt.
pub struct Draws {
    state: u64,
}

impl Draws {
    /// The numbers of an attempt at a problem.
    pub fn new(seed: u64, problem: u64, attempt: u64) -> Draws {
        Draws {
            state: mixed(mixed(mixed(seed) ^ problem) ^ attempt),
        }
    }

    /// The next number, uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.state = self.state.wrapping_add(INCREMENT);
        // 53 bits fill a double
        (mixed(self.state) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The next number, uniform between two others.
    pub fn between(&mut self, [lower, upper]: [f64; 2]) -> f64 {
        let unit = self.unit();
        (lower + (upper - lower) * unit).clamp(lower, upper)
    }

    /// A rotation, uniform among all (Shoemake, "Uniform random rotations", Graphics Gems III, 1992): (x, y, z, w).
    pub fn rotation(&mut self) -> [f64; 4] {
        let [u, a, b] = [self.unit(), self.unit() * TAU, self.unit() * TAU];
        let (near, far) = ((1.0 - u).sqrt(), u.sqrt());
        [near * a.sin(), near * a.cos(), far * b.sin(), far * b.cos()]
    }
}

fn mixed(x: u64) -> u64 {
    let mut z = x.wrapping_add(INCREMENT);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_fill_their_range_evenly() {
        let mut counts = [0u32; 10];
        let mut draws = Draws::new(3, 5, 7);
        for _ in 0..100_000 {
            counts[(draws.between([-1.0, 1.0]) * 5.0 + 5.0) as usize] += 1;
        }
        // five standard deviations of a count of 10,000
        assert!(
            counts.iter().all(|count| count.abs_diff(10_000) < 475),
            "{counts:?}"
        );
    }

    #[test]
    fn every_part_of_the_counter_matters() {
        let first = |seed, problem, attempt| Draws::new(seed, problem, attempt).unit();
        let all = [
            first(0, 0, 0),
            first(1, 0, 0),
            first(0, 1, 0),
            first(0, 0, 1),
        ];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b), "{all:?}");
        }
    }
}
