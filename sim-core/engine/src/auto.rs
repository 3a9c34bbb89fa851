//! The choice of `auto` between the processor and a GPU: each steps the worlds for a moment, and the faster one keeps them.
//!
//! Which one is faster depends on the card, the cores, the model's contacts and the number of worlds. So each steps the scene from its
//! start, with the commands of the start. Rates are means over the later half of the frames that both have made: by then more shapes
//! touch. The host copies the frames of the GPU.
//!
//! The processor comes first, and its worlds are dropped before the GPU takes memory. So a measurement needs the memory of one side at
//! a time, and that of a frame. The worlds that stay are at their start, bit for bit.
//!
//! Rates are kept in the folder of compiled programs, in a file for each build, adapter, driver, processor, model and number of worlds.
//! Its first line says what was measured, its second line has both rates. A file that cannot be read or written costs a measurement, no
//! more. Rates that are close decide nothing at later launches, which measure again.

use crate::backend::{BackendError, Backends, Faults};
use sim_device::{AdapterInfo, AdapterKind};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Least frames of a side: the first one is slow, since memory is touched for the first time.
const FRAMES_MIN: usize = 3;
/// Most frames of a side: in this time a falling body has landed.
const FRAMES_MAX: usize = 64;
/// After this time a side begins no frame beyond [`FRAMES_MIN`].
const LIMIT: Duration = Duration::from_millis(500);
/// Kept rates within this factor are measured again: other work on the computer may have put them in the wrong order.
const CLOSE: f64 = 1.3;
/// Most bytes of kept rates: thousands of scenes.
const RATES_MAX: u64 = 1 << 20;

/// What both sides are to run.
pub(crate) struct Question<'a> {
    /// The GPU.
    pub adapter: &'a AdapterInfo,
    /// All that the rates depend on, in one line.
    pub key: String,
    /// Folder of kept rates.
    pub folder: Option<&'a Path>,
    /// Worlds of a group.
    pub worlds: usize,
    /// Substeps of a frame.
    pub substeps: usize,
    /// Size of a frame [8 bytes].
    pub words: usize,
}

/// Steps per second of all worlds.
#[derive(Clone, Copy)]
struct Rates {
    gpu: f64,
    cpu: f64,
}

/// The backends of the faster side, and why, for people. A side that fails leaves the worlds to the other one.
///
/// # Errors
/// Those of the processor, where the GPU fails too.
pub(crate) fn choose(
    question: &Question<'_>,
    on_gpu: impl Fn() -> Result<Backends, BackendError>,
    on_cpu: impl Fn() -> Result<Backends, BackendError>,
) -> Result<(Backends, String), BackendError> {
    let chosen = match question.load() {
        Some(rates) if !rates.are_for_gpu() => Ok((None, question.reason(rates, None))),
        Some(rates) => on_gpu().map(|gpu| (Some(gpu), question.reason(rates, None))),
        None => match on_cpu() {
            Ok(cpu) => question.measure(&on_gpu, cpu),
            Err(e) => return question.without_cpu(on_gpu, e),
        },
    };
    match chosen {
        Ok((Some(gpu), reason)) => Ok((gpu, reason)),
        Ok((None, reason)) => match on_cpu() {
            Ok(cpu) => Ok((cpu, reason)),
            Err(e) => question.without_cpu(on_gpu, e),
        },
        Err(e) => {
            let name = &question.adapter.name;
            Ok((on_cpu()?, format!("the processor: `{name}` failed: {e}")))
        }
    }
}

