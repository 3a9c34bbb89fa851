//! Stages in which several threads share a world, run in lockstep on the CPU, beside those of one thread.

use super::*;
use sim_physics::constants::rolled::RolledSystem;
use sim_record::split::{Limits, Prices, Split, split};

/// Numbers of threads that a world may have, and states that are compared.
const LANES: [usize; 3] = [8, 16, 32];
const COMPARED: usize = 9;
/// What a kernel may cost: as an engine asks, and so little that it is cut wherever it can be.
const KERNEL_COSTS: [usize; 2] = [6000, 500];
/// Largest difference, as a part of the largest number of an array: of the worst state, and of the median one. Shapes are deep inside each
/// other in these states; sums have another order, and the solver ends where its steps gain little.
const WORST: f32 = 1e-2;
const MEDIAN: f32 = 2e-3;

/// The stage in kernels as a hardware GPU has them, or in as many as can be.
fn in_kernels(m: &Constants<f32>, stage: StageId, lanes: usize, most: usize) -> Split {
    let recording = recorded(m, stage.reads(), stage.writes(), |cx, b| {
        cx.set_lanes(lanes);
        stages_recorded::run(stage, cx, m, b);
    });
    let limits = Limits {
        kernel: most,
        repeated: usize::MAX,
        repeated_dispatch: 0,
        dispatch: 0,
        prices: Prices::HARDWARE,
    };
    let spare = (recording.inputs() + recording.outputs()) as u32;
    let parts = split(&recording, &ProgramOptions::default(), limits, spare);
    for kernel in &parts.kernels {
        toy::validated(&kernel.wgsl());
    }
    parts
}

#[test]
fn several_lanes_solve_what_one_solves() {
    compare(&LANES, |_| {});
}

#[test]
fn loops_over_a_system_in_memory_solve_what_is_unrolled() {
    // several lanes keep systems without torsional friction in registers
    compare(&[1, 8], RolledSystem::add_to);
}

#[test]
fn lanes_share_the_loops_over_a_system_in_memory() {
    // others keep the system in registers
    let is_alone = |case: &Case| case.m.contacts.classes.is_empty();
    let alone: Vec<Case> = cases().into_iter().filter(is_alone).collect();
    assert!(alone.len() > 2);
    for mut case in alone {
        RolledSystem::add_to(&mut case.m);
        let m = &case.m;
        for stage in needed(m).filter(|stage| stage.name() == "solver") {
            let parts = in_kernels(m, stage, 8, 6000);
            let texts: Vec<String> = parts.kernels.iter().map(|kernel| kernel.wgsl()).collect();
            let shared: usize = texts
                .iter()
                .map(|text| text.matches("+ lane;").count())
                .sum();
            // those that set it to 0, eliminate, divide by pivots, and substitute
            assert_eq!(shared, 4, "{}", case.name);
        }
    }
}

/// Compares recorded stages with the code of one world. `prepare` changes the constants first.
fn compare(lanes: &[usize], prepare: fn(&mut Constants<f32>)) {
    for mut case in cases() {
        // few of the models need a correction
        case.m.solver.refinements = 1;
        prepare(&mut case.m);
        let m = &case.m;
        let is_shared = |stage: &StageId| {
            let names = ["contact_rows", "solver", "refine"];
            names.iter().any(|name| stage.name().starts_with(name))
        };
        let kernels: Vec<(StageId, usize, [Split; 2])> = needed(m)
            .filter(is_shared)
            .flat_map(|stage| lanes.iter().map(move |lanes| (stage, *lanes)))
            .map(|(stage, lanes)| {
                let parts = KERNEL_COSTS.map(|most| in_kernels(m, stage, lanes, most));
                (stage, lanes, parts)
            })
            .collect();
        let mut apart = vec![Vec::new(); kernels.len()];
        let mut random = toy::Random(1);
        for _ in 0..COMPARED {
            let mut block = case.random_state(|| random.unit());
            let mut memory = memory(m);
            for stage in before_integrate(m) {
                let inputs = gathered(&mut block, stage.reads());
                let before = memory.clone();
                run(stage, m, &mut block, &mut memory);
                for ((known, _, splits), apart) in kernels.iter().zip(&mut apart) {
                    if *known != stage {
                        continue;
                    }
                    let [first, second] = splits.each_ref().map(|parts| {
                        let mut scratch = before.clone();
                        let got = parts.evaluate(&inputs, &mut scratch, &m.contacts.tables);
                        (got, scratch)
                    });
                    assert_same(&second.0, &first.0, case.name);
                    assert_same(&second.1, &first.1, case.name);
                    // each row is one thread's
                    if stage.name() == "contact_rows" {
                        assert_same(&first.1, &memory, case.name);
                    }
                    let first = first.0;
                    apart.push(difference(&mut block, stage, &first));
                }
            }
        }
        for ((stage, lanes, _), mut apart) in kernels.iter().zip(apart) {
            apart.sort_by(f32::total_cmp);
            let what = format!("{}: {} with {lanes} lanes", case.name, stage.name());
            // one lane has the operations of one world, in its order; stiff contacts are not asked for here
            if *lanes == 1 && !m.contacts.are_stiff {
                assert_eq!(apart[COMPARED - 1], 0.0, "{what}");
            }
            assert!(apart[COMPARED / 2] <= MEDIAN, "{what}: {apart:?}");
            assert!(apart[COMPARED - 1] <= WORST, "{what}: {apart:?}");
        }
    }
}

/// The largest difference of what a stage wrote from what one thread wrote, as a part of the largest number of its array. Counts of its work
/// are left out.
fn difference(block: &mut Scalar, stage: StageId, got: &[f32]) -> f32 {
    let (mut rest, mut worst) = (got, 0.0_f32);
    for array in stage.writes() {
        let expected = numbers(block, *array).to_vec();
        let (of_array, behind) = rest.split_at(expected.len());
        rest = behind;
        if !matches!(
            array,
            Array::SolverWork | Array::SolverProgress | Array::Unconverged
        ) {
            let largest = expected.iter().fold(1.0_f32, |most, x| most.max(x.abs()));
            let both = of_array.iter().zip(&expected);
            for (a, b) in both {
                assert!(a.is_finite(), "{array:?}: {a}");
                worst = worst.max((a - b).abs() / largest);
            }
        }
    }
    worst
}
