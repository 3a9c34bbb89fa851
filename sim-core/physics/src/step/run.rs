//! Which function a stage is, by its number.
//!
//! The number belongs to the type and is no argument: what the other stages do, and the pairs of shapes that a stage does
//! not look at, then never reach the optimizer. It would take minutes to find out that nothing calls them.

use super::{
    BlockOf, ConstantsOf, Stage, actuation, bias, collide, command, constraint, contact_rows,
    integrate, kinematics, mass_matrix, poses, site_inverse, sites, solver, velocities,
};
use crate::lane::Cx;

/// A function that is generic over the number of a stage, for each of [`Stage::ALL`]: as many as there are.
#[macro_export]
macro_rules! every_stage {
    ($function:ident) => {
        $crate::every_stage!(@ $function
            0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24 25 26 27 28 29 30 31 32 33 34 35 36 37)
    };
    (@ $function:ident $($stage:literal)*) => {
        [$($function::<$stage>),*]
    };
}

/// What runs where stage `$number` is of a pattern; the stage is of exactly one.
macro_rules! by_number {
    ($number:ident, $($stage:pat => $run:expr,)*) => {
        const {
            let arms = 0 $(+ matches!(Stage::ALL[$number], $stage) as usize)*;
            assert!(arms == 1, "a stage has no arm in step/run.rs, or two");
        }
        $(if const { matches!(Stage::ALL[$number], $stage) } {
            $run;
        })*
    };
}

/// Runs stage `STAGE` of [`Stage::ALL`] on a block.
#[inline(always)]
pub fn run<C: Cx, const STAGE: usize>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let t = &m.contacts;
    by_number!(STAGE,
        Stage::Command => command::arrive(cx, m, b),
        Stage::Kinematics => kinematics::kinematics(cx, m, b),
        Stage::Bias => bias::bias_force(cx, m, b),
        Stage::MassMatrix => mass_matrix::mass_matrix(m, &b.params, &mut b.work),
        Stage::Actuation => actuation::smooth_force(cx, m, b),
        Stage::Constraint => constraint::rows(cx, m, b),
        Stage::Place => collide::place(cx, m, b),
        Stage::Touch(0) => collide::touch::<C, 0>(cx, t),
        Stage::Touch(1) => collide::touch::<C, 1>(cx, t),
        Stage::Touch(2) => collide::touch::<C, 2>(cx, t),
        Stage::Touch(3) => collide::touch::<C, 3>(cx, t),
        Stage::Touch(4) => collide::touch::<C, 4>(cx, t),
        Stage::Touch(5) => collide::touch::<C, 5>(cx, t),
        Stage::Touch(6) => collide::touch::<C, 6>(cx, t),
        Stage::Touch(7) => collide::touch::<C, 7>(cx, t),
        Stage::Touch(8) => collide::touch::<C, 8>(cx, t),
        Stage::Touch(9) => collide::touch::<C, 9>(cx, t),
        Stage::Touch(10) => collide::touch::<C, 10>(cx, t),
        Stage::Touch(11) => collide::touch::<C, 11>(cx, t),
        Stage::Touch(12) => collide::touch::<C, 12>(cx, t),
        Stage::Touch(13) => collide::touch::<C, 13>(cx, t),
        Stage::Touch(14) => collide::touch::<C, 14>(cx, t),
        Stage::Touch(15) => collide::touch::<C, 15>(cx, t),
        Stage::Touch(16) => collide::touch::<C, 16>(cx, t),
        Stage::Touch(17) => collide::touch::<C, 17>(cx, t),
        Stage::Touch(18) => collide::touch::<C, 18>(cx, t),
        Stage::Touch(19) => collide::touch::<C, 19>(cx, t),
        Stage::ContactRows => contact_rows::contact_rows(cx, m, b),
        Stage::Solver => solver::solve(cx, m, b),
        Stage::Refine => solver::refine(cx, m, b),
        Stage::Integrate => integrate::implicit_fast(cx, m, b),
        Stage::Accelerations => solver::accelerations(cx, m, b),
        Stage::JointTorque => actuation::joint_torque(cx, m, b),
        Stage::Poses => poses::body_q(cx, m, b),
        Stage::Velocities => velocities::body_qd(m, &mut b.work),
        Stage::Sites => sites::site_q(m, &mut b.work),
        Stage::Imu => sites::imu(cx, m, b),
        Stage::SiteInverse => site_inverse::inverse_jacobian(m, &mut b.work),
    );
}
