//! A tile: worlds that lie in one set of buffers, and the batches that step them.
//!
//! A tile has as many worlds as a buffer can bind. A frame of it is recorded once: the commands that wait, the substeps, the checks for
//! faults, the evaluation, then a batch that writes the output fields.
//!
//! # Sizes
//! Drivers check no index of our programs (`sim_device`, "Robust buffer access"), so the buffers are as large as the programs assume:
//!
//! | buffer | numbers | largest index |
//! |---|---|---|
//! | fields | `Places::len` times `width` | a place, and a world below `width`: other threads leave at once |
//! | contacts | `Room::numbers` times `width` | a row below its list's capacity, which `push` and `kept` hold; `Compiled::indices` has the same room |
//! | counters, lists of worlds | 4, 1 times `width` | a world below `width` |
//! | lacks | 4 | 2 |
//! | numbers, indices | those of the model's tables | a row that a table names, or that is clamped to the table before it is read |
//! | frame, runs, pairs | the layout's, the runs', the pairs' | `check_frame` and `show` derive both from one layout |

use super::compiled::{Compiled, Kernels, constant};
use super::kernels::places::Places;
use super::kernels::show::ShowTable;
use super::kernels::workgroups::{self, BOOKKEEPING};
use super::lacks::{Again, Lacks};
use super::recipe::{Extent, Recipe};
use super::software::{self, ActiveWorlds};
use super::uploads::{RowUpload, Rows, StagedCommand};
use crate::backend::{BackendError, Input};
use sim_device::{Batch, BatchBuilder, Buffer, Device, Program, Replay, Staging};
use sim_physics::constants::Constants;
use sim_record::split::Part;
use std::ops::Range;

/// What all tiles of a run share.
#[derive(Clone, Copy)]
pub(super) struct TileInputs<'a> {
    pub device: &'a Device,
    pub constants: &'a Constants<f32>,
    pub places: &'a Places,
    pub compiled: &'a Compiled,
    pub bounds: &'a Buffer,
}

/// Buffers and batches of some worlds. Field order matters: batches are dropped before what they name.
pub(super) struct Tile {
    step: Option<Batch>,
    forward: Option<Batch>,
    show: Option<Batch>,
    copy_out: Option<Batch>,
    /// Copies state and counters to the host.
    read_state: Batch,
    commands: Vec<StagedCommand>,
    rows: RowUpload,
    /// Its worlds, by number.
    pub worlds: Range<usize>,
    /// Lanes: its worlds, and padding that runs along.
    pub width: u32,
    /// Threads of a workgroup of physics; `width` is a multiple of it.
    workgroup: u32,
    fields: Buffer,
    scratch: Buffer,
    counters: Buffer,
    bounds: Buffer,
    /// Whether a world lacked room for contacts, where worlds can get more.
    lacks: Option<Lacks>,
    runs: Buffer,
    /// Workgroups that show its worlds.
    show_groups: u32,
    pairs: Buffer,
    /// Lists of the worlds that are active in a split loop.
    active: Option<ActiveWorlds>,
    /// State and counters, as the host sees them.
    state_copy: Staging,
}

