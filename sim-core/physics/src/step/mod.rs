//! One physics step on one screen: the stages in their order, each a page of equations.
//!
//! A page begins with its source and equations; its [`Stage`] says which arrays it reads and writes and when a model needs it.
//! Every page is written once and runs on every execution backend of [`crate::lane`].

pub mod collide;
pub mod constraints;
pub mod forces;
pub mod integrate;
mod lengths;
pub mod outputs;
mod params;
pub mod solver;
mod stage;
pub mod tendons;
pub mod tree;

use params::{gravity, masses, param};
pub use stage::{BlockOf, ConstantsOf, Runs, Stage, StageId, StageRow};

/// The stages in the order of a step: name, page, and what [`Runs`] it.
/// The name is also the symbol of the compiled function, so a profile shows it.
#[macro_export]
macro_rules! every_stage {
    ($expand:ident $arguments:tt) => {
        $crate::$expand! { $arguments
            command              [forces::command::Commands]                 Once;
            delays               [forces::delays::Delays]                    Once;
            // where bodies are, how they move, and their inertia in joint space
            kinematics           [tree::kinematics::Kinematics]              Both;
            bias                 [tree::bias::Bias]                          Both;
            mass_matrix          [tree::mass_matrix::MassMatrix]             Both;
            tendons              [tendons::Tendons]                          Both;
            tendon_armature      [tendons::armature::Armature]               Both;
            // forces but those of constraints, summed in `smooth_force`
            actuation            [forces::actuation::Actuation]              Both;
            springs              [forces::springs::Springs]                  Both;
            fluid                [forces::fluid::Fluid]                      Both;
            gravity_compensation [forces::gravity_compensation::GravityCompensation] Both;
            actuators            [forces::actuators::Actuators]              Both;
            // rows of joints and of ties
            constraint           [constraints::joint_rows::Constraint]       Both;
            ties                 [constraints::ties::Ties]                   Both;
            // contacts: where shapes are, then one stage for each pair of kinds of shapes
            place                [collide::Place]                            Both;
            plane_sphere         [collide::PlaneSphere]                      Both;
            plane_capsule        [collide::PlaneCapsule]                     Both;
            plane_box            [collide::PlaneBox]                         Both;
            plane_cylinder       [collide::PlaneCylinder]                    Both;
            plane_ellipsoid      [collide::PlaneEllipsoid]                   Both;
            plane_hull           [collide::PlaneHull]                        Both;
            field_sphere         [collide::FieldSphere]                      Both;
            field_capsule        [collide::FieldCapsule]                     Both;
            field_box            [collide::FieldBox]                         Both;
            field_cylinder       [collide::FieldCylinder]                    Both;
            field_ellipsoid      [collide::FieldEllipsoid]                   Both;
            field_hull           [collide::FieldHull]                        Both;
            sphere_sphere        [collide::SphereSphere]                     Both;
            sphere_capsule       [collide::SphereCapsule]                    Both;
            sphere_box           [collide::SphereBox]                        Both;
            sphere_cylinder      [collide::SphereCylinder]                   Both;
            sphere_ellipsoid     [collide::SphereEllipsoid]                  Both;
            sphere_hull          [collide::SphereHull]                       Both;
            capsule_capsule      [collide::CapsuleCapsule]                   Both;
            capsule_box          [collide::CapsuleBox]                       Both;
            capsule_cylinder     [collide::CapsuleCylinder]                  Both;
            capsule_ellipsoid    [collide::CapsuleEllipsoid]                 Both;
            capsule_hull         [collide::CapsuleHull]                      Both;
            box_box              [collide::BoxBox]                           Both;
            box_cylinder         [collide::BoxCylinder]                      Both;
            box_ellipsoid        [collide::BoxEllipsoid]                     Both;
            box_hull             [collide::BoxHull]                          Both;
            cylinder_cylinder    [collide::CylinderCylinder]                 Both;
            cylinder_ellipsoid   [collide::CylinderEllipsoid]                Both;
            cylinder_hull        [collide::CylinderHull]                     Both;
            ellipsoid_ellipsoid  [collide::EllipsoidEllipsoid]               Both;
            ellipsoid_hull       [collide::EllipsoidHull]                    Both;
            hull_hull            [collide::HullHull]                         Both;
            contact_rows         [constraints::contact_rows::ContactRows]    Both;
            // the forces along contacts, which ends those of actuators
            adhesion             [forces::adhesion::Adhesion]                Both;
            contact_adhesion     [forces::contact_adhesion::Pull]            Both;
            // accelerations and constraint forces, then the next state
            solver               [solver::Solver::<false>]                   Both;
            solver_turning       [solver::Solver::<true>]                    Both;
            refine               [solver::Refine]                            Both;
            noslip               [solver::NoSlip]                            Both;
            net_contact_forces   [forces::contact_adhesion::NetForces]       Both;
            integrate            [integrate::semi_implicit::Integrate]       Step;
            implicit             [integrate::implicit::Implicit]             Step;
            // in its place, as `schedule::step_stages` orders them
            runge_kutta_0        [integrate::runge_kutta::Begin]             RungeKutta;
            runge_kutta_1        [integrate::runge_kutta::RungeKutta::<0>]   RungeKutta;
            runge_kutta_2        [integrate::runge_kutta::RungeKutta::<1>]   RungeKutta;
            runge_kutta_3        [integrate::runge_kutta::RungeKutta::<2>]   RungeKutta;
            runge_kutta_4        [integrate::runge_kutta::RungeKutta::<3>]   RungeKutta;
            // outputs of a state
            accelerations        [solver::Accelerations]                     Evaluation;
            energy               [outputs::energy::Energy]                   Evaluation;
            joint_torque         [forces::actuation::JointTorque]            Evaluation;
            poses                [outputs::poses::Poses]                     Evaluation;
            velocities           [outputs::velocities::Velocities]           Evaluation;
            sites                [outputs::sites::Sites]                     Evaluation;
            imu                  [outputs::sites::Imu]                       Evaluation;
            height_scan          [outputs::height_scan::HeightScans]         Evaluation;
            site_inverse         [outputs::site_inverse::SiteInverse]        Evaluation;
            passive              [forces::springs::Passive]                  Evaluation;
            passive_adhesion     [forces::contact_adhesion::PassivePull]     Evaluation;
            frames_of_bodies     [outputs::frames::Bodies]                   Evaluation;
            frames_of_sites      [outputs::frames::Sites]                    Evaluation;
            frames_of_geoms      [outputs::frames::Geoms]                    Evaluation;
            lengths_of_tendons   [outputs::tendons::Lengths]                 Evaluation;
            subtrees             [outputs::subtrees::Subtrees]               Evaluation;
            inertias             [outputs::inertias::Inertias]               Evaluation;
            momenta              [outputs::momenta::Momenta]                 Evaluation;
            wrenches             [outputs::wrenches::Forces]                 Evaluation;
            sensor_states        [outputs::sensors::States]                  Evaluation;
            sensor_subtrees      [outputs::sensors::Subtrees]                Evaluation;
            sensor_energies      [outputs::sensors::Energies]                Evaluation;
            sensor_forces        [outputs::sensors::Forces]                  Evaluation;
            sensor_imu           [outputs::sensors::Accelerations]           Evaluation;
            sensor_wrenches      [outputs::sensors::Wrenches]                Evaluation;
            sensor_contacts      [outputs::sensors::Contacts]                Evaluation;
            sensor_rays          [outputs::sensors::Rays]                    Evaluation;
            sensor_cameras       [outputs::sensors::Cameras]                 Evaluation;
        }
    };
}
