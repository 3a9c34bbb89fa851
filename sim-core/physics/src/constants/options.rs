//! Options of a step: how it integrates, and how its solver iterates.

use super::recast::{Recast, recast, same};
use std::ops::Range;

/// How a step integrates velocities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Implicit in damping of joints, drives and actuators, and in the gyroscopic force of free bodies.
    #[default]
    ImplicitFast,
    /// Implicit in the damping of joints and drives alone.
    Euler,
    /// Implicit in all forces that change with the velocity, those of rotating bodies on each other included.
    Implicit,
    /// Runge-Kutta of fourth order.
    RungeKutta,
}

recast! {
    /// Options of the constraint solver.
    #[derive(Clone, Debug)]
    pub struct Newton<R> {
        /// Most iterations.
        pub iterations: usize,
        /// Most line-search evaluations per iteration.
        pub ls_iterations: usize,
        /// Improvement of the cost below which the solver stops: the option × mean inertia × dofs.
        pub tolerance: R,
        /// Corrections of the accelerations in `f32` (`step/solver/refine.rs`).
        pub refinements: usize,
        /// How the solver ends its iterations and line searches in `f64`, for models from MuJoCo.
        pub search: Option<Search<R>>,
        /// What keeps contacts from a slow slip, where a model asks for it.
        pub noslip: Option<NoSlip<R>>,
    }
}

recast! {
    /// Sweeps over the rows of friction after the solver (`step/solver/noslip/mod.rs`).
    #[derive(Clone, Debug)]
    pub struct NoSlip<R> {
        /// Most sweeps.
        pub iterations: usize,
        /// Gain of a sweep below which an island ends, over the trace of its mass matrix.
        pub tolerance: R,
        /// The same of a whole world, times mean inertia and dofs, where islands are not kept apart.
        pub least_gain: R,
        /// Rows of dry friction, in MuJoCo's order.
        pub dry_rows: Vec<DryRow>,
    }
}

/// A constraint row of dry friction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DryRow {
    /// Its place among the rows.
    pub row: usize,
    /// The tie that it is of; none of a joint's.
    pub tie: Option<usize>,
    /// Its place among the rows of the tie, or among the frictions of joints.
    pub place: usize,
}

recast! {
    /// Options of MuJoCo's solver, and the parts that it may solve one by one.
    #[derive(Clone, Debug)]
    pub struct Search<R> {
        /// Improvement, gradient and expected gain below which an island ends, over the trace of its mass matrix.
        pub tolerance: R,
        /// Share of the tolerance to which a line is searched.
        pub ls_tolerance: R,
        /// Whether trees that no constraint couples are solved one by one.
        pub islands: bool,
        /// Whether the last step's accelerations may be the start.
        pub warm_start: bool,
        /// Of each dof, the first one of its kinematic tree.
        pub roots: Vec<usize>,
        /// Of each such first dof, the classes of contacts that its tree is the first of; empty for other dofs.
        pub classes: Vec<Vec<usize>>,
    }
}

impl<R> Search<R> {
    /// The first dofs of trees, after which islands are named.
    pub fn islands_of(&self, dofs: usize) -> impl Iterator<Item = usize> + '_ {
        (0..dofs).filter(|&dof| self.roots[dof] == dof)
    }

    /// Runs of dofs that are of one tree.
    pub fn segments(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let mut end = 0;
        self.roots.chunk_by(|a, b| a == b).map(move |run| {
            let start = end;
            end += run.len();
            start..end
        })
    }
}

same! { Integrator, DryRow }