impl Tile {
    /// Allocates the buffers of some worlds, with the room for contacts that the programs have.
    pub fn new(
        inputs: TileInputs<'_>,
        recipe: &Recipe,
        extent: &Extent,
        worlds: Range<usize>,
    ) -> Result<Tile, BackendError> {
        let TileInputs {
            device,
            constants: m,
            places,
            compiled,
            bounds,
        } = inputs;
        let width = extent.width;
        let lanes = u64::from(width);
        let bytes = |numbers: u64| 4 * numbers.max(4) * lanes;
        let fields = device.buffer("fields", bytes(u64::from(places.len)))?;
        let scratch = device.buffer("contacts", bytes(extent.room.numbers(m) as u64))?;
        let counters = device.buffer("counters", bytes(4))?;
        let words = software::show_words(device.info());
        let show = ShowTable::new(&recipe.runs, &worlds, words, device.info().workgroups_max);
        let runs = constant(device, "runs", show.words.as_flattened())?;
        let pairs: Vec<u32> = (recipe.pairs)
            .as_flattened()
            .iter()
            .map(|x| x.cast_unsigned())
            .collect();
        let pairs = constant(device, "pairs", &pairs)?;
        let grows = compiled.note_room.is_some();
        let lacks = grows.then(|| Lacks::new(device, worlds.len()));
        let state = 4 * u64::from(places.state) * lanes;
        let state_copy = device.staging("state", state + 16 * lanes)?;
        let mut read_state = device.batch(Replay::Recorded);
        if state > 0 {
            read_state.copy(&fields, 0, &state_copy, 0, state);
        }
        read_state.copy(&counters, 0, &state_copy, state, 16 * lanes);
        let commands = StagedCommand::all(device, m, places, compiled, &fields, &worlds, width)?;
        let rows = RowUpload::new(device, compiled, places.state, width)?;
        Ok(Tile {
            step: None,
            forward: None,
            show: None,
            copy_out: None,
            read_state: read_state.finish()?,
            commands,
            rows,
            worlds,
            width,
            workgroup: workgroups::physics(device.info()),
            fields,
            scratch,
            counters,
            bounds: bounds.clone(),
            lacks: lacks.transpose()?,
            runs,
            show_groups: show.groups,
            pairs,
            active: compiled.compaction.allocate(device, width)?,
            state_copy,
        })
    }

    /// Records the batches of a frame.
    pub fn record(
        &mut self,
        device: &Device,
        compiled: &Compiled,
        frame: &Buffer,
    ) -> Result<(), BackendError> {
        let mut step = device.batch(compiled.replay);
        self.bookkeep(&mut step, &compiled.begin);
        self.physics(
            &mut step,
            &compiled.step,
            &compiled.step.order,
            compiled,
            None,
        );
        if let Some(note_room) = &compiled.note_room {
            self.bookkeep(&mut step, note_room);
        }
        self.bookkeep(&mut step, &compiled.check_faults);
        self.evaluate(&mut step, compiled);
        self.step = Some(step.finish()?);
        let mut forward = device.batch(compiled.replay);
        self.bookkeep(&mut forward, &compiled.begin_evaluation);
        self.evaluate(&mut forward, compiled);
        self.forward = Some(forward.finish()?);
        let mut show = device.batch(compiled.replay);
        self.show(&mut show, compiled, frame, 0..frame.bytes());
        self.show = Some(show.finish()?);
        Ok(())
    }

    fn evaluate(&self, batch: &mut BatchBuilder, compiled: &Compiled) {
        let evaluate = &compiled.evaluate;
        self.physics(batch, evaluate, &evaluate.order, compiled, None);
        if let Some(note_room) = &compiled.note_shown_room {
            self.bookkeep(batch, note_room);
        }
        if let Some(lacks) = &self.lacks {
            lacks.read(batch);
        }
    }

    fn physics(
        &self,
        batch: &mut BatchBuilder,
        program: &Kernels,
        order: &[Part],
        compiled: &Compiled,
        iteration: Option<usize>,
    ) {
        let mut buffers = vec![
            (0, &self.fields, 0..self.fields.bytes()),
            (1, &self.scratch, 0..self.scratch.bytes()),
            (2, &compiled.numbers, 0..compiled.numbers.bytes()),
            (3, &compiled.indices, 0..compiled.indices.bytes()),
        ];
        let active = self.active.as_ref();
        let groups = self.width.div_ceil(self.workgroup);
        for part in order {
            match (part, iteration.zip(active)) {
                (Part::Kernel(k), None) => {
                    let kernel = &program.kernels[*k];
                    batch.dispatch(&kernel.program, &buffers, kernel.groups(self.width));
                }
                (Part::Kernel(k), Some((iteration, active))) => {
                    buffers.truncate(4);
                    buffers.extend(active.bindings(iteration));
                    let (groups, at) = active.groups(iteration);
                    batch.dispatch_found(&program.kernels[*k].program, &buffers, groups, at);
                }
                (
                    Part::Repeat {
                        iterations: iterations @ 2..,
                        parts,
                        exited: Some(exited),
                    },
                    None,
                ) => {
                    let active = active.expect("a list for every loop");
                    let compaction = &compiled.compaction;
                    active.begin(batch, compaction, *exited, &self.fields, groups);
                    for iteration in 0..*iterations {
                        self.physics(batch, program, parts, compiled, Some(iteration));
                        if iteration + 1 < *iterations {
                            active.compact(batch, compaction, *exited, &self.fields, iteration);
                        }
                    }
                }
                (
                    Part::Repeat {
                        iterations, parts, ..
                    },
                    _,
                ) => {
                    for _ in 0..*iterations {
                        self.physics(batch, program, parts, compiled, iteration);
                    }
                }
            }
        }
    }

