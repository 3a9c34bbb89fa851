//! Functions that round to the nearest number, ties to even (IEEE 754), where a driver's own operation need not.
//!
//! Vulkan lets `fma` round twice, and asks of quotients 2.5 units in the last place, of roots some 3 (Vulkan 1.3, precision of SPIR-V
//! instructions). Sums and products are the nearest numbers everywhere.
//!
//! What a driver has is corrected by a remainder until it is less than a unit in the last place off. Then one of two neighbours is the
//! nearest number, and `fma` has their remainders exactly: that of a quotient (Markstein, IBM Journal of Research and Development 34,
//! 1990), and Tuckerman's test for a root (Agarwal et al., IBM Journal of Research and Development 30, 1986). Large and small numbers are
//! scaled by 2^64, so that nothing overflows, and no remainder is lost below 2^-126. A result that is itself below 2^-126 may be 0.

/// Operations that are printed as functions of this module. All false: as the driver has them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Corrections {
    /// `fma` by sums and products of doubles: the program then needs a device with 64-bit floats.
    pub fma: bool,
    /// Quotients.
    pub quotient: bool,
    /// Square roots.
    pub root: bool,
}

/// A product of doubles is exact. Their sum may lie halfway between two floats while the exact sum does not; then what the sum lost (Knuth,
/// The Art of Computer Programming 2, 4.2.2) tells which float is nearer.
const FUSED: &str = "
fn fused(a: f32, b: f32, c: f32) -> f32 {
    let product = f64(a) * f64(b);
    let term = f64(c);
    let sum = product + term;
    let near = f32(sum);
    let rest = sum - f64(near);
    let other = f32(sum + rest);
    let added = sum - product;
    let lost = (product - (sum - added)) + (term - added);
    let is_finite = abs(rest) <= abs(sum);
    return select(near, other, is_finite && f64(other) - sum == rest && rest * lost > 0.0lf);
}";

/// A power of two that brings a number near 1, or the inverse of it.
const SCALE: &str = "
fn scale(x: f32, small: f32, large: f32) -> f32 {
    return select(select(1.0f, small, abs(x) <= 5.421011e-20f), large, abs(x) >= 1.8446744e19f);
}";

/// The neighbour of a number, away from 0 or towards it.
const NEIGHBOUR: &str = "
fn neighbour(x: f32, is_larger: bool) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) + select(0xffffffffu, 1u, is_larger));
}";

const QUOTIENT: &str = "
fn quotient(above: f32, below: f32) -> f32 {
    let a = above * scale(above, 1.8446744e19f, 5.421011e-20f);
    let b = below * scale(below, 1.8446744e19f, 5.421011e-20f);
    let back = scale(below, 1.8446744e19f, 5.421011e-20f) * scale(above, 5.421011e-20f, 1.8446744e19f);
    let guess = 1.0f / b;
    let inverse = fma(fma(-b, guess, 1.0f), guess, guess);
    let first = a * inverse;
    let near = fma(fma(-first, b, a), inverse, first);
    let rest = fma(-near, b, a);
    let signs = bitcast<u32>(rest) ^ bitcast<u32>(b) ^ bitcast<u32>(near);
    let other = neighbour(near, (signs & 0x80000000u) == 0u);
    let nearest = select(near, other, abs(fma(-other, b, a)) < abs(rest));
    let is_regular = abs(a) > 0.0f && abs(b) > 0.0f && abs(near) > 0.0f && abs(near) <= 3.4028235e38f;
    return select(a * guess, nearest, is_regular) * back;
}";

const ROOT: &str = "
fn root(given: f32) -> f32 {
    let is_small = given < 1.0f;
    let a = given * select(1.0f, 1.8446744e19f, is_small);
    let first = sqrt(a);
    let near = fma(fma(-first, first, a), 0.5f / first, first);
    let up = neighbour(near, true);
    let down = neighbour(near, false);
    let above = select(near, up, fma(-near, up, a) > 0.0f);
    let nearest = select(above, down, fma(-near, down, a) <= 0.0f);
    let is_regular = given > 0.0f && given <= 3.4028235e38f;
    return select(first, nearest, is_regular) * select(1.0f, 2.3283064e-10f, is_small);
}";

impl Corrections {
    /// Their functions, as WGSL.
    pub fn functions(&self) -> String {
        let mut text = String::new();
        if self.fma {
            text += FUSED;
        }
        if self.quotient || self.root {
            text += NEIGHBOUR;
        }
        if self.quotient {
            text += SCALE;
            text += QUOTIENT;
        }
        if self.root {
            text += ROOT;
        }
        match self.fma {
            true => text.replace("fma(", "fused("),
            false => text,
        }
    }

    /// The function of a product and a sum.
    pub fn fma(&self) -> &'static str {
        if self.fma { "fused" } else { "fma" }
    }

    /// A quotient of two expressions.
    pub fn quotient(&self, a: &str, b: &str) -> String {
        match self.quotient {
            true => format!("quotient({a}, {b})"),
            false => format!("{a} / {b}"),
        }
    }

    /// The function of a square root.
    pub fn root(&self) -> &'static str {
        if self.root { "root" } else { "sqrt" }
    }
}
