//! One block of worlds at work: state, commands, and what the stages of a step leave for each other.

use crate::constants::Constants;
use crate::lane::{Num, Real};
use crate::math::quat::Quat;
use crate::math::spatial::{Inertia, Spatial};
use crate::math::vec3::{Mat3, Vec3};

/// Arrays of a block. `F` is a number of every world, `V` a cell that a step may change.
pub struct Block<F, V> {
    /// Joint positions. `(coords)` [rad or m]
    pub joint_q: Vec<V>,
    /// What rounding has left out of `joint_q`; not used in `f64`. `(coords)` [rad or m]
    pub joint_q_rest: Vec<V>,
    /// Joint velocities. `(dofs)` [rad/s or m/s]
    pub joint_qd: Vec<V>,
    /// Joint accelerations: the solver's result, and its next start. `(dofs)` [rad/s² or m/s²]
    pub joint_qdd: Vec<V>,
    /// 1 where the solver used up its iterations since this was cleared, else 0. `(1)` [–]
    pub unconverged: Vec<V>,
    /// Most contacts that did not fit in a step since this was cleared. `(1)` [–]
    pub left_out: Vec<V>,
    /// Regularised stiffness D = 1/R of each constraint row; 0 where it is not active. `(rows)` [kg·m² or kg]
    pub efc_weight: Vec<V>,
    /// Reference acceleration of each row. `(rows)` [rad/s² or m/s²]
    pub efc_aref: Vec<V>,
    /// Force of each row. `(rows)` [N·m or N]
    pub efc_force: Vec<V>,
    /// Constraint forces in joint space, Jᵀ f. `(dofs)` [N·m or N]
    pub constraint_force: Vec<V>,
    /// Scratch of the solver: a matrix to add contacts to. Packed as `mass_matrix`; empty without contacts.
    pub system: Vec<V>,
    /// Scratch of the solver: the same, with the couplings of contacts. Packed as `Constants::coupled`.
    pub coupled_system: Vec<V>,
    /// Scratch of the solver: a right-hand side to add contacts to. `(dofs)`
    pub pull: Vec<V>,
    /// Scratch of the solver: what solves either system. `(dofs)`
    pub solution: Vec<V>,
    /// Joint torques applied. `(dofs)` [N·m or N]
    pub joint_f: Vec<F>,
    /// Position targets. `(dofs)` [rad or m]
    pub joint_target_q: Vec<F>,
    /// Velocity targets. `(dofs)` [rad/s or m/s]
    pub joint_target_qd: Vec<F>,
    /// Numbers of the model that vary; see [`crate::constants::params::Varying`].
    pub params: Vec<F>,
    /// Substeps since the start of the control frame. `(1)` [–]
    pub substep: Vec<V>,
    /// Commands of the frames before, the last one first, each as `joint_f`, `joint_target_q`, `joint_target_qd`; empty where
    /// none come late. `(frames, 3, dofs)`
    pub command_history: Vec<F>,
    /// Noise of the commands of the frame; empty where there is none. `(3, dofs)`
    pub command_noise: Vec<F>,
    /// What the stages leave for each other.
    pub work: Workspace<F>,
}

