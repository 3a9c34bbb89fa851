//! A step that is implicit in all forces that change with the velocity (MuJoCo: `integrator="implicit"`).
//!
//! ```text
//! (M + h K) q̈' = smooth + constraint        K = -∂(actuators + passive - bias)/∂q̇        q̇ += h q̈'        q += h q̇
//! ```
//!
//! K has what `implicitfast` has, and the change of bias forces ([`crate::step::tree::bias_slope`]). That of a medium's forces on
//! ellipsoids is not made symmetric, so K is not symmetric. As in MuJoCo, K has products of dofs on one path to the root alone,
//! and an actuator whose own force is at its bound has none. Bounds of the forces on joints and tendons do not count. The
//! armature of a tendon is in M, but its part of the bias is not in K.
//!
//! A K of MuJoCo's coordinates is a K of ours, with h K c less on the right ([`crate::step::tree::free_joints`]). That of bias
//! forces is 0 where c is not.
//!
//! The matrix is kept as two triangles: with its diagonal in the mass matrix, and what is above it in `hessian`, transposed.
//! Elimination runs from the last dof to the first, without pivots, so that a tree makes no fill.

use super::semi_implicit::{advance, damped_system};
use crate::arrays::Array as A;
use crate::constants::options::Integrator;
use crate::constants::{Constants, MassEntry};
use crate::lane::{Cx, Num, Real};
use crate::step::forces::ellipsoid_fluid;
use crate::step::tree::bias_slope;
use crate::step::{BlockOf, ConstantsOf, Stage};

/// The next state.
pub struct Implicit;

impl Stage for Implicit {
    const READS: &'static [A] = &[
        A::Params,
        A::Ctrl,
        A::ControlHistory,
        A::DelayedControl,
        A::Act,
        A::ActDot,
        A::ActuatorMoment,
        A::PlasticRest,
        A::TenLength,
        A::TenMoment,
        A::TenVelocity,
        A::ActuatorLength,
        A::ActuatorVelocity,
        A::ActuatorForce,
        A::Rotation,
        A::Origin,
        A::Arm,
        A::Inertia,
        A::Motion,
        A::Velocity,
        A::JointQ,
        A::JointQRest,
        A::JointQd,
        A::JointQdd,
        A::MassMatrix,
        A::SmoothForce,
        A::ConstraintForce,
    ];
    // the last stage of a step: the mass matrix is not read after it
    const WRITES: &'static [A] = &[
        A::JointQ,
        A::JointQRest,
        A::JointQd,
        A::JointQdd,
        A::Act,
        A::ControlHistory,
        A::PlasticRest,
        A::MassMatrix,
    ];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        m.integrator == Integrator::Implicit
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // the symmetric part of M + h K, and the right-hand side
        damped_system(cx, m, b);
        let w = &mut b.work;
        w.hessian.copy_from_slice(&w.mass_matrix);
        // what is not symmetric
        bias_slope::add_bias_slope::<C>(m, b);
        ellipsoid_fluid::add_whole_damping::<C>(m, b);
        // q̈' in place of the right-hand side
        let w = &mut b.work;
        solve(m, &mut w.mass_matrix, &mut w.hessian, &mut w.acceleration);
        advance(cx, m, b);
    }
}

/// Dofs before one on its path and itself, with their places in its row.
#[inline(always)]
fn row<R>(m: &Constants<R>, dof: usize) -> &[MassEntry] {
    let (start, end) = m.dofs[dof].entries;
    &m.mass_entries[start..end]
}

/// Replaces x by A⁻¹ x. `lower` has A(k, i) and the diagonal, `upper` has A(i, k) at the same place, i before k on its path.
#[inline(always)]
fn solve<F: Num>(m: &Constants<F::Real>, lower: &mut [F], upper: &mut [F], x: &mut [F]) {
    for k in (0..m.dofs.len()).rev() {
        let (last, path) = row(m, k).split_last().expect("a dof meets itself");
        let inverse = F::c(1.0).div(lower[last.place]);
        lower[last.place] = inverse;
        for entry in path {
            // A(i, k) / A(k, k) and A(k, i) / A(k, k)
            let (share, other) = (upper[entry.place] * inverse, lower[entry.place] * inverse);
            // the dofs before i are those with which the path of k begins
            for (target, from) in row(m, entry.other).iter().zip(path) {
                // A(i, j) -= A(i, k) A(k, j) / A(k, k)
                let (at, from) = (target.place, from.place);
                lower[at] = share.fnma(lower[from], lower[at]);
                // A(j, i) -= A(j, k) A(k, i) / A(k, k); that on the diagonal is not read
                upper[at] = other.fnma(upper[from], upper[at]);
            }
            x[entry.other] = share.fnma(x[k], x[entry.other]);
        }
    }
    // x(k) = (x(k) - Σ A(k, i) x(i)) / A(k, k), from the root
    for k in 0..m.dofs.len() {
        let (last, path) = row(m, k).split_last().expect("a dof meets itself");
        for entry in path {
            x[k] = lower[entry.place].fnma(x[entry.other], x[k]);
        }
        x[k] = x[k] * lower[last.place];
    }
}
