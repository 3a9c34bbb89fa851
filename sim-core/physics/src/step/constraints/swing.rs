//! By how much MuJoCo's J q̈ of a contact is less than ours.

use crate::constants::contact::Class;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf};

/// The difference between MuJoCo's J q̈ and ours. The acceleration of a free joint is that of its frame's origin there, of the
/// centre of mass here: they differ by ω × (ω × r). None where every centre of mass is its frame's origin. `lever` gives a scalar of
/// the contact's pair, if trees differ within the class.
#[inline(always)]
pub(super) fn swing_between<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    class: &Class<<C::F as Num>::Real>,
    lever: impl Fn(&mut C, usize) -> C::F,
) -> Option<Vec3<C::F>> {
    if C::TAKES_HEAPS && class.mixes {
        return swing_of_trees(cx, m, b, class, lever);
    }
    let (first, second) = class.trees;
    if first == Some(second) {
        // both bodies move with the same tree
        return None;
    }
    // of the second tree less that of the first, a static side having none
    let first = first.and_then(|tree| swing(cx, m, b, tree));
    let second = swing(cx, m, b, second);
    match (first, second) {
        (Some(first), Some(second)) => Some(second - first),
        (Some(first), None) => Some(first * -C::F::c(1.0)),
        (None, second) => second,
    }
}

/// [`swing_between`] where contacts of the class are of different trees: the lever of each tree says on which side it is, if any.
fn swing_of_trees<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    class: &Class<<C::F as Num>::Real>,
    lever: impl Fn(&mut C, usize) -> C::F,
) -> Option<Vec3<C::F>> {
    let mut sum: Option<Vec3<C::F>> = None;
    for (c, column) in class.columns.iter().enumerate() {
        let is_next = c == 0 || class.columns[c - 1].tree != column.tree;
        // the first dof of a tree with a free body is of that body
        if let (true, Some(swing)) = (is_next, swing(cx, m, b, column.tree)) {
            let swing = swing * lever(cx, column.lever);
            sum = Some(match sum {
                Some(sum) => sum + swing,
                None => swing,
            });
        }
    }
    sum
}

/// ω × (ω × r) of a tree's free body, with its centre of mass at r from its frame's origin.
#[inline(always)]
fn swing<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &BlockOf<C>, tree: usize) -> Option<Vec3<C::F>> {
    let free = m.trees[tree].free?;
    let body = &m.bodies[free];
    // MuJoCo's acceleration of this body is ours
    if body.center.iter().all(|x| x.to_f64() == 0.0) {
        return None;
    }
    let mut spin = Vec3::zero();
    for (i, x) in spin.iter_mut().enumerate() {
        *x = cx.get(&b.joint_qd[body.dof + 3 + i]);
    }
    // the frame's origin is kept relative to the centre
    Some(spin.cross(b.work.origin[free].cross(spin)))
}
