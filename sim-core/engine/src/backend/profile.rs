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

/// Work of a kind, in lanes: what blocks did, and what their worlds needed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LaneWork {
    /// What worlds needed.
    pub needed: u64,
    /// What blocks did, in every lane that holds a world; of gathered blocks in every lane.
    pub executed: u64,
}

impl LaneWork {
    /// Adds work that some lanes needed and all did.
    pub fn add(&mut self, needed: usize, executed: usize) {
        self.needed += needed as u64;
        self.executed += executed as u64;
    }

    /// The share that was needed [–]; none of no work.
    pub fn share(&self) -> Option<f64> {
        (self.executed > 0).then(|| self.needed as f64 / self.executed as f64)
    }
}

/// A stage over all blocks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StageProfile {
    /// Time in steps [ns].
    pub step_ns: u64,
    /// Time in evaluations of outputs [ns].
    pub evaluation_ns: u64,
    /// Contacts that a narrow phase found or that rows were made of, iterations of the solver.
    pub work: LaneWork,
}

impl StageProfile {
    /// Share of the lanes that waited for others, where the stage's work is counted [–].
    pub fn masked(&self) -> Option<f64> {
        self.work.share().map(|needed| 1.0 - needed)
    }
}

/// What a chunk does between stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// State and commands of a block into its workspace.
    Load,
    /// The state of a block out of its workspace, and its faults.
    Store,
    /// Fields of frames, and counters.
    Fields,
    /// Worlds that share a block, chosen and moved.
    Grouping,
    /// Worlds moved amid a solve, to where registers are full.
    Gathering,
}

impl Part {
    /// How many there are.
    pub const COUNT: usize = 5;
    /// All, with their names.
    pub const ALL: [(Part, &'static str); Part::COUNT] = [
        (Part::Load, "load"),
        (Part::Store, "store"),
        (Part::Fields, "fields"),
        (Part::Grouping, "grouping"),
        (Part::Gathering, "gathering"),
    ];
}

/// What steps took and did, on one thread.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Profile {
    /// By [`StageId::index`].
    pub stages: Vec<StageProfile>,
    /// Time of everything, outputs included, the clock's own not [ns].
    pub total_ns: u64,
    /// Time between stages, by [`Part`] [ns].
    pub parts: [u64; Part::COUNT],
    /// Steps of a world.
    pub world_steps: u64,
    /// Contacts of a world, in every step.
    pub contacts: Histogram,
    /// Constraint rows that act in a world, in every step.
    pub rows: Histogram,
    /// Iterations of the solver in a world, in every solve.
    pub iterations: Histogram,
    /// Iterations of a block until it pauses; of its slowest world where it does not.
    pub block_iterations: Histogram,
    /// Line searches of a world, in every solve.
    pub searches: Histogram,
    /// Evaluations of these line searches.
    pub evaluations: Histogram,
    /// Evaluations of a block until it pauses: of each search, those of its slowest world.
    pub block_evaluations: Histogram,
    /// Lanes that have a contact which their block visits.
    pub contact_lanes: Histogram,
    /// Moves of worlds to another block amid a solve.
    pub moves: u64,
    /// Contacts that blocks visit, in every iteration.
    pub lane_contacts: LaneWork,
    /// Iterations of the solver.
    pub lane_iterations: LaneWork,
    /// Evaluations of line searches.
    pub lane_evaluations: LaneWork,
    /// Solves of the system in which contacts couple what the mass matrix does not.
    pub lane_couplings: LaneWork,
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
