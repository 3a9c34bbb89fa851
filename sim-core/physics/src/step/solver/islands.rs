//! Islands: kinematic trees that constraints couple, which MuJoCo solves one by one.
//!
//! A dof's island is the first dof of the first of its trees. Where no constraint acts on a tree, the number of dofs is added:
//! its accelerations are M⁻¹ τ. MuJoCo measures an island by the trace of its mass matrix (`mj_island`; the measure is found
//! by experiment with MuJoCo 3.17).

use super::contact_line::Island;
use super::contacts;
use super::rows::Acting;
use crate::arrays::Workspace;
use crate::constants::Constants;
use crate::constants::options::Search;
use crate::lane::{Cx, MaskOf, Num};
use crate::math::vec3::Vec3;
use crate::step::tree::generalized::{free_bodies, halves};
use crate::step::{BlockOf, ConstantsOf};

/// Writes the island of each dof.
#[inline(always)]
pub(super) fn find<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    search: &Search<<C::F as Num>::Real>,
    b: &mut BlockOf<C>,
    acting: Acting,
) {
    let w = &mut b.work;
    let (labels, weight) = (&mut w.island, &w.row_weight);
    let dofs = m.dofs.len();
    // each tree by itself, and not constrained yet: its first dof + n
    for (label, root) in labels.iter_mut().zip(&search.roots) {
        *label = C::F::c((root + dofs) as f64);
    }
    let mut links = Links { search, labels };
    let zero = C::F::c(0.0);
    let mut r = 0;
    // a row with D > 0 constrains its trees; an equality makes one island of its two trees
    for e in &m.equalities {
        links.add(cx, [e.follower, e.leader], zero.lt(weight[r]));
        r += 1;
    }
    for f in &m.frictions {
        links.add(cx, [f.dof], zero.lt(weight[r]));
        r += 1;
    }
    // limits, where they act
    for l in acting.runs().flatten() {
        links.add(cx, [m.limits[l].dof], zero.lt(weight[r + l]));
    }
    // ties and classes of contacts make one island of the trees of all their dofs
    for (r, tie) in (m.joint_rows()..m.rows()).zip(&m.tie_of_row) {
        let dofs = m.ties[*tie].dofs.iter().copied();
        links.add(cx, dofs, zero.lt(weight[r]));
    }
    for (k, class) in m.contacts.classes.iter().enumerate() {
        let some = C::F::c(0.5).lt(contacts::count_of_class(cx, &m.contacts, k));
        links.add(cx, class.columns.iter().map(|column| column.dof), some);
    }
    // MuJoCo's option `island` is off: all dofs are one island where any constraint acts
    if !search.islands {
        let constrained = links.any_constrained::<C>();
        for label in &mut *links.labels {
            *label = C::F::select(constrained, zero, *label);
        }
    }
}

/// The islands of all dofs, while constraints are added.
struct Links<'a, F: Num> {
    search: &'a Search<F::Real>,
    labels: &'a mut [F],
}

impl<F: Num> Links<'_, F> {
    /// Makes one island of the trees of these dofs, in the worlds where a constraint acts on them.
    #[inline(always)]
    fn add<C: Cx<F = F>>(
        &mut self,
        cx: &mut C,
        dofs: impl IntoIterator<Item = usize, IntoIter: Clone>,
        acts: MaskOf<C>,
    ) {
        if !cx.anywhere(acts) {
            return;
        }
        // the lowest label of these trees, n subtracted: a constraint acts on them now
        let roots = dofs.into_iter().map(|dof| self.search.roots[dof]);
        let count = F::c(self.labels.len() as f64);
        let mut least = count + count;
        for root in roots.clone() {
            let current = self.labels[root];
            least = least.min(F::select(current.lt(count), current, current - count));
        }
        // each dof with the label of one of these trees gets it; roots that repeat are skipped
        let mut last = None;
        for root in roots {
            if last == Some(root) {
                continue;
            }
            last = Some(root);
            let from = self.labels[root];
            for label in &mut *self.labels {
                let moves = acts & is_island(*label, from);
                *label = F::select(moves, least, *label);
            }
        }
    }

    /// Whether any constraint acts.
    fn any_constrained<C: Cx<F = F>>(&self) -> MaskOf<C> {
        // a label below n: see `add`
        let count = F::c(self.labels.len() as f64);
        let mut least = count;
        for label in &*self.labels {
            least = least.min(*label);
        }
        least.lt(count)
    }
}

