//! Actuators: forces along lengths that a control and an activation drive.

use super::lengths::Term;
use super::recast::{Recast, recast, same};
use super::site::Mount;
use crate::lane::Real;

recast! {
    /// Actuators, and bounds of their sums; none where only drives move a model.
    #[derive(Clone, Debug)]
    pub struct Actuators<R> {
        /// Actuators.
        pub all: Vec<Actuator<R>>,
        /// How many of them have an activation.
        pub activations: usize,
        /// Those whose force may depend on their velocity.
        pub damped: Vec<usize>,
        /// Bounds of the sum of actuator forces on a dof.
        pub dof_bounds: Vec<ActuatorBound<R>>,
        /// Bounds of the sum of actuator forces along a tendon.
        pub tendon_bounds: Vec<TendonBound<R>>,
        /// Those that pull a body to what it touches.
        pub adhesions: Vec<Adhesion>,
    }
}

impl<R> Actuators<R> {
    /// Those that follow earlier controls, in their order.
    #[inline(always)]
    pub fn delays(&self) -> impl Iterator<Item = &ControlDelay<R>> {
        self.all
            .iter()
            .filter_map(|actuator| actuator.delay.as_ref())
    }

    /// How many earlier controls they keep.
    pub fn kept_controls(&self) -> usize {
        self.delays().map(|delay| delay.steps).sum()
    }
}

impl<R> Default for Actuators<R> {
    fn default() -> Actuators<R> {
        Actuators {
            all: Vec::new(),
            activations: 0,
            damped: Vec::new(),
            dof_bounds: Vec::new(),
            tendon_bounds: Vec::new(),
            adhesions: Vec::new(),
        }
    }
}

recast! {
    /// An actuator: a force along a length (MuJoCo: `actuator/general`).
    #[derive(Clone, Debug)]
    pub struct Actuator<R> {
        /// Its length is the sum of these coordinates times their coefficients, gear included.
        pub terms: Vec<Term<R>>,
        /// In place of that, a length whose moments are found at run time.
        pub turning: Option<TurningLength<R>>,
        /// What its control drives, if that is not its force.
        pub activation: Option<Activation<R>>,
        /// Which earlier controls it follows, if not the one that is held.
        pub delay: Option<ControlDelay<R>>,
        /// Bounds of its control, if it has any.
        pub ctrl_range: Option<[R; 2]>,
        /// Bounds of its force, if it has any [N or N·m].
        pub force_range: Option<[R; 2]>,
        /// What the control or the activation is multiplied with: a constant, and factors of length and velocity.
        pub gain: [R; 3],
        /// What is added to it: a constant, and factors of length and velocity.
        pub bias: [R; 3],
        /// In place of that gain, a muscle's.
        pub muscle_gain: Option<Muscle<R>>,
        /// In place of that bias, a muscle's.
        pub muscle_bias: Option<Muscle<R>>,
        /// What a DC motor has besides, with gain and bias for its torque without inductance and bounds.
        pub motor: Option<Motor<R>>,
    }
}

recast! {
    /// The earlier controls that an actuator follows (MuJoCo: `delay`, `nsample` and `interp`).
    #[derive(Clone, Debug, PartialEq)]
    pub struct ControlDelay<R> {
        /// Its place in `delayed_control`.
        pub place: usize,
        /// Place in `control_history` of the control of the last step. Those of the steps before it follow.
        pub first: usize,
        /// How many are kept.
        pub steps: usize,
        /// Their weights at the start of a step, in its middle and at its end, from the control of the last step on.
        pub weights: [Vec<R>; 3],
    }
}

