//! One world per lane of two NEON registers: [`F32x8`].
//!
//! Eight worlds, as with AVX2, so that both have the same blocks of worlds. Operations on the two registers are independent,
//! which fills the pipelines of a core that starts several a cycle.
//!
//! SAFETY of every intrinsic here: NEON belongs to the baseline of aarch64.
#![allow(clippy::undocumented_unsafe_blocks)] // one proof serves all blocks: the module's documentation

use crate::lane::{Lane, Num};
use std::arch::aarch64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

/// Eight worlds in two NEON registers.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct F32x8([float32x4_t; 2]);

/// Booleans of eight worlds: all bits of a lane, or none.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Mask8([uint32x4_t; 2]);

/// Applies an expression to both registers.
macro_rules! both {
    ($name:ident($half:ident => $value:expr)) => {
        $name({
            let low = {
                let $half = 0;
                unsafe { $value }
            };
            let high = {
                let $half = 1;
                unsafe { $value }
            };
            [low, high]
        })
    };
}

impl Default for F32x8 {
    #[inline(always)]
    fn default() -> Self {
        Self::k(0.0)
    }
}
impl Add for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        both!(Self(h => vaddq_f32(self.0[h], b.0[h])))
    }
}
impl Sub for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        both!(Self(h => vsubq_f32(self.0[h], b.0[h])))
    }
}
impl Mul for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        both!(Self(h => vmulq_f32(self.0[h], b.0[h])))
    }
}
impl Neg for F32x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        both!(Self(h => vnegq_f32(self.0[h])))
    }
}

impl BitAnd for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, b: Self) -> Self {
        both!(Self(h => vandq_u32(self.0[h], b.0[h])))
    }
}
impl BitOr for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, b: Self) -> Self {
        both!(Self(h => vorrq_u32(self.0[h], b.0[h])))
    }
}
impl Not for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        both!(Self(h => vmvnq_u32(self.0[h])))
    }
}

impl Num for F32x8 {
    type Real = f32;
    type Mask = Mask8;
    #[inline(always)]
    fn k(x: f32) -> Self {
        Self([unsafe { vdupq_n_f32(x) }; 2])
    }
    #[inline(always)]
    fn fma(self, b: Self, c: Self) -> Self {
        both!(Self(h => vfmaq_f32(c.0[h], self.0[h], b.0[h])))
    }
    #[inline(always)]
    fn fnma(self, b: Self, c: Self) -> Self {
        both!(Self(h => vfmsq_f32(c.0[h], self.0[h], b.0[h])))
    }
    #[inline(always)]
    fn div(self, b: Self) -> Self {
        both!(Self(h => vdivq_f32(self.0[h], b.0[h])))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        both!(Self(h => vsqrtq_f32(self.0[h])))
    }
    // not fmin and fmax, which return NaN where either is NaN
    #[inline(always)]
    fn min(self, b: Self) -> Self {
        Self::select(self.lt(b), self, b)
    }
    #[inline(always)]
    fn max(self, b: Self) -> Self {
        Self::select(b.lt(self), self, b)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        both!(Self(h => vabsq_f32(self.0[h])))
    }
    #[inline(always)]
    fn round(self) -> Self {
        both!(Self(h => vrndnq_f32(self.0[h])))
    }
    #[inline(always)]
    fn lt(self, b: Self) -> Mask8 {
        both!(Mask8(h => vcltq_f32(self.0[h], b.0[h])))
    }
    #[inline(always)]
    fn select(mask: Mask8, a: Self, b: Self) -> Self {
        both!(Self(h => vbslq_f32(mask.0[h], a.0[h], b.0[h])))
    }
}

