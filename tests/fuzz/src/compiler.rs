//! Machine code of this processor beside the interpreter of recordings.

#[path = "../../../sim-core/compile/tests/compile/beside.rs"]
mod beside;
#[allow(dead_code)] // tests begin with a seed, too
#[path = "../../../sim-core/compile/tests/compile/random_code.rs"]
mod random_code;

use random_code::{INPUTS, Random, code, run};

/// Code whose blocks, loops and formulas are chosen by the bytes, one each, with the bits of the interpreter in every lane.
pub fn program(bytes: &[u8]) {
    let mut random = Random::chosen(bytes);
    let steps = code(&mut random, 2, 3, 14);
    let recording = sim_record::record(INPUTS, |cx, inputs| run(cx, &steps, inputs));
    let recording = recording.expect("random code is right");
    beside::assert_same(&recording, &mut random, "chosen code");
}
