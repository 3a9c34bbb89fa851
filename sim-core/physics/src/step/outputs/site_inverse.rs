//! Inverse Jacobian of a site by damped least squares, for output: it maps a small displacement of the site to one of the
//! joints (Wampler 1986; Nakamura and Hanafusa 1986; Buss 2004).
//!
//! ```text
//! J(d) = ± [v(d) + ω(d) × p, ω(d)]      + for a dof that moves the site, - for one that moves the frame it is relative to
//! J⁺ = Jᵀ (J Jᵀ + λ² 1)⁻¹
//! [Jᵀ; λ 1] = [Q; S] R                  columns of [Q; S] orthonormal, R upper triangular: Rᵀ R = J Jᵀ + λ² 1
//! J⁺ = Q R⁻ᵀ = Q Sᵀ / λ                 its rows in the axes of the frame that the site is relative to
//! ```
//!
//! q = J⁺ x minimises |J q - x|² + λ² |q|²: more damping makes it shorter where the arm is stretched. A dof that moves both
//! frames has no column. J q̇ is the velocity of [`super::sites`], and displacements are in the same axes.
//!
//! R is found from J by modified Gram-Schmidt, not from J Jᵀ: in `f32` the rounding of J Jᵀ would exceed a small λ². No column
//! is shorter than λ, so no entry of J⁺ is much larger than 1 / λ.

use super::sites::{position, reference, to_local};
use crate::arrays::{Array as A, Workspace};
use crate::constants::Constants;
use crate::constants::site::Site;
use crate::lane::{Cx, Num, Real};
use crate::math::spatial::Spatial;
use crate::math::vec3::Vec3;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Scalars of a displacement: of the origin, then of the rotation.
const SIX: usize = 6;

/// Inverse Jacobians of sites, for output.
pub struct SiteInverse;

impl Stage for SiteInverse {
    const READS: &'static [A] = &[A::Rotation, A::Origin, A::Reference, A::Motion];
    const WRITES: &'static [A] = &[A::SiteInverse];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.sites.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        inverse_jacobian(m, &mut b.work);
    }
}

/// Writes the rows of J⁺ of the dofs that move each site, site by site.
#[inline(always)]
fn inverse_jacobian<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>) {
    // sites have rows one after the other, one row per dof that moves them
    let mut end = 0;
    for site in &m.sites {
        let first = end;
        end += site.columns.len();
        jacobian(w, site, first);
        // [Jᵀ; λ 1] is [q; s] before its columns are made orthonormal
        let damping = F::k(site.damping);
        let mut s = [[F::c(0.0); SIX]; SIX];
        for i in 0..SIX {
            s[i][i] = damping;
        }
        orthonormalize(&mut w.site_inverse[first..end], &mut s);
        let undamped = F::c(1.0).div(damping);
        for i in 0..SIX {
            for j in i..SIX {
                s[i][j] = s[i][j] * undamped;
            }
        }
        // a row of J⁺ = Q Sᵀ / λ; S is upper triangular, so entry i sums over j ≥ i
        for k in first..end {
            let q = w.site_inverse[k];
            let mut row = [F::c(0.0); SIX];
            for i in 0..SIX {
                for j in i..SIX {
                    row[i] = q[j].fma(s[i][j], row[i]);
                }
            }
            // with the other frame's axes A, the inverse of Aᵀ J is J⁺ A: rotate both halves of the row
            if let Some(other) = &site.relative_to {
                let [x, y, z, turn_x, turn_y, turn_z] = row;
                let Vec3([x, y, z]) = to_local(w, other, Vec3([x, y, z]));
                let turn = to_local(w, other, Vec3([turn_x, turn_y, turn_z]));
                let Vec3([turn_x, turn_y, turn_z]) = turn;
                row = [x, y, z, turn_x, turn_y, turn_z];
            }
            w.site_inverse[k] = row;
        }
    }
}

/// Jᵀ of a site in world axes, from row `first` on.
#[inline(always)]
fn jacobian<F: Num>(w: &mut Workspace<F>, site: &Site<F::Real>, first: usize) {
    let here = position(w, &site.mount);
    let mut there = here;
    if let Some(other) = &site.relative_to
        && site.mount.tree != other.tree
    {
        // the same point, from the reference point of the other robot
        there = here + (reference(w, &site.mount) - reference(w, other));
    }
    // v(d) + ω(d) × p and ω(d), with the opposite sign for a dof that moves the other frame
    for (k, column) in site.columns.iter().enumerate() {
        let Spatial([linear, angular]) = w.motion[column.dof];
        let Vec3([turn_x, turn_y, turn_z]) = angular;
        w.site_inverse[first + k] = if column.is_of_other {
            let Vec3([x, y, z]) = angular.cross_add(there, linear);
            [-x, -y, -z, -turn_x, -turn_y, -turn_z]
        } else {
            let Vec3([x, y, z]) = angular.cross_add(here, linear);
            [x, y, z, turn_x, turn_y, turn_z]
        };
    }
}

/// Makes the columns of [q; s] orthonormal, one after the other; `s` is upper triangular and stays so.
#[inline(always)]
fn orthonormalize<F: Num>(q: &mut [[F; SIX]], s: &mut [[F; SIX]; SIX]) {
    for c in 0..SIX {
        // squared norm of column c; below the diagonal, s is 0
        let mut square = F::c(0.0);
        for row in s[..c + 1].iter() {
            square = row[c].fma(row[c], square);
        }
        for row in q.iter() {
            square = row[c].fma(row[c], square);
        }
        // a column is never shorter than λ, so the division needs no guard
        let inverse = F::c(1.0).div(square.sqrt());
        for row in s[..c + 1].iter_mut() {
            row[c] = row[c] * inverse;
        }
        for row in q.iter_mut() {
            row[c] = row[c] * inverse;
        }
        // modified Gram-Schmidt: later columns lose their part along column c at once
        for d in c + 1..SIX {
            let mut along = F::c(0.0);
            for row in s[..c + 1].iter() {
                along = row[c].fma(row[d], along);
            }
            for row in q.iter() {
                along = row[c].fma(row[d], along);
            }
            for row in s[..c + 1].iter_mut() {
                row[d] = along.fnma(row[c], row[d]);
            }
            for row in q.iter_mut() {
                row[d] = along.fnma(row[c], row[d]);
            }
        }
    }
}
