//! One world at a time: `f64`, the reference, and `f32`, bitwise equal to a SIMD lane.

use super::{Lane, Num};

macro_rules! scalar {
    ($real:ident) => {
        impl Num for $real {
            type Real = $real;
            type Mask = bool;
            #[inline(always)]
            fn k(x: $real) -> Self {
                x
            }
            #[inline(always)]
            fn fma(self, b: Self, c: Self) -> Self {
                self.mul_add(b, c)
            }
            #[inline(always)]
            fn fnma(self, b: Self, c: Self) -> Self {
                (-self).mul_add(b, c)
            }
            #[inline(always)]
            fn div(self, b: Self) -> Self {
                self / b
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$real>::sqrt(self)
            }
            // as x86 does: `b` where either is NaN; `f32::min` would return the other
            #[inline(always)]
            fn min(self, b: Self) -> Self {
                if self < b { self } else { b }
            }
            #[inline(always)]
            fn max(self, b: Self) -> Self {
                if self > b { self } else { b }
            }
            #[inline(always)]
            fn abs(self) -> Self {
                <$real>::abs(self)
            }
            #[inline(always)]
            fn round(self) -> Self {
                self.round_ties_even()
            }
            #[inline(always)]
            fn lt(self, b: Self) -> bool {
                self < b
            }
            #[inline(always)]
            fn select(mask: bool, a: Self, b: Self) -> Self {
                if mask { a } else { b }
            }
        }

        impl Lane for $real {
            const WIDTH: usize = 1;
            #[inline(always)]
            fn load(from: &[$real]) -> Self {
                from[0]
            }
            #[inline(always)]
            fn store(self, to: &mut [$real]) {
                to[0] = self;
            }
            #[inline(always)]
            fn store_rows(numbers: [Self; 4], to: &mut [$real], _stride: usize) {
                to[..4].copy_from_slice(&numbers);
            }
            #[inline(always)]
            fn all() -> bool {
                true
            }
            #[inline(always)]
            fn any(mask: bool) -> bool {
                mask
            }
            #[inline(always)]
            fn bits(mask: bool) -> u32 {
                u32::from(mask)
            }
            #[inline(always)]
            fn lane(self, _lane: usize) -> $real {
                self
            }
            #[inline(always)]
            fn scatter(self, mask: bool, to: &mut [Self], rows: Self, stride: usize) {
                if mask {
                    to[rows as usize * stride] = self;
                }
            }
            #[inline(always)]
            fn gather(from: &[$real], places: Self) -> Self {
                from[places as usize]
            }
            #[inline(always)]
            fn take_lanes(targets: &mut [Self], sources: &[Self], _from: &[u32], to: bool) {
                if to {
                    targets.copy_from_slice(sources);
                }
            }
        }
    };
}

scalar!(f32);
scalar!(f64);
