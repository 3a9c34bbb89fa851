//! The programs of a run, compiled, and the tables of the model.

use super::kernels::bookkeeping;
use super::kernels::places::Places;
use super::kernels::programs::{KernelSequence, Programs};
use super::kernels::workgroups::{self, BOOKKEEPING};
use super::software::{self, Compaction};
use crate::backend::{BackendError, ProgramInfo};
use sim_device::{Buffer, Device, DeviceError, Program, Replay, Source};
use sim_physics::constants::Constants;
use sim_record::split::Part;
use std::time::Duration;

/// Kernel sources that depend on the output fields.
pub(super) struct OutputSources {
    pub show: String,
    pub contacts: Option<String>,
    /// Whether the evaluation finds contacts.
    pub finds_contacts: bool,
}

/// A kernel of physics.
pub(super) struct Kernel {
    pub program: Program,
    /// Threads per world.
    lanes: u32,
    workgroup: u32,
}

impl Kernel {
    /// Workgroups for so many worlds.
    pub fn groups(&self, worlds: u32) -> u32 {
        (worlds * self.lanes).div_ceil(self.workgroup)
    }
}

/// Kernels of physics, and the order in which they are dispatched.
pub(super) struct Kernels {
    pub kernels: Vec<Kernel>,
    pub order: Vec<Part>,
}

/// All programs of a run, and the tables of the model.
pub(super) struct Compiled {
    /// All substeps of a frame.
    pub step: Kernels,
    /// The evaluation of output fields.
    pub evaluate: Kernels,
    pub begin: Program,
    pub begin_evaluation: Program,
    pub check_faults: Program,
    pub rows: Program,
    pub show: Program,
    pub contacts: Option<Program>,
    /// Lists of active worlds.
    pub compaction: Compaction,
    pub numbers: Buffer,
    pub indices: Buffer,
    /// Descriptions of all programs, for people.
    pub info: Vec<ProgramInfo>,
    /// Whether the batches of a frame are recorded or encoded.
    pub replay: Replay,
}

impl Compiled {
    /// Compiles all programs of a model, for tiles of `width` worlds.
    pub fn new(
        device: &Device,
        m: &Constants<f32>,
        places: &Places,
        programs: &Programs,
        outputs: OutputSources,
        width: u32,
        limit: Duration,
    ) -> Result<Compiled, BackendError> {
        let source_of = |label: &str, wgsl: String, workgroup: Option<u32>| {
            let worlds = ("worlds".to_owned(), f64::from(width));
            let workgroup = workgroup.map(|n| ("workgroup".to_owned(), f64::from(n)));
            Source {
                label: label.to_owned(),
                wgsl,
                entry: "main".to_owned(),
                constants: [worlds].into_iter().chain(workgroup).collect(),
            }
        };
        let source = |label: &str, wgsl, workgroup| source_of(label, wgsl, Some(workgroup));
        let threads = workgroups::physics(device.info());
        let physics = |label: &'static str, program: &KernelSequence| {
            let kernels = program.kernels.iter().enumerate();
            let kernels = kernels.map(|(k, kernel)| {
                let threads = kernel.workgroup.is_none().then_some(threads);
                source_of(&format!("{label} {k}"), kernel.wgsl.clone(), threads)
            });
            kernels.collect::<Vec<_>>()
        };
        let mut sources: Vec<Source> = vec![
            source("begin", bookkeeping::begin(places, true), BOOKKEEPING),
            source(
                "begin evaluation",
                bookkeeping::begin(places, false),
                BOOKKEEPING,
            ),
            source(
                "check faults",
                bookkeeping::check_faults(places, m, !outputs.finds_contacts),
                BOOKKEEPING,
            ),
            source("rows", bookkeeping::ROWS.to_owned(), BOOKKEEPING),
            source("show", outputs.show, BOOKKEEPING),
        ];
        let steps = sources.len()..sources.len() + programs.step.kernels.len();
        sources.extend(physics("step", &programs.step));
        sources.extend(physics("evaluate", &programs.evaluate));
        let loops = software::loops([&programs.step.order, &programs.evaluate.order]);
        sources.extend(software::sources(device, &loops, width));
        let has_contacts = outputs.contacts.is_some();
        sources.extend(
            outputs
                .contacts
                .map(|wgsl| source("contacts", wgsl, BOOKKEEPING)),
        );
        let info = (sources.iter().enumerate())
            .map(|(k, source)| ProgramInfo {
                label: source.label.clone(),
                statements: source.wgsl.matches(';').count(),
                dispatches: (steps.contains(&k))
                    .then(|| dispatches_of(k - steps.start, &programs.step.order)),
            })
            .collect();
        let mut compiled = device.programs(&sources, limit)?.into_iter();
        let mut next = || compiled.next().expect("a program for every source");
        let [begin, begin_evaluation, check_faults, rows, show] = std::array::from_fn(|_| next());
        let mut kernels = |program: &KernelSequence| Kernels {
            kernels: (program.kernels.iter())
                .map(|kernel| Kernel {
                    program: next(),
                    lanes: kernel.lanes,
                    workgroup: kernel.workgroup.unwrap_or(threads),
                })
                .collect(),
            order: program.order.clone(),
        };
        let (step, evaluate) = (kernels(&programs.step), kernels(&programs.evaluate));
        let compaction = Compaction::new(loops, &mut next);
        let contacts = has_contacts.then(&mut next);
        let tables = &m.contacts.tables;
        let numbers: Vec<u32> = tables.numbers.iter().map(|x| x.to_bits()).collect();
        Ok(Compiled {
            step,
            evaluate,
            begin,
            begin_evaluation,
            check_faults,
            rows,
            show,
            contacts,
            compaction,
            numbers: constant(device, "numbers", &numbers)?,
            indices: constant(device, "indices", &tables.indices)?,
            info,
            replay: Replay::Recorded,
        })
    }
}

/// How often a kernel is dispatched.
pub(super) fn dispatches_of(kernel: usize, order: &[Part]) -> usize {
    let dispatches = order.iter().map(|part| match part {
        Part::Kernel(k) => usize::from(*k == kernel),
        Part::Repeat {
            iterations, parts, ..
        } => iterations * dispatches_of(kernel, parts),
    });
    dispatches.sum()
}

/// A buffer of constant words.
pub(super) fn constant(device: &Device, label: &str, words: &[u32]) -> Result<Buffer, DeviceError> {
    let bytes = 4 * words.len().max(4) as u64;
    let (staging, buffer) = (device.staging(label, bytes)?, device.buffer(label, bytes)?);
    staging.write()[..4 * words.len()].copy_from_slice(bytemuck::cast_slice(words));
    let mut batch = device.batch(Replay::Encoded);
    batch.copy(&staging, 0, &buffer, 0, bytes);
    device.run(&[&batch.finish()?])?;
    Ok(buffer)
}
