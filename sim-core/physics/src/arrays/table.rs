//! THE table of arrays: what a block of worlds holds, and which of it is an output.
//!
//! A row is: kind of storage and name of the array, its variant in [`Array`], its entries and how many, who writes it and
//! its unit; where clients see it, `=>` its public name, group and shape, and a sentence. Below the arrays stand the outputs
//! that are made of several: what each is made of ([`Source`]) takes the place of the array.
//!
//! `values` that clients see are commands. In place of the group, they name how they are kept, such as `CONTROL`. The checks of the
//! daemon, the GPU, arguments in Python and documents follow from the row.
//!
//! To add an output, add a row here and the line that computes it in the stage that names it in its `WRITES`.

use super::define::{Flat, arrays};
use super::element::{self, Element};
use super::fields::{
    Axis, CONTROL, F64, FORCE, FieldDtype, FieldRow, Group, I32, POSE, RATE, REAL, SWITCH, TARGET,
    U32, U64,
};
use super::pause::Pause;
use crate::constants::Constants;
use crate::constants::contact::DIRECTIONS_MAX;
use crate::constants::options::Integrator;
use crate::lane::{Num, Real};

/// Who writes an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Writer {
    /// Stages: what a world resumes from. Snapshots keep it.
    Motion,
    /// Clients: held over a control frame. Snapshots keep it.
    Command,
    /// The backend, for the frame that it runs.
    Backend,
    /// Stages: counted over the substeps of a frame.
    Counter,
    /// Stages: left for the stages after them.
    Stage,
    /// A stage, for itself alone.
    Scratch,
}

