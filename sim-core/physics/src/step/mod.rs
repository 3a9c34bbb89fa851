//! One physics step on one screen: the stages in their order, each a page of equations.
//!
//! A page begins with its source and equations; its [`Stage`] says which arrays it reads and writes and when a model needs it.
//! Every page is written once and runs on every execution backend of [`crate::lane`].

pub mod actuation;
pub mod actuators;
pub mod bias;
pub mod collide;
pub mod command;
pub mod constraint;
pub mod contact_rows;
pub mod energy;
pub mod fluid;
mod free_joints;
pub mod gravity_compensation;
pub mod height_scan;
pub mod integrate;
mod inverse_dynamics;
pub mod kinematics;
mod link_forces;
pub mod mass_matrix;
pub mod mujoco_forces;
pub mod mujoco_frames;
pub mod mujoco_inertias;
pub mod mujoco_momenta;
pub mod mujoco_state;
pub mod mujoco_subtrees;
mod params;
pub mod poses;
pub mod runge_kutta;
pub mod sensors;
pub mod site_inverse;
pub mod sites;
pub mod solver;
pub mod springs;
mod stage;
mod tied_frames;
pub mod ties;
mod transmission;
pub mod velocities;

use params::{gravity, masses, param};
pub use stage::{BlockOf, ConstantsOf, Runs, Stage, StageId, StageRow};

/// The stages in the order of a step: name, page, and what runs it: a step, an evaluation of outputs, or both.
/// The name is also the symbol of the compiled function, so a profile shows it.
#[macro_export]
macro_rules! every_stage {
    ($expand:ident $arguments:tt) => {
        $crate::$expand! { $arguments
            command            [command::Commands]           Both;
            kinematics         [kinematics::Kinematics]      Both;
            bias               [bias::Bias]                  Both;
            mass_matrix        [mass_matrix::MassMatrix]     Both;
            actuation          [actuation::Actuation]        Both;
            springs            [springs::Springs]            Both;
            fluid              [fluid::Fluid]                Both;
            gravity_compensation [gravity_compensation::GravityCompensation] Both;
            actuators          [actuators::Actuators]        Both;
            constraint         [constraint::Constraint]      Both;
            ties               [ties::Ties]                  Both;
            // contacts: where shapes are, then one stage for each pair of kinds of shapes
            place              [collide::Place]              Both;
            plane_sphere       [collide::PlaneSphere]        Both;
            plane_capsule      [collide::PlaneCapsule]       Both;
            plane_box          [collide::PlaneBox]           Both;
            plane_cylinder     [collide::PlaneCylinder]      Both;
            plane_hull         [collide::PlaneHull]          Both;
            field_sphere       [collide::FieldSphere]        Both;
            field_capsule      [collide::FieldCapsule]       Both;
            field_box          [collide::FieldBox]           Both;
            field_cylinder     [collide::FieldCylinder]      Both;
            field_hull         [collide::FieldHull]          Both;
            sphere_sphere      [collide::SphereSphere]       Both;
            sphere_capsule     [collide::SphereCapsule]      Both;
            sphere_box         [collide::SphereBox]          Both;
            sphere_cylinder    [collide::SphereCylinder]     Both;
            sphere_hull        [collide::SphereHull]         Both;
            capsule_capsule    [collide::CapsuleCapsule]     Both;
            capsule_box        [collide::CapsuleBox]         Both;
            capsule_cylinder   [collide::CapsuleCylinder]    Both;
            capsule_hull       [collide::CapsuleHull]        Both;
            box_box            [collide::BoxBox]             Both;
            box_cylinder       [collide::BoxCylinder]        Both;
            box_hull           [collide::BoxHull]            Both;
            cylinder_cylinder  [collide::CylinderCylinder]   Both;
            cylinder_hull      [collide::CylinderHull]       Both;
            hull_hull          [collide::HullHull]           Both;
            contact_rows       [contact_rows::ContactRows]   Both;
            // accelerations and constraint forces, then the next state
            solver             [solver::Solver::<false>]     Both;
            solver_turning     [solver::Solver::<true>]      Both;
            refine             [solver::Refine]              Both;
            integrate          [integrate::Integrate]        Step;
            // in its place: the first of these, then all above four times, each followed by one of the others
            runge_kutta_0      [runge_kutta::Begin]          Step;
            runge_kutta_1      [runge_kutta::RungeKutta::<0>] Step;
            runge_kutta_2      [runge_kutta::RungeKutta::<1>] Step;
            runge_kutta_3      [runge_kutta::RungeKutta::<2>] Step;
            runge_kutta_4      [runge_kutta::RungeKutta::<3>] Step;
            // outputs of a state
            accelerations      [solver::Accelerations]       Evaluation;
            energy             [energy::Energy]              Evaluation;
            joint_torque       [actuation::JointTorque]      Evaluation;
            poses              [poses::Poses]                Evaluation;
            velocities         [velocities::Velocities]      Evaluation;
            sites              [sites::Sites]                Evaluation;
            imu                [sites::Imu]                  Evaluation;
            height_scan        [height_scan::HeightScans]    Evaluation;
            site_inverse       [site_inverse::SiteInverse]   Evaluation;
            passive            [springs::Passive]            Evaluation;
            mujoco_bodies      [mujoco_frames::Bodies]       Evaluation;
            mujoco_sites       [mujoco_frames::Sites]        Evaluation;
            mujoco_geoms       [mujoco_frames::Geoms]        Evaluation;
            mujoco_subtrees    [mujoco_subtrees::Subtrees]   Evaluation;
            mujoco_inertias    [mujoco_inertias::Inertias]   Evaluation;
            mujoco_momenta     [mujoco_momenta::Momenta]     Evaluation;
            mujoco_forces      [mujoco_forces::Forces]       Evaluation;
            sensor_states      [sensors::States]             Evaluation;
            sensor_subtrees    [sensors::Subtrees]           Evaluation;
            sensor_energies    [sensors::Energies]           Evaluation;
            sensor_forces      [sensors::Forces]             Evaluation;
            sensor_imu         [sensors::Accelerations]      Evaluation;
            sensor_wrenches    [sensors::Wrenches]           Evaluation;
            sensor_contacts    [sensors::Contacts]           Evaluation;
            sensor_rays        [sensors::Rays]               Evaluation;
        }
    };
}
