//! Springs and dampers whose stiffness or damping is a polynomial (MuJoCo: `stiffness="k a b"`, `damping="d a b"`).
//!
//! ```text
//! f = -x (k + a x + b x²)        E = x² (k/2 + a/3 x + b/4 x²)       x: how far a joint or a tendon is from rest
//! f = -v (d + a |v| + b v²)      -∂f/∂v = d + 2 a |v| + 3 b v²       v: velocity of a dof, rate of a tendon
//! ```
//!
//! A spring's polynomial takes x with its sign, so that a x may be negative; a damper's takes the speed. Springs of balls, and
//! of positions and rotations of free joints, have |x| in place of x in the parentheses.

use crate::lane::{Num, Real};

/// k + a x + b x²; k alone where a model has no a and b.
#[inline(always)]
pub(in crate::step) fn curved<F: Num>(k: F, curve: [F::Real; 2], x: F) -> F {
    weighted(k, curve, [1.0, 1.0], x)
}

/// d + 2 a |v| + 3 b v², the derivative of v (d + a |v| + b v²).
#[inline(always)]
pub(in crate::step) fn slope<F: Num>(d: F, curve: [F::Real; 2], v: F) -> F {
    weighted(d, curve, [2.0, 3.0], v.abs())
}

/// k/2 + a/3 x + b/4 x², the energy of a spring over x².
#[inline(always)]
pub(in crate::step) fn energy<F: Num>(k: F::Real, curve: [F::Real; 2], x: F) -> F {
    weighted(F::c(0.5 * k.to_f64()), curve, [1.0 / 3.0, 0.25], x)
}

/// Whether a polynomial has more than its constant.
#[inline(always)]
pub(in crate::step) fn bends<R: Real>([a, b]: [R; 2]) -> bool {
    a.to_f64() != 0.0 || b.to_f64() != 0.0
}

/// k + s a x + t b x².
#[inline(always)]
fn weighted<F: Num>(k: F, curve: [F::Real; 2], [s, t]: [f64; 2], x: F) -> F {
    let [a, b] = curve;
    // models without a and b keep the bits of a product with k
    if !bends(curve) {
        return k;
    }
    // Horner's scheme: (t b x + s a) x + k
    let (linear, square) = (F::c(s * a.to_f64()), F::c(t * b.to_f64()));
    square.fma(x, linear).fma(x, k)
}
