//! Frames that outputs are of: those of MuJoCo models in MuJoCo's order, model after model, also where no physics needs them.

use super::lengths::Length;
use super::recast::{Recast, recast};
use super::site::Mount;
use super::tendons::SpatialTendon;

recast! {
    /// Frames of bodies, sites and geoms, and tendons; all empty for other models.
    #[derive(Clone, Debug)]
    pub struct OutputFrames<R> {
        /// Bodies, the world of each model first, parents before children.
        pub bodies: Vec<OutputBody<R>>,
        /// Sites.
        pub sites: Vec<Mount<R>>,
        /// Geoms, also those that touch nothing.
        pub geoms: Vec<Mount<R>>,
        /// Tendons.
        pub tendons: Vec<OutputTendon<R>>,
    }
}

impl<R> Default for OutputFrames<R> {
    fn default() -> OutputFrames<R> {
        OutputFrames {
            bodies: Vec::new(),
            sites: Vec::new(),
            geoms: Vec::new(),
            tendons: Vec::new(),
        }
    }
}

recast! {
    /// A body of a MuJoCo model.
    #[derive(Clone, Debug)]
    pub struct OutputBody<R> {
        /// Its index among the links.
        pub link: usize,
        /// Its parent in this list; a world's is itself.
        pub parent: usize,
        /// Its ancestor below the world, or itself: velocities and forces of MuJoCo are about the centre of mass of that subtree.
        pub root: usize,
        /// Its frame.
        pub frame: Mount<R>,
        /// Its inertial frame: origin at the centre of mass, along the principal axes.
        pub inertial: Mount<R>,
        /// [kg]
        pub mass: R,
        /// Principal moments of inertia [kg·m²].
        pub moments: [R; 3],
    }
}

recast! {
    /// A tendon of a MuJoCo model.
    #[derive(Clone, Debug)]
    pub struct OutputTendon<R> {
        /// Its length; 0 of one that is idle.
        pub length: Length<R>,
        /// A spatial tendon that a step does without. It has no moments in `ten_moment`, so `first` means nothing.
        pub idle: Option<SpatialTendon<R>>,
    }
}
