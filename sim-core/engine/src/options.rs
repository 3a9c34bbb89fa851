//! Options of a run, and the choice of its device.

use crate::auto::{Question, choose};
use crate::backend::{
    BackendError, Backends, Faults, Groups, Lanes, OutputsAt, Precision, available_memory, cpu, gpu,
};
use crate::random::{Draws, Numbering};
use crate::workers::PARTS_PER_THREAD;
use sim_model::Model;
use sim_physics::arrays::{Field, Layout};
use sim_physics::constants::options::Integrator;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, UNIX_EPOCH};

pub use crate::backend::gpu::Cuts;
pub use sim_device::{
    AdapterInfo, AdapterKind, Choice as Adapter, Replay, adapters, leave, leave_at_once,
};
#[doc(hidden)]
pub use sim_device::{allocate_at_most, compiling, lose_after, open_as_discrete};

/// The device that keeps the worlds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Device {
    /// The processor.
    #[default]
    Cpu,
    /// An adapter of this computer; `cache` is a folder that keeps its programs from run to run.
    Gpu {
        /// Which one.
        adapter: Adapter,
        /// Where programs are kept, if anywhere.
        cache: Option<PathBuf>,
    },
    /// The faster of a hardware GPU and the processor, by a measurement at the launch, for single precision and at least
    /// [`AUTO_WORLDS`] worlds; otherwise the processor.
    Auto {
        /// Where programs and measurements are kept, if anywhere.
        cache: Option<PathBuf>,
        /// Whether a software driver takes part too, for tests.
        software: bool,
    },
}

/// Least worlds for which [`Device::Auto`] measures. The ends of a frame alone take a card some 120 µs, a prediction; in this
/// time eight cores step 200 arms through a frame (benches/NOTES.md).
pub const AUTO_WORLDS: usize = 128;

/// Limit per program. On a busy computer lavapipe takes up to 4 s for a program of a grasp, and 12 s for all of them in sequence.
const COMPILE_LIMIT: Duration = Duration::from_secs(180);
/// Environment variable of another limit.
const COMPILE_LIMIT_NAME: &str = "TIGHTLOOP_COMPILE_LIMIT";

/// How to run a model.
#[derive(Clone, Debug)]
pub struct Options {
    /// Number of worlds.
    pub worlds: usize,
    /// The device that keeps them.
    pub device: Device,
    /// Whether the batches of a GPU are recorded or encoded; benchmarks compare both.
    pub replay: Replay,
    /// Threads of a GPU that share a world where contacts can be, a power of two up to 32; none = what suits the adapter.
    pub world_threads: Option<usize>,
    /// Whether frames have the same bits on the processor and on GPUs, in single precision: one thread per world, sums in the processor's
    /// order, and every operation rounded to the nearest number. In frames zeros have no sign, and what is below 2^-126 is 0.
    pub cpu_bits: bool,
    /// Where the kernels of a GPU are cut, where that differs from what suits the adapter; benchmarks vary it.
    pub cuts: Cuts,
    /// Limit on the compile time of a GPU program; a driver that exceeds it is abandoned.
    pub compile_limit: Duration,
    /// Precision of state, commands and fields.
    pub precision: Precision,
    /// Threads of a step; none = one per core.
    pub threads: Option<usize>,
    /// Worlds per block.
    pub lanes: Lanes,
    /// Whether the processor runs a model as machine code of its own where that can be made, instead of stages that were compiled
    /// for all models: faster, with the same bits.
    pub compiles: bool,
    /// Compares that machine code first with the stages of this model, which outside of tests is the one that runs. Where it differs,
    /// stages run, and the device's name has the reason.
    pub checked_with: Option<Arc<Model>>,
    /// Fields of a frame; counters come with every frame.
    pub fields: Vec<Field>,
    /// Which state the evaluated outputs of a step belong to.
    pub outputs_at: OutputsAt,
    /// Bounds of faults, and what happens to a faulted world.
    pub faults: Faults,
    /// What the draws of a world depend on.
    pub draws: Draws,
    /// World number of the first world in draws; other groups may come before.
    pub first_world: usize,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            worlds: 1,
            device: Device::Cpu,
            replay: Replay::Recorded,
            world_threads: None,
            cpu_bits: false,
            cuts: Cuts::default(),
            compile_limit: COMPILE_LIMIT,
            precision: Precision::F32,
            threads: None,
            lanes: Lanes::Auto,
            compiles: true,
            checked_with: None,
            fields: vec![Field::JointQ, Field::JointQd, Field::BodyQ],
            outputs_at: OutputsAt::Frame,
            faults: Faults::default(),
            draws: Draws::default(),
            first_world: 0,
        }
    }
}

