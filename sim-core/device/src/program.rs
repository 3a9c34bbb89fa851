//! Programs: WGSL in, compiled on all cores, with a limit on a driver's patience.

use crate::ahead;
use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::leave::COMPILING;
use crate::module::{self, Binding, Module};
use crate::{portable, vulkan};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

/// A program to be compiled. All its bindings are storage buffers of group 0.
#[derive(Clone, Debug)]
pub struct Source {
    /// Name, for errors.
    pub label: String,
    /// Text.
    pub wgsl: String,
    /// Its `@compute` function.
    pub entry: String,
    /// Values of its overrides.
    pub constants: Vec<(String, f64)>,
}

/// A compiled program. Clones name the same one.
#[derive(Clone)]
pub struct Program(pub(crate) Arc<Compiled>);

/// What a program is made of. The fields go in this order: pipelines go before the device.
pub(crate) struct Compiled {
    pub source: Source,
    pub bindings: Vec<Binding>,
    pub numbers: Vec<u32>,
    /// Vulkan route: what recorded batches run.
    raw: Option<vulkan::Pipeline>,
    /// What encoded batches run; on the Vulkan route compiled when the first asks for it.
    wgpu: OnceLock<Result<wgpu::ComputePipeline, DeviceError>>,
    limit: Duration,
    pub device: Arc<Inner>,
}

impl Program {
    /// Numbers of the storage buffers that it uses, ascending.
    pub fn bindings(&self) -> &[u32] {
        &self.0.numbers
    }

    /// Name, for errors.
    pub fn label(&self) -> &str {
        &self.0.source.label
    }
}

impl Compiled {
    /// The pipeline of recorded batches.
    pub fn pipeline(&self) -> &vulkan::Pipeline {
        self.raw.as_ref().expect("recorded on the Vulkan route")
    }

    /// The pipeline of encoded batches.
    pub fn encoded(self: &Arc<Self>) -> Result<&wgpu::ComputePipeline, DeviceError> {
        self.wgpu
            .get_or_init(|| {
                let program = self.clone();
                let label = self.source.label.clone();
                let work = move |_| portable::pipeline(&program.device.wgpu, &program.source);
                let mut done = within(&self.device, vec![label], 1, self.limit, work)?;
                Ok(done.remove(0))
            })
            .as_ref()
            .map_err(Clone::clone)
    }
}

impl Device {
    /// Compiles programs on all cores, and runs each once over nothing (`warm`); the order is kept.
    ///
    /// A driver that takes longer than `limit` over one of them cannot be stopped: its thread is left to itself, and keeps the
    /// device open until it ends (`compiling` counts such threads). A process that ends before may crash in the driver: see `leave`.
    ///
    /// Errors: the first program that does not compile, takes too long or asks for more than the adapter has; those begun
    /// beside it are finished and dropped.
    pub fn programs(
        &self,
        sources: &[Source],
        limit: Duration,
    ) -> Result<Vec<Program>, DeviceError> {
        self.inner.alive()?;
        let made = ahead::compile(self, sources, limit)?;
        let labels = sources.iter().map(|source| source.label.clone()).collect();
        let sources = sources.to_vec();
        let inner = self.inner.clone();
        let compile = move |place: usize| {
            let source = &sources[place];
            let module = match &made[place] {
                Some(module) => module.clone(),
                None => read(&inner, source)?,
            };
            build(&inner, source, module, limit)
        };
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
        let made = within(&self.inner, labels, cores, limit, compile);
        self.inner.alive()?;
        let made = made?;
        let warmed = self.warm(&made, limit);
        self.inner.alive()?;
        warmed?;
        if let (Some(vulkan), Some(cache)) = (&self.inner.vulkan, &self.inner.cache) {
            cache.keep_pipelines(&vulkan.remembered());
        }
        Ok(made)
    }
}

/// What a driver makes of a program before it runs.
pub(crate) fn build(
    device: &Arc<Inner>,
    source: &Source,
    module: Module,
    limit: Duration,
) -> Result<Program, String> {
    let info = &device.info;
    if module.bindings.is_empty() {
        return Err("it uses no storage buffer".to_owned());
    }
    if module.bindings.len() > info.bindings_max as usize {
        let (used, max) = (module.bindings.len(), info.bindings_max);
        return Err(format!(
            "it uses {used} storage buffers, the adapter has {max}"
        ));
    }
    if module.workgroup > info.workgroup_max {
        let (wanted, max) = (module.workgroup, info.workgroup_max);
        return Err(format!(
            "its workgroup is {wanted} threads, the adapter has {max}"
        ));
    }
    let wgpu = OnceLock::new();
    let raw = match &device.vulkan {
        Some(vulkan) => Some(vulkan.pipeline(&module, &source.entry).map_err(|e| {
            let reason = format!("the driver says: {e}");
            let label = source.label.clone();
            device.failed(
                &e,
                DeviceError::Compile {
                    label,
                    reason: reason.clone(),
                },
            );
            reason
        })?),
        None => {
            let _ = wgpu.set(Ok(portable::pipeline(&device.wgpu, source)?));
            None
        }
    };
    Ok(Program(Arc::new(Compiled {
        numbers: module.bindings.iter().map(|b| b.number).collect(),
        bindings: module.bindings,
        source: source.clone(),
        raw,
        wgpu,
        limit,
        device: device.clone(),
    })))
}

