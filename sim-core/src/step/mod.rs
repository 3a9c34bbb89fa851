//! One physics step on one screen.
//!
//! A step runs the stages of [`STAGES`] in order. Each is one page: source, equations, code; each
//! is written once and runs on every machine of [`crate::lane`].

mod actuation;
mod bias;
pub mod collide;
mod constraint;
mod contact_rows;
mod integrate;
mod inverse_dynamics;
mod kinematics;
mod mass_matrix;
mod poses;
mod solver;
mod velocities;

use crate::batch::{Block, WorkSlot as Slot};
use crate::lane::{Cx, Num};
use crate::model::constants::Constants;

/// The constants that a machine reads.
pub type ConstantsOf<C> = Constants<<<C as Cx>::F as Num>::Real>;
/// The block that a machine works on.
pub type BlockOf<C> = Block<<C as Cx>::F, <C as Cx>::V>;

/// A stage of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Frames, motion axes and inertias in the world.
    Kinematics,
    /// Coriolis, centrifugal and gravity forces.
    Bias,
    /// Joint-space inertia.
    MassMatrix,
    /// Applied, drive and damping forces.
    Actuation,
    /// Constraint rows: stiffness and reference acceleration.
    Constraint,
    /// Contacts: where shapes touch.
    Collide,
    /// Constraint rows of contacts.
    ContactRows,
    /// Accelerations and constraint forces.
    Solver,
    /// Accelerations and constraint forces, corrected where `f32` needs it.
    Refine,
    /// The next state.
    Integrate,
    /// Link frames for output.
    Poses,
    /// Link velocities for output.
    Velocities,
    /// Accelerations for output, where the solver left them out.
    Accelerations,
}

/// The order of a step.
pub const STAGES: [Stage; 10] = [
    Stage::Kinematics,
    Stage::Bias,
    Stage::MassMatrix,
    Stage::Actuation,
    Stage::Constraint,
    Stage::Collide,
    Stage::ContactRows,
    Stage::Solver,
    Stage::Refine,
    Stage::Integrate,
];

/// What evaluates a state without stepping: all derived fields.
pub const FORWARD: [Stage; 12] = [
    Stage::Kinematics,
    Stage::Bias,
    Stage::MassMatrix,
    Stage::Actuation,
    Stage::Constraint,
    Stage::Collide,
    Stage::ContactRows,
    Stage::Solver,
    Stage::Refine,
    Stage::Accelerations,
    Stage::Poses,
    Stage::Velocities,
];

impl Stage {
    /// Every stage.
    pub const ALL: [Stage; 13] = [
        Stage::Kinematics,
        Stage::Bias,
        Stage::MassMatrix,
        Stage::Actuation,
        Stage::Constraint,
        Stage::Collide,
        Stage::ContactRows,
        Stage::Solver,
        Stage::Refine,
        Stage::Integrate,
        Stage::Poses,
        Stage::Velocities,
        Stage::Accelerations,
    ];

    /// Its name, for timers and reports.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Kinematics => "kinematics",
            Stage::Bias => "bias",
            Stage::MassMatrix => "mass_matrix",
            Stage::Actuation => "actuation",
            Stage::Constraint => "constraint",
            Stage::Collide => "collide",
            Stage::ContactRows => "contact_rows",
            Stage::Solver => "solver",
            Stage::Refine => "refine",
            Stage::Integrate => "integrate",
            Stage::Poses => "poses",
            Stage::Velocities => "velocities",
            Stage::Accelerations => "accelerations",
        }
    }

    /// What it reads.
    pub fn reads(self) -> &'static [Slot] {
        use Slot::*;
        match self {
            Stage::Kinematics => &[JointQ],
            Stage::Bias => &[JointQd, Motion, Inertia],
            Stage::MassMatrix => &[Motion, Inertia],
            Stage::Actuation => &[
                JointQ,
                JointQd,
                JointF,
                JointTargetQ,
                JointTargetQd,
                BiasForce,
            ],
            Stage::Constraint => &[JointQ, JointQd],
            Stage::Collide => &[LeftOut, Rotation, Origin, Reference],
            Stage::ContactRows => &[JointQd, Reference, Motion],
            Stage::Solver => &[
                JointQdd,
                Unconverged,
                MassMatrix,
                SmoothForce,
                EfcWeight,
                EfcAref,
                LimitSide,
            ],
            Stage::Refine | Stage::Accelerations => &[
                JointQ,
                JointQd,
                JointQdd,
                Rotation,
                Velocity,
                BiasForce,
                MassMatrix,
                SmoothForce,
                EfcWeight,
                EfcAref,
                LimitSide,
                EfcForce,
                ConstraintForce,
            ],
            Stage::Integrate => &[
                Rotation,
                JointQ,
                JointQd,
                JointQdd,
                MassMatrix,
                SmoothForce,
                ConstraintForce,
            ],
            Stage::Poses => &[JointQ, Rotation, Origin, Reference],
            Stage::Velocities => &[Rotation, Origin, Velocity],
        }
    }

    /// What it writes.
    pub fn writes(self) -> &'static [Slot] {
        use Slot::*;
        match self {
            Stage::Kinematics => &[Rotation, Origin, Reference, Motion, Inertia],
            Stage::Bias => &[BiasForce, Velocity],
            Stage::MassMatrix => &[MassMatrix, Inertia],
            Stage::Actuation => &[SmoothForce],
            Stage::Constraint => &[EfcWeight, EfcAref, LimitSide],
            Stage::Collide => &[LeftOut],
            Stage::ContactRows => &[],
            Stage::Solver => &[JointQdd, Unconverged, EfcForce, ConstraintForce],
            Stage::Refine | Stage::Accelerations => &[JointQdd, EfcForce, ConstraintForce],
            Stage::Integrate => &[JointQ, JointQd, MassMatrix],
            Stage::Poses => &[BodyQ],
            Stage::Velocities => &[LinkCenter, BodyQd],
        }
    }

    /// Runs it on a block.
    #[inline(always)]
    pub fn run<C: Cx>(self, cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        match self {
            Stage::Kinematics => kinematics::kinematics(cx, m, b),
            Stage::Bias => bias::bias_force(cx, m, b),
            Stage::MassMatrix => mass_matrix::mass_matrix(m, &mut b.work),
            Stage::Actuation => actuation::smooth_force(cx, m, b),
            Stage::Constraint => constraint::rows(cx, m, b),
            Stage::Collide => collide::collide(cx, m, b),
            Stage::ContactRows => contact_rows::contact_rows(cx, m, b),
            Stage::Solver => solver::solve(cx, m, b),
            Stage::Refine => solver::refine(cx, m, b),
            Stage::Integrate => integrate::implicit_fast(cx, m, b),
            Stage::Poses => poses::body_q(cx, m, b),
            Stage::Velocities => velocities::body_qd(m, &mut b.work),
            Stage::Accelerations => solver::accelerations(cx, m, b),
        }
    }
}

/// One substep: the state moves on by `dt`.
#[inline(always)]
pub fn step<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    for stage in STAGES {
        stage.run(cx, m, b);
    }
}
