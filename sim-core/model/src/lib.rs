//! From a robot description to a frozen model.
//!
//! `Description` is named, f64 and editable; it is checked, then compiled.

mod body;
mod checks;
mod compile;
mod description;
mod distribution;
mod error;
mod frozen;
pub mod geometry;
pub mod hull_tables;
mod inertia;
mod inverse_weight;
mod pairs;
mod paths;
mod pose;
mod ranges;
mod robot;
mod rows;
mod shapes;
mod sites;
mod surface;
mod touching;
mod tree;
mod urdf;
mod validate;

pub use body::Body;
pub use description::{
    Collision, ContactSensor, Description, Inertial, Joint, JointDof, JointKind, Link, Mimic,
    Robot, Shape, Site, Solver, StaticShape, TargetMode,
};
pub use distribution::Distribution;
pub use error::ModelError;
pub use frozen::{Model, RobotRange, SensedShapes, Start};
pub use inertia::principal_moments;
pub use pose::Pose;
pub use ranges::{ParamDraw, ParamRanges};
pub use sim_physics::constants::contact::Cone;
pub use surface::Surface;
pub use urdf::{Look, UrdfOptions, Visual, Visuals};
