//! Joint-space inertia matrix by composite rigid bodies (Featherstone 2008, chapter 6).
//!
//! ```text
//! Iᶜ(b) = I(b) + Σ Iᶜ(child)          H(i,j) = S(j)ᵀ Iᶜ(body of i) S(i),  j on the path from i to the root
//! ```
//!
//! For a free body S = 1: its columns are the momentum Iᶜ S(i) itself, its own block is Iᶜ.

use super::param;
use crate::arrays::Workspace;
use crate::constants::params::Param;
use crate::constants::{Constants, Motion};
use crate::lane::Num;
use crate::math::spatial::{momentum, power};

#[inline(always)]
pub(super) fn mass_matrix<F: Num>(m: &Constants<F::Real>, params: &[F], w: &mut Workspace<F>) {
    for &place in &m.mass_zeros {
        w.mass_matrix[place] = F::c(0.0);
    }
    for (k, body) in m.bodies.iter().enumerate().rev() {
        // children come after their parents: all of them were added
        let composite = w.inertia[k];
        let is_free = m.trees[body.tree].free.is_some();
        for (axis, i) in body.dofs().enumerate() {
            let dof = &m.dofs[i];
            let entries = &m.mass_entries[dof.entries.0..dof.entries.1];
            let (own, path) = entries.split_last().expect("a dof meets itself");
            let diagonal;
            if body.motion == Motion::Free {
                let row = free_row(&composite, axis);
                for (entry, x) in path.iter().zip(row) {
                    w.mass_matrix[entry.place] = x;
                }
                diagonal = row[axis];
            } else {
                let force = momentum(&composite, &w.motion[i]);
                let (base, path) = path.split_at(if is_free { 6 } else { 0 });
                for (entry, x) in base.iter().zip(force.as_flattened()) {
                    w.mass_matrix[entry.place] = *x;
                }
                for entry in path {
                    w.mass_matrix[entry.place] = power(&w.motion[entry.other], &force);
                }
                diagonal = power(&w.motion[i], &force);
            }
            w.mass_matrix[own.place] =
                diagonal + param(m, params, Param::JointArmature, i, dof.armature);
        }
        if let Some(parent) = body.parent {
            for e in 0..10 {
                w.inertia[parent][e] = w.inertia[parent][e] + composite[e];
            }
        }
    }
}

/// Row `axis` of an inertia as a matrix of 6 × 6, linear then angular, up to its diagonal.
#[inline(always)]
fn free_row<F: Num>([m, hx, hy, hz, xx, yy, zz, xy, xz, yz]: &[F; 10], axis: usize) -> [F; 6] {
    let o = F::c(0.0);
    match axis {
        0 => [*m, o, o, o, o, o],
        1 => [o, *m, o, o, o, o],
        2 => [o, o, *m, o, o, o],
        3 => [o, -*hz, *hy, *xx, o, o],
        4 => [*hz, o, -*hx, *xy, *yy, o],
        _ => [-*hy, *hx, o, *xz, *yz, *zz],
    }
}
