//! A stage on the processor: in double precision, one world at a time, and as many worlds a register as there can be.

use super::worlds::{Given, Left, numbers};
use sim_engine::backend::cpu::available;
use sim_engine::simulation::Lanes;
use sim_physics::arrays::Block;
use sim_physics::compiled::RunStage;
use sim_physics::constants::Constants;
use sim_physics::lane::{Lane, Real};
use sim_physics::step::StageId;

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
        // a block that is not full repeats its first world
        let number = |of: &dyn Fn(&Given) -> f64| {
            let lanes: Vec<F::Real> = (0..F::WIDTH)
                .map(|lane| F::Real::of(of(worlds.get(lane).unwrap_or(&worlds[0]))))
                .collect();
            F::load(&lanes)
        };
        let mut block = Block::<F, F>::new(m, F::c(0.0));
        let mut k = 0;
        for array in stage.reads() {
            for x in numbers(block.array_mut(*array)) {
                *x = number(&|world| world.numbers[k]);
                k += 1;
            }
        }
        let mut memory: Vec<F> = (0..m.contacts.memory.len)
            .map(|k| number(&|world| world.memory[k]))
            .collect();
        // SAFETY: by contract.
        unsafe { run(m, &mut block, &mut memory) };
        let mut left: Vec<Left> = worlds.iter().map(|_| Left::default()).collect();
        let mut lanes = vec![F::Real::default(); F::WIDTH];
        for array in stage.writes() {
            for x in numbers(block.array_mut(*array)) {
                x.store(&mut lanes);
                for (world, x) in left.iter_mut().zip(&lanes) {
                    world.numbers.push(x.to_f64());
                }
            }
        }
        for x in memory {
            x.store(&mut lanes);
            for (world, x) in left.iter_mut().zip(&lanes) {
                world.memory.push(x.to_f64());
            }
        }
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
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,fma,bmi1,bmi2")]
    eight sim_physics::lane::simd::F32x8
);

/// The reference: double precision, of a model and states that are rounded to `f32`.
pub fn double(m: &Constants<f64>, stage: StageId, given: &[Given]) -> Vec<Left> {
    assert!(available(Lanes::Scalar));
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
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        if available(Lanes::Eight) {
            // SAFETY: as just asked.
            found.push(unsafe { eight(stages_f32x8::STAGES[stage.index()], m, stage, given) });
        }
        if available(Lanes::Sixteen) {
            // SAFETY: as just asked.
            found.push(unsafe { sixteen(stages_f32x16::STAGES[stage.index()], m, stage, given) });
        }
    }
    found
}
