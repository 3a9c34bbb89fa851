//! Runs with many seeds.
#![allow(dead_code, reason = "each test uses what it needs")]

use std::io::ErrorKind;

use sim_machine::Run;

/// A run without a trace, in which so many calls in a million fail.
pub fn run(seed: u64, failing: u32) -> Run {
    Run {
        seed,
        failing,
        dropping: 0,
        preempting: 0,
        longest: 14,
        lateness: 1_000_000,
        steps_max: 200_000,
        trace: false,
    }
}

/// Runs a scenario with many seeds.
pub fn with_seeds(scenario: impl Fn() + Send + Sync + Clone + 'static) {
    for seed in 0..100 {
        let outcome = run(seed, 0).play(scenario.clone());
        assert_eq!(outcome.failure, None, "{seed}");
    }
}

/// Why a call failed, if it did.
pub fn kind<T>(result: std::io::Result<T>) -> Option<ErrorKind> {
    result.err().map(|error| error.kind())
}