/// Results and scratch of the stages. Positions and moments are about the robot's reference point, in world axes.
pub struct Workspace<F> {
    /// Rotation of each body's frame, by columns. `(bodies, 3, 3)` [–]
    pub rotation: Vec<Mat3<F>>,
    /// Origin of each body's frame. `(bodies, 3)` [m]
    pub origin: Vec<Vec3<F>>,
    /// World position of each robot's reference point. `(trees, 3)` [m]
    pub reference: Vec<Vec3<F>>,
    /// Motion axis of each dof at the reference point, linear then angular. `(dofs, 2, 3)` [–]
    pub motion: Vec<Spatial<F>>,
    /// Inertia of each body about the reference point; the mass matrix makes it that of the subtree.
    /// `(bodies, 10)` [kg, kg·m, kg·m²]
    pub inertia: Vec<Inertia<F>>,
    /// Coriolis, centrifugal and gravity forces. `(dofs)` [N·m or N]
    pub bias_force: Vec<F>,
    /// Packed, see [`crate::math::factor::Pattern::at`]. `(pattern)` [kg·m², kg·m or kg]
    pub mass_matrix: Vec<F>,
    /// All forces but those of constraints. `(dofs)` [N·m or N]
    pub smooth_force: Vec<F>,
    /// +1 where the lower bound is the nearer, -1 where the upper is. `(limits)` [–]
    pub limit_side: Vec<F>,
    /// Orientation of each body's frame. `(bodies, 4)` [–]
    pub orientation: Vec<Quat<F>>,
    /// Link frames in the world: position, quaternion (x, y, z, w). `(frames, 7)` [m, –]
    pub body_q: Vec<[F; 7]>,
    /// Centre of mass of each link from the reference point. `(frames, 3)` [m]
    pub link_center: Vec<Vec3<F>>,
    /// Velocity of each link's centre of mass, then angular velocity. `(frames, 2, 3)` [m/s, rad/s]
    pub body_qd: Vec<Spatial<F>>,
    /// Commands that act in the substep, where that is not what was sent. `(3, dofs)`
    pub applied: Vec<F>,
    /// Applied and drive forces, for output. `(dofs)` [N·m or N]
    pub joint_torque: Vec<F>,
    /// Sites: position, quaternion (x, y, z, w). `(sites, 7)` [m, –]
    pub site_q: Vec<[F; 7]>,
    /// Velocity of each site, then angular velocity. `(sites, 2, 3)` [m/s, rad/s]
    pub site_qd: Vec<Spatial<F>>,
    /// Angular velocity of each site, in its axes. `(sites, 3)` [rad/s]
    pub gyro: Vec<Vec3<F>>,
    /// Acceleration of each site less gravity, in its axes. `(sites, 3)` [m/s²]
    pub accelerometer: Vec<Vec3<F>>,
    /// What takes a small displacement of each site to one of the joints: a row a dof that moves it, in the order of
    /// [`crate::constants::site::Site::columns`]. `(columns of all sites, 6)` [rad or m per m or rad]
    pub site_inverse: Vec<[F; 6]>,
    /// Velocity of each body at the reference point. `(bodies, 2, 3)`
    pub velocity: Vec<Spatial<F>>,
    /// Scratch of a stage: acceleration, then force of each body. `(bodies, 2, 3)`
    pub force: Vec<Spatial<F>>,
    /// Scratch of a stage: a matrix to factor. Packed as `mass_matrix`.
    pub hessian: Vec<F>,
    /// Scratch of the solver: `coupled_system` to factor.
    pub coupled_hessian: Vec<F>,
    /// Scratch of a stage. `(4, dofs)`
    pub vector: [Vec<F>; 4],
    /// Scratch of a stage. `(4, rows)`
    pub row: [Vec<F>; 4],
}

