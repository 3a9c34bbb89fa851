//! Which friction contacts of two shapes have.

use crate::lane::Num;

/// Which friction of two shapes counts for a pair, where it varies.
pub mod rule {
    /// What [`FrictionCombine`](super::FrictionCombine) makes of both.
    pub const COMBINED: f64 = 0.0;
    /// The larger one.
    pub const LARGER: f64 = 1.0;
    /// That of the first shape, which has a higher priority.
    pub const FIRST: f64 = 2.0;
    /// That of the second shape.
    pub const SECOND: f64 = 3.0;
    /// The pair's own.
    pub const OWN: f64 = 4.0;
    /// That of the model, in all worlds.
    pub const FIXED: f64 = 5.0;
}

/// How the coefficients of friction of two shapes that touch combine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrictionCombine {
    /// The larger one (MuJoCo: `mj_contactParam`).
    #[default]
    Max,
    /// Their mean.
    Mean,
    /// The smaller one.
    Min,
    /// Their product.
    Product,
}

impl FrictionCombine {
    /// The coefficient of a pair.
    #[inline(always)]
    pub fn coefficient<F: Num>(self, a: F, b: F) -> F {
        match self {
            FrictionCombine::Max => a.max(b),
            FrictionCombine::Mean => (a + b) * F::c(0.5),
            FrictionCombine::Min => a.min(b),
            FrictionCombine::Product => a * b,
        }
    }
}
