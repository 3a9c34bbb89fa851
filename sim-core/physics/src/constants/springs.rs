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

impl<R> Springs<R> {
    /// Scalars of the rests of springs that yield.
    #[inline(always)]
    pub fn plastic_rests(&self) -> usize {
        let joints = self.joints.iter().filter_map(|x| x.plasticity.as_ref());
        let poses = self.poses.iter().filter_map(|x| x.plasticity.as_ref());
        let tendons = self.tendons.iter().filter_map(|x| x.plasticity.as_ref());
        joints.count() + 4 * poses.count() + 2 * tendons.count()
    }

    /// Is the rate of a spatial tendon needed at the end of a step?
    #[inline(always)]
    pub fn yields_along_tendons(&self) -> bool {
        let mut tendons = self.tendons.iter();
        tendons.any(|tendon| tendon.plasticity.is_some() && tendon.length.tendon.is_some())
    }
}

impl<R: Copy + Default> Springs<R> {
    /// Rests of springs that yield, before any did, `(plastic_rests,)` [rad, m or –].
    pub fn starting_rests(&self) -> Vec<R> {
        let mut rests = vec![R::default(); self.plastic_rests()];
        let mut put = |plasticity: Option<Plasticity<R>>, rest: &[R]| {
            if let Some(Plasticity { place, .. }) = plasticity {
                rests[place..place + rest.len()].copy_from_slice(rest);
            }
        };
        for spring in &self.joints {
            put(spring.plasticity, &[spring.rest]);
        }
        for spring in &self.poses {
            put(spring.plasticity, &spring.quat);
        }
        for tendon in &self.tendons {
            put(tendon.plasticity, &tendon.rest);
        }
        rests
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
    /// A spring that yields: its rest follows where it is stretched too far (MuJoCo: `springyield`).
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Plasticity<R> {
        /// First place of its rest in `plastic_rest`: a position, a quaternion (x, y, z, w), or the two rests of a tendon.
        pub place: usize,
        /// Stretch beyond which it yields [rad or m].
        pub bound: R,
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
        /// How its rest follows, if it yields.
        pub plasticity: Option<Plasticity<R>>,
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
        /// How its rest follows, if it yields. Those of free joints do not.
        pub plasticity: Option<Plasticity<R>>,
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
        /// How its rests follow, if its spring yields.
        pub plasticity: Option<Plasticity<R>>,
    }
}
