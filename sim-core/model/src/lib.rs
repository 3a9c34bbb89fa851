//! From a robot description to a model that is ready to run.
//!
//! A [`Description`] is named, f64 and editable. It is checked, then compiled to a [`Model`], which is sorted and immutable.
//!
//! Modules import only those before them (`tests/tidy/main.rs` checks it):
//!
//! | module | what it holds |
//! |---|---|
//! | `joint_kind`, `error`, `pose` | motions of joints, what can be wrong, frames |
//! | `files`, `cache_files` | files to read; files of a cache |
//! | `value_checks` | checks of one name or one value |
//! | `inertia`, `geometry` | mass properties; shapes, meshes, convex hulls |
//! | `distribution`, `surface`, `softness`, `geom_contact` | what values are drawn from; how shapes touch, and MuJoCo's geoms |
//! | `visual` | what links look like |
//! | `description` | scene, robots, joints, and what is named in them |
//! | `validate` | checks of a description |
//! | `ray_scene` | what rays meet in many worlds |
//! | `urdf`, `mujoco`, `rigid_body` | robots from files; bodies of one link |
//! | `hull_fans`, `hull_tables`, `model` | the kernel source's tables of hulls; the result |
//! | `hash` | the text that a model's hash is of |
//! | `compile` | from a description to a model |

mod cache_files;
mod compile;
mod contents;
mod description;
mod distribution;
mod error;
pub mod files;
mod geom_contact;
pub mod geometry;
mod hash;
mod hull_fans;
pub mod hull_tables;
mod inertia;
mod joint_kind;
mod model;
mod mujoco;
mod pose;
pub mod ray_scene;
mod rigid_body;
mod softness;
mod surface;
mod urdf;
mod validate;
mod value_checks;
mod visual;

pub use description::{
    Actuator, Camera, CameraPart, Collision, ContactSensor, Description, HeightScan, Joint,
    JointDof, JointExtras, Lens, Link, Mimic, ParamDraw, Precompiled, Robot, Sees, Site, Solver,
    StaticShape, TargetMode,
};
pub use distribution::{Distribution, ParamRanges};
pub use error::ModelError;
pub use geom_contact::{ContactOverride, GeomContact};
pub use geometry::Shape;
pub use inertia::{Inertial, principal_moments};
pub use joint_kind::JointKind;
pub use model::{KeyState, Model, RobotRange, SensedShapes, Start};
pub use mujoco::{MujocoCamera, MujocoContents, MujocoElement, MujocoOptions};
pub use pose::Pose;
pub use rigid_body::Body;
pub use sim_physics::constants::contact::{Cone, FrictionCombine};
pub use softness::Softness;
pub use surface::Surface;
pub use urdf::UrdfOptions;
pub use validate::check_counts;
pub use visual::{Look, Visual, Visuals};
