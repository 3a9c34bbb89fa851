//! From a robot description to a frozen model.
//!
//! `Description` is named, f64 and editable; it is checked, then compiled.

mod description;
mod error;
mod pose;

pub use description::{
    Collision, Cone, Description, Inertial, Joint, JointKind, Link, Mimic, Robot, Shape, Solver,
    StaticShape, TargetMode,
};
pub use error::ModelError;
pub use pose::Pose;
