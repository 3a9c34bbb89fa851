//! What programs and tiles of a run are made from, besides the model.

use super::kernels::programs::Programs;
use super::kernels::room::Room;
use super::kernels::show::Run;
use sim_device::Replay;
use std::time::Duration;

/// Kernel sources that depend on the output fields.
pub(super) struct OutputSources {
    pub show: String,
    pub contacts: Option<String>,
    /// Whether the evaluation finds contacts.
    pub finds_contacts: bool,
}

/// What stays the same for a whole run.
pub(super) struct Recipe {
    pub programs: Programs,
    pub outputs: OutputSources,
    pub runs: Vec<Run>,
    pub pairs: Vec<[i32; 4]>,
    /// Threads that share a world.
    pub threads: u32,
    /// Whether frames are as [`crate::canonical`] has them.
    pub canonical: bool,
    /// Limit on the compile time of a program.
    pub limit: Duration,
    /// Whether the batches of a frame are recorded or encoded.
    pub replay: Replay,
    /// Groups of worlds in this process, all with the same memory.
    pub groups: usize,
}

/// How large tiles are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Extent {
    /// What contacts have in each world.
    pub room: Room,
    /// Worlds of a tile.
    pub width: u32,
}