impl Question<'_> {
    /// The GPU, if it is faster, and the reason. An error is the GPU's.
    fn measure(
        &self,
        on_gpu: impl FnOnce() -> Result<Backends, BackendError>,
        mut cpu: Backends,
    ) -> Result<(Option<Backends>, String), BackendError> {
        let (on_cpu, took) = self.frames(&mut cpu);
        drop(cpu);
        let mut gpu = on_gpu()?;
        let (on_gpu, took_gpu) = self.frames(&mut gpu);
        for group in &mut gpu {
            assert!(group.restart(), "a GPU begins a run again");
        }
        if let Some(e) = gpu.iter().find_map(|group| group.lost()) {
            return Err(e.clone());
        }
        let frames = on_gpu.len().min(on_cpu.len());
        let rate = |durations: &[f64]| {
            let later = &durations[frames / 2..frames];
            let steps = gpu.len() * self.worlds * self.substeps * later.len();
            steps as f64 / later.iter().sum::<f64>()
        };
        let rates = Rates {
            gpu: rate(&on_gpu),
            cpu: rate(&on_cpu),
        };
        self.keep(rates);
        let reason = self.reason(rates, Some(took + took_gpu));
        Ok((rates.are_for_gpu().then_some(gpu), reason))
    }

    /// The GPU, where the processor does not start; its error if the GPU does not start either.
    fn without_cpu(
        &self,
        on_gpu: impl Fn() -> Result<Backends, BackendError>,
        error: BackendError,
    ) -> Result<(Backends, String), BackendError> {
        let gpu = on_gpu().map_err(|_| error.clone())?;
        Ok((
            gpu,
            format!("{}: the processor failed: {error}", self.gpu()),
        ))
    }

    /// Durations of frames from the start [s], and what that took.
    fn frames(&self, groups: &mut Backends) -> (Vec<f64>, Duration) {
        let begin = Instant::now();
        let mut arena = vec![0; self.words];
        for group in groups.iter_mut() {
            // a frozen world costs less, and bounds are 0 on a GPU until they are set
            group.set_faults(Faults::default());
        }
        let mut durations = Vec::new();
        while durations.len() < FRAMES_MIN
            || durations.len() < FRAMES_MAX && begin.elapsed() < LIMIT
        {
            let begin = Instant::now();
            for group in groups.iter_mut() {
                group.run(self.substeps, &mut arena);
            }
            durations.push(begin.elapsed().as_secs_f64());
        }
        (durations, begin.elapsed())
    }

    /// The GPU, for people.
    fn gpu(&self) -> String {
        let software = match self.adapter.kind {
            AdapterKind::Software => ", a software driver",
            _ => "",
        };
        format!("the GPU `{}`{software}", self.adapter.name)
    }

    /// The choice and its reason. `took` is the duration of the measurement; none = rates were kept.
    fn reason(&self, rates: Rates, took: Option<Duration>) -> String {
        let sides = [
            (self.gpu(), rates.gpu),
            ("the processor".to_owned(), rates.cpu),
        ];
        let [(gpu, on_gpu), (cpu, on_cpu)] = sides;
        let ((chosen, most), (other, least)) = match rates.are_for_gpu() {
            true => ((gpu, on_gpu), (cpu, on_cpu)),
            false => ((cpu, on_cpu), (gpu, on_gpu)),
        };
        let when = match took {
            Some(took) => format!("in {:.1} s", took.as_secs_f64()),
            None => "by an earlier launch".to_owned(),
        };
        let [most, least] = [most, least].map(|rate| format!("{:.3} M", rate * 1e-6));
        format!("{chosen}: {most} steps/s beside {least} on {other}, measured {when}")
    }

    fn file(&self) -> Option<PathBuf> {
        let mut hasher = DefaultHasher::new();
        self.key.hash(&mut hasher);
        Some(self.folder?.join(format!("auto-{:016x}", hasher.finish())))
    }

    /// Kept rates of this key, unless they are close.
    fn load(&self) -> Option<Rates> {
        let text = std::fs::read_to_string(self.file()?).ok()?;
        let (key, rates) = text.strip_suffix('\n')?.split_once('\n')?;
        let (gpu, cpu) = rates.split_once(' ')?;
        let rate = |text: &str| {
            text.parse()
                .ok()
                .filter(|rate: &f64| rate.is_normal() && *rate > 0.0)
        };
        let rates = Rates {
            gpu: rate(gpu)?,
            cpu: rate(cpu)?,
        };
        (key == self.key && !rates.are_close()).then_some(rates)
    }

    /// Writes a whole file or nothing: several processes may share the folder.
    fn keep(&self, rates: Rates) {
        let Some(path) = self.file() else {
            return;
        };
        let draft = path.with_extension(std::process::id().to_string());
        let text = format!("{}\n{} {}\n", self.key, rates.gpu, rates.cpu);
        let folder = path.parent().expect("the file is in a folder");
        let _ = std::fs::create_dir_all(folder);
        if std::fs::write(&draft, text).is_err() || std::fs::rename(&draft, &path).is_err() {
            let _ = std::fs::remove_file(&draft);
        }
        sim_device::bound(folder, "auto-", RATES_MAX);
    }
}

impl Rates {
    fn are_for_gpu(self) -> bool {
        self.gpu > self.cpu
    }

    fn are_close(self) -> bool {
        self.gpu.max(self.cpu) < CLOSE * self.gpu.min(self.cpu)
    }
}