impl Lane for F32x8 {
    const WIDTH: usize = 8;
    #[inline(always)]
    fn load(from: &[f32]) -> Self {
        assert!(from.len() >= 8);
        // the slice holds both registers (asserted); the load may be unaligned
        both!(Self(h => vld1q_f32(from.as_ptr().add(4 * h))))
    }
    #[inline(always)]
    fn store(self, to: &mut [f32]) {
        assert!(to.len() >= 8);
        // the slice holds both registers (asserted); the store may be unaligned
        unsafe {
            vst1q_f32(to.as_mut_ptr(), self.0[0]);
            vst1q_f32(to.as_mut_ptr().add(4), self.0[1]);
        }
    }
    #[inline(always)]
    fn store_rows(numbers: [Self; 4], to: &mut [f32], stride: usize) {
        let [a, b, c, d] = numbers;
        let mut rows = to;
        for h in 0..2 {
            let worlds = unsafe { transposed([a.0[h], b.0[h], c.0[h], d.0[h]]) };
            for (r, world) in worlds.into_iter().enumerate() {
                // the row holds four scalars (the index is checked)
                unsafe { vst1q_f32(rows[..4].as_mut_ptr(), world) };
                if 4 * h + r + 1 < 8 {
                    rows = &mut rows[stride..];
                }
            }
        }
    }
    #[inline(always)]
    fn all() -> Mask8 {
        Mask8([unsafe { vdupq_n_u32(u32::MAX) }; 2])
    }
    #[inline(always)]
    fn any(mask: Mask8) -> bool {
        unsafe { vmaxvq_u32(vorrq_u32(mask.0[0], mask.0[1])) != 0 }
    }
    #[inline(always)]
    fn bits(mask: Mask8) -> u32 {
        const BITS: [[u32; 4]; 2] = [[1, 2, 4, 8], [16, 32, 64, 128]];
        unsafe {
            let low = vandq_u32(mask.0[0], vld1q_u32(BITS[0].as_ptr()));
            let high = vandq_u32(mask.0[1], vld1q_u32(BITS[1].as_ptr()));
            vaddvq_u32(vorrq_u32(low, high))
        }
    }
    #[inline(always)]
    fn lane(self, lane: usize) -> f32 {
        let mut lanes = [0.0; 8];
        self.store(&mut lanes);
        lanes[lane]
    }
    #[inline(always)]
    fn scatter(self, mask: Mask8, to: &mut [Self], rows: Self, stride: usize) {
        let (mut numbers, mut places) = ([0.0; 8], [0.0; 8]);
        self.store(&mut numbers);
        rows.store(&mut places);
        let mut worlds = Self::bits(mask);
        while worlds != 0 {
            let world = worlds.trailing_zeros() as usize & 7;
            worlds &= worlds - 1;
            let register = &mut to[places[world] as usize * stride];
            // SAFETY: a register is transparent over eight scalars, those of its worlds in order
            let lanes = unsafe { &mut *std::ptr::from_mut(register).cast::<[f32; 8]>() };
            lanes[world] = numbers[world];
        }
    }
    #[inline(always)]
    fn gather(from: &[f32], places: Self) -> Self {
        // clamped to the slice; NaN becomes 0
        let last = from.len().min(1 << 24) as f32 - 1.0;
        assert!(last >= 0.0, "nothing to read");
        let places = places.max(Self::k(0.0)).min(Self::k(last));
        let mut lanes = [0.0; 8];
        places.store(&mut lanes);
        for lane in &mut lanes {
            *lane = from[*lane as usize];
        }
        Self::load(&lanes)
    }
    #[inline(always)]
    fn take_lanes(targets: &mut [Self], sources: &[Self], from: &[u32], to: Mask8) {
        for (target, source) in targets.iter_mut().zip(sources) {
            let mut lanes = [0.0; 8];
            source.store(&mut lanes);
            let mut taken = [0.0; 8];
            for (taken, &lane) in taken.iter_mut().zip(from) {
                *taken = lanes[lane as usize & 7];
            }
            *target = Self::select(to, Self::load(&taken), *target);
        }
    }
}

/// From scalars by world to worlds by scalar.
#[inline(always)]
unsafe fn transposed([a, b, c, d]: [float32x4_t; 4]) -> [float32x4_t; 4] {
    unsafe {
        let (ab, ab_high) = (vzip1q_f32(a, b), vzip2q_f32(a, b));
        let (cd, cd_high) = (vzip1q_f32(c, d), vzip2q_f32(c, d));
        let pair = |low, high| {
            let (low, high) = (vreinterpretq_f64_f32(low), vreinterpretq_f64_f32(high));
            [
                vreinterpretq_f32_f64(vzip1q_f64(low, high)),
                vreinterpretq_f32_f64(vzip2q_f64(low, high)),
            ]
        };
        let ([first, second], [third, fourth]) = (pair(ab, cd), pair(ab_high, cd_high));
        [first, second, third, fourth]
    }
}
