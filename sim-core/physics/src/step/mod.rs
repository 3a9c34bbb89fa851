//! One physics step on one screen.
//!
//! A step runs the stages of [`STAGES`] in order. Each is one page: source, equations, code; each
//! is written once and runs on every machine of [`crate::lane`].

mod actuation;
mod bias;
pub mod collide;
mod command;
mod constraint;
mod contact_rows;
mod integrate;
mod inverse_dynamics;
mod kinematics;
mod mass_matrix;
mod poses;
mod run;
mod site_inverse;
mod sites;
mod solver;
mod velocities;

use crate::arrays::{Block, WorkSlot as Slot};
use crate::constants::Constants;
use crate::constants::contact::PAIR_KINDS;
use crate::constants::params::Param;
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::Vec3;
pub use run::run;

/// The constants that a machine reads.
pub type ConstantsOf<C> = Constants<<<C as Cx>::F as Num>::Real>;
/// The block that a machine works on.
pub type BlockOf<C> = Block<<C as Cx>::F, <C as Cx>::V>;

/// A stage of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Commands as they act in this substep.
    Command,
    /// Frames, motion axes and inertias in the world.
    Kinematics,
    /// Coriolis, centrifugal and gravity forces.
    Bias,
    /// Joint-space inertia.
    MassMatrix,
    /// Applied, drive and damping forces.
    Actuation,
    /// Constraint rows of joints: stiffness and reference acceleration.
    Constraint,
    /// Where the shapes are.
    Place,
    /// Contacts of two kinds of shapes, by their place in [`PAIR_KINDS`].
    Touch(usize),
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
    /// What drives the joints, for output.
    JointTorque,
    /// Frames and velocities of sites, for output.
    Sites,
    /// What inertial measurement units in the sites show, for output.
    Imu,
    /// What moves the sites by a little, for output.
    SiteInverse,
}

/// Stages before contacts are looked for.
const BEFORE: [Stage; 7] = [
    Stage::Command,
    Stage::Kinematics,
    Stage::Bias,
    Stage::MassMatrix,
    Stage::Actuation,
    Stage::Constraint,
    Stage::Place,
];
const KINDS: usize = PAIR_KINDS.len();
/// Stages up to the accelerations.
const SOLVED: usize = BEFORE.len() + KINDS + 3;

/// The order of a step.
pub const STAGES: [Stage; SOLVED + 1] = sequence([Stage::Integrate]);

/// What evaluates a state without stepping: all derived fields.
pub const FORWARD: [Stage; SOLVED + 7] = sequence([
    Stage::Accelerations,
    Stage::JointTorque,
    Stage::Poses,
    Stage::Velocities,
    Stage::Sites,
    Stage::Imu,
    Stage::SiteInverse,
]);

/// Stages up to the accelerations, then some more.
const fn sequence<const N: usize, const MORE: usize>(more: [Stage; MORE]) -> [Stage; N] {
    let mut stages = [Stage::ContactRows; N];
    let mut k = 0;
    while k < BEFORE.len() {
        stages[k] = BEFORE[k];
        k += 1;
    }
    while k < BEFORE.len() + KINDS {
        stages[k] = Stage::Touch(k - BEFORE.len());
        k += 1;
    }
    stages[k + 1] = Stage::Solver;
    stages[k + 2] = Stage::Refine;
    k = 0;
    while k < MORE {
        stages[SOLVED + k] = more[k];
        k += 1;
    }
    stages
}

impl Stage {
    /// Every stage.
    pub const ALL: [Stage; SOLVED + 8] = sequence([
        Stage::Integrate,
        Stage::Accelerations,
        Stage::JointTorque,
        Stage::Poses,
        Stage::Velocities,
        Stage::Sites,
        Stage::Imu,
        Stage::SiteInverse,
    ]);

    /// Its place in [`Stage::ALL`].
    pub fn number(self) -> usize {
        let place = Stage::ALL.iter().position(|stage| *stage == self);
        place.expect("all stages are there")
    }

    /// Has the model anything for it to do?
    pub fn is_needed<R: Real>(self, m: &Constants<R>) -> bool {
        match self {
            Stage::Command => m.alters_commands(),
            Stage::Sites | Stage::Imu | Stage::SiteInverse => !m.sites.is_empty(),
            Stage::Place | Stage::ContactRows => !m.contacts.groups.is_empty(),
            Stage::Touch(kinds) => m.contacts.group(kinds).is_some(),
            _ => true,
        }
    }

