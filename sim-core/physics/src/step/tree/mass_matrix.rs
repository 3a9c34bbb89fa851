//! Joint-space inertia matrix by composite rigid bodies (Featherstone 2008, chapter 6).
//!
//! ```text
//! Iᶜ(b) = I(b) + Σ Iᶜ(child)          H(i,j) = S(j)ᵀ Iᶜ(body of i) S(i),  j on the path from i to the root
//! ```
//!
//! For a free body S = 1: its columns are the momentum Iᶜ S(i) itself, its own block is Iᶜ.
//!
//! Each Iᶜ is about the body's own point, and Iᶜ S(i) moves from there to the point of each body on the path (see
//! [`super::kinematics`]). So an entry's rounding is relative to what it is made of, also in `f32`.

use super::bias::along;
use super::free_joints;
use crate::arrays::{Array as A, Workspace};
use crate::constants::params::Param;
use crate::constants::{Constants, MassEntry, Motion};
use crate::lane::{Cx, Num};
use crate::math::spatial::{ANGULAR, Inertia, LINEAR, Spatial};
use crate::step::{BlockOf, ConstantsOf, Stage, param};

/// Joint-space inertia.
pub struct MassMatrix;

impl Stage for MassMatrix {
    const READS: &'static [A] = &[
        A::Arm,
        A::Motion,
        A::Inertia,
        A::Params,
        A::Rotation,
        A::Origin,
    ];
    const WRITES: &'static [A] = &[A::MassMatrix, A::Inertia];

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let (w, params) = (&mut b.work, &b.params);
        // places of the pattern that are on no path of the tree
        for &place in &m.mass_zeros {
            w.mass_matrix[place] = C::F::c(0.0);
        }
        // children follow their parents: in this order the inertia of a subtree is complete when its root is reached
        for (k, body) in m.bodies.iter().enumerate().rev() {
            let composite = w.inertia[k];
            let is_free = m.trees[body.tree].free.is_some();
            // row i of H: the dofs before it on its path, root first, and itself last
            for (axis, i) in body.dofs().enumerate() {
                let dof = &m.dofs[i];
                let entries = &m.mass_entries[dof.entries.0..dof.entries.1];
                let (last, path) = entries.split_last().expect("a dof meets itself");
                let diagonal;
                if body.motion == Motion::Free {
                    // S = 1: the row of Iᶜ, up to its diagonal
                    let row = free_row(&composite, axis);
                    for (entry, x) in path.iter().zip(row) {
                        w.mass_matrix[entry.place] = x;
                    }
                    diagonal = row[axis];
                } else {
                    // Iᶜ S(i) is the force of a unit acceleration, H(i,i) = S(i)ᵀ Iᶜ S(i)
                    let force = momentum(body.motion, &composite, &w.motion[i]);
                    diagonal = along(body.motion, &w.motion[i], force);
                    // H(i,j) = S(j)ᵀ Iᶜ S(i) up the path. A free root has S = 1: its six entries are the force itself
                    let (base, path) = path.split_at(if is_free { 6 } else { 0 });
                    let force = write_path(m, w, k, path, force);
                    for (entry, x) in base.iter().zip(force.scalars()) {
                        w.mass_matrix[entry.place] = x;
                    }
                }
                w.mass_matrix[last.place] = diagonal;
            }
            // Iᶜ(parent) += Iᶜ about the carrier's point
            if let Some(parent) = body.parent {
                w.inertia[parent] = w.inertia[parent] + composite.moved(w.arm[k]);
            }
        }
        // a drive's armature is on the diagonal. `add_armature` adds that of MuJoCo's free joints
        for &j in &m.diagonal_dofs {
            let diagonal = m.pattern.at(j, j);
            let armature = param(m, params, Param::JointArmature, j, m.dofs[j].armature);
            w.mass_matrix[diagonal] = w.mass_matrix[diagonal] + armature;
        }
        free_joints::add_armature(m, params, w);
    }
}

/// Iᶜ S(i) about the point of a body whose joint does not move it freely.
#[inline(always)]
fn momentum<F: Num>(motion: Motion, composite: &Inertia<F>, axis: &Spatial<F>) -> Spatial<F> {
    let h = composite.first_moment();
    match motion {
        Motion::Prismatic => {
            // S = (z, 0): momentum m z, and h × z about the point
            let z = axis[LINEAR];
            Spatial([z * composite[0], h.cross(z)])
        }
        _ => {
            // S = (0, z): momentum z × h, and I z about the point
            let z = axis[ANGULAR];
            Spatial([z.cross(h), composite.second_moment(z)])
        }
    }
}

/// Writes the entries of a dof of body `k` with those before it on its path, root first, from its Iᶜ S(i). Returns this
/// about the point of the body that carries the last.
#[inline(always)]
fn write_path<F: Num>(
    m: &Constants<F::Real>,
    w: &mut Workspace<F>,
    k: usize,
    path: &[MassEntry],
    force: Spatial<F>,
) -> Spatial<F> {
    let (mut at, mut force) = (k, force);
    // towards the root: the force moves to another point only where the body changes
    for entry in path.iter().rev() {
        let body = m.dofs[entry.other].body;
        if body != at {
            force = force.moved(w.arm[at]);
            at = body;
        }
        // S(j) · Iᶜ S(i), both about the point of j's body
        w.mass_matrix[entry.place] = along(m.bodies[body].motion, &w.motion[entry.other], force);
    }
    // of a root, which has no carrier, it is not used
    force.moved(w.arm[at])
}

/// Row `axis` of an inertia as a 6 × 6 matrix, linear then angular, up to its diagonal.
#[inline(always)]
fn free_row<F: Num>(inertia: &Inertia<F>, axis: usize) -> [F; 6] {
    let Inertia([m, hx, hy, hz, xx, yy, zz, xy, xz, yz]) = *inertia;
    let o = F::c(0.0);
    // lower triangle of [[m 1, -h×], [h×, I]]
    match axis {
        0 => [m, o, o, o, o, o],
        1 => [o, m, o, o, o, o],
        2 => [o, o, m, o, o, o],
        3 => [o, -hz, hy, xx, o, o],
        4 => [hz, o, -hx, xy, yy, o],
        _ => [-hy, hx, o, xz, yz, zz],
    }
}
