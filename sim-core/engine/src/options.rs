//! How a model is run, and what keeps its worlds.

use crate::backend::{
    BackendError, Backends, Faults, Groups, Lanes, Precision, available_memory, cpu, gpu,
};
use crate::random::{Draws, Numbering};
use sim_model::Model;
use sim_physics::arrays::{Field, Layout};
use std::path::PathBuf;
use std::time::Duration;

pub use sim_device::{AdapterInfo, AdapterKind, Choice as Adapter, Replay, adapters, leave};
#[doc(hidden)]
pub use sim_device::{compiling, lose_after};

/// What keeps the worlds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Device {
    /// The processor.
    #[default]
    Cpu,
    /// An adapter of this machine; `cache` is a folder that keeps its programs from run to run.
    Gpu {
        /// Which one.
        adapter: Adapter,
        /// Where programs are kept, if anywhere.
        cache: Option<PathBuf>,
    },
    /// A GPU if there is one that is no software, for single precision and at least [`AUTO_WORLDS`] worlds; else the processor.
    Auto {
        /// Where programs are kept, if anywhere.
        cache: Option<PathBuf>,
        /// A GPU that software plays will do, too: for tests of what comes after.
        software: bool,
    },
}

/// Worlds from which on [`Device::Auto`] looks for a GPU: fewer leave most of it idle.
pub const AUTO_WORLDS: usize = 1024;

/// For each: lavapipe takes up to 4 s over one program of a grasp on a busy machine, and 12 s over all of them where it compiles one after the other.
const COMPILE_LIMIT: Duration = Duration::from_secs(180);
/// Where another limit is said.
const COMPILE_LIMIT_NAME: &str = "TIGHTLOOP_COMPILE_LIMIT";

/// How to run a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Number of worlds.
    pub worlds: usize,
    /// What keeps them.
    pub device: Device,
    /// How a GPU gets the batches of a frame: recorded, unless that is what is measured.
    pub replay: Replay,
    /// A driver that takes longer over a program of a GPU is given up.
    pub compile_limit: Duration,
    /// Precision of state, commands and fields.
    pub precision: Precision,
    /// Threads of a step; none = one a core.
    pub threads: Option<usize>,
    /// Worlds a block.
    pub lanes: Lanes,
    /// Fields of a frame; counters come with every frame.
    pub fields: Vec<Field>,
    /// When a world is frozen, and what becomes of it.
    pub faults: Faults,
    /// What the draws of a world depend on.
    pub draws: Draws,
    /// The number of the first world in draws: that of a group of worlds which others come before.
    pub first_world: usize,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            worlds: 1,
            device: Device::Cpu,
            replay: Replay::Recorded,
            compile_limit: COMPILE_LIMIT,
            precision: Precision::F32,
            threads: None,
            lanes: Lanes::Auto,
            fields: vec![Field::JointQ, Field::JointQd, Field::BodyQ],
            faults: Faults::default(),
            draws: Draws::default(),
            first_world: 0,
        }
    }
}

/// Where programs of GPUs are kept from run to run, if this user has such a place.
pub fn cache_folder() -> Option<PathBuf> {
    let absolute = |name: &str| {
        let path = PathBuf::from(std::env::var_os(name)?);
        path.is_absolute().then_some(path)
    };
    let caches = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")));
    Some(caches?.join("tightloop"))
}

/// How long a driver may take over a program: seconds in `TIGHTLOOP_COMPILE_LIMIT`, or what [`Options::default`] has.
///
/// # Errors
/// What stands there is no time.
pub fn compile_limit() -> Result<Duration, BackendError> {
    let Ok(value) = std::env::var(COMPILE_LIMIT_NAME) else {
        return Ok(COMPILE_LIMIT);
    };
    let seconds = value.parse().unwrap_or(f64::NAN);
    let limit = Duration::try_from_secs_f64(seconds);
    limit.map_err(|_| BackendError::CompileLimit { value })
}

/// Whether [`Device::Auto`] takes a GPU that software plays: `TIGHTLOOP_AUTO_SOFTWARE=1`, for tests of daemons.
pub fn auto_takes_software() -> bool {
    std::env::var_os("TIGHTLOOP_AUTO_SOFTWARE").is_some_and(|value| value == "1")
}