recast! {
    /// A DC motor (MuJoCo: `actuator/dcmotor`).
    #[derive(Clone, Debug, PartialEq)]
    pub struct Motor<R> {
        /// Torque per current, and voltage per velocity: K [N·m/A, V·s/rad].
        pub constant: R,
        /// K over the resistance [N·m/V].
        pub per_volt: R,
        /// Largest voltage that its controller gives it, if there is a bound [V].
        pub voltage: Option<R>,
        /// How fast its current changes at most, if there is a bound [A/s].
        pub current_rate: Option<R>,
        /// Amplitude [N·m], cycles per turn [1/rad] and phase [rad] of what its magnets add.
        pub cogging: [R; 3],
    }
}

recast! {
    /// A muscle (MuJoCo: `actuator/muscle`). Lengths are those of the actuator, `l_` and `f_` without units.
    #[derive(Clone, Debug, PartialEq)]
    pub struct Muscle<R> {
        /// Peak active force [N].
        pub peak: R,
        /// Shortest length of the actuator [m].
        pub shortest: R,
        /// The same in units of the optimal length.
        pub l_shortest: R,
        /// 1 over the optimal length [1/m].
        pub inverse_optimum: R,
        /// 1 over the velocity at which it shortens without force [s/m].
        pub inverse_speed: R,
        /// Shortest length with an active force.
        pub l_min: R,
        /// Longest length with an active force.
        pub l_max: R,
        /// Passive force at `l_max`, in units of the peak.
        pub fp_max: R,
        /// Active force where it lengthens, in units of the peak.
        pub fv_max: R,
    }
}

recast! {
    /// How fast a muscle's activation follows its control.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct MuscleRate<R> {
        /// Time constant of activation [s].
        pub rise: R,
        /// Time constant of deactivation [s].
        pub fall: R,
        /// Difference of control and activation over which the one changes into the other; 0 for a switch.
        pub width: R,
    }
}

recast! {
    /// Bounds of the sum of actuator forces on a dof (MuJoCo: `actuatorfrcrange`).
    #[derive(Clone, Debug)]
    pub struct ActuatorBound<R> {
        /// The dof.
        pub dof: usize,
        /// [N·m or N]
        pub range: [R; 2],
    }
}

recast! {
    /// Bounds of the sum of actuator forces along a tendon (MuJoCo: `tendon/fixed/actuatorfrcrange`).
    #[derive(Clone, Debug)]
    pub struct TendonBound<R> {
        /// Places of its actuators.
        pub actuators: Vec<usize>,
        /// [N or N·m]
        pub range: [R; 2],
    }
}

/// An actuator that pulls a body to what it touches (MuJoCo: `actuator/adhesion`). It has no terms and no turning length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Adhesion {
    /// The actuator.
    pub actuator: usize,
    /// The body, among those of MuJoCo models.
    pub body: usize,
}

same! { Adhesion }

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
    /// As that of a muscle.
    Muscle(MuscleRate<R>),
    /// As the current of a DC motor, over this time constant [s].
    Current(R),
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
    /// The length of a spatial tendon, of this index.
    Tendon(usize),
    /// Where the slider of a slider-crank is.
    SliderCrank(SliderCrank<R>),
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

recast! {
    /// A rod from a slider to a crank.
    #[derive(Clone, Debug)]
    pub struct SliderCrank<R> {
        /// The site along whose z axis the slider moves.
        pub slider: Mount<R>,
        /// The site on the crank.
        pub crank: Mount<R>,
        /// How long the rod is [m].
        pub rod: R,
    }
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for ActivationRate<R> {
    type Out = ActivationRate<S>;
    fn recast(&self) -> ActivationRate<S> {
        match self {
            ActivationRate::Held => ActivationRate::Held,
            ActivationRate::Control => ActivationRate::Control,
            ActivationRate::Filter(time) => ActivationRate::Filter(time.recast()),
            ActivationRate::Muscle(rate) => ActivationRate::Muscle(rate.recast()),
            ActivationRate::Current(time) => ActivationRate::Current(time.recast()),
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
            LengthKind::Tendon(tendon) => LengthKind::Tendon(tendon),
            LengthKind::SliderCrank(ref crank) => LengthKind::SliderCrank(crank.recast()),
        }
    }
}
