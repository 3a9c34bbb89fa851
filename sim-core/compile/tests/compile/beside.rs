//! A program of machine code and the interpreter of its recording, beside each other.

use super::random_code::Random;
use sim_compile::{Address, CompileError, Places, Program, Target};
use sim_physics::lane::Tables;
use sim_physics::lane::simd::widths;
use sim_record::Recording;

/// Numbers of the outputs' array before a program writes them.
const BEFORE: f32 = -77.0;

/// The targets that this processor runs, with their worlds in a block.
pub fn targets() -> Vec<(Target, usize)> {
    let widths = widths();
    let all = [
        (
            Target::Avx2,
            8,
            widths.eight && cfg!(target_arch = "x86_64"),
        ),
        (Target::Avx512, 16, widths.sixteen),
    ];
    let here = all.into_iter().filter(|(.., runs)| *runs);
    here.map(|(target, width, _)| (target, width)).collect()
}

/// So many registers of an array, from the first on.
pub fn addresses(array: u32, n: usize) -> Vec<Address> {
    let each = (0..n as u32).map(|at| Address { array, at });
    each.collect()
}

pub fn compiled(recording: &Recording, target: Target) -> Result<Program, CompileError> {
    let places = Places {
        inputs: &addresses(0, recording.inputs()),
        outputs: &addresses(1, recording.outputs()),
        memory: Some(2),
    };
    Program::new(recording, &places, &tables(), target)
}

pub fn tables() -> Tables<f32> {
    Tables {
        numbers: vec![0.5, -2.0, 3.0, 0.25],
        indices: Vec::new(),
    }
}

/// Aligned memory.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Line(pub [f32; 16]);

/// Runs a program; `worlds` are as many as a block has. Outputs of each world, or none where the program refuses.
pub fn outputs(
    program: &Program,
    recording: &Recording,
    width: usize,
    worlds: &[Vec<f32>],
) -> Option<Vec<Vec<f32>>> {
    assert_eq!(worlds.len(), width);
    let lines = |registers: usize| (registers * width).div_ceil(16) + 1;
    let mut inputs = vec![Line([0.0; 16]); lines(recording.inputs())];
    let mut results = vec![Line([BEFORE; 16]); lines(recording.outputs())];
    let mut scratch = vec![Line([f32::NAN; 16]); lines(program.scratch())];
    let mut memory = vec![Line([BEFORE; 16]); lines(recording.scratch())];
    for (lane, world) in worlds.iter().enumerate() {
        for (k, x) in world.iter().enumerate() {
            let place = k * width + lane;
            inputs[place / 16].0[place % 16] = *x;
        }
    }
    let arrays = [&mut inputs, &mut results, &mut memory].map(|lines| lines.as_mut_ptr().cast());
    // SAFETY: the arrays have the registers of inputs and outputs, and `targets` are those that this processor has.
    let done = unsafe { program.run(&arrays, scratch.as_mut_ptr().cast()) };
    let result = |lane: usize, k: usize| {
        let place = k * width + lane;
        results[place / 16].0[place % 16]
    };
    if !done {
        let registers = 0..recording.outputs();
        assert!(
            registers
                .clone()
                .all(|k| (0..width).all(|lane| result(lane, k) == BEFORE))
        );
        return None;
    }
    let of_lane = |lane| (0..recording.outputs()).map(|k| result(lane, k)).collect();
    Some((0..width).map(of_lane).collect())
}

/// Compares a program with the interpreter, in random worlds; returns how many values left the registers.
#[track_caller]
pub fn assert_same(recording: &Recording, random: &mut Random<'_>, what: &str) -> usize {
    let mut spills = 0;
    for (target, width) in targets() {
        let program = compiled(recording, target).unwrap_or_else(|e| panic!("{what}: {e}"));
        spills += program.size().spills;
        let worlds: Vec<Vec<f32>> = (0..width)
            .map(|_| random.numbers(recording.inputs()))
            .collect();
        let results = outputs(&program, recording, width, &worlds).expect("it assumes nothing");
        for (lane, (world, result)) in worlds.iter().zip(&results).enumerate() {
            let mut memory = vec![BEFORE; recording.scratch()];
            let expected = recording.evaluate(world, &mut memory, &tables());
            let bits = |x: &[f32]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(
                bits(result),
                bits(&expected),
                "{what}, {target:?}, lane {lane}: {result:?}, not {expected:?}"
            );
        }
    }
    spills
}
