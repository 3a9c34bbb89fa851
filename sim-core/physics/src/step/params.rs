//! Parameters as stages read them: the worlds' own where they vary, else constants of the model.

use crate::constants::Constants;
use crate::constants::params::Param;
use crate::lane::Num;
use crate::math::vec3::Vec3;

/// Value `k` of a parameter: the worlds' own where it varies, else `fixed`, the model's.
#[inline(always)]
pub(super) fn param<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    param: Param,
    k: usize,
    fixed: F::Real,
) -> F {
    match m.varying.first(param) {
        Some(first) => params[first + k],
        None => F::k(fixed),
    }
}

/// Gravity in world axes.
#[inline(always)]
pub(super) fn gravity<F: Num>(m: &Constants<F::Real>, params: &[F]) -> Vec3<F> {
    let mut gravity = Vec3::zero();
    for i in 0..3 {
        gravity[i] = param(m, params, Param::Gravity, i, m.gravity[i]);
    }
    gravity
}