/// Whether two islands are the same.
#[inline(always)]
pub(super) fn is_island<F: Num>(island: F, other: F) -> F::Mask {
    (island - other).abs().lt(F::c(0.5))
}

/// The trace of the mass matrix over the dofs of an island, in MuJoCo's velocities.
#[inline(always)]
pub(super) fn trace<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    w: &Workspace<C::F>,
    island: &Island<'_, C::F>,
) -> C::F {
    let zero = C::F::c(0.0);
    let mut sum = zero;
    // Σ M(j, j), tree by tree
    for segment in island.search.segments() {
        let here = island.has(segment.start);
        if cx.anywhere(here) {
            for j in segment {
                let diagonal = w.mass_matrix[m.pattern.at(j, j)];
                sum = sum + C::F::select(here, diagonal, zero);
            }
        }
    }
    for (k, dof) in free_bodies(m) {
        let here = island.has(dof);
        if !cx.anywhere(here) {
            continue;
        }
        // an angular velocity e about the frame's origin moves the centre of mass by e × r, with r = -origin
        let mut more = zero;
        for i in 0..3 {
            let mut axis = [zero; 3];
            axis[i] = C::F::c(1.0);
            let shift = w.origin[k].cross(Vec3(axis));
            // 2 M(angular i, linear) · shift + shiftᵀ M(linear, linear) shift, with shift = origin × eᵢ
            for row in 0..3 {
                let cross = entry(m, w, dof + 3 + i, dof + row);
                more = (cross + cross).fma(shift.0[row], more);
                for column in 0..3 {
                    let (high, low) = (row.max(column), row.min(column));
                    let linear = entry(m, w, dof + high, dof + low);
                    more = (linear * shift.0[row]).fma(shift.0[column], more);
                }
            }
        }
        sum = sum + C::F::select(here, more, zero);
    }
    sum
}

/// An entry of the mass matrix, column ≤ row.
#[inline(always)]
fn entry<F: Num>(m: &Constants<F::Real>, w: &Workspace<F>, row: usize, column: usize) -> F {
    match m.pattern.find(row, column) {
        Some(place) => w.mass_matrix[place],
        None => F::c(0.0),
    }
}

/// The norm of an acceleration of an island in MuJoCo's velocities.
#[inline(always)]
pub(super) fn norm<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    w: &Workspace<C::F>,
    island: &Island<'_, C::F>,
    step: &[C::F],
) -> C::F {
    let mut sum = dot(cx, island, step, step);
    // the linear half becomes a' = a - α × r; a difference of accelerations has no ω × (ω × r), and Rᵀ keeps norms
    for (k, dof) in free_bodies(m) {
        let here = island.has(dof);
        if cx.anywhere(here) {
            let [linear, angular] = halves(&step[dof..]);
            let moved = angular.cross_add(w.origin[k], linear);
            let more = moved.dot(moved) - linear.dot(linear);
            sum = sum + C::F::select(here, more, C::F::c(0.0));
        }
    }
    sum.sqrt()
}

/// The norm of a force of dofs over an island, in MuJoCo's velocities.
#[inline(always)]
pub(super) fn force_norm<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    w: &Workspace<C::F>,
    island: &Island<'_, C::F>,
    force: &[C::F],
) -> C::F {
    let mut sum = dot(cx, island, force, force);
    // the torque becomes τ' = Rᵀ (τ + r × f), and Rᵀ keeps its norm
    for (k, dof) in free_bodies(m) {
        let here = island.has(dof);
        if cx.anywhere(here) {
            let [force, torque] = halves(&force[dof..]);
            let moved = torque - w.origin[k].cross(force);
            let more = moved.dot(moved) - torque.dot(torque);
            sum = sum + C::F::select(here, more, C::F::c(0.0));
        }
    }
    sum.sqrt()
}

/// Σ x y over the dofs of an island.
#[inline(always)]
pub(super) fn dot<C: Cx>(
    cx: &mut C,
    island: &Island<'_, C::F>,
    first: &[C::F],
    second: &[C::F],
) -> C::F {
    let mut sum = C::F::c(0.0);
    for segment in island.search.segments() {
        let here = island.has(segment.start);
        if cx.anywhere(here) {
            for j in segment {
                let x = C::F::select(here, first[j], C::F::c(0.0));
                sum = x.fma(second[j], sum);
            }
        }
    }
    sum
}
