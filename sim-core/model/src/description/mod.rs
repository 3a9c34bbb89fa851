//! What users name and edit: a scene, its robots, their joints, and what is named in them.

mod balance;
mod camera;
mod constraints;
mod dofs;
mod followers;
mod frames;
mod joint;
mod output_frames;
mod param_draws;
mod precompiled;
mod robot;
mod scene;
mod sensors;
mod shapes;
mod tendons;

pub(crate) use crate::geometry::Shape;
pub(crate) use crate::inertia::Inertial;
pub(crate) use crate::joint_kind::JointKind;
pub use camera::{Camera, CameraPart, Lens, Sees};
pub use constraints::{Constraint, ConstraintLaw, Measure, Tendon};
pub(crate) use followers::start_followers;
pub(crate) use frames::Bearer;
pub use joint::{Joint, JointDof, Mimic, TargetMode};
pub use output_frames::{FrameParts, Inertia, OnLink};
pub use param_draws::ParamDraw;
pub use precompiled::{
    Actuator, ActuatorActivation, ActuatorDelay, ActuatorLength, Compensator, ContactPair, Drag,
    EllipsoidInFluid, Interpolation, JointExtras, Keyframe, Precompiled,
};
pub(crate) use robot::BODY_LINK;
pub use robot::{Collision, Link, Robot};
pub use scene::{ContactSensor, Description, HeightScan, Site, Solver, StaticShape};
pub use sensors::{
    AimPart, DistancePart, EyePart, FramePart, LimitPart, RayPart, Reduction, Sense, Sensor,
    SensorParts, SubtreePart, Touching, ZoneKind, ZonePart,
};
pub(crate) use shapes::named;
pub use tendons::{Length, Span, SpatialTendon, TendonPart, Wrap};
