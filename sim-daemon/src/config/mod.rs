//! Scene files: TOML on disk, JSON from Python, and the description they stand for.
//!
//! Paths in a file are relative to it; relative paths in a text are relative to the folder given with it.

mod bodies;
mod cameras;
mod compiled;
mod error;
mod ik;
mod looks;
mod mujoco;
mod number;
pub(crate) mod paths;
mod pose;
mod randomize;
mod rays;
mod robots;
mod scene;
mod sensors;
mod shapes;
mod summary;
mod surface;

pub use bodies::BodyTable;
pub use cameras::CameraTable;
pub use error::ConfigError;
pub use ik::{IkReach, IkTask};
pub use looks::Parts;
pub(crate) use looks::{Looks, PartKind, SeenPart, hull_sides};
pub use mujoco::{MujocoTable, mujoco_summary};
pub use number::{Number, PerDof};
pub use randomize::{DistributionTable, ParamTable, RandomizeTable};
pub use robots::{ModeName, RobotTable};
pub(crate) use scene::SCENE_MAX;
pub use scene::{ConeName, SceneFile, SolverTable, load, parse};
pub use sensors::{ContactSensorTable, HeightScanTable, SiteTable};
pub use shapes::{ShapeName, ShapeTable};
pub use sim_engine::backend::BackendError;
pub use sim_engine::dynamics::Dynamics;
pub use sim_engine::random::{Draw, Stream, TASK_STREAMS};
pub use sim_ik::{
    IkError, Options as IkOptions, Precision as IkPrecision, Problems as IkProblems,
    Solution as IkSolution, Solver as IkSolver, Stop as IkStop, Width as IkWidth, frame_names,
};
pub use sim_model::UrdfOptions;
pub use sim_model::geometry::{Image, MeshOptions, Texture, VisualMesh};
pub use sim_model::ray_scene::{Casting, Hits, Placed, Ray, RayGeom, RayScene};
pub use sim_model::{Model, Pose};
pub use sim_physics::arrays::Field;
pub(crate) use summary::{joint_type, mesh_properties, robot_summary};
pub use summary::{mesh_summary, urdf_summary};