/// What keeps the worlds of each of so many groups, and why where that was left open.
pub(crate) fn backends(
    model: &Model,
    options: &Options,
    count: usize,
    layout: &Layout,
) -> Result<(Backends, Option<String>), BackendError> {
    let (worlds, precision) = (options.worlds, options.precision);
    let numbering = Numbering {
        draws: options.draws,
        first_world: options.first_world,
    };
    let groups = Groups {
        count,
        worlds,
        numbering,
    };
    let on_gpu = |adapter: &Adapter, cache: &Option<PathBuf>| {
        let wanted = gpu::Wanted {
            adapter,
            cache: cache.as_deref(),
            replay: options.replay,
            compile_limit: options.compile_limit,
        };
        gpu::create(model, groups, layout, &wanted)
    };
    let note = match &options.device {
        Device::Gpu { .. } if precision == Precision::F64 => return Err(BackendError::DoubleOnGpu),
        Device::Gpu { adapter, cache } => return Ok((on_gpu(adapter, cache)?, None)),
        Device::Cpu => None,
        Device::Auto { .. } if precision == Precision::F64 => {
            Some("the processor: a GPU computes in single precision".to_owned())
        }
        Device::Auto { .. } if groups.all() < AUTO_WORLDS => {
            Some(format!("the processor: fewer than {AUTO_WORLDS} worlds"))
        }
        Device::Auto { cache, software } => {
            let found = adapters();
            let will_do = |info: &&AdapterInfo| *software || info.kind != AdapterKind::Software;
            match found.iter().find(will_do) {
                None => Some("the processor: no GPU was found".to_owned()),
                Some(info) => match on_gpu(&Adapter::Index(info.index), cache) {
                    Ok(made) => return Ok((made, Some(format!("the GPU `{}`", info.name)))),
                    Err(e) => Some(format!("the processor: `{}` failed: {e}", info.name)),
                },
            }
        }
    };
    let threads = threads_of(options);
    let made = cpu::create(model, groups, precision, options.lanes, layout, threads)?;
    Ok((made, note))
}

/// Threads that are asked for: as many as there are cores if none are.
fn threads_of(options: &Options) -> usize {
    let cores = || std::thread::available_parallelism().map_or(1, |n| n.get());
    options.threads.unwrap_or_else(cores)
}

/// Memory that the worlds take in this process, an arena not included [bytes].
pub(crate) fn memory_of(model: &Model, options: &Options) -> u64 {
    let (real, width) = match options.precision {
        Precision::F32 => (4, 16),
        Precision::F64 => (8, 1),
    };
    let worlds = (options.worlds as u64).saturating_add(width);
    // scratch of each chunk, its matrices included; see backend/cpu/mod.rs
    let m = model.constants();
    let matrices = 3 * m.pattern.len() + 2 * m.coupled.pattern.len();
    let chunks = threads_of(options).saturating_mul(cpu::CHUNKS_PER_THREAD) as u64;
    let scratch = ((m.contacts.memory.len + matrices) as u64 * real * width)
        .saturating_mul(chunks.min(worlds));
    // state and commands of a world, its counters; see backend/cpu/chunk.rs
    worlds
        .saturating_mul(
            ((5 + 3 * m.delay.frames) * model.dofs() + 2 * model.coords() + m.varying.len()) as u64
                * real
                + 45,
        )
        .saturating_add(scratch)
}

/// Refuses what would not fit in so many groups, before anything is taken.
pub(crate) fn check_memory(
    model: &Model,
    options: &Options,
    groups: usize,
) -> Result<(), BackendError> {
    const MB: u64 = 1 << 20;
    // a system that does not say how much is free is not asked twice: the allocation itself will tell
    let Some(available) = available_memory() else {
        return Ok(());
    };
    let needed = memory_of(model, options).saturating_mul(groups as u64);
    if needed > available {
        return Err(BackendError::Memory {
            worlds: options.worlds * groups,
            needed_mb: needed / MB,
            available_mb: available / MB,
        });
    }
    Ok(())
}