/// An array that stages read or write; the order of a step is checked against these.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Slot {
    /// [`Block::joint_q`]
    JointQ,
    /// [`Block::joint_q_rest`]
    JointQRest,
    /// [`Block::joint_qd`]
    JointQd,
    /// [`Block::joint_qdd`]
    JointQdd,
    /// [`Block::unconverged`]
    Unconverged,
    /// [`Block::left_out`]
    LeftOut,
    /// [`Block::system`]
    System,
    /// [`Block::coupled_system`]
    CoupledSystem,
    /// [`Block::pull`]
    Pull,
    /// [`Block::solution`]
    Solution,
    /// [`Block::joint_f`]
    JointF,
    /// [`Block::joint_target_q`]
    JointTargetQ,
    /// [`Block::joint_target_qd`]
    JointTargetQd,
    /// [`Block::params`]
    Params,
    /// [`Block::substep`]
    Substep,
    /// [`Block::command_history`]
    CommandHistory,
    /// [`Block::command_noise`]
    CommandNoise,
    /// [`Workspace::applied`]
    Applied,
    /// [`Workspace::rotation`]
    Rotation,
    /// [`Workspace::origin`]
    Origin,
    /// [`Workspace::reference`]
    Reference,
    /// [`Workspace::motion`]
    Motion,
    /// [`Workspace::inertia`]
    Inertia,
    /// [`Workspace::bias_force`]
    BiasForce,
    /// [`Workspace::mass_matrix`]
    MassMatrix,
    /// [`Workspace::smooth_force`]
    SmoothForce,
    /// [`Block::efc_weight`]
    EfcWeight,
    /// [`Block::efc_aref`]
    EfcAref,
    /// [`Workspace::limit_side`]
    LimitSide,
    /// [`Block::efc_force`]
    EfcForce,
    /// [`Block::constraint_force`]
    ConstraintForce,
    /// [`Workspace::velocity`]
    Velocity,
    /// [`Workspace::body_q`]
    BodyQ,
    /// [`Workspace::link_center`]
    LinkCenter,
    /// [`Workspace::body_qd`]
    BodyQd,
    /// [`Workspace::orientation`]
    Orientation,
    /// [`Workspace::joint_torque`]
    JointTorque,
    /// [`Workspace::site_q`]
    SiteQ,
    /// [`Workspace::site_qd`]
    SiteQd,
    /// [`Workspace::gyro`]
    Gyro,
    /// [`Workspace::accelerometer`]
    Accelerometer,
    /// [`Workspace::site_inverse`]
    SiteInverse,
}

