//! Chooses the instruction set once: one compiled version of the kernel for each.

use crate::error::IkError;
use crate::queue::{Job, Solution, run};
use sim_physics::lane::Lane;
#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
use sim_physics::lane::simd::F32x8;
#[cfg(target_arch = "x86_64")]
use sim_physics::lane::simd::F32x16;
use sim_physics::lane::simd::widths;
use std::ops::Range;

/// How many problems a register holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Width {
    /// As many as the processor has lanes for.
    #[default]
    Auto,
    /// One, without vector registers.
    Scalar,
    /// Eight: AVX2 or NEON.
    Eight,
    /// Sixteen: AVX-512.
    Sixteen,
}

/// A thread's work: a range of problems, with their rows of states and solutions.
pub type Work<R> = for<'a, 'b> fn(&'a Job<'b, R>, Range<usize>, &mut [f64], &mut [Solution]);

macro_rules! compiled {
    ($(#[$attribute:meta])* $name:ident) => {
        /// # Safety
        /// The processor has the instructions.
        $(#[$attribute])*
        unsafe fn $name<F: Lane>(job: &Job<F::Real>, range: Range<usize>, joint_q: &mut [f64], solutions: &mut [Solution]) {
            run::<F>(job, range, joint_q, solutions);
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
    baseline
);

fn checked(width: Width) -> Result<Width, IkError> {
    let widths = widths();
    let missing = |instructions| Err(IkError::Lanes { instructions });
    match width {
        _ if !widths.one => missing("AVX2 with FMA"),
        Width::Auto | Width::Sixteen if widths.sixteen => Ok(Width::Sixteen),
        Width::Auto | Width::Eight if widths.eight => Ok(Width::Eight),
        Width::Auto | Width::Scalar => Ok(Width::Scalar),
        Width::Eight => missing("AVX2 with FMA, or NEON"),
        Width::Sixteen => missing("AVX-512"),
    }
}

/// What solves in single precision.
///
/// # Errors
/// [`IkError::Lanes`]
pub fn single(width: Width) -> Result<Work<f32>, IkError> {
    Ok(match checked(width)? {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: `checked` has found the instructions
        Width::Sixteen => |job, range, q, s| unsafe { avx512::<F32x16>(job, range, q, s) },
        #[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
        // SAFETY: as above
        Width::Eight => |job, range, q, s| unsafe { baseline::<F32x8>(job, range, q, s) },
        // SAFETY: as above
        _ => |job, range, q, s| unsafe { baseline::<f32>(job, range, q, s) },
    })
}

/// What solves in double precision.
///
/// # Errors
/// [`IkError::Lanes`]
pub fn double() -> Result<Work<f64>, IkError> {
    checked(Width::Scalar)?;
    // SAFETY: `checked` has found the instructions
    Ok(|job, range, q, s| unsafe { baseline::<f64>(job, range, q, s) })
}
