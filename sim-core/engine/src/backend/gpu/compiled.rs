//! The programs of a run, compiled, and the tables of the model.

use super::kernels::bookkeeping;
use super::kernels::places::Places;
use super::kernels::programs::KernelSequence;
use super::kernels::room::Room;
use super::kernels::workgroups::{self, BOOKKEEPING};
use super::recipe::{Extent, Recipe};
use super::software::{self, Compaction};
use crate::backend::{BackendError, ProgramInfo};
use sim_device::{Buffer, Device, DeviceError, Program, Replay, Source};
use sim_physics::constants::Constants;
use sim_record::split::Part;

/// A kernel of physics.
#[derive(Clone)]
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
#[derive(Clone)]
pub(super) struct Kernels {
    pub kernels: Vec<Kernel>,
    pub order: Vec<Part>,
}

/// All programs of a run, and the tables of the model.
#[derive(Clone)]
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
    /// Notes whether a world lacked room for contacts in the substeps; only where worlds can get more.
    pub note_room: Option<Program>,
    /// The same in the evaluation, where that finds contacts.
    pub note_shown_room: Option<Program>,
    /// Lists of active worlds.
    pub compaction: Compaction,
    pub numbers: Buffer,
    /// The indices of the model, with the room that its contacts have.
    pub indices: Buffer,
    /// Descriptions of all programs, for people.
    pub info: Vec<ProgramInfo>,
    /// Whether the batches of a frame are recorded or encoded.
    pub replay: Replay,
}

impl Compiled {
    /// Compiles all programs of a model.
    pub fn new(
        device: &Device,
        m: &Constants<f32>,
        places: &Places,
        recipe: &Recipe,
        extent: &Extent,
    ) -> Result<Compiled, BackendError> {
        let (programs, outputs, width) = (&recipe.programs, &recipe.outputs, extent.width);
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
            source("begin", bookkeeping::begin(places, m, true), BOOKKEEPING),
            source(
                "begin evaluation",
                bookkeeping::begin(places, m, false),
                BOOKKEEPING,
            ),
            source(
                "check faults",
                bookkeeping::check_faults(places, m, !outputs.finds_contacts),
                BOOKKEEPING,
            ),
            source("rows", bookkeeping::ROWS.to_owned(), BOOKKEEPING),
            source("show", outputs.show.clone(), BOOKKEEPING),
        ];
        let steps = sources.len()..sources.len() + programs.step.kernels.len();
        sources.extend(physics("step", &programs.step));
        sources.extend(physics("evaluate", &programs.evaluate));
        let loops = software::loops([&programs.step.order, &programs.evaluate.order]);
        sources.extend(software::sources(device, &loops, width));
        let contacts = outputs.contacts.clone();
        sources.extend(contacts.map(|wgsl| source("contacts", wgsl, BOOKKEEPING)));
        let grows = m.contacts.room_grows;
        let notes = [grows, grows && outputs.finds_contacts];
        for (lacking, _) in notes.into_iter().enumerate().filter(|(_, notes)| *notes) {
            let mut note = source("note room", bookkeeping::note_room(places, m), BOOKKEEPING);
            note.constants.push(("lacking".to_owned(), lacking as f64));
            sources.push(note);
        }
        let info = (sources.iter().enumerate())
            .map(|(k, source)| ProgramInfo {
                label: source.label.clone(),
                statements: source.wgsl.matches(';').count(),
                dispatches: (steps.contains(&k))
                    .then(|| dispatches_of(k - steps.start, &programs.step.order)),
            })
            .collect();
        let mut compiled = device.programs(&sources, recipe.limit)?.into_iter();
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
        let contacts = outputs.contacts.is_some().then(&mut next);
        let [note_room, note_shown_room] = notes.map(|notes| notes.then(&mut next));
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
            note_room,
            note_shown_room,
            compaction,
            numbers: constant(device, "numbers", &numbers)?,
            indices: constant(device, "indices", &extent.room.indices(m))?,
            info,
            replay: recipe.replay,
        })
    }

    /// The same programs, with this room for contacts.
    pub fn with_room(
        &self,
        device: &Device,
        m: &Constants<f32>,
        room: &Room,
    ) -> Result<Compiled, BackendError> {
        let indices = constant(device, "indices", &room.indices(m))?;
        Ok(Compiled {
            indices,
            ..self.clone()
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