/// What an output is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// An array as it is.
    Array(Array),
    /// A function of arrays, see `gather` in `sim-engine`.
    Computed(&'static [Array]),
    /// Lists of contacts, complete once the stages that write these arrays have run.
    Contacts(&'static [Array]),
    /// Kept by the backend for each world.
    Counter,
}

arrays! { m;
    cells {
        // what a world resumes from: `RECORD` in sim-engine is their order in a snapshot
        joint_q: JointQ [m.coords] Motion "rad or m"
            => "joint_q" State [Coords], "Joint positions.";
        joint_q_rest: JointQRest [m.coords] Motion "rad or m";
        joint_qd: JointQd [m.dofs.len()] Motion "rad/s or m/s"
            => "joint_qd" State [Dofs], "Joint velocities.";
        // the solver's result, and its next start: that of `Constants::prescribed_search` between steps in MuJoCo's velocities
        joint_qdd: JointQdd [m.dofs.len()] Motion "rad/s² or m/s²"
            => "joint_qdd" Derived [Dofs], "Joint accelerations under the commands held, constraints included.";
        act: Act [m.actuators.activations] Motion "–"
            => "act" State [Activations], "Activations of the actuators that have one, in their order, as MuJoCo's `act`.";
        // controls of the last steps of actuators with a delay, see `ControlDelay::first`
        control_history: ControlHistory [m.actuators.kept_controls()] Motion "–";
        // rests of springs that yield, see `Plasticity::place`
        plastic_rest: PlasticRest [m.springs.plastic_rests()] Motion "rad, m or –";
        // substeps since the start of the control frame
        substep: Substep [1] Counter "–";
        // 1 where the solver used up its iterations since this was cleared
        unconverged: Unconverged [1] Counter "–";
        // most contacts that did not fit in a step since this was cleared
        left_out: LeftOut [1] Counter "–";
        // constraint rows of joints: D = 1/R, 0 where a row is not active
        efc_weight: EfcD [m.rows()] Stage "kg·m² or kg"
            => "efc_D" Derived [Rows], "Regularised stiffness of a constraint row, 1/R; zero in a row that is not active.";
        efc_aref: EfcAref [m.rows()] Stage "rad/s² or m/s²"
            => "efc_aref" Derived [Rows], "Reference acceleration of a constraint row.";
        efc_force: EfcForce [m.rows()] Stage "N·m or N"
            => "efc_force" Derived [Rows], "Force of a constraint row.";
        constraint_force: ConstraintForce [m.dofs.len()] Stage "N·m or N"
            => "constraint_force" Derived [Dofs], "Constraint forces in joint space, Jᵀ f.";
        // matrices and right-hand sides to which contacts add; packed as `mass_matrix` and `Constants::coupled`
        system: System [if m.contacts.classes.is_empty() { 0 } else { m.pattern.len() }] Scratch "–";
        coupled_system: CoupledSystem [m.coupled.pattern.len()] Scratch "–";
        pull: Pull [if m.contacts.classes.is_empty() { 0 } else { m.dofs.len() }] Scratch "–";
        solution: Solution [m.dofs.len()] Scratch "–";
        // iterations of the solver, line searches and their evaluations so far, for a profile: of each world, and of the block
        solver_work: SolverWork [3] Scratch "–";
        solver_block_work: SolverBlockWork [3] Scratch "–";
        // of a solve that pauses: `Progress` of the solver
        solver_progress: SolverProgress [5] Scratch "–";
        // 1 where the solver has not ended, at the first dof of an island
        busy: Busy [m.island_dofs()] Scratch "–";
        // contacts that a sensor shows
        contact_records: ContactRecords [m.sensors.record_scalars()] Scratch "–";
        // torque, then force, of the contacts of each body of MuJoCo models
        contact_wrench: ContactWrench [6 * m.outputs.bodies.len()] Scratch "N·m, N";
        // sum of the normal rows of contacts that pull: by an actuator, or as their shapes adhere
        adhesion_moment: AdhesionMoment [if m.actuators.adhesions.is_empty() && m.contacts.adhesion.rows == 0 { 0 } else { m.dofs.len() }] Scratch "–";
    }
    values {
        joint_f: JointF [Scalar; m.dofs.len()] Command "N·m or N"
            => "joint_f" FORCE [Dofs], "Joint torques applied, not clamped by the effort limit.";
        joint_target_q: JointTargetQ [Scalar; m.dofs.len()] Command "rad or m"
            => "joint_target_q" TARGET [Dofs], "Position targets of the drives.";
        joint_target_qd: JointTargetQd [Scalar; m.dofs.len()] Command "rad/s or m/s"
            => "joint_target_qd" RATE [Dofs], "Velocity targets of the drives.";
        ctrl: Ctrl [Scalar; m.actuators.all.len()] Command "–"
            => "ctrl" CONTROL [Actuators], "Controls of the actuators, as MuJoCo's `ctrl`, before they are clamped to their ranges.";
        mocap_pos: MocapPos [Scalar; 3 * m.mocaps] Command "m"
            => "mocap_pos" POSE [Mocaps, Size(3)], "Where the mocap bodies of MuJoCo models are, in the world.";
        mocap_quat: MocapQuat [Scalar; 4 * m.mocaps] Command "–"
            => "mocap_quat" POSE [Mocaps, Size(4)], "How they are turned: quaternions (w, x, y, z) of any length.";
        eq_active: EqActive [Scalar; m.switches] Command "–"
            => "eq_active" SWITCH [Equalities], "1 where an equality of a MuJoCo model acts, 0 where it does not.";
        // commands of the frames before, the last one first, each as joint_f, joint_target_q, joint_target_qd
        command_history: CommandHistory [Scalar; m.delay.frames * 3 * m.dofs.len()] Command "–";
        // parameters of the model that vary from world to world, see `constants::params::Varying`
        params: Params [Scalar; m.varying.len()] Command "–";
        // added to the commands of the frame, `(3, dofs)`; empty where there is no noise
        command_noise: CommandNoise [Scalar; if m.noisy_commands() { 3 * m.dofs.len() } else { 0 }] Backend "–";
    }
    work {
        // kinematics: positions and moments are about the robot's reference point, in world axes
        rotation: Rotation [Mat3; m.bodies.len()] Stage "–";
        origin: Origin [Vec3; m.bodies.len()] Stage "m";
        // world position of each robot's reference point
        reference: Reference [Vec3; m.trees.len()] Stage "m";
        // from the point of a body's carrier, of a root from the reference point, to the body's own: see `step::kinematics`
        arm: Arm [Vec3; m.bodies.len()] Stage "m";
        // motion axis of each dof
        motion: Motion [Spatial; m.dofs.len()] Stage "–";
        // of each body about its own point; the mass matrix makes it that of the subtree
        inertia: Inertia [Inertia; m.bodies.len()] Stage "kg, kg·m, kg·m²";
        velocity: Velocity [Spatial; m.bodies.len()] Stage "m/s, rad/s";

        // what acts: commands where they are not what was sent, `(3, dofs)`; forces
        applied: Applied [Scalar; if m.alters_commands() { 3 * m.dofs.len() } else { 0 }] Stage "–";
        bias_force: BiasForce [Scalar; m.dofs.len()] Stage "N·m or N"
            => "bias_force" [Dofs], "Coriolis, centrifugal and gravity forces: what holds the joints at zero acceleration.";
        smooth_force: SmoothForce [Scalar; m.dofs.len()] Stage "N·m or N"
            => "smooth_force" [Dofs], "Applied, drive and damping forces less the bias: all but constraint forces.";
        // spatial tendons: lengths, their rates, and moments, see `SpatialTendon::first`
        ten_length: TenLength [Scalar; m.tendons.len()] Stage "m";
        ten_velocity: TenVelocity [Scalar; m.tendons.len()] Stage "m/s";
        ten_moment: TenMoment [Scalar; m.tendons.iter().map(|tendon| tendon.dofs.len()).sum::<usize>()] Stage "m/rad or –";
        // J (ω × (ω × o)) of free bodies, which MuJoCo's acceleration of a length has beside our J q̈
        ten_swing: TenSwing [Scalar; m.tendons.len()] Stage "m/s²";
        // a J J̇ q̇ of tendons with armature, for each moment
        ten_bias: TenBias [Scalar; m.tendons.iter().map(|tendon| tendon.dofs.len()).sum::<usize>()] Stage "N·m or N";
        actuator_length: ActuatorLength [Scalar; m.actuators.all.len()] Stage "rad or m"
            => "actuator_length" [Actuators], "Length of each actuator, gear included.";
        actuator_velocity: ActuatorVelocity [Scalar; m.actuators.all.len()] Stage "rad/s or m/s"
            => "actuator_velocity" [Actuators], "How fast it changes.";
        actuator_force: ActuatorForce [Scalar; m.actuators.all.len()] Stage "N or N·m"
            => "actuator_force" [Actuators], "Force of each actuator along its length.";
        // what actuators with a delay follow in place of `ctrl`, see `ControlDelay::place`
        delayed_control: DelayedControl [Scalar; m.actuators.delays().count()] Stage "–";
        act_dot: ActDot [Scalar; m.actuators.activations] Stage "1/s";
        // moments of turning lengths, see `TurningLength::first`
        actuator_moment: ActuatorMoment [Scalar; m.actuators.all.iter().filter_map(|actuator| actuator.turning.as_ref()).map(|length| length.dofs.len()).sum::<usize>()] Stage "–";
        qfrc_actuator: QfrcActuator [Scalar; if m.actuators.all.is_empty() { 0 } else { m.dofs.len() }] Stage "N·m or N";
        // compensation of gravity, where it counts as a force of actuators
        qfrc_gravcomp: QfrcGravcomp [Scalar; if m.compensation.actuated_dofs.is_empty() { 0 } else { m.dofs.len() }] Stage "N·m or N";
        // packed, see `math::factor::Pattern::at`
        mass_matrix: MassMatrix [Scalar; m.pattern.len()] Stage "kg·m², kg·m or kg";
        // +1 where the lower bound is the nearer, -1 where the upper is
        limit_side: LimitSide [Scalar; m.limits.len()] Stage "–";

        // Jacobians of ties, see `Tie::jacobian`
        row_jacobian: RowJacobian [Scalar; m.ties.iter().map(|tie| tie.rows * tie.dofs.len()).sum::<usize>()] Stage "–";

        // the Runge-Kutta step: where it began, and sums of velocities and accelerations
        rk_q: RkQ [Scalar; if m.integrator == Integrator::RungeKutta { m.coords } else { 0 }] Stage "rad or m";
        rk_q_rest: RkQRest [Scalar; if m.integrator == Integrator::RungeKutta { m.coords } else { 0 }] Stage "rad or m";
        rk_velocity: RkVelocity [Scalar; if m.integrator == Integrator::RungeKutta { m.dofs.len() } else { 0 }] Stage "rad/s or m/s";
        rk_velocity_sum: RkVelocitySum [Scalar; if m.integrator == Integrator::RungeKutta { m.dofs.len() } else { 0 }] Stage "rad/s or m/s";
        rk_acceleration_sum: RkAccelerationSum [Scalar; if m.integrator == Integrator::RungeKutta { m.dofs.len() } else { 0 }] Stage "rad/s² or m/s²";

        // lengths and moments of spatial tendons where it began, for springs that yield
        rk_length: RkLength [Scalar; if m.integrator == Integrator::RungeKutta && m.springs.yields_along_tendons() { m.tendons.len() } else { 0 }] Stage "m";
        rk_moment: RkMoment [Scalar; if m.integrator == Integrator::RungeKutta && m.springs.yields_along_tendons() { m.tendons.iter().map(|tendon| tendon.dofs.len()).sum::<usize>() } else { 0 }] Stage "m/rad or –";
        rk_warm_start: RkWarmStart [Scalar; if m.integrator == Integrator::RungeKutta { m.dofs.len() } else { 0 }] Stage "rad/s² or m/s²";

        // how bias forces change with velocities, see `step::tree::bias_slope`: of dofs, then of subtrees
        carried_motion: CarriedMotion [Spatial; if m.integrator == Integrator::Implicit { m.dofs.len() } else { 0 }] Scratch "m/s, rad/s";
        subtree_momentum: SubtreeMomentum [Vec3; if m.integrator == Integrator::Implicit { m.bodies.len() } else { 0 }] Scratch "kg·m/s";
        subtree_whirl: SubtreeWhirl [Mat3; if m.integrator == Integrator::Implicit { m.bodies.len() } else { 0 }] Scratch "kg·m²/s";

        // the same of activations: where they began, and sums of their rates
        rk_act: RkAct [Scalar; if m.integrator == Integrator::RungeKutta { m.actuators.activations } else { 0 }] Stage "–";
        rk_act_rate_sum: RkActRateSum [Scalar; if m.integrator == Integrator::RungeKutta { m.actuators.activations } else { 0 }] Stage "1/s";

        // contacts are in the tables of `Contacts::memory`; these arrays have no entries and represent them in `READS` and `WRITES`
        shape_poses: ShapePoses [Scalar; 0] Stage "–";
        contact_points: ContactPoints [Scalar; 0] Stage "–";
        contact_rows: ContactRows [Scalar; 0] Stage "–";
        contact_forces: ContactForces [Scalar; 0] Stage "–";

        // output only
        orientation: Orientation [Quat; m.bodies.len()] Stage "–";
        body_q: BodyQ [Pose; m.frames.len()] Stage "m, –"
            => "body_q" [Bodies, Size(7)], "Link frames in the world: position, then quaternion (x, y, z, w).";
        // centre of mass of each link from the reference point
        link_center: LinkCenter [Vec3; m.frames.len()] Stage "m";
        body_qd: BodyQd [Spatial; m.frames.len()] Stage "m/s, rad/s"
            => "body_qd" [Bodies, Size(6)], "Velocity of each link's centre of mass, then its angular velocity, in world axes.";
        kinetic_energy: KineticEnergy [Scalar; 1] Stage "J"
            => "kinetic_energy" [], "Kinetic energy of the world, ½ q̇ᵀ M q̇, armature included.";
        potential_energy: PotentialEnergy [Scalar; 1] Stage "J"
            => "potential_energy" [], "Potential energy of the bodies that move, in gravity, 0 at the height of the world's origin, and of springs.";
        joint_torque: JointTorque [Scalar; m.dofs.len()] Stage "N·m or N"
            => "joint_torque" [Dofs], "What joint_f and the drive, clamped by its effort limit, give; damping, friction and contacts are not in it.";
        site_q: SiteQ [Pose; m.sites.len()] Stage "m, –"
            => "site_q" [Sites, Size(7)], "Sites: position, then quaternion (x, y, z, w), in the world, or in the frame that a site is relative to.";
        site_qd: SiteQd [Spatial; m.sites.len()] Stage "m/s, rad/s"
            => "site_qd" [Sites, Size(6)], "Velocity of each site, then its angular velocity, in world axes, or as seen from and in the axes of the frame that it is relative to.";
        gyro: Gyro [Vec3; m.sites.len()] Stage "rad/s"
            => "gyro" [Sites, Size(3)], "Angular velocity of each site, in its own axes.";
        accelerometer: Accelerometer [Vec3; m.sites.len()] Stage "m/s²"
            => "accelerometer" [Sites, Size(3)], "Acceleration of each site less gravity, in its own axes: 9.81 upwards at rest.";
        height_scan: HeightScan [Scalar; m.scans.iter().map(|scan| scan.rays()).sum::<usize>()] Stage "m"
            => "height_scan" [ScanRays], "Height of each scan's frame above the ground under each of its rays, scans one after another, x innermost; negative where the ground is higher than the frame.";
        // a row for each dof that moves a site, in the order of `Site::columns`
        site_inverse: SiteInverse [Row6; m.sites.iter().map(|site| site.columns.len()).sum::<usize>()] Stage "rad or m per m or rad";

        passive_force: PassiveForce [Scalar; m.dofs.len()] Stage "N·m or N";
        // frames of MuJoCo models, in MuJoCo's order, frames and conventions
        xpos: Xpos [Vec3; m.outputs.bodies.len()] Stage "m"
            => "xpos" [OutputBodies, Size(3)], "Origin of each body of MuJoCo models in the world, the world of each model first.";
        xquat: Xquat [MujocoQuat; m.outputs.bodies.len()] Stage "–"
            => "xquat" [OutputBodies, Size(4)], "Orientation of each body of MuJoCo models in the world, (w, x, y, z).";
        xmat: Xmat [MujocoMat; m.outputs.bodies.len()] Stage "–"
            => "xmat" [OutputBodies, Size(9)], "Orientation of each body of MuJoCo models in the world, a matrix row by row.";
        xipos: Xipos [Vec3; m.outputs.bodies.len()] Stage "m"
            => "xipos" [OutputBodies, Size(3)], "Centre of mass of each body of MuJoCo models in the world.";
        ximat: Ximat [MujocoMat; m.outputs.bodies.len()] Stage "–"
            => "ximat" [OutputBodies, Size(9)], "Principal axes of inertia of each body of MuJoCo models in the world, a matrix row by row.";
        site_xpos: SiteXpos [Vec3; m.outputs.sites.len()] Stage "m"
            => "site_xpos" [OutputSites, Size(3)], "Origin of each site of MuJoCo models in the world.";
        site_xmat: SiteXmat [MujocoMat; m.outputs.sites.len()] Stage "–"
            => "site_xmat" [OutputSites, Size(9)], "Orientation of each site of MuJoCo models in the world, a matrix row by row.";
        geom_xpos: GeomXpos [Vec3; m.outputs.geoms.len()] Stage "m"
            => "geom_xpos" [OutputGeoms, Size(3)], "Centre of each geom of MuJoCo models in the world, also of geoms that touch nothing.";
        geom_xmat: GeomXmat [MujocoMat; m.outputs.geoms.len()] Stage "–"
            => "geom_xmat" [OutputGeoms, Size(9)], "Orientation of each geom of MuJoCo models in the world, a matrix row by row.";
        // all tendons of MuJoCo models, where `ten_length` has the spatial ones that something uses
        tendon_length: TendonLength [Scalar; m.outputs.tendons.len()] Stage "rad or m"
            => "ten_length" [OutputTendons], "Length of each tendon of MuJoCo models, also of tendons that nothing uses.";
        tendon_velocity: TendonVelocity [Scalar; m.outputs.tendons.len()] Stage "rad/s or m/s"
            => "ten_velocity" [OutputTendons], "Rate of change of the length of each tendon of MuJoCo models.";
        // from the reference point of the body's tree
        subtree_center: SubtreeCenter [Vec3; m.outputs.bodies.len()] Stage "m";
        subtree_mass: SubtreeMass [Scalar; m.outputs.bodies.len()] Stage "kg";
        subtree_com: SubtreeCom [Vec3; m.outputs.bodies.len()] Stage "m"
            => "subtree_com" [OutputBodies, Size(3)], "Centre of mass of each body of MuJoCo models with all bodies below it, in the world.";
        cvel: Cvel [Row6; m.outputs.bodies.len()] Stage "rad/s, m/s"
            => "cvel" [OutputBodies, Size(6)], "Velocity of each body of MuJoCo models in world axes: angular, then that of the point of the body at the centre of mass of its tree, as MuJoCo's `cvel`.";
        cinert: Cinert [MujocoInertia; m.outputs.bodies.len()] Stage "kg·m², kg·m, kg"
            => "cinert" [OutputBodies, Size(10)], "Inertia of each body of MuJoCo models in world axes, about the point that `cvel` is about: xx, yy, zz, xy, xz, yz, then mass times the place of its centre, then mass, as MuJoCo's `cinert`; 0 for the world.";
        subtree_linvel: SubtreeLinvel [Vec3; m.outputs.bodies.len()] Stage "m/s"
            => "subtree_linvel" [OutputBodies, Size(3)], "Velocity of the centre of mass of each body of MuJoCo models with all bodies below it, in world axes.";
        subtree_angmom: SubtreeAngmom [Vec3; m.outputs.bodies.len()] Stage "kg·m²/s"
            => "subtree_angmom" [OutputBodies, Size(3)], "Angular momentum of each body of MuJoCo models with all bodies below it, about their centre of mass, in world axes.";
        cacc: Cacc [Row6; m.outputs.bodies.len()] Stage "rad/s², m/s²"
            => "cacc" [OutputBodies, Size(6)], "Acceleration of each body of MuJoCo models less gravity, as MuJoCo's `cacc`: angular, then linear, as a spatial vector at the point that `cvel` is about.";
        cfrc_int: CfrcInt [Row6; m.outputs.bodies.len()] Stage "N·m, N"
            => "cfrc_int" [OutputBodies, Size(6)], "Torque, then force, from the parent on each body of MuJoCo models, about the point that `cvel` is about, as MuJoCo's `cfrc_int`.";
        cfrc_ext: CfrcExt [Row6; m.outputs.bodies.len()] Stage "N·m, N"
            => "cfrc_ext" [OutputBodies, Size(6)], "Torque, then force, of contacts, body_f, connects and welds on each body of MuJoCo models, about the point that `cvel` is about, as MuJoCo's `cfrc_ext`.";
        sensordata: Sensordata [Scalar; m.sensors.scalars] Stage "–"
            => "sensordata" [Sensordata], "Sensors of MuJoCo models, in MuJoCo's order.";

        // body by body: acceleration, then force
        force: Force [Spatial; m.bodies.len()] Scratch "–";
        // at zero joint acceleration
        rest_acceleration: RestAcceleration [Spatial; m.bodies.len()] Scratch "m/s², rad/s²";
        // copies that are factored in place
        hessian: Hessian [Scalar; m.pattern.len()] Scratch "–";
        coupled_hessian: CoupledHessian [Scalar; m.coupled.pattern.len()] Scratch "–";
        // where contacts may be stiff: M and the rows of joints, then a factor; two scalars for each dof and direction of a contact
        joint_system: JointSystem [Scalar; if m.contacts.are_stiff { m.pattern.len() } else { 0 }] Scratch "–";
        update_vectors: UpdateVectors [Scalar; if m.contacts.are_stiff { 2 * DIRECTIONS_MAX * m.dofs.len() } else { 0 }] Scratch "–";
        // dof by dof: accelerations that an iteration starts from, where it goes, the step between; those of the integrator;
        // M or Jᵀ times a vector; what inverse dynamics leaves unexplained
        start: Start [Scalar; m.dofs.len()] Scratch "rad/s² or m/s²";
        minimum: Minimum [Scalar; m.dofs.len()] Scratch "rad/s² or m/s²";
        step: Step [Scalar; m.dofs.len()] Scratch "rad/s² or m/s²";
        acceleration: Acceleration [Scalar; m.dofs.len()] Scratch "rad/s² or m/s²";
        joint_force: JointForce [Scalar; m.dofs.len()] Scratch "N·m or N";
        missing: Missing [Scalar; m.dofs.len()] Scratch "N·m or N";
        // M a - τ, and the island of each dof, where the solver runs as MuJoCo's: see `step::solver::islands`
        gauss_gradient: GaussGradient [Scalar; m.island_dofs()] Scratch "N·m or N";
        island: Island [Scalar; m.island_dofs()] Scratch "–";
        // M⁻¹ Jᵀ of the directions of friction of a contact, where they are swept
        friction_steps: FrictionSteps [Scalar; if m.solver.noslip.is_some() { (DIRECTIONS_MAX - 1) * m.dofs.len() } else { 0 }] Scratch "rad/s² or m/s²";
        // row by row: J a - aref at the start, at the minimum (or its change), D, aref, force; distance to each limit
        jar: Jar [Scalar; m.rows()] Scratch "rad/s² or m/s²";
        jar_minimum: JarMinimum [Scalar; m.rows()] Scratch "rad/s² or m/s²";
        row_weight: RowWeight [Scalar; m.rows()] Scratch "kg·m² or kg";
        row_aref: RowAref [Scalar; m.rows()] Scratch "rad/s² or m/s²";
        row_force: RowForce [Scalar; m.rows()] Scratch "N·m or N";
        limit_distance: LimitDistance [Scalar; m.limits.len()] Scratch "rad or m";
    }
    outputs {
        BodyJacobian "body_jacobian" Derived [Bodies, Size(6), Dofs] "m/s or rad/s per rad/s or m/s" REAL, Source::Computed(&[Motion, LinkCenter]),
            "What takes joint_qd to body_qd.";
        MassMatrix "mass_matrix" Derived [Dofs, Dofs] "kg·m², kg·m or kg" REAL, Source::Computed(&[MassMatrix]),
            "Joint-space inertia, armature included.";
        EfcJ "efc_J" Derived [Rows, Dofs] "–" REAL, Source::Computed(&[EfcD, LimitSide, RowJacobian]),
            "Constraint Jacobian: equalities, frictions, limits of joints, then the other constraints of MuJoCo models; zero in a row that is not active.";
        ContactCount "contact_count" Derived [] "–" I32, Source::Contacts(&[ContactRows]),
            "Contacts of the world: how many rows of the other contact fields are in use.";
        ContactPos "contact_pos" Derived [Contacts, Size(3)] "m" REAL, Source::Contacts(&[ContactRows, Reference]),
            "Point half-way between the two surfaces, in the world.";
        ContactNormal "contact_normal" Derived [Contacts, Size(3)] "–" REAL, Source::Contacts(&[ContactRows]),
            "Unit normal from the first shape of the pair to the second.";
        ContactDistance "contact_distance" Derived [Contacts] "m" REAL, Source::Contacts(&[ContactRows]),
            "Distance of the two surfaces, negative in penetration.";
        ContactForce "contact_force" Derived [Contacts, Size(3)] "N" REAL, Source::Contacts(&[ContactForces]),
            "Force on the second shape of the pair, in world axes.";
        ContactPair "contact_pair" Derived [Contacts, Size(2)] "–" I32, Source::Contacts(&[ContactRows]),
            "The two shapes, as places in shape_names; -1 in a row that is not in use.";
        BodyContactForce "body_contact_force" Derived [Bodies, Size(3)] "N" REAL, Source::Contacts(&[ContactForces]),
            "Sum of the contact forces on each link, in world axes.";
        JointQMeasured "joint_q_measured" Derived [Coords] "rad or m" REAL, Source::Array(JointQ),
            "Joint positions with the noise that joint_q_noise gives.";
        JointQdMeasured "joint_qd_measured" Derived [Dofs] "rad/s or m/s" REAL, Source::Array(JointQd),
            "Joint velocities with the noise that joint_qd_noise gives.";
        SiteInverseJacobian "site_inverse_jacobian" Derived [Sites, Dofs, Size(6)] "rad or m per m or rad" REAL, Source::Computed(&[SiteInverse]),
            "What takes a small displacement of each site, of its origin, then of its rotation as a rotation vector, in the axes of site_qd, to one of the joints, as joint_qd has them: Jᵀ (J Jᵀ + λ² I)⁻¹, where J takes joint_qd to site_qd and λ is the site's damping. Zero for dofs that do not move the site.";
        ContactSensor "contact_sensor" Derived [ContactSensors, Size(3)] "N" REAL, Source::Contacts(&[ContactForces]),
            "Sum of the contact forces that each contact sensor is about, in world axes.";
        Qpos "qpos" Derived [Coords] "rad or m" REAL, Source::Computed(&[JointQ]),
            "Joint positions in MuJoCo's order: a quaternion is (w, x, y, z).";
        Qvel "qvel" Derived [Dofs] "rad/s or m/s" REAL, Source::Computed(&[JointQd, Rotation, Origin]),
            "Joint velocities as MuJoCo has them: of a free joint that of its frame's origin in world axes, then the angular velocity in its own axes.";
        Qacc "qacc" Derived [Dofs] "rad/s² or m/s²" REAL, Source::Computed(&[JointQd, JointQdd, Rotation, Origin]),
            "Joint accelerations as MuJoCo has them, under the commands held, constraints included.";
        QfrcActuator "qfrc_actuator" Derived [Dofs] "N·m or N" REAL, Source::Computed(&[QfrcActuator, Rotation, Origin]),
            "Forces of the actuators of MuJoCo models in joint space, as MuJoCo has them.";
        QfrcConstraint "qfrc_constraint" Derived [Dofs] "N·m or N" REAL, Source::Computed(&[ConstraintForce, Rotation, Origin]),
            "Constraint forces in joint space, as MuJoCo has them.";
        QfrcBias "qfrc_bias" Derived [Dofs] "N·m or N" REAL, Source::Computed(&[BiasForce, MassMatrix, JointQd, Rotation, Origin]),
            "Coriolis, centrifugal and gravity forces in joint space, as MuJoCo has them.";
        QfrcPassive "qfrc_passive" Derived [Dofs] "N·m or N" REAL, Source::Computed(&[PassiveForce, Rotation, Origin]),
            "Forces of springs and dampers in joint space, as MuJoCo has them. Drives are not in it.";
        Time "time" Counter [] "s" F64, Source::Counter,
            "Simulated time since the world's reset.";
        Step "step" Counter [] "–" U64, Source::Counter,
            "Control frames since the world's reset.";
        Status "status" Counter [] "–" U32, Source::Counter,
            "Faults of the world, as bits: 1 = it was no longer finite, or a command of it where the run freezes for that, 8 = it was beyond the bounds of the run: it is frozen at its state before that frame, and `step`, until it is reset; 2 = the solver used up its iterations, 4 = contacts were left out; 0 = none.";
        ContactsLeftOut "contacts_left_out" Counter [] "–" U32, Source::Counter,
            "Contacts that did not fit into contacts_max, rows_max or the memory of a GPU: the most of any substep of the last frame, and of the state shown where contact fields are asked for.";
    }
}
