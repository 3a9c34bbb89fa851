//! Constraints of a robot that MuJoCo compiled, beyond limits and frictions of single dofs.

use super::tendons::Length;
use crate::pose::Pose;
use crate::softness::Softness;

/// One constraint: what it measures, what it allows, and how soft it is.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// What it measures.
    pub measure: Measure,
    /// What it allows.
    pub law: ConstraintLaw,
    /// Softness.
    pub softness: Softness,
    /// Approximate inverse inertia that its rows see, `invweight0` of MuJoCo: along lengths, about axes [1/kg, 1/(kg·m²)].
    pub inverse_weight: [f64; 2],
}

/// What a constraint measures.
#[derive(Clone, Debug, PartialEq)]
pub enum Measure {
    /// l₁ - o₁ - p(l₂ - o₂)
    Lengths {
        /// l₁
        first: Length,
        /// l₂
        second: Length,
        /// o₁ and o₂ [rad or m].
        offsets: [f64; 2],
        /// Coefficients of p, the constant first.
        polynomial: [f64; 5],
        /// The joints whose references o₁ and o₂ are; none of tendons.
        referred: [Option<usize>; 2],
    },
    /// How far a ball joint has turned [rad].
    Angle {
        /// The joint.
        joint: usize,
    },
    /// The dofs of a free joint.
    Free {
        /// The joint.
        joint: usize,
    },
    /// The position of a frame less that of another one.
    Frames {
        /// Links with the frames on them.
        links: [usize; 2],
        /// The frames on their links.
        poses: [Pose; 2],
        /// What the rotation between them is multiplied with [m/rad]; `None` ties positions alone.
        torque_scale: Option<f64>,
    },
}

/// What a constraint allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ConstraintLaw {
    /// Nothing but 0, while the equality of this index is on.
    Equality(usize),
    /// Motion against a dry friction of this bound [N or N·m].
    Friction(f64),
    /// What lies between two bounds, and how near to them it acts.
    Range {
        /// [rad or m]
        bounds: [f64; 2],
        /// [rad or m]
        margin: f64,
    },
}

/// A tendon that acts as a spring, a damper and an inertia.
#[derive(Clone, Debug, PartialEq)]
pub struct Tendon {
    /// Its length.
    pub length: Length,
    /// [N/m or N·m/rad]
    pub stiffness: f64,
    /// Lengths between which its spring has no force [m or rad].
    pub rest: [f64; 2],
    /// [N·s/m or N·m·s/rad]
    pub damping: f64,
    /// [kg or kg·m²]
    pub armature: f64,
    /// By which its stiffness grows with the stretch and its square [N/m², N/m³ or N·m/rad², N·m/rad³].
    pub stiffness_curve: [f64; 2],
    /// By which its damping grows with the speed and its square [N·s²/m², N·s³/m³ or N·m·s²/rad², N·m·s³/rad³].
    pub damping_curve: [f64; 2],
    /// Stretch beyond which its rests follow, if its spring yields [m or rad].
    pub spring_yield: Option<f64>,
}
