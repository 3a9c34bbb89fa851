//! Parameters as stages read them: values of each world where they vary, otherwise constants of the model.

pub(super) mod masses;

use crate::constants::Constants;
use crate::constants::params::Param;
use crate::lane::Num;
use crate::math::vec3::Vec3;

/// Value `k` of a parameter: that of each world where it varies, otherwise the model's, `fixed`.
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

/// What value `k` of a parameter has over its initial value; none where it does not vary.
#[inline(always)]
pub(super) fn moved_by<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    param: Param,
    k: usize,
) -> Option<F> {
    let place = m.varying.first(param)? + k;
    Some(params[place] - F::c(m.varying.start(place)))
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
