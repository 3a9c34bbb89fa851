//! The programs of a run, compiled, and the tables of the model.

use super::places::Places;
use super::programs::{Kernel, Programs};
use super::show;
use super::upkeep::{self, WORKGROUP};
use crate::backend::BackendError;
use sim_core::model::constants::Constants;
use sim_device::{Buffer, Device, DeviceError, Program, Replay, Source};
use std::time::Duration;

/// Threads of a workgroup of physics: registers are what it needs.
pub(super) const PHYSICS: u32 = 32;

/// Texts that depend on what a frame shows.
pub(super) struct Books {
    pub counters: String,
    pub contacts: Option<String>,
}

/// All programs of a run, and the tables of the model.
pub(super) struct Compiled {
    /// Kernels of a step.
    pub step: Vec<Program>,
    /// How often they run in a frame.
    pub rounds: usize,
    pub evaluate: Vec<Program>,
    pub begin: Program,
    pub begin_evaluation: Program,
    pub note: Program,
    pub left_out: Program,
    pub rows: Program,
    pub show: Program,
    pub counters: Program,
    pub contacts: Option<Program>,
    pub numbers: Buffer,
    pub indices: Buffer,
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
        let physics = |kernel: &Kernel| source(&kernel.label, kernel.wgsl.clone(), PHYSICS);
        let mut sources: Vec<Source> = vec![
            source("begin", upkeep::begin(places, true), WORKGROUP),
            source("begin evaluation", upkeep::begin(places, false), WORKGROUP),
            source("note", upkeep::note(places, m), WORKGROUP),
            source("count left out", upkeep::count_left_out(places), WORKGROUP),
            source("rows", upkeep::ROWS.to_owned(), WORKGROUP),
            source("show", show::SHOW.to_owned(), WORKGROUP),
            source("counters", books.counters, WORKGROUP),
        ];
        sources.extend(programs.step.iter().map(physics));
        sources.extend(programs.evaluate.iter().map(physics));
        let has_contacts = books.contacts.is_some();
        sources.extend(
            books
                .contacts
                .map(|text| source("contacts", text, WORKGROUP)),
        );
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
        let step = programs.step.iter().map(|_| next()).collect();
        let evaluate = programs.evaluate.iter().map(|_| next()).collect();
        let contacts = has_contacts.then(&mut next);
        let tables = &m.contacts.tables;
        let numbers: Vec<u32> = tables.numbers.iter().map(|x| x.to_bits()).collect();
        Ok(Compiled {
            step,
            rounds: programs.rounds,
            evaluate,
            begin,
            begin_evaluation,
            note,
            left_out,
            rows,
            show,
            counters,
            contacts,
            numbers: constant(device, "numbers", &numbers)?,
            indices: constant(device, "indices", &tables.indices)?,
        })
    }
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
