//! One compiled text per instruction set, chosen once at start.

use super::chunk::{Chunk, Job};
use super::transfer::Arena;
use super::{Backend, BackendError, Cpu, Layout, Run};
use crate::lane::{Lane, Num};
use crate::model::Model;
use crate::simulation::{Lanes, Precision};

macro_rules! compiled {
    ($(#[$doc:meta])* $name:ident, $features:literal) => {
        $(#[$doc])*
        ///
        /// # Safety
        /// The processor has these features; see also [`Chunk::run`].
        #[target_feature(enable = $features)]
        #[cfg(target_arch = "x86_64")]
        unsafe fn $name<F: Lane>(
            chunk: &mut Chunk<F>,
            job: &Job<<F as Num>::Real>,
            substeps: usize,
            arena: Arena,
        ) {
            // SAFETY: by contract.
            unsafe { chunk.run(job, substeps, arena) }
        }
    };
}

compiled!(
    /// AVX-512, as on Skylake-X, Zen 4 and later.
    with_avx512,
    "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma,bmi1,bmi2"
);
compiled!(
    /// AVX2 and fused multiply-add, as on Haswell, Zen and later.
    with_avx2,
    "avx2,fma,bmi1,bmi2"
);

/// Whatever the target has. Without a fused instruction `mul_add` is a library call: slow, the same bits.
///
/// # Safety
/// See [`Chunk::run`].
unsafe fn portable<F: Lane>(
    chunk: &mut Chunk<F>,
    job: &Job<<F as Num>::Real>,
    substeps: usize,
    arena: Arena,
) {
    // SAFETY: by contract.
    unsafe { chunk.run(job, substeps, arena) }
}

/// Does this processor run blocks of this width?
pub fn available(lanes: Lanes) -> bool {
    #[cfg(target_arch = "x86_64")]
    let (avx2, avx512) = (
        is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2"),
        is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl") && is_x86_feature_detected!("avx512bw"),
    );
    #[cfg(not(target_arch = "x86_64"))]
    let (avx2, avx512) = (false, false);
    match lanes {
        Lanes::Auto | Lanes::Scalar => true,
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
    let fused = available(Lanes::Eight);
    let lanes = match lanes {
        Lanes::Auto if available(Lanes::Sixteen) => Lanes::Sixteen,
        Lanes::Auto if fused => Lanes::Eight,
        Lanes::Auto => Lanes::Scalar,
        asked => asked,
    };
    if !available(lanes) {
        let (lanes, instructions) = match lanes {
            Lanes::Eight => (8, "AVX2 with FMA"),
            _ => (16, "AVX-512"),
        };
        return Err(BackendError::Lanes { lanes, instructions });
    }
    match (precision, lanes) {
        (Precision::F64, _) => scalar::<f64>(model, worlds, layout, threads, fused, "f64"),
        #[cfg(target_arch = "x86_64")]
        (Precision::F32, Lanes::Sixteen) => {
            boxed::<crate::lane::simd::F32x16>(model, worlds, layout, threads, "AVX-512", with_avx512)
        }
        #[cfg(target_arch = "x86_64")]
        (Precision::F32, Lanes::Eight) => {
            boxed::<crate::lane::simd::F32x8>(model, worlds, layout, threads, "AVX2", with_avx2)
        }
        (Precision::F32, _) => scalar::<f32>(model, worlds, layout, threads, fused, "f32"),
    }
}

fn scalar<F: Lane>(
    model: &Model,
    worlds: usize,
    layout: &Layout,
    threads: usize,
    fused: bool,
    name: &str,
) -> Result<Box<dyn Backend>, BackendError> {
    #[cfg(target_arch = "x86_64")]
    if fused {
        return boxed::<F>(model, worlds, layout, threads, &format!("{name} scalar, FMA"), with_avx2);
    }
    let _ = fused;
    boxed::<F>(model, worlds, layout, threads, &format!("{name} scalar"), portable)
}

fn boxed<F: Lane>(
    model: &Model,
    worlds: usize,
    layout: &Layout,
    threads: usize,
    instructions: &str,
    run: Run<F>,
) -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(Cpu::<F>::new(model, worlds, layout, threads, instructions, run)?))
}
