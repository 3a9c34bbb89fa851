//! Chooses the instruction set once: one compiled version of the kernel for each.

use crate::error::IkError;
use crate::queue::{Job, Solution, run};
use sim_physics::lane::Lane;
#[cfg(target_arch = "x86_64")]
use sim_physics::lane::simd::{F32x8, F32x16};
use std::ops::Range;

/// How many problems a register holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Width {
    /// As many as the processor has lanes for.
    #[default]
    Auto,
    /// One, without vector registers.
    Scalar,
    /// Eight: AVX2.
    Eight,
    /// Sixteen: AVX-512.
    Sixteen,
}

/// A thread's work: a range of problems, with their rows of states and solutions.
pub type Work<R> = for<'a, 'b> fn(&'a Job<'b, R>, Range<usize>, &mut [f64], &mut [Solution]);

macro_rules! compiled {
    ($(#[$attribute:meta])* $name:ident $($features:literal)?) => {
        $(#[$attribute])*
        $(#[target_feature(enable = $features)])?
        fn $name<F: Lane>(job: &Job<F::Real>, range: Range<usize>, joint_q: &mut [f64], solutions: &mut [Solution]) {
            run::<F>(job, range, joint_q, solutions);
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

/// Instruction sets of this processor: (AVX2 with FMA, AVX-512).
fn instructions() -> (bool, bool) {
    #[cfg(target_arch = "x86_64")]
    return (
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
    (false, false)
}

#[cfg(target_arch = "x86_64")]
fn checked(width: Width) -> Result<Width, IkError> {
    let missing = |instructions| Err(IkError::Lanes { instructions });
    match (width, instructions()) {
        (_, (false, _)) => missing("AVX2 with FMA"),
        (Width::Auto | Width::Sixteen, (_, true)) => Ok(Width::Sixteen),
        (Width::Sixteen, (_, false)) => missing("AVX-512"),
        (Width::Auto, _) => Ok(Width::Eight),
        (asked, _) => Ok(asked),
    }
}

/// What solves in single precision.
///
/// # Errors
/// [`IkError::Lanes`]
#[cfg(target_arch = "x86_64")]
pub fn single(width: Width) -> Result<Work<f32>, IkError> {
    // SAFETY of all: `checked` has found the instructions
    Ok(match checked(width)? {
        Width::Auto | Width::Sixteen => {
            |job, range, q, s| unsafe { avx512::<F32x16>(job, range, q, s) }
        }
        Width::Eight => |job, range, q, s| unsafe { avx2::<F32x8>(job, range, q, s) },
        Width::Scalar => |job, range, q, s| unsafe { avx2::<f32>(job, range, q, s) },
    })
}

/// What solves in double precision.
///
/// # Errors
/// [`IkError::Lanes`]
#[cfg(target_arch = "x86_64")]
pub fn double() -> Result<Work<f64>, IkError> {
    checked(Width::Scalar)?;
    // SAFETY: `checked` has found the instructions
    Ok(|job, range, q, s| unsafe { avx2::<f64>(job, range, q, s) })
}
