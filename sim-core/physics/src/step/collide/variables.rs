//! Vectors of variables of an execution context, and vectors of model tables.

use crate::lane::{Cx, Fixed, Table};
use crate::math::vec3::Vec3;

/// New variables.
#[inline(always)]
pub(super) fn var3<C: Cx>(cx: &mut C, x: Vec3<C::F>) -> [C::V; 3] {
    [cx.var(x[0]), cx.var(x[1]), cx.var(x[2])]
}

/// Their values.
#[inline(always)]
pub(super) fn get3<C: Cx>(cx: &C, v: &[C::V; 3]) -> Vec3<C::F> {
    Vec3([cx.get(&v[0]), cx.get(&v[1]), cx.get(&v[2])])
}

/// Assigns in the active worlds.
#[inline(always)]
pub(super) fn set3<C: Cx>(cx: &mut C, v: &mut [C::V; 3], x: Vec3<C::F>) {
    for i in 0..3 {
        cx.set(&mut v[i], x[i]);
    }
}

/// Assigns unmasked; see [`Cx::put`].
#[inline(always)]
pub(super) fn put3<C: Cx>(cx: &mut C, v: &mut [C::V; 3], x: Vec3<C::F>) {
    for i in 0..3 {
        cx.put(&mut v[i], x[i]);
    }
}

/// Three scalars of a row of a model table, another row in each world.
#[inline(always)]
pub(super) fn pick3<C: Cx>(cx: &mut C, t: Fixed, row: C::F, k: usize) -> Vec3<C::F> {
    Vec3([
        cx.pick(t, row, k),
        cx.pick(t, row, k + 1),
        cx.pick(t, row, k + 2),
    ])
}

/// Three scalars of a scratch row, loaded one by one.
#[inline(always)]
pub(super) fn load_each3<C: Cx>(cx: &mut C, t: Table, i: C::I, k: usize) -> Vec3<C::F> {
    Vec3([cx.load(t, i, k), cx.load(t, i, k + 1), cx.load(t, i, k + 2)])
}