/// The numbers of a slot, flat.
pub enum Numbers<'a, F, V> {
    /// Cells.
    Cells(&'a mut [V]),
    /// Values.
    Values(&'a mut [F]),
}

impl<F: Num, V: Copy> Block<F, V> {
    /// Room for a model; every number 0, every cell a copy of `cell`.
    pub fn new<R: Real>(m: &Constants<R>, cell: V) -> Self {
        let (n, bodies, rows) = (m.dofs.len(), m.bodies.len(), m.rows());
        let zero = F::c(0.0);
        let packed = m.pattern.len();
        let touching = !m.contacts.classes.is_empty();
        let coupled = m.coupled.pattern.len();
        let when = |condition: bool, length: usize| if condition { length } else { 0 };
        Block {
            joint_q: vec![cell; m.coords],
            joint_q_rest: vec![cell; m.coords],
            joint_qd: vec![cell; n],
            joint_qdd: vec![cell; n],
            unconverged: vec![cell; 1],
            left_out: vec![cell; 1],
            system: vec![cell; when(touching, packed)],
            coupled_system: vec![cell; coupled],
            pull: vec![cell; when(touching, n)],
            solution: vec![cell; n],
            efc_weight: vec![cell; rows],
            efc_aref: vec![cell; rows],
            efc_force: vec![cell; rows],
            constraint_force: vec![cell; n],
            joint_f: vec![zero; n],
            joint_target_q: vec![zero; n],
            joint_target_qd: vec![zero; n],
            substep: vec![cell; 1],
            command_history: vec![zero; m.delay.frames * 3 * n],
            command_noise: vec![zero; when(m.noisy_commands(), 3 * n)],
            params: m.varying.starts().iter().map(|&(_, x)| F::c(x)).collect(),
            work: Workspace {
                rotation: vec![[[zero; 3]; 3]; bodies],
                origin: vec![[zero; 3]; bodies],
                reference: vec![[zero; 3]; m.trees.len()],
                motion: vec![[[zero; 3]; 2]; n],
                inertia: vec![[zero; 10]; bodies],
                bias_force: vec![zero; n],
                mass_matrix: vec![zero; packed],
                smooth_force: vec![zero; n],
                limit_side: vec![zero; m.limits.len()],
                orientation: vec![[zero; 4]; bodies],
                body_q: vec![[zero; 7]; m.frames.len()],
                link_center: vec![[zero; 3]; m.frames.len()],
                body_qd: vec![[[zero; 3]; 2]; m.frames.len()],
                applied: vec![zero; when(m.alters_commands(), 3 * n)],
                joint_torque: vec![zero; n],
                site_q: vec![[zero; 7]; m.sites.len()],
                site_qd: vec![[[zero; 3]; 2]; m.sites.len()],
                gyro: vec![[zero; 3]; m.sites.len()],
                accelerometer: vec![[zero; 3]; m.sites.len()],
                site_inverse: vec![[zero; 6]; m.sites.iter().map(|site| site.columns.len()).sum()],
                velocity: vec![[[zero; 3]; 2]; bodies],
                force: vec![[[zero; 3]; 2]; bodies],
                hessian: vec![zero; packed],
                coupled_hessian: vec![zero; coupled],
                vector: [vec![zero; n], vec![zero; n], vec![zero; n], vec![zero; n]],
                row: [
                    vec![zero; rows],
                    vec![zero; rows],
                    vec![zero; rows],
                    vec![zero; rows],
                ],
            },
        }
    }

    /// The numbers of a slot.
    pub fn numbers(&mut self, slot: Slot) -> Numbers<'_, F, V> {
        use Numbers::{Cells, Values};
        let w = &mut self.work;
        match slot {
            Slot::JointQ => Cells(&mut self.joint_q),
            Slot::JointQRest => Cells(&mut self.joint_q_rest),
            Slot::JointQd => Cells(&mut self.joint_qd),
            Slot::JointQdd => Cells(&mut self.joint_qdd),
            Slot::Unconverged => Cells(&mut self.unconverged),
            Slot::LeftOut => Cells(&mut self.left_out),
            Slot::System => Cells(&mut self.system),
            Slot::CoupledSystem => Cells(&mut self.coupled_system),
            Slot::Pull => Cells(&mut self.pull),
            Slot::Solution => Cells(&mut self.solution),
            Slot::JointF => Values(&mut self.joint_f),
            Slot::JointTargetQ => Values(&mut self.joint_target_q),
            Slot::JointTargetQd => Values(&mut self.joint_target_qd),
            Slot::Params => Values(&mut self.params),
            Slot::Substep => Cells(&mut self.substep),
            Slot::CommandHistory => Values(&mut self.command_history),
            Slot::CommandNoise => Values(&mut self.command_noise),
            Slot::Applied => Values(&mut w.applied),
            Slot::Rotation => Values(w.rotation.as_flattened_mut().as_flattened_mut()),
            Slot::Origin => Values(w.origin.as_flattened_mut()),
            Slot::Reference => Values(w.reference.as_flattened_mut()),
            Slot::Motion => Values(w.motion.as_flattened_mut().as_flattened_mut()),
            Slot::Inertia => Values(w.inertia.as_flattened_mut()),
            Slot::BiasForce => Values(&mut w.bias_force),
            Slot::MassMatrix => Values(&mut w.mass_matrix),
            Slot::SmoothForce => Values(&mut w.smooth_force),
            Slot::EfcWeight => Cells(&mut self.efc_weight),
            Slot::EfcAref => Cells(&mut self.efc_aref),
            Slot::LimitSide => Values(&mut w.limit_side),
            Slot::EfcForce => Cells(&mut self.efc_force),
            Slot::ConstraintForce => Cells(&mut self.constraint_force),
            Slot::Velocity => Values(w.velocity.as_flattened_mut().as_flattened_mut()),
            Slot::LinkCenter => Values(w.link_center.as_flattened_mut()),
            Slot::BodyQd => Values(w.body_qd.as_flattened_mut().as_flattened_mut()),
            Slot::BodyQ => Values(w.body_q.as_flattened_mut()),
            Slot::Orientation => Values(w.orientation.as_flattened_mut()),
            Slot::JointTorque => Values(&mut w.joint_torque),
            Slot::SiteQ => Values(w.site_q.as_flattened_mut()),
            Slot::SiteQd => Values(w.site_qd.as_flattened_mut().as_flattened_mut()),
            Slot::Gyro => Values(w.gyro.as_flattened_mut()),
            Slot::Accelerometer => Values(w.accelerometer.as_flattened_mut()),
            Slot::SiteInverse => Values(w.site_inverse.as_flattened_mut()),
        }
    }
}
