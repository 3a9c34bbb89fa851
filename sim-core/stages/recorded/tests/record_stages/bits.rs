//! Every recorded stage against its scalar run: as it is, in vectors of four, and cut into kernels.

use super::*;
use sim_record::split::Split;

/// What a kernel may cost: as an engine asks, and so little that every loop is cut.
const KERNEL_COSTS: [usize; 2] = [2500, 200];

/// States that the kernels are run from: each of them is a program of its own.
const CUT_STATES: usize = 5;

#[test]
fn every_recorded_stage_gives_the_bits_of_the_scalar_run() {
    for case in cases() {
        let m = &case.m;
        let mut random = toy::Random(1);
        let recordings: Vec<Option<(Recording, Recording, [Split; 2])>> = StageId::all()
            .map(|stage| {
                let recording = stage.is_needed(m).then(|| recorded_stage(m, stage))?;
                let packed = recording.vectorized();
                let splits = KERNEL_COSTS.map(|most| toy::in_kernels(&recording, most));
                Some((recording, packed, splits))
            })
            .collect();
        for n in 0..STATES {
            let mut block = case.random_state(|| random.unit());
            let mut memory = memory(m);
            // outputs belong to the state before it moves on
            let (moves, others): (Vec<_>, Vec<_>) =
                needed(m).partition(|stage| stage.row().runs.moves());
            for stage in others.into_iter().chain(moves) {
                let recorded = recordings[stage.index()].as_ref();
                let (recording, packed, splits) = recorded.expect("it is needed");
                let what = format!("{}: {}", case.name, stage.name());
                let inputs = gathered(&mut block, stage.reads());
                let before = memory.clone();
                run(stage, m, &mut block, &mut memory);
                let expected = gathered(&mut block, stage.writes());
                let tables = &m.contacts.tables;
                let check = |got: &dyn Fn(&mut [f32]) -> Vec<f32>| {
                    let mut scratch = before.clone();
                    assert_same(&got(&mut scratch), &expected, &what);
                    assert_same(&scratch, &memory, &format!("{what}: memory"));
                };
                check(&|scratch| recording.evaluate(&inputs, scratch, tables));
                check(&|scratch| packed.evaluate(&inputs, scratch, tables));
                let kernels = if n < CUT_STATES { &splits[..] } else { &[] };
                for kernels in kernels {
                    check(&|scratch| kernels.evaluate(&inputs, scratch, tables));
                }
            }
        }
    }
}
