//! What steps took and did, by stage: for benchmarks.

use sim_physics::step::StageId;

/// Counts of whole numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Histogram {
    counts: Vec<u64>,
}

impl Histogram {
    /// Counts a number.
    pub fn add(&mut self, number: usize) {
        if self.counts.len() <= number {
            self.counts.resize(number + 1, 0);
        }
        self.counts[number] += 1;
    }

    /// How many were counted.
    pub fn len(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Was none counted?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Their mean; 0 of none.
    pub fn mean(&self) -> f64 {
        let sum = self.counts.iter().zip(0u64..).map(|(n, x)| n * x);
        sum.sum::<u64>() as f64 / self.len().max(1) as f64
    }

    /// The least number that is not below this share of them; 0 of none.
    pub fn quantile(&self, share: f64) -> usize {
        let wanted = share * self.len() as f64;
        let mut seen = 0;
        let reached = self.counts.iter().position(|n| {
            seen += n;
            seen as f64 >= wanted
        });
        reached.unwrap_or(0)
    }

    /// The largest; 0 of none.
    pub fn max(&self) -> usize {
        self.counts.iter().rposition(|&n| n > 0).unwrap_or(0)
    }
}

/// A stage over all blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageProfile {
    /// Time in steps [ns].
    pub step_ns: u64,
    /// Time in evaluations of outputs [ns].
    pub evaluation_ns: u64,
    /// Units of work of worlds: contacts that a narrow phase found or that rows were made of, iterations of the solver.
    pub useful: u64,
    /// The same, had every world of a block done what the block did.
    pub done: u64,
}

impl StageProfile {
    /// Share of the lanes that waited for others, where the stage's work is counted [–].
    pub fn masked(&self) -> Option<f64> {
        (self.done > 0).then(|| 1.0 - self.useful as f64 / self.done as f64)
    }
}

/// What steps took and did, on one thread.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// By [`StageId::index`].
    pub stages: Vec<StageProfile>,
    /// Time of everything, outputs included, the clock's own not [ns].
    pub total_ns: u64,
    /// Steps of a world.
    pub world_steps: u64,
    /// Contacts of a world, in every step.
    pub contacts: Histogram,
    /// Constraint rows that act in a world, in every step.
    pub rows: Histogram,
    /// Iterations of the solver in a world, in every solve.
    pub iterations: Histogram,
    /// Iterations of a block's slowest world.
    pub block_iterations: Histogram,
    /// Line searches of a world, in every solve.
    pub searches: Histogram,
    /// Evaluations of these line searches.
    pub evaluations: Histogram,
    /// Evaluations of a block: of each search, those of its slowest world.
    pub block_evaluations: Histogram,
}

impl Profile {
    /// Nothing yet.
    pub fn new() -> Profile {
        Profile {
            stages: vec![StageProfile::default(); StageId::COUNT],
            ..Profile::default()
        }
    }

    /// The stages that took time, with their names, in the order of a step.
    pub fn stages(&self) -> impl Iterator<Item = (&'static str, &StageProfile)> {
        let named = StageId::all().map(|stage| (stage.name(), &self.stages[stage.index()]));
        named.filter(|(_, stage)| stage.step_ns + stage.evaluation_ns > 0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_histogram_knows_mean_quantiles_and_extremes() {
        let mut of = Histogram::default();
        assert_eq!((of.mean(), of.quantile(0.99), of.max()), (0.0, 0, 0));
        for number in (0..99).map(|_| 2).chain([7]) {
            of.add(number);
        }
        assert_eq!(of.len(), 100);
        assert!((of.mean() - 2.05).abs() < 1e-12);
        assert_eq!((of.quantile(0.99), of.quantile(1.0), of.max()), (2, 7, 7));
    }
}
