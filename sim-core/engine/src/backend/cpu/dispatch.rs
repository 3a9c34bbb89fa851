//! One compiled text per instruction set, chosen once at start.

use super::chunk::{Chunk, Job};
use super::transfer::Arena;
use super::{Backend, BackendError, Backends, Cpu, Groups, Lanes, Layout, Precision, Workers};
use sim_model::Model;
use sim_physics::compiled::Stages;
use sim_physics::lane::Lane;

/// A chunk, compiled for an instruction set.
///
/// # Safety
/// As [`Chunk::run`].
pub(super) type RunChunk<F> = unsafe fn(&mut Chunk<F>, &Job<F>, usize, Arena);

/// The text, compiled for an instruction set.
pub(super) struct Program<F: Lane> {
    /// For people.
    pub instructions: &'static str,
    pub stages: Stages<F>,
    pub chunk: RunChunk<F>,
}

macro_rules! compiled {
    ($(#[$attribute:meta])* $name:ident $($features:literal)?) => {
        $(#[$attribute])*
        $(#[target_feature(enable = $features)])?
        unsafe fn $name<F: Lane>(chunk: &mut Chunk<F>, job: &Job<F>, substeps: usize, arena: Arena) {
            // SAFETY: by contract.
            unsafe { chunk.run(job, substeps, arena) }
        }
    };
}

compiled!(
    #[cfg(target_arch = "x86_64")]
    avx512 "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,bmi1,bmi2"
);
compiled!(
    #[cfg(target_arch = "x86_64")]
    avx2 "avx2,fma,bmi1,bmi2"
);
compiled!(
    #[cfg(not(target_arch = "x86_64"))]
    portable
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

/// A backend for each group: the fastest that the processor has, or the one asked for.
///
/// # Errors
/// [`BackendError::Lanes`] for a width that it has not, [`BackendError::Threads`].
pub fn create(
    model: &Model,
    groups: Groups,
    precision: Precision,
    lanes: Lanes,
    layout: &Layout,
    threads: usize,
) -> Result<Backends, BackendError> {
    let lanes = match lanes {
        // a register that holds one world takes longer than a scalar, for the same bits
        Lanes::Auto if groups.worlds == 1 => Lanes::Scalar,
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
        (Precision::F64, _) => {
            let program = least("f64 scalar, FMA", stages_f64::STAGES);
            boxed(model, groups, layout, threads, program)
        }
        #[cfg(target_arch = "x86_64")]
        (Precision::F32, Lanes::Sixteen) => {
            let program = Program {
                instructions: "AVX-512",
                stages: stages_f32x16::STAGES,
                chunk: avx512,
            };
            boxed(model, groups, layout, threads, program)
        }
        #[cfg(target_arch = "x86_64")]
        (Precision::F32, Lanes::Eight) => {
            let program = least("AVX2", stages_f32x8::STAGES);
            boxed(model, groups, layout, threads, program)
        }
        (Precision::F32, _) => {
            let program = least("f32 scalar, FMA", stages_f32::STAGES);
            boxed(model, groups, layout, threads, program)
        }
    }
}

/// What runs wherever the text does.
fn least<F: Lane>(instructions: &'static str, stages: Stages<F>) -> Program<F> {
    #[cfg(target_arch = "x86_64")]
    let chunk = avx2;
    #[cfg(not(target_arch = "x86_64"))]
    let chunk = portable;
    Program {
        instructions,
        stages,
        chunk,
    }
}

fn boxed<F: Lane>(
    model: &Model,
    groups: Groups,
    layout: &Layout,
    threads: usize,
    program: Program<F>,
) -> Result<Backends, BackendError> {
    // a thread for each block is enough
    let threads = threads.min(groups.count * groups.worlds.div_ceil(F::WIDTH));
    let workers = Workers::new(threads, groups.count)?;
    let made = groups.numberings().map(|numbering| {
        let job = Job::new(model, layout.clone(), program.stages, numbering);
        let cpu = Cpu::new(job, groups.worlds, threads, workers.clone(), &program);
        Box::new(cpu) as Box<dyn Backend>
    });
    Ok(made.collect())
}
