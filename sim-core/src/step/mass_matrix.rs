//! Joint-space inertia matrix by composite rigid bodies (Featherstone 2008, chapter 6).
//!
//! ```text
//! Iᶜ(b) = I(b) + Σ Iᶜ(child)          H(i,j) = S(j)ᵀ Iᶜ(body of i) S(i),  j on the path from i to the root
//! ```

use crate::batch::Workspace;
use crate::lane::Num;
use crate::math::spatial::{momentum, power};
use crate::model::constants::Constants;

#[inline(always)]
pub(super) fn mass_matrix<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>) {
    for j in 0..m.dofs.len() {
        w.composite[j] = w.inertia[j];
    }
    // entries off the paths to the root stay 0, as the workspace was made
    for (i, dof) in m.dofs.iter().enumerate().rev() {
        let composite = w.composite[i];
        let force = momentum(&composite, &w.motion[i]);
        w.mass_matrix[m.pattern.at(i, i)] = power(&w.motion[i], &force) + F::k(dof.armature);
        let mut ancestor = dof.parent;
        while let Some(j) = ancestor {
            w.mass_matrix[m.pattern.at(i, j)] = power(&w.motion[j], &force);
            ancestor = m.dofs[j].parent;
        }
        if let Some(parent) = dof.parent {
            for e in 0..10 {
                w.composite[parent][e] = w.composite[parent][e] + composite[e];
            }
        }
    }
}
