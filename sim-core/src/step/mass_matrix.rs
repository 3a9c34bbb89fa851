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
    w.composite.copy_from_slice(&w.inertia);
    // entries off the paths to the root stay 0, as the workspace was made
    for (k, body) in m.bodies.iter().enumerate().rev() {
        let composite = w.composite[k];
        for i in body.dofs() {
            let dof = &m.dofs[i];
            let force = momentum(&composite, &w.motion[i]);
            for entry in &m.mass_entries[dof.entries.0..dof.entries.1] {
                w.mass_matrix[entry.place] = power(&w.motion[entry.other], &force);
            }
            let own = m.mass_entries[dof.entries.1 - 1].place;
            w.mass_matrix[own] = w.mass_matrix[own] + F::k(dof.armature);
        }
        if let Some(parent) = body.parent {
            for e in 0..10 {
                w.composite[parent][e] = w.composite[parent][e] + composite[e];
            }
        }
    }
}