/// Folder that keeps GPU programs and compiled meshes from run to run, if this user has a cache folder.
pub fn cache_folder() -> Option<PathBuf> {
    let absolute = |name: &str| {
        let path = PathBuf::from(std::env::var_os(name)?);
        path.is_absolute().then_some(path)
    };
    let caches = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")));
    Some(caches?.join("tightloop"))
}

/// Limit on the compile time of a GPU program: `TIGHTLOOP_COMPILE_LIMIT` in seconds, or that of [`Options::default`].
///
/// # Errors
/// A value that is no duration.
pub fn compile_limit() -> Result<Duration, BackendError> {
    let Ok(value) = std::env::var(COMPILE_LIMIT_NAME) else {
        return Ok(COMPILE_LIMIT);
    };
    let seconds = value.parse().unwrap_or(f64::NAN);
    let limit = Duration::try_from_secs_f64(seconds);
    limit.map_err(|_| BackendError::CompileLimit { value })
}

/// What a launch compares a model's machine code with: with `TIGHTLOOP_CHECK=1` its stages, else nothing.
pub fn machine_code_check(model: &Arc<Model>) -> Option<Arc<Model>> {
    let checks = std::env::var_os("TIGHTLOOP_CHECK").is_some_and(|value| value == "1");
    checks.then(|| Arc::clone(model))
}

/// Whether [`Device::Auto`] accepts a software driver: `TIGHTLOOP_AUTO_SOFTWARE=1`, for tests of daemons.
pub fn auto_takes_software() -> bool {
    std::env::var_os("TIGHTLOOP_AUTO_SOFTWARE").is_some_and(|value| value == "1")
}

/// One backend per group, and why `auto` chose it.
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
            world_threads: options.world_threads,
            cpu_bits: options.cpu_bits,
            cuts: options.cuts,
            compile_limit: options.compile_limit,
        };
        gpu::create(model, groups, layout, &wanted)
    };
    let on_cpu = || {
        let layout = (layout, options.outputs_at);
        let running = cpu::CpuOptions {
            threads: threads_of(options),
            compiles: options.compiles,
            checked_with: options.checked_with.as_deref(),
        };
        cpu::create(model, groups, precision, options.lanes, layout, running)
    };
    let lags = options.outputs_at == OutputsAt::LastSubstep;
    let sweeps = model.constants().solver.noslip.is_some();
    let implicit = model.constants().integrator == Integrator::Implicit;
    let note = match &options.device {
        Device::Gpu { .. } if lags => return Err(BackendError::LastSubstepOnGpu),
        Device::Gpu { .. } if precision == Precision::F64 => return Err(BackendError::DoubleOnGpu),
        Device::Gpu { .. } if sweeps => return Err(BackendError::NoSlipOnGpu),
        Device::Gpu { .. } if implicit => return Err(BackendError::ImplicitOnGpu),
        Device::Gpu { adapter, cache } => return Ok((on_gpu(adapter, cache)?, None)),
        Device::Cpu => None,
        Device::Auto { .. } if lags => {
            Some("the processor: a GPU has no outputs of the last substep".to_owned())
        }
        Device::Auto { .. } if precision == Precision::F64 => {
            Some("the processor: a GPU computes in single precision".to_owned())
        }
        Device::Auto { .. } if sweeps => {
            Some("the processor: a GPU has no noslip_iterations".to_owned())
        }
        Device::Auto { .. } if implicit => {
            Some("the processor: a GPU has no integrator `implicit`".to_owned())
        }
        Device::Auto { .. } if groups.all() < AUTO_WORLDS => {
            Some(format!("the processor: fewer than {AUTO_WORLDS} worlds"))
        }
        Device::Auto { cache, software } => {
            let adapters = adapters();
            let will_do = |info: &&AdapterInfo| *software || info.kind != AdapterKind::Software;
            match adapters.iter().find(will_do) {
                None => Some("the processor: no GPU was found".to_owned()),
                Some(adapter) => {
                    let question = Question {
                        adapter,
                        key: measured(model, options, count, adapter),
                        folder: cache.as_deref(),
                        worlds,
                        substeps: model.substeps(),
                        words: layout.bytes / 8,
                    };
                    let on_gpu = || on_gpu(&Adapter::Index(adapter.index), cache);
                    let (made, note) = choose(&question, on_gpu, on_cpu)?;
                    return Ok((made, Some(note)));
                }
            }
        }
    };
    Ok((on_cpu()?, note))
}

