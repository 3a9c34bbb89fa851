//! Springs and dampers of joints and tendons.

use super::lengths::Length;
use super::recast::{Recast, recast};

recast! {
    /// Springs; none where a model has none.
    #[derive(Clone, Debug)]
    pub struct Springs<R> {
        /// Of joints with one coordinate.
        pub joints: Vec<Spring<R>>,
        /// Of balls and free joints.
        pub poses: Vec<PoseSpring<R>>,
        /// Springs and dampers of tendons.
        pub tendons: Vec<Tendon<R>>,
    }
}

impl<R> Default for Springs<R> {
    fn default() -> Springs<R> {
        Springs {
            joints: Vec::new(),
            poses: Vec::new(),
            tendons: Vec::new(),
        }
    }
}

recast! {
    /// A spring of a dof with one coordinate: the force is -(stiffness + a x + b x²) x with x = q - rest.
    #[derive(Clone, Debug)]
    pub struct Spring<R> {
        /// The dof.
        pub dof: usize,
        /// [N·m/rad or N/m]
        pub stiffness: R,
        /// Position without force [rad or m].
        pub rest: R,
        /// a and b, by which its stiffness grows with the stretch and its square [N·m/rad², N·m/rad³ or N/m², N/m³].
        pub curve: [R; 2],
    }
}

recast! {
    /// A spring of a ball or a free joint: forces along the axes of its position, and a torque along its rotation vector.
    #[derive(Clone, Debug)]
    pub struct PoseSpring<R> {
        /// The body of the joint.
        pub body: usize,
        /// Of its position [N/m] and of its rotation [N·m/rad].
        pub stiffness: R,
        /// Position without force of a free joint, in the world [m].
        pub position: [R; 3],
        /// Rotation without torque, (x, y, z, w) [–].
        pub quat: [R; 4],
        /// a and b, by which both grow with the distance from rest and its square [N/m², N/m³ and N·m/rad², N·m/rad³].
        pub curve: [R; 2],
    }
}

recast! {
    /// A tendon that acts as a spring, a damper and an inertia.
    #[derive(Clone, Debug)]
    pub struct Tendon<R> {
        /// Its length.
        pub length: Length<R>,
        /// [N/m or N·m/rad]
        pub stiffness: R,
        /// Lengths between which its spring has no force [m or rad].
        pub rest: [R; 2],
        /// [N·s/m or N·m·s/rad]
        pub damping: R,
        /// [kg or kg·m²]
        pub armature: R,
        /// By which its stiffness grows with the stretch and its square [N/m², N/m³ or N·m/rad², N·m/rad³].
        pub stiffness_curve: [R; 2],
        /// By which its damping grows with the speed and its square [N·s²/m², N·s³/m³ or N·m·s²/rad², N·m·s³/rad³].
        pub damping_curve: [R; 2],
    }
}