    fn bookkeep(&self, batch: &mut BatchBuilder, program: &Program) {
        let mut buffers = vec![
            (0, &self.fields, 0..self.fields.bytes()),
            (1, &self.counters, 0..self.counters.bytes()),
            (2, &self.bounds, 0..self.bounds.bytes()),
        ];
        let lacks = self.lacks.iter();
        buffers.extend(lacks.map(|lacks| (3, &lacks.buffer, 0..lacks.buffer.bytes())));
        batch.dispatch(program, &buffers, self.width.div_ceil(BOOKKEEPING));
    }

    /// Writes the output rows of its worlds into a frame.
    pub fn show(
        &self,
        batch: &mut BatchBuilder,
        compiled: &Compiled,
        frame: &Buffer,
        part: Range<u64>,
    ) {
        let whole = |buffer: &Buffer| 0..buffer.bytes();
        let (fields, runs, pairs) = (&self.fields, &self.runs, &self.pairs);
        let (scratch, counters) = (&self.scratch, &self.counters);
        batch.dispatch(
            &compiled.show,
            &[
                (0, fields, whole(fields)),
                (1, runs, whole(runs)),
                (2, frame, part.clone()),
                (3, counters, whole(counters)),
            ],
            self.show_groups,
        );
        if let Some(contacts) = &compiled.contacts {
            batch.dispatch(
                contacts,
                &[
                    (0, fields, whole(fields)),
                    (1, scratch, whole(scratch)),
                    (2, runs, whole(runs)),
                    (3, frame, part.clone()),
                    (4, pairs, whole(pairs)),
                    (5, &compiled.indices, whole(&compiled.indices)),
                ],
                self.width.div_ceil(BOOKKEEPING),
            );
        }
    }

    /// Records the copy of the whole frame out of device memory, for the last tile.
    pub fn copy_out(
        &mut self,
        device: &Device,
        compiled: &Compiled,
        drawn: &Buffer,
        frame: &Buffer,
        bytes: u64,
    ) -> Result<(), BackendError> {
        let mut batch = device.batch(compiled.replay);
        batch.copy(drawn, 0, frame, 0, bytes);
        self.copy_out = Some(batch.finish()?);
        Ok(())
    }

    /// What each command of its last frame took [s]; frames that the device writes to their readers lack the output.
    pub fn seconds(&self) -> Vec<(&str, f64)> {
        let batches = [&self.step, &self.show, &self.copy_out];
        let batches = batches.into_iter().flatten();
        batches.flat_map(Batch::seconds).collect()
    }

    /// The batch that steps and evaluates, or only evaluates.
    pub fn computes(&self, part: Again) -> &Batch {
        let batch = match part {
            Again::Substeps => &self.step,
            Again::Evaluation => &self.forward,
        };
        batch.as_ref().expect("recorded at the start")
    }

    /// The batch that writes the output rows.
    pub fn shows(&self) -> &Batch {
        self.show.as_ref().expect("recorded at the start")
    }

    /// The batch that copies the whole frame out of device memory.
    pub fn copies_out(&self) -> Option<&Batch> {
        self.copy_out.as_ref()
    }

