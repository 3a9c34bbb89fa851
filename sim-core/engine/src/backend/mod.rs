//! Backends: they keep the worlds, run the physics code, and move fields in and out.

mod clocks;
pub mod cpu;
mod error;
mod frozen;
mod gather;
pub mod gpu;
mod input;
mod noise;
mod profile;
pub mod sharing;
mod state;

pub use error::BackendError;
pub use frozen::{FirstFrozen, Frozen};
pub use input::{Input, Values};
pub use profile::{Histogram, LaneWork, Part, Profile, StageProfile};
pub use sim_compile::{Line as CodeLine, Size as MachineCode};
pub use sim_device::HostPages;

use crate::random::{Episode, Numbering};
use sharing::Sharing;
use std::ops::Range;
use std::sync::Arc;

/// Bytes of a world's counters in a record: steps `u64`, status `u32`, contacts left out `u32`, seed `u64`, episode `u32`,
/// little endian.
pub const COUNTERS: usize = 28;

/// Precision of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Single: SIMD lanes.
    #[default]
    F32,
    /// Double: the reference, scalar.
    F64,
}

impl Precision {
    /// A value as a run of this precision keeps it.
    pub fn round(self, x: f64) -> f64 {
        match self {
            Precision::F32 => f64::from(x as f32),
            Precision::F64 => x,
        }
    }
}

/// Which state the evaluated outputs of a step belong to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OutputsAt {
    /// The state in the frame.
    #[default]
    Frame,
    /// Where forces were evaluated last in the step, as MuJoCo's `mj_step` leaves them: the state before the last substep, or the
    /// last of the four points of a Runge-Kutta substep. States, commands and counters are those of the frame. The CPU alone has it.
    LastSubstep,
}

impl OutputsAt {
    /// The one of a name.
    pub fn named(name: &str) -> Option<OutputsAt> {
        [OutputsAt::Frame, OutputsAt::LastSubstep]
            .into_iter()
            .find(|outputs_at| outputs_at.name() == name)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            OutputsAt::Frame => "frame",
            OutputsAt::LastSubstep => "last_substep",
        }
    }
}

/// Worlds per block on the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Lanes {
    /// As many as the processor supports; one in `f64`, and for a single world.
    #[default]
    Auto,
    /// One.
    Scalar,
    /// Eight: AVX2 or NEON.
    Eight,
    /// Sixteen, AVX-512.
    Sixteen,
}

/// Groups of worlds, each with a backend of its own. They share threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Groups {
    /// Number of groups.
    pub count: usize,
    /// Worlds per group.
    pub worlds: usize,
    /// Numbering of the first group; the worlds of the other groups follow.
    pub numbering: Numbering,
}

impl Groups {
    /// The numbering of each group.
    pub fn numberings(self) -> impl Iterator<Item = Numbering> {
        (0..self.count).map(move |group| self.numbering.after(group * self.worlds))
    }

    /// Worlds of all groups.
    pub fn all(self) -> usize {
        self.count * self.worlds
    }
}

/// Bounds beyond which a world faults, and what happens to a faulted world. A world that is not finite always faults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Faults {
    /// Largest |joint_q| [rad or m].
    pub joint_q_max: f64,
    /// Largest |joint_qd| [rad/s or m/s].
    pub joint_qd_max: f64,
    /// Whether a faulted world is reset before its next step; otherwise it is frozen until a client resets it.
    pub resets: bool,
    /// Whether a world with a NaN or infinite command is frozen; otherwise such a command is refused for all worlds.
    pub freezes_nan: bool,
}

impl Default for Faults {
    fn default() -> Faults {
        Faults {
            joint_q_max: f64::INFINITY,
            joint_qd_max: f64::INFINITY,
            resets: false,
            freezes_nan: false,
        }
    }
}

/// A program of a GPU, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramInfo {
    /// Its name.
    pub label: String,
    /// Statements of its source.
    pub statements: usize,
    /// Dispatches per frame, of a program that steps.
    pub dispatches: Option<usize>,
}

/// One for each group.
pub type Backends = Vec<Box<dyn Backend>>;

