//! What actuators of MuJoCo models have beyond a linear law: activations, and lengths whose moments are found at run time.

use super::recast::{Recast, recast};
use super::site::Mount;
use crate::lane::Real;

recast! {
    /// The state of an actuator (MuJoCo: `actuator_dyntype`).
    #[derive(Clone, Debug)]
    pub struct Activation<R> {
        /// Its place in `act`.
        pub place: usize,
        /// How fast it changes.
        pub rate: ActivationRate<R>,
        /// For how long that lasts in a step [s]: the step, or less where a filter is solved exactly.
        pub reach: R,
        /// Its bounds, if it has any.
        pub range: Option<[R; 2]>,
        /// Whether the force is that of the next activation (MuJoCo: `actearly`).
        pub early: bool,
    }
}

/// How fast an activation changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ActivationRate<R> {
    /// Not at all: its actuator is switched off.
    Held,
    /// As the control.
    Control,
    /// As the control less the activation, over this time constant [s].
    Filter(R),
}

recast! {
    /// A length whose moments change with the state.
    #[derive(Clone, Debug)]
    pub struct TurningLength<R> {
        /// What it measures.
        pub kind: LengthKind<R>,
        /// Factors of the translations and of the rotations.
        pub gear: [R; 6],
        /// The dofs that it depends on, rising.
        pub dofs: Vec<usize>,
        /// Place of its first moment in `actuator_moment`; each dof has one.
        pub first: usize,
    }
}

/// What a length measures.
#[derive(Clone, Debug)]
pub enum LengthKind<R> {
    /// The rotation vector of a ball, in the axes of its link, or of its parent.
    Ball {
        /// Its first coordinate.
        coord: usize,
        /// Whether gears are in the axes of the parent.
        in_parent: bool,
    },
    /// Nothing: forces and torques on a free body.
    Free {
        /// The body.
        body: usize,
        /// Whether the torque's gears are in the axes of the world, instead of those of the body.
        in_parent: bool,
    },
    /// Nothing: forces and torques in the axes of a site. With a second site, where the first is to it.
    Site(Sites<R>),
}

recast! {
    /// A site, and the one that it pushes against.
    #[derive(Clone, Debug)]
    pub struct Sites<R> {
        /// The site.
        pub site: Mount<R>,
        /// The site that it is relative to, if there is one.
        pub reference: Option<Mount<R>>,
    }
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for ActivationRate<R> {
    type Out = ActivationRate<S>;
    fn recast(&self) -> ActivationRate<S> {
        match self {
            ActivationRate::Held => ActivationRate::Held,
            ActivationRate::Control => ActivationRate::Control,
            ActivationRate::Filter(time) => ActivationRate::Filter(time.recast()),
        }
    }
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for LengthKind<R> {
    type Out = LengthKind<S>;
    fn recast(&self) -> LengthKind<S> {
        match *self {
            LengthKind::Ball { coord, in_parent } => LengthKind::Ball { coord, in_parent },
            LengthKind::Free { body, in_parent } => LengthKind::Free { body, in_parent },
            LengthKind::Site(ref sites) => LengthKind::Site(sites.recast()),
        }
    }
}
