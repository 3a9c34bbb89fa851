//! The programs of a run, compiled, and the tables of the model.

use super::left::{self, Enlisting};
use super::places::Places;
use super::programs::{self, Programs};
use super::show;
use super::upkeep::{self, WORKGROUP};
use crate::backend::{BackendError, ProgramFacts};
use sim_device::{Buffer, Device, DeviceError, Program, Replay, Source};
use sim_physics::constants::Constants;
use sim_record::split::Part;
use std::time::Duration;

/// Threads of a workgroup of physics: registers are what it needs.
pub(super) const PHYSICS: u32 = 32;

/// Texts that depend on what a frame shows.
pub(super) struct Books {
    pub counters: String,
    pub contacts: Option<String>,
}

/// Kernels of physics, and the order in which they are dispatched.
pub(super) struct Kernels {
    pub kernels: Vec<Program>,
    pub order: Vec<Part>,
}

/// All programs of a run, and the tables of the model.
pub(super) struct Compiled {
    /// All substeps of a frame.
    pub step: Kernels,
    /// What is shown.
    pub evaluate: Kernels,
    pub begin: Program,
    pub begin_evaluation: Program,
    pub note: Program,
    pub left_out: Program,
    pub rows: Program,
    pub show: Program,
    pub counters: Program,
    pub contacts: Option<Program>,
    /// What lists worlds that are left in a loop.
    pub enlisting: Enlisting,
    pub numbers: Buffer,
    pub indices: Buffer,
    /// All of them, for people.
    pub facts: Vec<ProgramFacts>,
    /// How the batches of a frame get to the device.
    pub replay: Replay,
}

impl Compiled {
    /// Compiles what a model needs for tiles of `width` worlds.
    pub fn new(
        device: &Device,
        m: &Constants<f32>,
        places: &Places,
        programs: &Programs,
        books: Books,
        width: u32,
        limit: Duration,
    ) -> Result<Compiled, BackendError> {
        let source = |label: &str, wgsl: String, workgroup: u32| Source {
            label: label.to_owned(),
            wgsl,
            entry: "main".to_owned(),
            constants: vec![
                ("worlds".to_owned(), f64::from(width)),
                ("workgroup".to_owned(), f64::from(workgroup)),
            ],
        };
        let physics = |label: &'static str, program: &programs::Program| {
            let kernels = program.kernels.iter().enumerate();
            let kernels =
                kernels.map(|(k, text)| source(&format!("{label} {k}"), text.clone(), PHYSICS));
            kernels.collect::<Vec<_>>()
        };
        let mut sources: Vec<Source> = vec![
            source("begin", upkeep::begin(places, true), WORKGROUP),
            source("begin evaluation", upkeep::begin(places, false), WORKGROUP),
            source("note", upkeep::note(places, m), WORKGROUP),
            source("count left out", upkeep::count_left_out(places), WORKGROUP),
            source("rows", upkeep::ROWS.to_owned(), WORKGROUP),
            source("show", show::SHOW.to_owned(), WORKGROUP),
            source("counters", books.counters, WORKGROUP),
        ];
        let steps = sources.len()..sources.len() + programs.step.kernels.len();
        sources.extend(physics("step", &programs.step));
        sources.extend(physics("evaluate", &programs.evaluate));
        let loops = left::loops([&programs.step.order, &programs.evaluate.order]);
        sources.extend(left::sources(device, &loops, width));
        let has_contacts = books.contacts.is_some();
        sources.extend(
            books
                .contacts
                .map(|text| source("contacts", text, WORKGROUP)),
        );
        let facts = (sources.iter().enumerate())
            .map(|(k, source)| ProgramFacts {
                label: source.label.clone(),
                statements: source.wgsl.matches(';').count(),
                rounds: (steps.contains(&k))
                    .then(|| rounds_of(k - steps.start, &programs.step.order)),
            })
            .collect();
        let mut compiled = device.programs(&sources, limit)?.into_iter();
        let mut next = || compiled.next().expect("a program for every source");
        let [
            begin,
            begin_evaluation,
            note,
            left_out,
            rows,
            show,
            counters,
        ] = std::array::from_fn(|_| next());
        let mut kernels = |program: &programs::Program| Kernels {
            kernels: program.kernels.iter().map(|_| next()).collect(),
            order: program.order.clone(),
        };
        let (step, evaluate) = (kernels(&programs.step), kernels(&programs.evaluate));
        let enlisting = Enlisting::new(loops, &mut next);
        let contacts = has_contacts.then(&mut next);
        let tables = &m.contacts.tables;
        let numbers: Vec<u32> = tables.numbers.iter().map(|x| x.to_bits()).collect();
        Ok(Compiled {
            step,
            evaluate,
            begin,
            begin_evaluation,
            note,
            left_out,
            rows,
            show,
            counters,
            contacts,
            enlisting,
            numbers: constant(device, "numbers", &numbers)?,
            indices: constant(device, "indices", &tables.indices)?,
            facts,
            replay: Replay::Recorded,
        })
    }
}

/// How often a kernel is dispatched.
fn rounds_of(kernel: usize, order: &[Part]) -> usize {
    let rounds = order.iter().map(|part| match part {
        Part::Kernel(k) => usize::from(*k == kernel),
        Part::Repeat { rounds, parts, .. } => rounds * rounds_of(kernel, parts),
    });
    rounds.sum()
}

/// A buffer of words that do not change.
pub(super) fn constant(device: &Device, label: &str, words: &[u32]) -> Result<Buffer, DeviceError> {
    let bytes = 4 * words.len().max(4) as u64;
    let (staging, buffer) = (device.staging(label, bytes)?, device.buffer(label, bytes)?);
    staging.write()[..4 * words.len()].copy_from_slice(bytemuck::cast_slice(words));
    let mut batch = device.batch(Replay::Encoded);
    batch.copy(&staging, 0, &buffer, 0, bytes);
    device.run(&[&batch.finish()?])?;
    Ok(buffer)
}
