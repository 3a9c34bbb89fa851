//! One world per lane of a vector register: [`F32x8`] everywhere, and `F32x16` where there is AVX-512.
//!
//! A width has the same bits on every processor: all operations of [`Num`](super::Num) are correctly rounded. Only the bits
//! of a NaN differ.

#[cfg(target_arch = "aarch64")]
mod neon;
#[cfg(target_arch = "x86_64")]
mod x86;

#[cfg(target_arch = "aarch64")]
pub use neon::{F32x8, Mask8};
#[cfg(target_arch = "x86_64")]
pub use x86::{F32x8, F32x16, Mask8};

/// The instructions of [`F32x8`].
pub const EIGHT: &str = if cfg!(target_arch = "aarch64") {
    "NEON"
} else {
    "AVX2"
};

/// Which blocks a processor runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Widths {
    /// One world: on x86 AVX2 with FMA.
    pub one: bool,
    /// Eight worlds: AVX2 with FMA, or NEON.
    pub eight: bool,
    /// Sixteen worlds: AVX-512.
    pub sixteen: bool,
}

/// Asks this processor.
#[must_use]
pub fn widths() -> Widths {
    #[cfg(target_arch = "x86_64")]
    {
        let avx2 = is_x86_feature_detected!("avx2")
            && is_x86_feature_detected!("fma")
            && is_x86_feature_detected!("bmi1")
            && is_x86_feature_detected!("bmi2");
        let avx512 = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512bw");
        Widths {
            one: avx2,
            eight: avx2,
            sixteen: avx2 && avx512,
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    Widths {
        one: true,
        eight: cfg!(target_arch = "aarch64"),
        sixteen: false,
    }
}
