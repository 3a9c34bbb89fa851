//! A stage on the processor: in double precision, one world at a time, and as many worlds a register as there can be.

use super::worlds::{Given, Left, numbers};
use sim_engine::backend::cpu::available;
use sim_engine::simulation::Lanes;
use sim_physics::arrays::Block;
use sim_physics::compiled::RunStage;
use sim_physics::constants::Constants;
use sim_physics::lane::{Lane, Real};
use sim_physics::step::StageId;

/// Most worlds of a register.
const LANES_MAX: usize = 16;

/// Values of some worlds as registers: value k of each, for all k. A register that is not full repeats its first world.
///
/// This crate is compiled without optimisation, and a model has up to a hundred thousand values: so plain loops over slices.
#[inline(always)]
fn gather<F: Lane>(worlds: &[&[f64]], to: &mut [F]) {
    let mut lanes = [F::Real::default(); LANES_MAX];
    let mut k = 0;
    while k < to.len() {
        let mut lane = 0;
        while lane < F::WIDTH {
            let world = if lane < worlds.len() { lane } else { 0 };
            lanes[lane] = F::Real::from_f64(worlds[world][k]);
            lane += 1;
        }
        to[k] = F::load(&lanes[..F::WIDTH]);
        k += 1;
    }
}

/// The values of registers, world by world.
#[inline(always)]
fn scatter<F: Lane>(from: &[F], worlds: &mut [&mut [f64]]) {
    let mut lanes = [F::Real::default(); LANES_MAX];
    let mut k = 0;
    while k < from.len() {
        from[k].store(&mut lanes[..F::WIDTH]);
        let mut lane = 0;
        while lane < worlds.len() {
            worlds[lane][k] = lanes[lane].to_f64();
            lane += 1;
        }
        k += 1;
    }
}

/// Runs a stage, `F::WIDTH` worlds at a time.
///
/// # Safety
/// The processor has the instructions that `run` and `F` were made for.
#[inline(always)]
unsafe fn run<F: Lane>(
    run: RunStage<F>,
    m: &Constants<F::Real>,
    stage: StageId,
    given: &[Given],
) -> Vec<Left> {
    let mut all = Vec::new();
    for worlds in given.chunks(F::WIDTH) {
        let mut block = Block::<F, F>::new(m, F::c(0.0));
        let mut first = 0;
        for array in stage.reads() {
            let to = numbers(block.array_mut(*array));
            let of: Vec<&[f64]> = worlds.iter().map(|w| &w.numbers[first..]).collect();
            gather(&of, to);
            first += to.len();
        }
        let mut memory = vec![F::c(0.0); m.contacts.memory.len];
        let of: Vec<&[f64]> = worlds.iter().map(|world| &world.memory[..]).collect();
        gather(&of, &mut memory);
        // SAFETY: by contract.
        unsafe { run(m, &mut block, &mut memory) };
        let counts = (stage.writes().iter()).map(|array| numbers(block.array_mut(*array)).len());
        let count = counts.sum();
        let nothing = |_| Left {
            numbers: vec![0.0; count],
            memory: vec![0.0; memory.len()],
        };
        let mut left: Vec<Left> = worlds.iter().map(nothing).collect();
        let mut first = 0;
        for array in stage.writes() {
            let from = numbers(block.array_mut(*array));
            let to = left.iter_mut().map(|world| &mut world.numbers[first..]);
            scatter(from, &mut to.collect::<Vec<_>>());
            first += from.len();
        }
        let to = left.iter_mut().map(|world| &mut world.memory[..]);
        scatter(&memory, &mut to.collect::<Vec<_>>());
        all.extend(left);
    }
    all
}

macro_rules! machine {
    ($(#[$attribute:meta])* $name:ident $number:ty) => {
        $(#[$attribute])*
        unsafe fn $name(
            stage: RunStage<$number>,
            m: &Constants<<$number as sim_physics::lane::Num>::Real>,
            of: StageId,
            given: &[Given],
        ) -> Vec<Left> {
            // SAFETY: by contract.
            unsafe { run(stage, m, of, given) }
        }
    };
}

machine!(
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,bmi1,bmi2")]
    sixteen sim_physics::lane::simd::F32x16
);
machine!(
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    eight sim_physics::lane::simd::F32x8
);

/// The reference: double precision, of a model and states that are rounded to `f32`.
pub fn double(m: &Constants<f64>, stage: StageId, given: &[Given]) -> Vec<Left> {
    assert!(available(Lanes::Scalar));
    // one solver is compiled for it, with the code for torsional friction
    let solvers = ["solver", "solver_turning"];
    let needed = |other: &StageId| solvers.contains(&other.name()) && other.is_needed(m);
    let stage = match solvers.contains(&stage.name()) {
        true => StageId::all().find(needed).expect("a model needs one"),
        false => stage,
    };
    // SAFETY: as just asked.
    unsafe { run::<f64>(stages_f64::STAGES[stage.index()], m, stage, given) }
}

/// Single precision, a world at a time.
pub fn scalar(m: &Constants<f32>, stage: StageId, given: &[Given]) -> Vec<Left> {
    assert!(available(Lanes::Scalar));
    // SAFETY: as just asked.
    unsafe { run::<f32>(stages_f32::STAGES[stage.index()], m, stage, given) }
}

/// Single precision, in every register that this processor has.
pub fn registers(m: &Constants<f32>, stage: StageId, given: &[Given]) -> Vec<Vec<Left>> {
    let mut results = Vec::new();
    if available(Lanes::Eight) {
        // SAFETY: as just asked.
        results.push(unsafe { eight(stages_f32x8::STAGES[stage.index()], m, stage, given) });
    }
    #[cfg(target_arch = "x86_64")]
    if available(Lanes::Sixteen) {
        // SAFETY: as just asked.
        results.push(unsafe { sixteen(stages_f32x16::STAGES[stage.index()], m, stage, given) });
    }
    results
}