/// The program's words, from the cache if they are there.
pub(crate) fn read(device: &Inner, source: &Source) -> Result<Module, String> {
    let Some(cache) = &device.cache else {
        return module::read(source, device.vulkan.is_some());
    };
    if let Some(module) = cache.module(source) {
        return Ok(module);
    }
    let module = module::read(source, true)?;
    cache.keep_module(source, &module);
    Ok(module)
}

/// Stack of a thread that compiles [bytes]. LLVM (lavapipe) follows chains of statements by recursion: 20,000 overflow 2 MB. Pages
/// are taken as they are used.
const STACK: usize = 256 << 20;

/// News of a thread that works.
enum News<T> {
    Started(usize),
    Done(usize, Result<T, String>),
}

/// A thread that compiles, counted until it ends, however that is.
struct Counted(Option<Arc<Inner>>);

impl Counted {
    fn new(device: &Arc<Inner>) -> Counted {
        device.compiling.fetch_add(1, Ordering::Relaxed);
        COMPILING.fetch_add(1, Ordering::Relaxed);
        Counted(Some(device.clone()))
    }
}

impl Drop for Counted {
    fn drop(&mut self) {
        if let Some(device) = self.0.take() {
            device.compiling.fetch_sub(1, Ordering::Relaxed);
            // that may close the device, in the driver
            drop(device);
        }
        COMPILING.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Does one piece of work a label, in so many threads, and gives up where one takes longer than `limit`.
pub(crate) fn within<T: Send + 'static>(
    device: &Arc<Inner>,
    labels: Vec<String>,
    threads: usize,
    limit: Duration,
    work: impl Fn(usize) -> Result<T, String> + Send + Sync + 'static,
) -> Result<Vec<T>, DeviceError> {
    let count = labels.len();
    let (work, next) = (Arc::new(work), Arc::new(AtomicUsize::new(0)));
    let stop = Arc::new(AtomicBool::new(false));
    let (tell, news) = mpsc::channel();
    let mut spawned = Vec::new();
    for _ in 0..threads.min(count) {
        let (work, next, stop, tell) = (work.clone(), next.clone(), stop.clone(), tell.clone());
        let counted = Counted::new(device);
        let thread = std::thread::Builder::new().name("compile".to_owned());
        let begun = thread.stack_size(STACK).spawn(move || {
            loop {
                let place = next.fetch_add(1, Ordering::Relaxed);
                if place >= count || stop.load(Ordering::Relaxed) {
                    break;
                }
                let _ = tell.send(News::Started(place));
                let _ = tell.send(News::Done(place, work(place)));
            }
            drop((work, tell));
            drop(counted);
        });
        spawned.push(begun.expect("the system has threads"));
    }
    drop((tell, work));

    let mut started: Vec<Option<Instant>> = vec![None; count];
    let mut done: Vec<Option<T>> = (0..count).map(|_| None).collect();
    let mut failure = None;
    while failure.is_none() && done.iter().any(Option::is_none) {
        let running = || (0..count).filter(|&i| started[i].is_some() && done[i].is_none());
        let due = running().min_by_key(|&i| started[i]);
        let patience = due
            .and_then(|i| started[i])
            .map_or(limit, |since| limit.saturating_sub(since.elapsed()));
        match news.recv_timeout(patience) {
            Ok(News::Started(place)) => started[place] = Some(Instant::now()),
            Ok(News::Done(place, Ok(made))) => done[place] = Some(made),
            Ok(News::Done(place, Err(reason))) => {
                let label = labels[place].clone();
                failure = Some(DeviceError::Compile { label, reason });
            }
            Err(RecvTimeoutError::Timeout) => {
                if let Some(place) = due {
                    let label = labels[place].clone();
                    failure = Some(DeviceError::CompileTimeout { label, limit });
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                let label = labels[due.unwrap_or(0)].clone();
                let reason = "the compiler panicked".to_owned();
                failure = Some(DeviceError::Compile { label, reason });
            }
        }
    }
    stop.store(true, Ordering::Relaxed);
    match failure {
        Some(failure) => Err(failure),
        None => {
            // else the last of them may close the device while the process ends
            for thread in spawned {
                let _ = thread.join();
            }
            Ok(done.into_iter().flatten().collect())
        }
    }
}