    /// What of its last frame has to run again, since a world lacked room for contacts.
    pub fn again(&self) -> Option<Again> {
        self.lacks.as_ref().and_then(Lacks::again)
    }

    /// Gives its worlds the state, counters and commands that they have in other tiles, of at least its width.
    pub fn take(&self, device: &Device, others: &[Tile]) -> Result<(), BackendError> {
        let mut batch = device.batch(Replay::Encoded);
        for other in others {
            let first = self.worlds.start.max(other.worlds.start);
            let end = self.worlds.end.min(other.worlds.end);
            let lanes = end.saturating_sub(first) as u64;
            if lanes == 0 {
                continue;
            }
            let [from, to] = [other, self].map(|tile| (first - tile.worlds.start) as u64);
            let buffers = [
                (&other.fields, &self.fields),
                (&other.counters, &self.counters),
            ];
            for (old, new) in buffers {
                let [old_width, new_width] = [other, self].map(|tile| u64::from(tile.width));
                for quad in 0..new.bytes() / (16 * new_width) {
                    let (from, to) = (quad * old_width + from, quad * new_width + to);
                    batch.copy(old, 16 * from, new, 16 * to, 16 * lanes);
                }
            }
        }
        Ok(device.run(&[&batch.finish()?])?)
    }

    /// Takes a command of all worlds, to be sent with the next frame; false if these columns are no whole command.
    pub fn stage(&mut self, input: Input, columns: &Range<usize>, values: &[f32]) -> bool {
        let staged = self.commands.iter_mut().find(|c| c.is(input, columns));
        let Some(command) = staged else { return false };
        command.stage(values, &self.worlds);
        true
    }

    /// What a command of the host that waits is replaced by: one in shared memory.
    pub fn unstage(&mut self, input: Input) {
        let staged = self.commands.iter_mut();
        staged
            .filter(|command| command.is_of(input))
            .for_each(StagedCommand::sent);
    }

    /// Writes a command of all worlds out of shared memory, where it begins at a byte.
    pub fn write_shared(
        &self,
        device: &Device,
        compiled: &Compiled,
        input: Input,
        shared: (&Buffer, u64),
    ) -> Result<Batch, BackendError> {
        let mut staged = self.commands.iter();
        let staged = staged.find(|command| command.is_of(input));
        let staged = staged.expect("every command can be staged");
        staged.write_shared(device, compiled, &self.fields, shared, &self.worlds)
    }

    /// Commands that wait.
    pub fn pending(&self) -> impl Iterator<Item = &Batch> {
        self.commands.iter().filter_map(StagedCommand::pending)
    }

    /// The commands that waited were sent.
    pub fn sent(&mut self) {
        self.commands.iter_mut().for_each(StagedCommand::sent);
    }

    /// Writes neighbouring values of some of its worlds.
    pub fn send(
        &self,
        device: &Device,
        target: Rows,
        first: u32,
        columns: u32,
        worlds: &[usize],
        row: impl Fn(usize, &mut [u32]),
    ) -> Result<(), BackendError> {
        let lanes = worlds.iter().map(|world| world - self.worlds.start);
        let buffer = match target {
            Rows::Fields => &self.fields,
            Rows::Counters => &self.counters,
        };
        self.rows
            .send(device, (target, buffer), first, columns, lanes, row)
    }

    /// Gives every lane the same state.
    pub fn fill(&self, device: &Device, state: &[u32]) -> Result<(), BackendError> {
        let (lanes, columns) = (0..self.width as usize, state.len() as u32);
        self.rows.send(
            device,
            (Rows::Fields, &self.fields),
            0,
            columns,
            lanes,
            |_, to| {
                to.copy_from_slice(state);
            },
        )
    }

    /// State and counters, four values of every lane after each other. Commands that wait are included and go on waiting: the frame
    /// sends them again.
    pub fn fetch(&self, device: &Device) -> Result<&Staging, BackendError> {
        let batches: Vec<_> = self.pending().chain([&self.read_state]).collect();
        device.run(&batches)?;
        Ok(&self.state_copy)
    }
}
