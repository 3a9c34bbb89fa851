//! Chooses the instruction set once, at start: one compiled version of the physics code for each.

use super::backend::{CompiledStages, Cpu};
use super::chunk::{Chunk, Job};
use super::compiled::{CompiledStep, StagesOfModel};
use super::transfer::Arena;
use crate::backend::{
    Backend, BackendError, Backends, Groups, Lanes, OutputsAt, Precision, Profile,
};
use crate::workers::Workers;
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

/// How worlds run on the CPU.
#[derive(Clone, Copy)]
pub(crate) struct CpuOptions<'a> {
    /// Threads of a step.
    pub threads: usize,
    /// Whether models run as machine code of their own.
    pub compiles: bool,
    /// The model with whose stages that is compared first, if any.
    pub checked_with: Option<&'a Model>,
}

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
pub(crate) fn create(
    model: &Model,
    groups: Groups,
    precision: Precision,
    lanes: Lanes,
    layout: (&Layout, OutputsAt),
    options: CpuOptions<'_>,
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
            boxed(model, groups, layout, options, compiled)
        }
        #[cfg(target_arch = "x86_64")]
        (Precision::F32, Lanes::Sixteen) => {
            let compiled = CompiledStages {
                instructions: "AVX-512",
                stages: stages_f32x16::STAGES,
                chunk: avx512,
            };
            boxed(model, groups, layout, options, compiled)
        }
        #[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
        (Precision::F32, Lanes::Eight) => {
            let compiled = baseline(EIGHT, stages_f32x8::STAGES);
            boxed(model, groups, layout, options, compiled)
        }
        (Precision::F32, _) => {
            let compiled = baseline("f32 scalar, FMA", stages_f32::STAGES);
            boxed(model, groups, layout, options, compiled)
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
    options: CpuOptions<'_>,
    stages: CompiledStages<F>,
) -> Result<Backends, BackendError> {
    // a substep whose stages are shown runs as stages
    let shows_all = outputs_at == OutputsAt::LastSubstep && model.substeps() == 1;
    let made = match options.compiles && !shows_all {
        true => CompiledStep::of_model::<F>(model),
        false => Ok(None),
    };
    let job = |model, compiled, numbering| {
        let layout = (layout.clone(), outputs_at);
        Job::new(model, layout, stages.stages, compiled, numbering)
    };
    let compiled = match (made, options.checked_with) {
        (Ok(Some(step)), Some(model)) => {
            let job = job(model, None, groups.numbering);
            let of_stages = StagesOfModel {
                constants: &job.constants,
                stages: &job.stages,
                step: &job.step,
                start: &job.start,
            };
            // SAFETY: this processor has the instructions of the stages, which `create` chose for their scalars.
            let checked = unsafe { step.check(&of_stages) };
            checked.map(|()| Some(step))
        }
        (made, _) => made,
    };
    let checked = match options.checked_with {
        Some(_) => " (checked)",
        None => "",
    };
    let note = match &compiled {
        Ok(Some(step)) if step.is_whole() => format!(", machine code{checked}"),
        Ok(Some(_)) => format!(", machine code but for contacts and solver{checked}"),
        Ok(None) => String::new(),
        Err(error) => format!(", stages only: {error}"),
    };
    let compiled = compiled.ok().flatten().map(Arc::new);
    // one thread per block is enough
    let threads = (options.threads).min(groups.count * groups.worlds.div_ceil(F::WIDTH));
    let failed = |reason| BackendError::Threads { threads, reason };
    let workers = Workers::new(threads, groups.count).map_err(failed)?;
    let made = groups.numberings().map(|numbering| {
        let cpu = Cpu::new(
            job(model, compiled.clone(), numbering),
            groups.worlds,
            threads,
            workers.clone(),
            (&stages, &note),
        );
        Box::new(cpu) as Box<dyn Backend>
    });
    Ok(made.collect())
}
