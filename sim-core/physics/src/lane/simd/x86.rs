//! One world per lane of an x86 register: [`F32x8`] (AVX2) and [`F32x16`] (AVX-512).
//!
//! SAFETY of every intrinsic here: the types are used only below functions that enable their target features: a stage's
//! (`physics/src/compiled.rs`), a frame's (`engine/src/backend/cpu/dispatch.rs`) and an inverse problem's
//! (`ik/src/dispatch.rs`). Each runs after a check that the processor has them. What they call is `#[inline(always)]`, so
//! that it inherits the features.
#![allow(clippy::undocumented_unsafe_blocks)] // one proof serves all blocks: the module's documentation

use crate::lane::{Lane, Num};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Mul, Neg, Not, Sub};

/// Implements [`Num`] and [`Lane`] for a register type.
/// The bracketed names are intrinsics or the functions below that make up for missing ones.
macro_rules! register {
    ($(#[$doc:meta])* $name:ident($reg:ty), width $width:literal, mask $mask:ty,
     arithmetic [$add:ident $sub:ident $mul:ident $div:ident $fma:ident $fnma:ident $sqrt:ident $min:ident $max:ident],
     memory [$splat:ident $load:ident $store:ident $transpose:ident $block:ident],
     bits [$neg:ident $abs:ident $round:ident $lt:ident $select:ident],
     masks [$any:ident $all:ident $mask_bits:ident], places [$gather:ident $scatter:ident $indices:ident $permute:ident]) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        #[repr(transparent)]
        pub struct $name($reg);

        impl Default for $name {
            #[inline(always)]
            fn default() -> Self {
                Self(unsafe { $splat(0.0) })
            }
        }
        impl Add for $name {
            type Output = Self;
            #[inline(always)]
            fn add(self, b: Self) -> Self {
                Self(unsafe { $add(self.0, b.0) })
            }
        }
        impl Sub for $name {
            type Output = Self;
            #[inline(always)]
            fn sub(self, b: Self) -> Self {
                Self(unsafe { $sub(self.0, b.0) })
            }
        }
        impl Mul for $name {
            type Output = Self;
            #[inline(always)]
            fn mul(self, b: Self) -> Self {
                Self(unsafe { $mul(self.0, b.0) })
            }
        }
        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self(unsafe { $neg(self.0) })
            }
        }

        impl Num for $name {
            type Real = f32;
            type Mask = $mask;
            #[inline(always)]
            fn k(x: f32) -> Self {
                Self(unsafe { $splat(x) })
            }
            #[inline(always)]
            fn fma(self, b: Self, c: Self) -> Self {
                Self(unsafe { $fma(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn fnma(self, b: Self, c: Self) -> Self {
                Self(unsafe { $fnma(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn div(self, b: Self) -> Self {
                Self(unsafe { $div(self.0, b.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn min(self, b: Self) -> Self {
                Self(unsafe { $min(self.0, b.0) })
            }
            #[inline(always)]
            fn max(self, b: Self) -> Self {
                Self(unsafe { $max(self.0, b.0) })
            }
            #[inline(always)]
            fn abs(self) -> Self {
                Self(unsafe { $abs(self.0) })
            }
            #[inline(always)]
            fn round(self) -> Self {
                Self(unsafe { $round(self.0) })
            }
            #[inline(always)]
            fn lt(self, b: Self) -> $mask {
                unsafe { $lt(self.0, b.0) }
            }
            #[inline(always)]
            fn select(mask: $mask, a: Self, b: Self) -> Self {
                Self(unsafe { $select(mask, a.0, b.0) })
            }
        }

        impl Lane for $name {
            const WIDTH: usize = $width;
            #[inline(always)]
            fn load(from: &[f32]) -> Self {
                assert!(from.len() >= $width);
                // the slice holds a register (asserted); the load may be unaligned
                Self(unsafe { $load(from.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, to: &mut [f32]) {
                assert!(to.len() >= $width);
                // the slice holds a register (asserted); the store may be unaligned
                unsafe { $store(to.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn store_rows(numbers: [Self; 4], to: &mut [f32], stride: usize) {
                let [a, b, c, d] = numbers;
                // blocks of four worlds; world 4 l + r of a register is in block l of `worlds[r]`
                let worlds = unsafe { $transpose([a.0, b.0, c.0, d.0]) };
                let mut rows = to;
                for l in 0..$width / 4 {
                    for r in 0..4 {
                        let block = unsafe { $block(worlds[r], l) };
                        // the row holds four scalars (the index is checked)
                        unsafe { _mm_storeu_ps(rows[..4].as_mut_ptr(), block) };
                        if 4 * l + r + 1 < $width {
                            rows = &mut rows[stride..];
                        }
                    }
                }
            }
            #[inline(always)]
            fn all() -> $mask {
                unsafe { $all() }
            }
            #[inline(always)]
            fn any(mask: $mask) -> bool {
                unsafe { $any(mask) }
            }
            #[inline(always)]
            fn bits(mask: $mask) -> u32 {
                unsafe { $mask_bits(mask) }
            }
            #[inline(always)]
            fn lane(self, lane: usize) -> f32 {
                let mut lanes = [0.0; $width];
                self.store(&mut lanes);
                lanes[lane]
            }
            #[inline(always)]
            fn scatter(self, mask: $mask, to: &mut [Self], rows: Self, stride: usize) {
                // SAFETY: a register is transparent over $width scalars, those of its worlds in order
                let to = unsafe { std::slice::from_raw_parts_mut(to.as_mut_ptr().cast::<f32>(), to.len() * $width) };
                unsafe { $scatter(self.0, mask, to, rows.0, stride * $width) }
            }
            #[inline(always)]
            fn gather(from: &[f32], places: Self) -> Self {
                // clamped to the slice; NaN becomes 0
                let last = from.len().min(1 << 24) as f32 - 1.0;
                assert!(last >= 0.0, "nothing to read");
                let places = places.max(Self::k(0.0)).min(Self::k(last));
                Self(unsafe { $gather(from, places.0) })
            }
            #[inline(always)]
            fn take_lanes(targets: &mut [Self], sources: &[Self], from: &[u32], to: $mask) {
                assert!(from.len() >= $width);
                // the slice holds a register of indices (asserted), of which a permutation takes the lowest bits
                let from = unsafe { $indices(from.as_ptr().cast()) };
                for (target, source) in targets.iter_mut().zip(sources) {
                    target.0 = unsafe { $permute(target.0, to, from, source.0) };
                }
            }
        }
    };
}

register!(
    /// Eight worlds in an AVX2 register.
    F32x8(__m256), width 8, mask Mask8,
    arithmetic [_mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps _mm256_fmadd_ps _mm256_fnmadd_ps
        _mm256_sqrt_ps _mm256_min_ps _mm256_max_ps],
    memory [_mm256_set1_ps _mm256_loadu_ps _mm256_storeu_ps transpose8 block8],
    bits [neg8 abs8 round8 lt8 select8],
    masks [any8 all8 bits8], places [gather8 scatter8 _mm256_loadu_si256 permute8]
);

register!(
    /// Sixteen worlds in an AVX-512 register.
    F32x16(__m512), width 16, mask __mmask16,
    arithmetic [_mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps _mm512_fmadd_ps _mm512_fnmadd_ps
        _mm512_sqrt_ps _mm512_min_ps _mm512_max_ps],
    memory [_mm512_set1_ps _mm512_loadu_ps _mm512_storeu_ps transpose16 block16],
    bits [neg16 _mm512_abs_ps round16 lt16 select16],
    masks [any16 all16 bits16], places [gather16 scatter16 _mm512_loadu_si512 _mm512_mask_permutexvar_ps]
);

/// Booleans of eight worlds: all bits of a lane, or none. AVX-512 has registers for masks, which are `u16` in Rust.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Mask8(__m256);

impl BitAnd for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, b: Self) -> Self {
        Self(unsafe { _mm256_and_ps(self.0, b.0) })
    }
}
impl BitOr for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, b: Self) -> Self {
        Self(unsafe { _mm256_or_ps(self.0, b.0) })
    }
}
impl Not for Mask8 {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(unsafe { _mm256_xor_ps(self.0, all8().0) })
    }
}

#[inline(always)]
unsafe fn neg8(a: __m256) -> __m256 {
    unsafe { _mm256_xor_ps(a, _mm256_set1_ps(-0.0)) }
}
#[inline(always)]
unsafe fn abs8(a: __m256) -> __m256 {
    unsafe { _mm256_andnot_ps(_mm256_set1_ps(-0.0), a) }
}
#[inline(always)]
unsafe fn round8(a: __m256) -> __m256 {
    unsafe { _mm256_round_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(a) }
}
#[inline(always)]
unsafe fn lt8(a: __m256, b: __m256) -> Mask8 {
    unsafe { Mask8(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) }
}
#[inline(always)]
unsafe fn select8(mask: Mask8, a: __m256, b: __m256) -> __m256 {
    unsafe { _mm256_blendv_ps(b, a, mask.0) }
}
#[inline(always)]
unsafe fn all8() -> Mask8 {
    unsafe { Mask8(_mm256_castsi256_ps(_mm256_set1_epi32(-1))) }
}
#[inline(always)]
unsafe fn any8(a: Mask8) -> bool {
    unsafe { _mm256_movemask_ps(a.0) != 0 }
}
#[inline(always)]
unsafe fn bits8(a: Mask8) -> u32 {
    unsafe { _mm256_movemask_ps(a.0) as u32 }
}
/// Scalars of `from` at whole places inside it.
#[inline(always)]
unsafe fn gather8(from: &[f32], places: __m256) -> __m256 {
    unsafe { _mm256_i32gather_ps::<4>(from.as_ptr(), _mm256_cvtps_epi32(places)) }
}

/// To each lane of the mask the scalar of the lane that its index names.
#[inline(always)]
unsafe fn permute8(target: __m256, to: Mask8, from: __m256i, x: __m256) -> __m256 {
    unsafe { select8(to, _mm256_permutevar8x32_ps(x, from), target) }
}

/// Writes the scalar of each world w of the mask to `to[rows * stride + w]`, where `rows` are whole.
#[inline(always)]
unsafe fn scatter8(x: __m256, mask: Mask8, to: &mut [f32], rows: __m256, stride: usize) {
    let (mut numbers, mut places) = ([0.0; 8], [0u32; 8]);
    unsafe {
        _mm256_storeu_ps(numbers.as_mut_ptr(), x);
        _mm256_storeu_si256(places.as_mut_ptr().cast(), _mm256_cvttps_epi32(rows));
    }
    let mut worlds = unsafe { bits8(mask) };
    while worlds != 0 {
        let world = worlds.trailing_zeros() as usize & 7;
        worlds &= worlds - 1;
        to[places[world] as usize * stride + world] = numbers[world];
    }
}

/// In each block of four worlds: from scalars by world to worlds by scalar.
#[inline(always)]
unsafe fn transpose8([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    unsafe {
        let (ab, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (cd, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            _mm256_shuffle_ps::<0x44>(ab, cd),
            _mm256_shuffle_ps::<0xee>(ab, cd),
            _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
            _mm256_shuffle_ps::<0xee>(ab_high, cd_high),
        ]
    }
}
#[inline(always)]
unsafe fn block8(a: __m256, block: usize) -> __m128 {
    unsafe {
        match block {
            0 => _mm256_castps256_ps128(a),
            _ => _mm256_extractf128_ps::<1>(a),
        }
    }
}

#[inline(always)]
unsafe fn neg16(a: __m512) -> __m512 {
    unsafe { _mm512_xor_ps(a, _mm512_set1_ps(-0.0)) }
}
#[inline(always)]
unsafe fn round16(a: __m512) -> __m512 {
    unsafe { _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC }>(a) }
}
#[inline(always)]
unsafe fn lt16(a: __m512, b: __m512) -> __mmask16 {
    unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b) }
}
#[inline(always)]
unsafe fn select16(mask: __mmask16, a: __m512, b: __m512) -> __m512 {
    unsafe { _mm512_mask_blend_ps(mask, b, a) }
}
#[inline(always)]
unsafe fn any16(a: __mmask16) -> bool {
    a != 0
}
#[inline(always)]
unsafe fn bits16(a: __mmask16) -> u32 {
    u32::from(a)
}
/// As [`gather8`].
#[inline(always)]
unsafe fn gather16(from: &[f32], places: __m512) -> __m512 {
    unsafe { _mm512_i32gather_ps::<4>(_mm512_cvtps_epi32(places), from.as_ptr()) }
}
/// As [`scatter8`]. The instruction takes as long whatever the mask; a loop over its worlds takes 0.8 to 1.8 times that (Zen 5).
#[inline(always)]
unsafe fn scatter16(x: __m512, mask: __mmask16, to: &mut [f32], rows: __m512, stride: usize) {
    // places are compared unsigned, so that what lies below the largest integer is none below 0
    let places = to.len().min(1 << 31);
    assert!(places > 0, "nowhere to write");
    unsafe {
        let worlds = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
        let rows = _mm512_mullo_epi32(_mm512_cvttps_epi32(rows), _mm512_set1_epi32(stride as i32));
        let at = _mm512_add_epi32(rows, worlds);
        let last = _mm512_set1_epi32((places - 1) as i32);
        let outside = _mm512_mask_cmpgt_epu32_mask(mask, at, last);
        assert!(outside == 0, "a row out of bounds");
        // all places of the mask lie inside (asserted)
        _mm512_mask_i32scatter_ps::<4>(to.as_mut_ptr().cast(), mask, at, x);
    }
}
#[inline(always)]
unsafe fn all16() -> __mmask16 {
    0xffff
}
/// As [`transpose8`].
#[inline(always)]
unsafe fn transpose16([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    unsafe {
        let (ab, ab_high) = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
        let (cd, cd_high) = (_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
        [
            _mm512_shuffle_ps::<0x44>(ab, cd),
            _mm512_shuffle_ps::<0xee>(ab, cd),
            _mm512_shuffle_ps::<0x44>(ab_high, cd_high),
            _mm512_shuffle_ps::<0xee>(ab_high, cd_high),
        ]
    }
}
#[inline(always)]
unsafe fn block16(a: __m512, block: usize) -> __m128 {
    unsafe {
        match block {
            0 => _mm512_castps512_ps128(a),
            1 => _mm512_extractf32x4_ps::<1>(a),
            2 => _mm512_extractf32x4_ps::<2>(a),
            _ => _mm512_extractf32x4_ps::<3>(a),
        }
    }
}
