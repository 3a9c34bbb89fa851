//! Machines that keep worlds: where the text runs, and how fields come and go.

pub mod cpu;
mod error;
mod frozen;
mod gather;
pub mod gpu;
mod noise;
mod state;

pub use error::BackendError;
pub use frozen::{FirstFrozen, Frozen};

use crate::random::Numbering;
use sim_physics::arrays::Field;
use std::ops::Range;

/// Bytes of a world's counters in a record: steps `u64`, status `u32`, contacts left out `u32`, seed `u64`, episode `u32`,
/// little endian.
pub const COUNTERS: usize = 28;

/// World-major numbers from outside, in either precision.
#[derive(Clone, Copy, Debug)]
pub enum Values<'a> {
    /// Single precision.
    F32(&'a [f32]),
    /// Double precision.
    F64(&'a [f64]),
}

impl Values<'_> {
    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Values::F32(v) => v.len(),
            Values::F64(v) => v.len(),
        }
    }

    /// No values?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The value at a place.
    pub fn at(&self, place: usize) -> f64 {
        match self {
            Values::F32(v) => f64::from(v[place]),
            Values::F64(v) => v[place],
        }
    }

    /// The first of a part that is not finite in a precision, counted from the first of all.
    pub fn first_not_finite(&self, part: Range<usize>, precision: Precision) -> Option<usize> {
        let first = part.start;
        let place = match self {
            Values::F32(v) => v[part].iter().position(|x| !x.is_finite()),
            Values::F64(v) => (v[part].iter()).position(|&x| !precision.round(x).is_finite()),
        };
        place.map(|place| first + place)
    }
}

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
    /// A number as a run of this precision keeps it.
    pub fn round(self, x: f64) -> f64 {
        match self {
            Precision::F32 => f64::from(x as f32),
            Precision::F64 => x,
        }
    }
}

/// Worlds a block on the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Lanes {
    /// As many as the processor can; one in `f64`, and for one world.
    #[default]
    Auto,
    /// One.
    Scalar,
    /// Eight, AVX2.
    Eight,
    /// Sixteen, AVX-512.
    Sixteen,
}

/// Worlds in groups, each with a backend of its own; they share threads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Groups {
    /// How many there are.
    pub count: usize,
    /// Worlds of each.
    pub worlds: usize,
    /// That of the first group; the worlds of the next ones follow.
    pub numbering: Numbering,
}

impl Groups {
    /// The numbering of each.
    pub fn numberings(self) -> impl Iterator<Item = Numbering> {
        (0..self.count).map(move |group| self.numbering.after(group * self.worlds))
    }

    /// Worlds of all.
    pub fn all(self) -> usize {
        self.count * self.worlds
    }
}

/// When a world is frozen, besides where it is no longer finite, and what becomes of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Faults {
    /// Largest |joint_q| [rad or m].
    pub joint_q_max: f64,
    /// Largest |joint_qd| [rad/s or m/s].
    pub joint_qd_max: f64,
    /// Is it reset before its next step, or frozen until somebody resets it?
    pub resets: bool,
    /// Is a world frozen whose command is NaN or infinite? Otherwise such a command is refused for all worlds.
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

/// A program of an accelerator, for people.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProgramFacts {
    /// What it does.
    pub label: String,
    /// Statements of its text.
    pub statements: usize,
    /// Of one that steps: how often a frame runs it.
    pub rounds: Option<usize>,
}

/// One for each group.
pub type Backends = Vec<Box<dyn Backend>>;

/// What keeps the worlds. Arguments were checked by [`crate::simulation::Simulation`].
pub trait Backend: Send {
    /// What it runs on, for people.
    fn device(&self) -> &str;
    /// The programs that it consists of: none on the CPU.
    fn programs(&self) -> &[ProgramFacts] {
        &[]
    }
    /// Threads that a step may use.
    fn threads(&self) -> usize;
    /// When worlds are frozen from now on, and what becomes of them.
    fn set_faults(&mut self, faults: Faults);
    /// Freezes the worlds that are not marked, at their present state, as no longer finite.
    fn freeze_others(&mut self, good: &[bool]);
    /// Sets columns of a state or command field in the worlds of the mask (none = all);
    /// a written state clears the warm start of its worlds.
    fn write(
        &mut self,
        field: Field,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    );
    /// Sets columns of the parameters that vary in the worlds of the mask (none = all).
    fn write_params(&mut self, columns: Range<usize>, values: Values<'_>, mask: Option<&[bool]>);
    /// Reads columns of the parameters that vary, `(worlds, columns)`, world-major.
    fn params(&self, columns: Range<usize>, to: &mut [f64]);
    /// Numbers of a world's state and commands: all that a step begins from.
    fn numbers(&self) -> usize;
    /// Writes the records of the first worlds, as many as there is room for, in order: [`COUNTERS`] bytes, then [`Backend::numbers`] numbers of the run's precision. They are
    /// worthless if a device is lost after it.
    fn save(&self, records: &mut [u8]);
    /// Sets the worlds of the mask (none = all) to their records, or all of them to that of `from_world`.
    fn restore(&mut self, records: &[u8], mask: Option<&[bool]>, from_world: Option<usize>);
    /// Back to the start, in the worlds of the mask (none = all): of their next episode, or of the first one of new seeds, one
    /// for all or one a world. What is drawn is [`crate::start::StartDraw`]'s.
    fn reset(&mut self, mask: Option<&[bool]>, seeds: Option<&[u64]>);
    /// The worlds that were frozen since this was asked last.
    fn take_frozen(&mut self) -> Frozen;
    /// Runs `substeps` substeps (none = evaluates only), then writes every field of the layout
    /// into the arena, 8-byte words. No allocation, no error: see [`Backend::lost`].
    fn run(&mut self, substeps: usize, arena: &mut [u64]);
    /// What made this backend useless: a device that is gone. Nothing is computed after it.
    fn lost(&self) -> Option<&BackendError> {
        None
    }
    /// Loses a device, as a driver might. For tests of what comes after.
    fn lose(&mut self) {}
    /// Name of the GPU, empty on the CPU.
    fn adapter(&self) -> &str {
        ""
    }
    /// How frames reach the memory of their readers: `direct`, or of a GPU `imported` or `copied`.
    fn delivery(&self) -> &'static str {
        "direct"
    }
    /// Bytes of frames that the processor has copied.
    fn copied(&self) -> u64 {
        0
    }
    /// Lets a device write into this arena whenever it is given to [`Backend::run`]; false where it cannot.
    ///
    /// # Safety
    /// Its memory stays mapped where it is, to the same pages, until [`Backend::forget`] or the end of the backend, and nothing
    /// else that lies in its pages is written while it runs.
    unsafe fn import(&mut self, _arena: &mut [u64]) -> bool {
        false
    }
    /// Forgets all arenas that were imported.
    fn forget(&mut self) {}
}

/// Memory that can be taken without swapping [bytes].
pub(crate) fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text
        .lines()
        .find(|line| line.starts_with("MemAvailable:"))?;
    let kb: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kb * 1024)
}
