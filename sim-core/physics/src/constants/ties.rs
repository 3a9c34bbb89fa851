//! Constraints from MuJoCo whose Jacobians are found at run time: bodies that are connected, tendons, and limits of balls.

use super::Soft;
use super::lengths::Length;
use super::recast::{Recast, recast};
use super::site::Mount;
use crate::lane::Real;

recast! {
    /// One or several constraint rows over the same dofs.
    #[derive(Clone, Debug)]
    pub struct Tie<R> {
        /// What the rows are about.
        pub measure: Measure<R>,
        /// What they allow.
        pub law: TieLaw<R>,
        /// Their softness.
        pub soft: Soft<R>,
        /// Inverse weight of the rows after the third, which are rotations [1/(kg·m²)].
        pub turning_weight: R,
        /// How many they are.
        pub rows: usize,
        /// The dofs that they depend on, rising.
        pub dofs: Vec<usize>,
        /// Place of the first row's Jacobian in `row_jacobian`; a row has an entry for each dof.
        pub first: usize,
        /// Places in the mass matrix's pattern of each dof with those up to it.
        pub places: Vec<usize>,
    }
}

/// What the rows of a tie measure.
#[derive(Clone, Debug)]
pub enum Measure<R> {
    /// A length less a polynomial of another one.
    Lengths(Lengths<R>),
    /// How far a ball has turned from its reference [rad]: its first coordinate and its first dof.
    Angle(usize, usize),
    /// Each dof of a free body, as MuJoCo has them: velocity of its frame's origin, then the angular velocity in its axes.
    Free(usize),
    /// Position of a frame less that of another, then, with a torque scale, the rotation between them.
    Frames(Frames<R>),
}

recast! {
    /// l₁ - o₁ - p(l₂ - o₂)
    #[derive(Clone, Debug)]
    pub struct Lengths<R> {
        /// l₁
        pub first: Length<R>,
        /// l₂
        pub second: Length<R>,
        /// o₁ and o₂ [rad or m].
        pub offsets: [R; 2],
        /// Coefficients of p, the constant first.
        pub polynomial: [R; 5],
        /// The dofs of the joints whose references o₁ and o₂ are; none of tendons.
        pub referred: [Option<usize>; 2],
    }
}

recast! {
    /// Two frames.
    #[derive(Clone, Debug)]
    pub struct Frames<R> {
        /// The first.
        pub first: Mount<R>,
        /// The second.
        pub second: Mount<R>,
        /// What rotations are multiplied with [m/rad]; none where only positions are tied.
        pub torque_scale: Option<R>,
        /// Their bodies, among those of MuJoCo models.
        pub bodies: [usize; 2],
    }
}

/// What rows of a tie allow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TieLaw<R> {
    /// Nothing but 0, while this entry of `eq_active` is 1.
    Equality(usize),
    /// Motion against a dry friction of this bound [N or N·m].
    Friction(R),
    /// What lies between two bounds, margins included.
    Range([R; 2]),
}

impl<R> Tie<R> {
    /// Place of the Jacobian of a row.
    #[inline(always)]
    pub fn jacobian(&self, row: usize) -> std::ops::Range<usize> {
        let first = self.first + row * self.dofs.len();
        first..first + self.dofs.len()
    }
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for Measure<R> {
    type Out = Measure<S>;
    fn recast(&self) -> Measure<S> {
        match self {
            Measure::Lengths(lengths) => Measure::Lengths(lengths.recast()),
            Measure::Angle(coord, dof) => Measure::Angle(*coord, *dof),
            Measure::Free(body) => Measure::Free(*body),
            Measure::Frames(frames) => Measure::Frames(frames.recast()),
        }
    }
}

impl<S: Real, R: Real + Recast<S, Out = S>> Recast<S> for TieLaw<R> {
    type Out = TieLaw<S>;
    fn recast(&self) -> TieLaw<S> {
        match self {
            TieLaw::Equality(place) => TieLaw::Equality(*place),
            TieLaw::Friction(loss) => TieLaw::Friction(loss.recast()),
            TieLaw::Range(bounds) => TieLaw::Range(bounds.recast()),
        }
    }
}