/// Keeps and steps the worlds of a group. [`crate::simulation::Simulation`] has checked all arguments.
pub trait Backend: Send {
    /// Name of the processor or GPU, for people.
    fn device(&self) -> &str;
    /// Contacts of a class that a world has room for now, of a model in which that can grow.
    fn contact_room(&self) -> Option<usize> {
        None
    }
    /// The programs of a GPU; none on the CPU.
    fn programs(&self) -> &[ProgramInfo] {
        &[]
    }
    /// Sizes of the machine code of a substep, without rare cases and with them; none where no stage is compiled, and on a GPU.
    fn compiled(&self) -> Option<[MachineCode; 2]> {
        None
    }
    /// Where the machine code of a substep is in memory: address, bytes and stage of each piece; empty where no stage is compiled.
    fn code_pieces(&self) -> Vec<(usize, usize, &'static str)> {
        Vec::new()
    }
    /// What each command of the first tile's last frame took on the device [s]; empty where they are not timed, and on the CPU.
    fn seconds(&self) -> Vec<(&str, f64)> {
        Vec::new()
    }
    /// Threads that a step may use.
    fn threads(&self) -> usize;
    /// Sets the bounds of faults, and what happens to faulted worlds.
    fn set_faults(&mut self, faults: Faults);
    /// Freezes the worlds that are not marked, in their present state, as not finite.
    fn freeze_others(&mut self, good: &[bool]);
    /// Sets columns of an array in the worlds of the mask (none = all). Writing a state clears the warm start of its worlds.
    fn write(
        &mut self,
        input: Input,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    );
    /// Reads columns of the parameters that vary, `(worlds, columns)`, world-major.
    fn params(&self, columns: Range<usize>, to: &mut [f64]);
    /// Scalars of a world's state and commands: everything that a step starts from.
    fn numbers(&self) -> usize;
    /// Writes the records of the first worlds, as many as fit, in order: [`COUNTERS`] bytes, then [`Backend::numbers`] scalars of the
    /// run's precision. They are invalid if [`Backend::lost`] reports an error afterwards.
    fn save(&self, records: &mut [u8]);
    /// Sets the worlds of the mask (none = all) to their records, or all of them to that of `from_world`.
    fn restore(&mut self, records: &[u8], mask: Option<&[bool]>, from_world: Option<usize>);
    /// Resets the worlds of the mask (none = all): to the start of their next episode, or of the first episode of new seeds (one for
    /// all worlds, or one per world). [`crate::start::StartDraw`] draws the start.
    fn reset(&mut self, mask: Option<&[bool]>, seeds: Option<&[u64]>);
    /// The episodes of the first worlds, as many as fit.
    fn episodes(&self, to: &mut [Episode]);
    /// Begins the run again, as if no frame had been made and nothing written; false on the CPU, where new worlds are as fast.
    fn restart(&mut self) -> bool {
        false
    }
    /// The worlds that were frozen since the last call.
    fn take_frozen(&mut self) -> Frozen;
    /// Runs `substeps` substeps (none = evaluates only), then writes every field of the layout
    /// into the arena, 8-byte words. No allocation, no error: see [`Backend::lost`].
    fn run(&mut self, substeps: usize, arena: &mut [u64]);
    /// As [`Backend::run`], on the caller's thread alone, and adds what that took to the profile; false where a backend has no
    /// profile, and nothing is run then.
    fn run_profiled(&mut self, _substeps: usize, _arena: &mut [u64], _to: &mut Profile) -> bool {
        false
    }
    /// The error that lost the device. Nothing is computed after it.
    fn lost(&self) -> Option<&BackendError> {
        None
    }
    /// Loses the device, as a driver may. For tests of the error path.
    fn lose(&mut self) {}
    /// Name of the GPU, empty on the CPU.
    fn adapter(&self) -> &str {
        ""
    }
    /// How frames reach the memory of their readers: `direct` on the CPU, `imported` or `copied` on a GPU.
    fn delivery(&self) -> &'static str {
        "direct"
    }
    /// Bytes of frames that the processor has copied.
    fn copied(&self) -> u64 {
        0
    }
    /// Lets the device write into this arena whenever [`Backend::run`] gets it; false if it cannot. The `owner` of its pages is asked
    /// for the first time, and kept until [`Backend::forget`].
    fn import(&mut self, _arena: &[u64], _owner: &dyn Fn() -> Option<Arc<dyn HostPages>>) -> bool {
        false
    }
    /// Forgets all arenas that were imported, and the memory that a client maps.
    fn forget(&mut self) {}
    /// The memory of a GPU that clients can map; none on the CPU.
    fn sharing(&mut self) -> Option<&mut dyn Sharing> {
        None
    }
}

/// Memory that can be allocated without swapping [bytes].
pub(crate) fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text
        .lines()
        .find(|line| line.starts_with("MemAvailable:"))?;
    let kb: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kb * 1024)
}
