//! Forces on links that no joint makes: the medium, and compensation of gravity.

use super::recast::{Recast, recast};

recast! {
    /// Resistance of the medium to a link's motion, along and about its axes of inertia.
    #[derive(Clone, Debug)]
    pub struct Drag<R> {
        /// The body that carries the link.
        pub body: usize,
        /// Its centre of mass in the body's frame [m].
        pub center: [R; 3],
        /// Its axes of inertia in the body's frame: columns [–].
        pub axes: [[R; 3]; 3],
        /// Force over velocity [N·s/m], then torque over angular velocity [N·m·s/rad].
        pub viscous: [R; 2],
        /// Of each axis, force over the square of velocity [N·s²/m²], then torque over that of angular velocity [N·m·s²/rad²].
        pub quadratic: [[R; 3]; 2],
        /// Velocity of the medium in the world [m/s].
        pub wind: [R; 3],
    }
}

recast! {
    /// A geom that counts as an ellipsoid in the medium. Diagonal matrices are along its axes; `*_differences` are those of the
    /// two entries after each, which is what (D v) × v needs.
    #[derive(Clone, Debug)]
    pub struct FluidGeom<R> {
        /// The body that carries the geom.
        pub body: usize,
        /// Its centre in the body's frame [m].
        pub center: [R; 3],
        /// Its axes in the body's frame: columns [–].
        pub axes: [[R; 3]; 3],
        /// Squared areas across the axes, over the largest: Q [–].
        pub areas: [R; 3],
        /// Of Q [–].
        pub area_differences: [R; 3],
        /// Added mass less that of the Magnus force: μ [kg].
        pub carried: [R; 3],
        /// Of added mass, m [kg].
        pub mass_differences: [R; 3],
        /// Of added moments of inertia, J [kg·m²].
        pub moment_differences: [R; 3],
        /// Lift after Kutta: k [kg/m].
        pub lift: R,
        /// Force over velocity, c [N·s/m], then torque over angular velocity, d [N·m·s/rad].
        pub viscous: [R; 2],
        /// Drag that does not depend on the area across the flow: s [kg/m].
        pub slender: R,
        /// Drag of the largest area across the flow, beyond `slender`: b [kg/m].
        pub blunt: R,
        /// Drag of rotations: e [kg·m²].
        pub turning: R,
        /// Its share about each axis, over the largest: E [–].
        pub turning_shares: [R; 3],
        /// Velocity of the medium in the world [m/s].
        pub wind: [R; 3],
    }
}

recast! {
    /// Gravity compensation.
    #[derive(Clone, Debug)]
    pub struct GravityCompensation<R> {
        /// Links that are held against gravity.
        pub links: Vec<Compensation<R>>,
        /// Dofs that this moves, except those of the next list.
        pub passive_dofs: Vec<usize>,
        /// Dofs of which it counts as a force of actuators.
        pub actuated_dofs: Vec<usize>,
    }
}

impl<R> Default for GravityCompensation<R> {
    fn default() -> GravityCompensation<R> {
        GravityCompensation {
            links: Vec::new(),
            passive_dofs: Vec::new(),
            actuated_dofs: Vec::new(),
        }
    }
}

recast! {
    /// A link that is held against gravity.
    #[derive(Clone, Debug)]
    pub struct Compensation<R> {
        /// The body that carries it.
        pub body: usize,
        /// Its index among the links.
        pub link: usize,
        /// Its mass [kg].
        pub mass: R,
        /// The share of its weight that is compensated [–].
        pub share: R,
        /// Its centre of mass in the body's frame [m].
        pub center: [R; 3],
    }
}
