//! Chooses the instruction set once, at start: one compiled version of the physics code for each.

use super::backend::{CompiledStages, Cpu, Workers};
use super::chunk::{Chunk, Job};
use super::compiled::CompiledStep;
use super::transfer::Arena;
use crate::backend::{
    Backend, BackendError, Backends, Groups, Lanes, OutputsAt, Precision, Profile,
};
use sim_model::Model;
use sim_physics::arrays::Layout;
use sim_physics::compiled::Stages;
use sim_physics::lane::Lane;
use sim_physics::lane::simd::{EIGHT, widths};
use std::sync::Arc;

macro_rules! compiled {
    ($(#[$attribute:meta])* $name:ident) => {
        $(#[$attribute])*
        unsafe fn $name<F: Lane>(chunk: &mut Chunk<F>, job: &Job<F>, substeps: usize, arena: Arena, profile: Option<&mut Profile>) {
            // SAFETY: by contract.
            unsafe { chunk.run(job, substeps, arena, profile) }
        }
    };
}

compiled!(
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,bmi1,bmi2")]
    avx512
);
compiled!(
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma,bmi1,bmi2"))]
    lowest
);

/// Whether this processor runs blocks of this width.
pub fn available(lanes: Lanes) -> bool {
    let widths = widths();
    match lanes {
        Lanes::Auto | Lanes::Scalar => widths.one,
        Lanes::Eight => widths.eight,
        Lanes::Sixteen => widths.sixteen,
    }
}

/// One backend per group: of the fastest instruction set that the processor has, or the requested one.
///
/// # Errors
/// [`BackendError::Lanes`] for a width that the processor does not support, [`BackendError::Threads`].
pub fn create(
    model: &Model,
    groups: Groups,
    precision: Precision,
    lanes: Lanes,
    layout: (&Layout, OutputsAt),
    threads_and_compiles: (usize, bool),
) -> Result<Backends, BackendError> {
    let lanes = match lanes {
        // one world in a SIMD register is slower than a scalar, with the same bits
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
            let compiled = baseline("f64 scalar, FMA", stages_f64::STAGES);
            boxed(model, groups, layout, threads_and_compiles, compiled)
        }
        #[cfg(target_arch = "x86_64")]
        (Precision::F32, Lanes::Sixteen) => {
            let compiled = CompiledStages {
                instructions: "AVX-512",
                stages: stages_f32x16::STAGES,
                chunk: avx512,
            };
            boxed(model, groups, layout, threads_and_compiles, compiled)
        }
        #[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
        (Precision::F32, Lanes::Eight) => {
            let compiled = baseline(EIGHT, stages_f32x8::STAGES);
            boxed(model, groups, layout, threads_and_compiles, compiled)
        }
        (Precision::F32, _) => {
            let compiled = baseline("f32 scalar, FMA", stages_f32::STAGES);
            boxed(model, groups, layout, threads_and_compiles, compiled)
        }
    }
}

/// A version for the lowest instruction set that is supported.
fn baseline<F: Lane>(instructions: &'static str, stages: Stages<F>) -> CompiledStages<F> {
    CompiledStages {
        instructions,
        stages,
        chunk: lowest,
    }
}

fn boxed<F: Lane>(
    model: &Model,
    groups: Groups,
    (layout, outputs_at): (&Layout, OutputsAt),
    (threads, compiles): (usize, bool),
    stages: CompiledStages<F>,
) -> Result<Backends, BackendError> {
    // a substep whose stages are shown runs as stages
    let shows_all = outputs_at == OutputsAt::LastSubstep && model.substeps() == 1;
    let compiled = match compiles && !shows_all {
        true => CompiledStep::of_model::<F>(model),
        false => Ok(None),
    };
    let note = match &compiled {
        Ok(Some(_)) => ", machine code".to_owned(),
        Ok(None) => String::new(),
        Err(error) => format!(", stages only: {error}"),
    };
    let compiled = compiled.ok().flatten().map(Arc::new);
    // one thread per block is enough
    let threads = threads.min(groups.count * groups.worlds.div_ceil(F::WIDTH));
    let workers = Workers::new(threads, groups.count)?;
    let made = groups.numberings().map(|numbering| {
        let job = Job::new(
            model,
            (layout.clone(), outputs_at),
            stages.stages,
            compiled.clone(),
            numbering,
        );
        let cpu = Cpu::new(
            job,
            groups.worlds,
            threads,
            workers.clone(),
            (&stages, &note),
        );
        Box::new(cpu) as Box<dyn Backend>
    });
    Ok(made.collect())
}
