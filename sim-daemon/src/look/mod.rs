//! For those who look on: any field of worlds whose state they are given, and recordings, frame after frame. Neither needs
//! anything of a daemon but what it tells and shows.

mod arrays;
mod evaluation;

pub use arrays::{Array, Arrays};
pub use evaluation::Evaluation;
pub use sim_engine::simulation::Precision;
pub use sim_physics::arrays::Field;
pub use sim_protocol::Dtype;

pub use crate::error::DaemonError;
pub use crate::recording::Playback;
