//! What users name and edit: a scene, its robots, their joints, and what is named in them.

mod balance;
mod dofs;
mod followers;
mod frames;
mod joint;
mod mujoco;
mod mujoco_constraints;
mod mujoco_frames;
mod mujoco_sensors;
mod param_draws;
mod robot;
mod scene;
mod shapes;

pub(crate) use crate::geometry::Shape;
pub(crate) use crate::inertia::Inertial;
pub(crate) use crate::joint_kind::JointKind;
pub(crate) use followers::start_followers;
pub(crate) use frames::Bearer;
pub use joint::{Joint, JointDof, Mimic, TargetMode};
pub use mujoco::{
    Actuator, ActuatorActivation, ActuatorLength, Compensator, ContactPair, Drag, Keyframe,
    MujocoJoint, MujocoParts,
};
pub use mujoco_constraints::{Constraint, ConstraintLaw, Measure, Tendon};
pub use mujoco_frames::{FrameParts, Inertia, OnLink};
pub use mujoco_sensors::{
    FramePart, LimitPart, RayPart, Reduction, Sense, Sensor, SensorParts, SubtreePart, Touching,
    ZoneKind, ZonePart,
};
pub use param_draws::ParamDraw;
pub(crate) use robot::BODY_LINK;
pub use robot::{Collision, Link, Robot};
pub use scene::{ContactSensor, Description, HeightScan, Site, Solver, StaticShape};
pub(crate) use shapes::named;