/// All that the rates of `auto` depend on, in one line.
fn measured(model: &Model, options: &Options, groups: usize, adapter: &AdapterInfo) -> String {
    let (worlds, threads) = (options.worlds, threads_of(options));
    let how = (
        options.replay,
        options.world_threads,
        options.cpu_bits,
        options.cuts,
    );
    format!(
        "tightloop {}, {}; {}, {}, {how:?}; {}, {threads} threads, {:?}; model {:016x}; {groups} x {worlds} worlds; {:?}",
        env!("CARGO_PKG_VERSION"),
        build(),
        adapter.name,
        adapter.driver,
        processor(),
        options.lanes,
        model.hash(),
        options.fields,
    )
}

/// Size and time of change of the file that has this code, as Linux has them: another build may have other kernels. To hash the kernels
/// they would have to be recorded at every launch.
fn build() -> String {
    let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
    let address = build as fn() -> String as usize;
    let has_this_code = |line: &&str| {
        let ends = line
            .split_once(' ')
            .and_then(|(part, _)| part.split_once('-'));
        let number = |digits| usize::from_str_radix(digits, 16).ok();
        let part = ends.and_then(|(first, end)| Some(number(first)?..number(end)?));
        part.is_some_and(|part| part.contains(&address))
    };
    let line = maps.lines().find(has_this_code).unwrap_or_default();
    let file = line
        .find('/')
        .map(|start| std::fs::metadata(&line[start..]));
    let Some(Ok(file)) = file else {
        return "unknown build".to_owned();
    };
    let changed = file.modified().ok();
    let changed = changed.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    let changed = changed.map_or(0, |time| time.as_nanos());
    format!("build of {} bytes at {changed}", file.len())
}

/// Name of the processor, as Linux has it.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split(": ").nth(1));
    name.unwrap_or("processor").to_owned()
}

/// Requested threads; one per core by default.
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
    // scratch of each chunk, its matrices included, for every block that it keeps at hand; see backend/cpu/gathered.rs
    let m = model.constants();
    let matrices = 3 * m.pattern.len() + 2 * m.coupled.pattern.len();
    let chunks = threads_of(options).saturating_mul(PARTS_PER_THREAD) as u64;
    let spaces = match width {
        1 => 1,
        _ => cpu::spaces_max(m, (real * width) as usize) as u64,
    };
    let scratch = ((m.contacts.memory.len + matrices) as u64 * real * width * spaces)
        .saturating_mul(chunks.min(worlds));
    // state and commands of a world, its counters; see backend/cpu/chunk.rs
    worlds
        .saturating_mul(
            ((5 + 3 * m.delay.frames) * model.dofs()
                + 2 * model.coords()
                + m.actuators.kept_controls()
                + m.springs.plastic_rests()
                + m.varying.len()) as u64
                * real
                + 45,
        )
        .saturating_add(scratch)
}

/// Refuses worlds that do not fit into memory, before any is allocated.
pub(crate) fn check_memory(
    model: &Model,
    options: &Options,
    groups: usize,
) -> Result<(), BackendError> {
    const MB: u64 = 1 << 20;
    // where the system does not report free memory, the allocation itself will fail
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
