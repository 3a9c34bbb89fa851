//! One compiled text per instruction set, chosen once at start.

use super::chunk::{Chunk, Job};
use super::transfer::Arena;
use super::{Backend, BackendError, Cpu, Lanes, Layout, Precision};
use crate::batch::Block;
use crate::lane::memory::Cpu as Machine;
use crate::lane::{Lane, Num};
use crate::model::Model;
use crate::model::constants::Constants;
use crate::step::Stage;

/// A stage on a block, compiled for an instruction set: a function of its own, so that registers are
/// given out for one page of equations and a profile names it.
///
/// # Safety
/// The processor has the instructions that it was compiled for.
pub(super) type RunStage<F> = unsafe fn(&Constants<<F as Num>::Real>, &mut Block<F, F>, &mut [F]);

/// A chunk, compiled for an instruction set.
///
/// # Safety
/// As [`Chunk::run`].
pub(super) type RunChunk<F> = unsafe fn(&mut Chunk<F>, &Job<F>, usize, Arena);

/// The text, compiled for an instruction set.
pub(super) struct Program<F: Lane> {
    pub stages: [RunStage<F>; Stage::ALL.len()],
    pub chunk: RunChunk<F>,
}

macro_rules! compiled {
    ($(#[$attribute:meta])* mod $name:ident $($features:literal)?) => {
        $(#[$attribute])*
        mod $name {
            use super::*;

            $(#[target_feature(enable = $features)])?
            unsafe fn stage<F: Lane, const S: usize>(
                constants: &Constants<F::Real>,
                block: &mut Block<F, F>,
                memory: &mut [F],
            ) {
                // made here, so that the compiler sees that every world is active: what is set outside of
                // blocks and loops is then a plain store, which the next load need not wait for
                let mut machine = Machine::new(memory, &constants.contacts.tables);
                Stage::ALL[S].run(&mut machine, constants, block);
            }

            $(#[target_feature(enable = $features)])?
            unsafe fn chunk<F: Lane>(
                chunk: &mut Chunk<F>,
                job: &Job<F>,
                substeps: usize,
                arena: Arena,
            ) {
                // SAFETY: by contract.
                unsafe { chunk.run(job, substeps, arena) }
            }

            pub fn program<F: Lane>() -> Program<F> {
                Program {
                    stages: [
                        stage::<F, 0>,
                        stage::<F, 1>,
                        stage::<F, 2>,
                        stage::<F, 3>,
                        stage::<F, 4>,
                        stage::<F, 5>,
                        stage::<F, 6>,
                        stage::<F, 7>,
                        stage::<F, 8>,
                        stage::<F, 9>,
                        stage::<F, 10>,
                        stage::<F, 11>,
                        stage::<F, 12>,
                        stage::<F, 13>,
                        stage::<F, 14>,
                        stage::<F, 15>,
                        stage::<F, 16>,
                        stage::<F, 17>,
                        stage::<F, 18>,
                        stage::<F, 19>,
                        stage::<F, 20>,
                        stage::<F, 21>,
                        stage::<F, 22>,
                        stage::<F, 23>,
                        stage::<F, 24>,
                        stage::<F, 25>,
                        stage::<F, 26>,
                        stage::<F, 27>,
                        stage::<F, 28>,
                        stage::<F, 29>,
                        stage::<F, 30>,
                        stage::<F, 31>,
                        stage::<F, 32>,
                    ],
                    chunk: chunk::<F>,
                }
            }
        }
    };
}

compiled!(
    /// AVX-512, as on Skylake-X, Zen 4 and later.
    #[cfg(target_arch = "x86_64")]
    mod avx512 "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,bmi1,bmi2"
);
compiled!(
    /// AVX2 and fused multiply-add, as on Haswell, Zen and later.
    #[cfg(target_arch = "x86_64")]
    mod avx2 "avx2,fma,bmi1,bmi2"
);
compiled!(
    /// Whatever the target has, where that is not x86: there AVX2 and FMA are asked for, and another text would
    /// take as long to compile as the others.
    #[cfg(not(target_arch = "x86_64"))]
    mod portable
);

/// Does this processor run blocks of this width?
pub fn available(lanes: Lanes) -> bool {
    #[cfg(target_arch = "x86_64")]
    let (avx2, avx512) = (
        is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2"),
        is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512bw"),
    );
    #[cfg(not(target_arch = "x86_64"))]
    let (avx2, avx512) = (false, false);
    match lanes {
        Lanes::Auto | Lanes::Scalar => avx2 || cfg!(not(target_arch = "x86_64")),
        Lanes::Eight => avx2,
        Lanes::Sixteen => avx2 && avx512,
    }
}

/// The fastest backend that the processor has, or the one asked for.
///
/// # Errors
/// [`BackendError::Lanes`] for a width that it has not, [`BackendError::Threads`].
pub fn create(
    model: &Model,
    worlds: usize,
    precision: Precision,
    lanes: Lanes,
    layout: &Layout,
    threads: usize,
) -> Result<Box<dyn Backend>, BackendError> {
    let lanes = match lanes {
        // a register that holds one world takes longer than a scalar, for the same bits
        Lanes::Auto if worlds == 1 => Lanes::Scalar,
        Lanes::Auto if available(Lanes::Sixteen) => Lanes::Sixteen,
        Lanes::Auto if available(Lanes::Eight) => Lanes::Eight,
        Lanes::Auto => Lanes::Scalar,
        asked => asked,
    };
    if !available(lanes) {
        let (lanes, instructions) = match lanes {
            Lanes::Sixteen => (16, "AVX-512"),
            Lanes::Eight => (8, "AVX2 with FMA"),
            Lanes::Auto | Lanes::Scalar => (1, "AVX2 with FMA"),
        };
        return Err(BackendError::Lanes {
            lanes,
            instructions,
        });
    }
    match (precision, lanes) {
        (Precision::F64, _) => scalar::<f64>(model, worlds, layout, threads, "f64"),
        #[cfg(target_arch = "x86_64")]
        (Precision::F32, Lanes::Sixteen) => boxed::<crate::lane::simd::F32x16>(
            model,
            worlds,
            layout,
            threads,
            "AVX-512",
            avx512::program(),
        ),
        #[cfg(target_arch = "x86_64")]
        (Precision::F32, Lanes::Eight) => boxed::<crate::lane::simd::F32x8>(
            model,
            worlds,
            layout,
            threads,
            "AVX2",
            avx2::program(),
        ),
        (Precision::F32, _) => scalar::<f32>(model, worlds, layout, threads, "f32"),
    }
}

fn scalar<F: Lane>(
    model: &Model,
    worlds: usize,
    layout: &Layout,
    threads: usize,
    name: &str,
) -> Result<Box<dyn Backend>, BackendError> {
    #[cfg(target_arch = "x86_64")]
    let (instructions, program) = (format!("{name} scalar, FMA"), avx2::program());
    #[cfg(not(target_arch = "x86_64"))]
    let (instructions, program) = (format!("{name} scalar"), portable::program());
    boxed::<F>(model, worlds, layout, threads, &instructions, program)
}

fn boxed<F: Lane>(
    model: &Model,
    worlds: usize,
    layout: &Layout,
    threads: usize,
    instructions: &str,
    program: Program<F>,
) -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(Cpu::<F>::new(
        model,
        worlds,
        layout,
        threads,
        instructions,
        program,
    )?))
}
