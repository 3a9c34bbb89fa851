//! For observers: any field of worlds at a given state, and recordings, frame after frame. Neither asks a daemon for more than
//! its description and its frames for observers.

mod evaluation;

pub use crate::export::arrays::{Array, Arrays};
pub use crate::eyes::FrameFields;

pub use evaluation::{Drawn, Evaluation};
pub use sim_engine::simulation::{Draws, Precision};
pub use sim_physics::arrays::Field;
pub use sim_protocol::Dtype;

pub use crate::error::DaemonError;
pub use crate::recording::{Playback, Shows};
