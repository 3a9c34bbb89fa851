//! Points of a plane, and angles in it.

use crate::lane::Num;
use std::f64::consts::PI;

/// What is no length (MuJoCo: `mjMINVAL`) [m].
pub(super) const TINY: f64 = 1e-15;

/// A point of the plane.
pub(super) type Flat<F> = [F; 2];

/// Where a way around a circle touches it.
pub(super) struct Arc<F: Num> {
    /// In which worlds it does.
    pub touches: F::Mask,
    /// Length on the circle [m].
    pub length: F,
    /// Where it meets the circle [m].
    pub meets: Flat<F>,
    /// Where it leaves it [m].
    pub leaves: Flat<F>,
}

impl<F: Num> Arc<F> {
    /// One arc where the mask holds, else the other.
    #[inline(always)]
    pub(super) fn select(mask: F::Mask, a: &Arc<F>, b: &Arc<F>) -> Arc<F> {
        Arc {
            touches: (mask & a.touches) | (!mask & b.touches),
            length: F::select(mask, a.length, b.length),
            meets: select(mask, a.meets, b.meets),
            leaves: select(mask, a.leaves, b.leaves),
        }
    }
}

/// One point where the mask holds, else the other.
#[inline(always)]
pub(super) fn select<F: Num>(mask: F::Mask, a: Flat<F>, b: Flat<F>) -> Flat<F> {
    [F::select(mask, a[0], b[0]), F::select(mask, a[1], b[1])]
}

#[inline(always)]
pub(super) fn dot<F: Num>(a: Flat<F>, b: Flat<F>) -> F {
    a[0].fma(b[0], a[1] * b[1])
}

/// a × b
#[inline(always)]
pub(super) fn cross<F: Num>(a: Flat<F>, b: Flat<F>) -> F {
    a[1].fnma(b[0], a[0] * b[1])
}

#[inline(always)]
pub(super) fn sub<F: Num>(a: Flat<F>, b: Flat<F>) -> Flat<F> {
    [a[0] - b[0], a[1] - b[1]]
}

/// a s + b
#[inline(always)]
pub(super) fn scale_add<F: Num>(a: Flat<F>, s: F, b: Flat<F>) -> Flat<F> {
    [a[0].fma(s, b[0]), a[1].fma(s, b[1])]
}

#[inline(always)]
pub(super) fn scale<F: Num>(a: Flat<F>, s: F) -> Flat<F> {
    [a[0] * s, a[1] * s]
}

#[inline(always)]
pub(super) fn norm<F: Num>(a: Flat<F>) -> F {
    dot(a, a).sqrt()
}

/// Direction of a point from the centre; that of the centre itself is x.
#[inline(always)]
pub(super) fn unit<F: Num>(a: Flat<F>) -> Flat<F> {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let size = norm(a);
    let is_center = size.lt(F::c(TINY));
    // a select: the centre divides by 1
    let inverse = one.div(F::select(is_center, one, size));
    select(is_center, [one, zero], scale(a, inverse))
}

/// The angle whose sine, at least 0, and cosine are these times any factor: in [0, π].
#[inline(always)]
pub(super) fn angle<F: Num>(sine: F, cosine: F) -> F {
    let angle = sine.atan2_positive(cosine.abs());
    F::select(cosine.lt(F::c(0.0)), F::c(PI) - angle, angle)
}

/// The angle whose sine is this, in [0, 1].
#[inline(always)]
pub(super) fn asin<F: Num>(sine: F) -> F {
    let one = F::c(1.0);
    sine.atan2_positive(((one - sine) * (one + sine)).max(F::c(0.0)).sqrt())
}
