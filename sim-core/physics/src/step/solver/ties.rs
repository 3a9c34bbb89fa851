//! Sums over the rows of ties, whose Jacobians are in `row_jacobian`.

use super::rows::{Law, dry_cost, dry_friction, equality, one_sided, pull};
use crate::constants::Constants;
use crate::constants::ties::TieLaw;
use crate::lane::Num;

/// The law of a row of a tie.
#[inline(always)]
pub(super) fn law<F: Num>(law: &TieLaw<F::Real>, jar: F, weight: F) -> Law<F> {
    match law {
        TieLaw::Equality(_) => equality(jar, weight),
        // Huber's zone is R × loss, with R = 1/D
        TieLaw::Friction(loss) => {
            let loss = F::k(*loss);
            dry_friction(jar, weight, loss.div(weight), loss)
        }
        TieLaw::Range(_) => one_sided(jar, weight),
    }
}

/// s(jar) of a row of a tie.
#[inline(always)]
pub(super) fn cost<F: Num>(law: &TieLaw<F::Real>, jar: F, weight: F) -> F {
    let half = F::c(0.5);
    match law {
        TieLaw::Equality(_) => half * weight * jar * jar,
        TieLaw::Friction(loss) => {
            let loss = F::k(*loss);
            dry_cost(jar, weight, loss.div(weight), loss)
        }
        // ½ D jar² = -½ f jar where the range pushes
        TieLaw::Range(_) => -(half * one_sided(jar, weight).force * jar),
    }
}

/// jar = J a - aref
#[inline(always)]
pub(super) fn residual<F: Num>(
    m: &Constants<F::Real>,
    jacobian: &[F],
    aref: &[F],
    a: &[F],
    jar: &mut [F],
) {
    let mut r = m.joint_rows();
    for tie in &m.ties {
        for row in 0..tie.rows {
            let mut sum = -aref[r];
            for (entry, &dof) in jacobian[tie.jacobian(row)].iter().zip(&tie.dofs) {
                sum = entry.fma(a[dof], sum);
            }
            jar[r] = sum;
            r += 1;
        }
    }
}

/// Adds Jᵀ W J to `hessian`, and Jᵀ times what `pull` makes of the law to `rhs`.
#[inline(always)]
pub(super) fn assemble<F: Num>(
    m: &Constants<F::Real>,
    jacobian: &[F],
    [weight, jar, aref]: [&[F]; 3],
    hessian: &mut [F],
    rhs: &mut [F],
    corrects: Option<F::Mask>,
) {
    let mut r = m.joint_rows();
    for tie in &m.ties {
        for row in 0..tie.rows {
            // stiffness and pull of the row; then Jᵀ W J of each dof with those up to it
            let law = law(&tie.law, jar[r], weight[r]);
            let pull = pull(&law, jar[r], aref[r], corrects);
            let entries = &jacobian[tie.jacobian(row)];
            let mut places = tie.places.iter();
            for (i, &dof) in tie.dofs.iter().enumerate() {
                rhs[dof] = entries[i].fma(pull, rhs[dof]);
                let stiff = law.stiffness * entries[i];
                for (other, &place) in entries[..i + 1].iter().zip(places.by_ref()) {
                    hessian[place] = stiff.fma(*other, hessian[place]);
                }
            }
            r += 1;
        }
    }
}

/// Writes the force of every row, and adds Jᵀ f to `joint`.
#[inline(always)]
pub(super) fn forces<F: Num>(
    m: &Constants<F::Real>,
    jacobian: &[F],
    [weight, jar]: [&[F]; 2],
    force: &mut [F],
    joint: &mut [F],
) {
    let mut r = m.joint_rows();
    for tie in &m.ties {
        for row in 0..tie.rows {
            // f = -s', and Jᵀ f on the dofs of the tie
            force[r] = law(&tie.law, jar[r], weight[r]).force;
            for (entry, &dof) in jacobian[tie.jacobian(row)].iter().zip(&tie.dofs) {
                joint[dof] = entry.fma(force[r], joint[dof]);
            }
            r += 1;
        }
    }
}
