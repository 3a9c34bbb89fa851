//! Inverse kinematics of a model: joint positions at which frames reach their targets.
//!
//! Levenberg-Marquardt in registers of many problems, one per lane, over the kinematics of [`sim_physics::step::tree::kinematics`].
//! A problem that ends leaves its lane to the next one.
//!
//! Imports run one way: `error ← task ← frames ← random ← rotation ← followers ← plan ← tables ← measure ← step ← lanes ← check ← starts
//! ← queue ← dispatch ← solver`.

mod check;
mod dispatch;
mod error;
mod followers;
mod frames;
mod lanes;
mod measure;
mod plan;
mod queue;
mod random;
mod rotation;
mod solver;
mod starts;
mod step;
mod tables;
mod task;

pub use dispatch::Width;
pub use error::IkError;
pub use frames::{frame, frame_names};
pub use queue::{Options, Problems, Solution, Stop};
pub use solver::{Precision, Solver};
pub use task::{Reach, Task};
