//! The recorder: what it refuses, what it folds, and that its programs are right.

mod algebra;
mod kept_lists;
mod lanes;
mod loop_fusion;
mod programs;
mod refusals;
mod refused_blocks;
mod schedule;
mod split;
#[path = "../toy/mod.rs"]
mod toy;
mod vectorized;

use sim_physics::lane::{Num, Table, Tables};
use sim_record::wgsl::{ProgramOptions, wgsl};
use sim_record::{Misuse, Recorded, Recorder, Recording, record};

const TABLE: Table = Table {
    base: 0,
    stride: 2,
    rows: 3,
};

fn c(x: f64) -> Recorded {
    Num::c(x)
}

/// The recording of code with two inputs that must be accepted; its program is valid.
#[track_caller]
fn accepted(code: impl FnOnce(&mut Recorder, &[Recorded]) -> Vec<Recorded>) -> Recording {
    let recording = record(2, code).unwrap_or_else(|e| panic!("refused: {e}"));
    toy::validated(&wgsl(&recording, &ProgramOptions::default()));
    recording
}

/// Why code with two inputs is refused. The error names this file, and the code still reaches its end.
#[track_caller]
fn refused(code: impl FnOnce(&mut Recorder, &[Recorded]) -> Vec<Recorded>) -> Misuse {
    let error = record(2, code).expect_err("bad code is refused");
    assert!(
        error.file.contains("tests/record/") && error.line > 0,
        "{error}"
    );
    error.misuse
}

fn evaluated(recording: &Recording, inputs: [f32; 2]) -> Vec<f32> {
    recording.evaluate(&inputs, &mut [0.0; 16], &Tables::default())
}
