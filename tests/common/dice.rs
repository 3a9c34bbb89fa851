//! Chance for tests: throws of a seed, and properties that are tried with many of them.

use super::noise;

/// Throws that a seed determines.
pub struct Dice {
    seed: usize,
    thrown: usize,
}

impl Dice {
    /// The throws of a seed.
    pub fn new(seed: usize) -> Dice {
        Dice { seed, thrown: 0 }
    }

    /// In [-1, 1).
    pub fn number(&mut self) -> f64 {
        self.thrown += 1;
        noise(self.seed, self.thrown)
    }

    /// In [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + 0.5 * (1.0 + self.number()) * (high - low)
    }

    /// In [low, high), each order of magnitude as likely as another.
    pub fn order(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// One of 0 to n - 1.
    pub fn below(&mut self, n: usize) -> usize {
        ((0.5 * (1.0 + self.number()) * n as f64) as usize).min(n - 1)
    }

    /// True in this share of the throws.
    pub fn chance(&mut self, share: f64) -> bool {
        self.between(0.0, 1.0) < share
    }

    /// One of several.
    pub fn pick<T: Clone>(&mut self, of: &[T]) -> T {
        of[self.below(of.len())].clone()
    }

    /// A number per world or column.
    pub fn numbers(&mut self, n: usize, size: f64) -> Vec<f64> {
        (0..n).map(|_| size * self.number()).collect()
    }

    /// Some worlds, at least one.
    pub fn mask(&mut self, worlds: usize) -> Vec<bool> {
        let share = self.pick(&[0.1, 0.5, 0.9]);
        let mut mask: Vec<bool> = (0..worlds).map(|_| self.chance(share)).collect();
        mask[self.below(worlds)] = true;
        mask
    }
}

/// A number that the environment may give.
fn given(variable: &str) -> Option<usize> {
    let text = std::env::var(variable).ok()?;
    let number = text.parse();
    Some(number.unwrap_or_else(|_| panic!("{variable} is `{text}`; give a number")))
}

/// Tries a property with `cases` seeds, or as many as `TIGHTLOOP_CASES` says, from `TIGHTLOOP_SEED` on.
///
/// # Panics
/// With the seeds for which it does not hold, after all were tried.
pub fn for_seeds(cases: usize, property: impl Fn(usize) -> Result<(), String>) {
    let first = given("TIGHTLOOP_SEED").unwrap_or(1);
    let cases = given("TIGHTLOOP_CASES").unwrap_or(cases);
    let mut wrong = Vec::new();
    for seed in first..first + cases {
        // shown where the property itself panics
        println!("seed {seed}");
        wrong.extend(
            property(seed)
                .err()
                .map(|why| format!("TIGHTLOOP_SEED={seed} TIGHTLOOP_CASES=1: {why}")),
        );
    }
    assert!(
        wrong.is_empty(),
        "{} of {cases} cases:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}