    /// Its name, for timers and reports.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Command => "command",
            Stage::Kinematics => "kinematics",
            Stage::Bias => "bias",
            Stage::MassMatrix => "mass_matrix",
            Stage::Actuation => "actuation",
            Stage::Constraint => "constraint",
            Stage::Place => "place",
            Stage::Touch(kinds) => PAIR_KINDS[kinds].1,
            Stage::ContactRows => "contact_rows",
            Stage::Solver => "solver",
            Stage::Refine => "refine",
            Stage::Integrate => "integrate",
            Stage::Poses => "poses",
            Stage::Velocities => "velocities",
            Stage::Accelerations => "accelerations",
            Stage::JointTorque => "joint_torque",
            Stage::Sites => "sites",
            Stage::Imu => "imu",
            Stage::SiteInverse => "site_inverse",
        }
    }

    /// What it reads.
    pub fn reads(self) -> &'static [Slot] {
        use Slot::*;
        match self {
            Stage::Command => &[
                JointF,
                JointTargetQ,
                JointTargetQd,
                Params,
                Substep,
                CommandHistory,
                CommandNoise,
            ],
            Stage::Kinematics => &[JointQ, Params],
            Stage::Bias => &[JointQd, Motion, Inertia, Params],
            Stage::MassMatrix => &[Motion, Inertia, Params],
            Stage::Actuation => &[
                JointQ,
                JointQd,
                JointF,
                JointTargetQ,
                JointTargetQd,
                Applied,
                Params,
                Rotation,
                Origin,
                Motion,
                BiasForce,
            ],
            Stage::JointTorque => &[
                JointQ,
                JointQd,
                JointF,
                JointTargetQ,
                JointTargetQd,
                Applied,
                Params,
            ],
            Stage::Constraint => &[JointQ, JointQd, Params],
            Stage::Place => &[Params, Rotation, Origin, Reference],
            Stage::Touch(_) => &[],
            Stage::ContactRows => &[LeftOut, JointQd, Origin, Reference, Motion],
            Stage::Solver => &[
                JointQdd,
                Unconverged,
                Params,
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
                Params,
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
                Params,
                Rotation,
                JointQ,
                JointQRest,
                JointQd,
                JointQdd,
                MassMatrix,
                SmoothForce,
                ConstraintForce,
            ],
            Stage::Poses => &[JointQ, Rotation, Origin, Reference],
            Stage::Velocities => &[Rotation, Origin, Velocity],
            Stage::Sites => &[Rotation, Origin, Reference, Velocity, Orientation],
            Stage::Imu => &[JointQ, JointQd, JointQdd, Params, Rotation, Velocity],
            Stage::SiteInverse => &[Rotation, Origin, Reference, Motion],
        }
    }

    /// What it writes.
    pub fn writes(self) -> &'static [Slot] {
        use Slot::*;
        match self {
            Stage::Command => &[Substep, Applied],
            Stage::Kinematics => &[Rotation, Origin, Reference, Motion, Inertia],
            Stage::Bias => &[BiasForce, Velocity],
            Stage::MassMatrix => &[MassMatrix, Inertia],
            Stage::Actuation => &[SmoothForce],
            Stage::Constraint => &[EfcWeight, EfcAref, LimitSide],
            Stage::Place | Stage::Touch(_) => &[],
            Stage::ContactRows => &[LeftOut],
            Stage::Solver => &[JointQdd, Unconverged, EfcForce, ConstraintForce],
            Stage::Refine | Stage::Accelerations => &[JointQdd, EfcForce, ConstraintForce],
            Stage::Integrate => &[JointQ, JointQRest, JointQd, MassMatrix],
            Stage::JointTorque => &[JointTorque],
            Stage::Poses => &[BodyQ, Orientation],
            Stage::Velocities => &[LinkCenter, BodyQd],
            Stage::Sites => &[SiteQ, SiteQd],
            Stage::Imu => &[Gyro, Accelerometer],
            Stage::SiteInverse => &[SiteInverse],
        }
    }
}

/// Number `k` of a parameter: the worlds' own where it varies, else the model's.
#[inline(always)]
fn param<F: Num>(
    m: &Constants<F::Real>,
    params: &[F],
    param: Param,
    k: usize,
    fixed: F::Real,
) -> F {
    match m.varying.first(param) {
        Some(first) => params[first + k],
        None => F::k(fixed),
    }
}

/// Gravity in world axes.
#[inline(always)]
fn gravity<F: Num>(m: &Constants<F::Real>, params: &[F]) -> Vec3<F> {
    let mut gravity = [F::c(0.0); 3];
    for i in 0..3 {
        gravity[i] = param(m, params, Param::Gravity, i, m.gravity[i]);
    }
    gravity
}
