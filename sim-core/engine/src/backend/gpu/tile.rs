//! Worlds that lie in one set of buffers, and the batches that move them.

use super::compiled::{Compiled, Kernels, PHYSICS, constant};
use super::left::Left;
use super::places::Places;
use super::show::Run;
use super::upkeep::WORKGROUP;
use crate::backend::BackendError;
use sim_device::{Batch, BatchBuilder, Buffer, Device, Program, Replay, Staging};
use sim_model::SensedShapes;
use sim_physics::arrays::Array;
use sim_physics::arrays::Field;
use sim_physics::constants::Constants;
use sim_record::split::Part;
use std::ops::Range;

/// Words before the list of what [`upkeep::ROWS`] reads.
const ROWS_HEAD: usize = 4;

/// Worlds of a tile: as many as its largest buffer may show at once, and all if they fit.
pub(super) fn widest(device: &Device, m: &Constants<f32>, places: &Places, worlds: usize) -> u32 {
    let numbers = (places.len as u64).max(m.contacts.memory.len as u64).max(4);
    let fit = (device.info().binding_max.min(u64::from(u32::MAX)) / (4 * numbers)).max(1);
    let tiles = (worlds as u64).div_ceil(fit);
    let width = (worlds as u64).div_ceil(tiles);
    width
        .next_multiple_of(u64::from(WORKGROUP))
        .min(u64::from(u32::MAX)) as u32
}

/// Memory that a tile takes, what the host sees of it included [bytes].
pub(super) fn memory(m: &Constants<f32>, places: &Places, width: u32) -> u64 {
    let state = u64::from(places.state);
    // fields, contacts and counters; state and counters for the host, rows from it with their worlds, commands
    let numbers = u64::from(places.len) + m.contacts.memory.len as u64 + 4;
    let host = (state + 4) + (state + 1) + 3 * m.dofs.len() as u64;
    4 * (numbers + host) * u64::from(width)
}

/// Of each pair its shapes and links, then of each sensor and shape what [`show::contacts`] reads.
pub(super) fn pairs(m: &Constants<f32>, sensors: &[SensedShapes]) -> Vec<[i32; 4]> {
    let link = |link: Option<usize>| link.map_or(-1, |link| link as i32);
    let pairs = m.contacts.pairs.iter().map(|pair| {
        let [a, b] = pair.shapes;
        [a as i32, b as i32, link(pair.links[0]), link(pair.links[1])]
    });
    let sensed = sensors.iter().flat_map(|sensor| {
        let both = sensor.of.iter().zip(&sensor.against);
        both.map(|(of, against)| [i32::from(*of) | i32::from(*against) << 1, 0, 0, 0])
    });
    pairs.chain(sensed).collect()
}

/// Which buffer rows of the host go to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rows {
    Fields,
    Counters,
}

/// A command that frames bring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Command(usize);

const COMMANDS: [Array; 3] = [Array::JointF, Array::JointTargetQ, Array::JointTargetQd];

/// The command that a field is.
pub(super) fn command(field: Field) -> Option<Command> {
    [Field::JointF, Field::JointTargetQ, Field::JointTargetQd]
        .iter()
        .position(|known| *known == field)
        .map(Command)
}

/// A command of all worlds that waits for the next frame.
struct Inbox {
    // the batch goes before what it names
    batch: Option<Batch>,
    rows: Staging,
    waits: bool,
}

/// Rows from the host to some worlds, at once.
struct Door {
    to_fields: Batch,
    to_counters: Batch,
    rows: Staging,
    what: Staging,
}

pub(super) struct Tile {
    step: Option<Batch>,
    forward: Option<Batch>,
    show: Option<Batch>,
    copy_out: Option<Batch>,
    keep: Batch,
    inboxes: Vec<Inbox>,
    door: Door,
    /// Worlds of it, by their numbers.
    pub worlds: Range<usize>,
    /// Lanes: the worlds and those that run along.
    pub width: u32,
    fields: Buffer,
    scratch: Buffer,
    counters: Buffer,
    bounds: Staging,
    runs: Buffer,
    pairs: Buffer,
    /// Worlds that are left in a loop.
    left: Option<Left>,
    /// State and counters, for the host.
    kept: Staging,
}

impl Tile {
    #[expect(clippy::too_many_arguments)] // what a tile is made of
    pub fn new(
        device: &Device,
        m: &Constants<f32>,
        places: &Places,
        compiled: &Compiled,
        worlds: Range<usize>,
        width: u32,
        runs: &[Run],
        pairs: &[[i32; 4]],
    ) -> Result<Tile, BackendError> {
        let lanes = u64::from(width);
        let bytes = |numbers: u64| 4 * numbers.max(4) * lanes;
        let fields = device.buffer("fields", bytes(u64::from(places.len)))?;
        let scratch = device.buffer("contacts", bytes(m.contacts.memory.len as u64))?;
        let counters = device.buffer("counters", bytes(4))?;
        let mut what = vec![[
            worlds.start as u32,
            worlds.len() as u32,
            runs.len() as u32,
            0,
        ]];
        what.extend(
            runs.iter()
                .map(|run| [run.from, run.to, run.len, run.stride]),
        );
        let runs = constant(device, "runs", what.as_flattened())?;
        let pairs: Vec<u32> = pairs
            .as_flattened()
            .iter()
            .map(|x| x.cast_unsigned())
            .collect();
        let pairs = constant(device, "pairs", &pairs)?;
        let state = 4 * u64::from(places.state) * lanes;
        let kept = device.staging("kept", state + 16 * lanes)?;
        let mut keep = device.batch(Replay::Recorded);
        if state > 0 {
            keep.copy(&fields, 0, &kept, 0, state);
        }
        keep.copy(&counters, 0, &kept, state, 16 * lanes);
        let rows = device.staging("rows", bytes(u64::from(places.state)))?;
        let list = device.staging("worlds of rows", 4 * (ROWS_HEAD as u64 + lanes))?;
        let to = |target: &Buffer| {
            let mut batch = device.batch(Replay::Recorded);
            placed(&mut batch, &compiled.rows, target, &rows, &list, width);
            batch.finish()
        };
        let door = Door {
            to_fields: to(&fields)?,
            to_counters: to(&counters)?,
            rows,
            what: list,
        };
        let mut inboxes = Vec::new();
        for group in COMMANDS {
            let dofs = m.dofs.len() as u64;
            let rows = device.staging("commands", bytes(dofs))?;
            let what = device.staging("what commands are", 16)?;
            let head = [worlds.len() as u32, dofs as u32, places.of(group).start, 0];
            what.write().copy_from_slice(bytemuck::cast_slice(&head));
            let mut batch = device.batch(compiled.replay);
            placed(&mut batch, &compiled.rows, &fields, &rows, &what, width);
            inboxes.push(Inbox {
                batch: Some(batch.finish()?),
                rows,
                waits: false,
            });
        }
        Ok(Tile {
            step: None,
            forward: None,
            show: None,
            copy_out: None,
            keep: keep.finish()?,
            inboxes,
            door,
            worlds,
            width,
            fields,
            scratch,
            counters,
            bounds: device.staging("bounds", 16)?,
            runs,
            pairs,
            left: compiled.enlisting.room(device, width)?,
            kept,
        })
    }

    /// Records what a frame does.
    pub fn record(
        &mut self,
        device: &Device,
        compiled: &Compiled,
        finds_contacts: bool,
        frame: &Buffer,
    ) -> Result<(), BackendError> {
        let mut step = device.batch(compiled.replay);
        self.book(&mut step, &compiled.begin);
        self.physics(
            &mut step,
            &compiled.step,
            &compiled.step.order,
            compiled,
            None,
        );
        self.book(&mut step, &compiled.note);
        self.evaluate(&mut step, compiled);
        self.book(&mut step, &compiled.left_out);
        self.step = Some(step.finish()?);
        let mut forward = device.batch(compiled.replay);
        self.book(&mut forward, &compiled.begin_evaluation);
        self.evaluate(&mut forward, compiled);
        if finds_contacts {
            self.book(&mut forward, &compiled.left_out);
        }
        self.forward = Some(forward.finish()?);
        let mut show = device.batch(compiled.replay);
        self.show(&mut show, compiled, frame, 0..frame.bytes());
        self.show = Some(show.finish()?);
        Ok(())
    }

    fn evaluate(&self, batch: &mut BatchBuilder, compiled: &Compiled) {
        let evaluate = &compiled.evaluate;
        self.physics(batch, evaluate, &evaluate.order, compiled, None);
    }

    fn physics(
        &self,
        batch: &mut BatchBuilder,
        program: &Kernels,
        order: &[Part],
        compiled: &Compiled,
        round: Option<usize>,
    ) {
        let mut buffers = vec![
            (0, &self.fields, 0..self.fields.bytes()),
            (1, &self.scratch, 0..self.scratch.bytes()),
            (2, &compiled.numbers, 0..compiled.numbers.bytes()),
            (3, &compiled.indices, 0..compiled.indices.bytes()),
        ];
        let left = self.left.as_ref();
        let groups = self.width.div_ceil(PHYSICS);
        for part in order {
            match (part, round.zip(left)) {
                (Part::Kernel(k), None) => {
                    batch.dispatch(&program.kernels[*k], &buffers, groups);
                }
                (Part::Kernel(k), Some((round, left))) => {
                    buffers.truncate(4);
                    buffers.extend(left.seen(round));
                    let (found, at) = left.groups(round);
                    batch.dispatch_found(&program.kernels[*k], &buffers, found, at);
                }
                (
                    Part::Repeat {
                        rounds: rounds @ 2..,
                        parts,
                        out: Some(out),
                    },
                    None,
                ) => {
                    let left = left.expect("a list for every loop");
                    left.begin(batch, &compiled.enlisting, *out, &self.fields, groups);
                    for round in 0..*rounds {
                        self.physics(batch, program, parts, compiled, Some(round));
                        if round + 1 < *rounds {
                            left.go_on(batch, &compiled.enlisting, *out, &self.fields, round);
                        }
                    }
                }
                (Part::Repeat { rounds, parts, .. }, _) => {
                    for _ in 0..*rounds {
                        self.physics(batch, program, parts, compiled, round);
                    }
                }
            }
        }
    }

    fn book(&self, batch: &mut BatchBuilder, program: &Program) {
        let buffers = [
            (0, &self.fields, 0..self.fields.bytes()),
            (1, &self.counters, 0..self.counters.bytes()),
            (2, &*self.bounds, 0..self.bounds.bytes()),
        ];
        batch.dispatch(program, &buffers, self.width.div_ceil(WORKGROUP));
    }

    /// Writes its worlds' rows of a frame.
    pub fn show(
        &self,
        batch: &mut BatchBuilder,
        compiled: &Compiled,
        frame: &Buffer,
        part: Range<u64>,
    ) {
        let groups = self.width.div_ceil(WORKGROUP);
        let whole = |buffer: &Buffer| 0..buffer.bytes();
        let (fields, runs, pairs) = (&self.fields, &self.runs, &self.pairs);
        let (scratch, counters) = (&self.scratch, &self.counters);
        batch.dispatch(
            &compiled.show,
            &[
                (0, fields, whole(fields)),
                (1, runs, whole(runs)),
                (2, frame, part.clone()),
            ],
            groups,
        );
        batch.dispatch(
            &compiled.counters,
            &[
                (0, counters, whole(counters)),
                (1, runs, whole(runs)),
                (2, frame, part.clone()),
            ],
            groups,
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
                ],
                groups,
            );
        }
    }

    /// After all tiles: the frame out of the memory of the device.
    pub fn copy_out(
        &mut self,
        device: &Device,
        drawn: &Buffer,
        frame: &Buffer,
        bytes: u64,
    ) -> Result<(), BackendError> {
        let mut batch = device.batch(Replay::Recorded);
        batch.copy(drawn, 0, frame, 0, bytes);
        self.copy_out = Some(batch.finish()?);
        Ok(())
    }

    /// What computes a frame, or evaluates.
    pub fn computes(&self, steps: bool) -> &Batch {
        let batch = if steps { &self.step } else { &self.forward };
        batch.as_ref().expect("recorded at the start")
    }

    /// What shows it.
    pub fn shows(&self) -> &Batch {
        self.show.as_ref().expect("recorded at the start")
    }

    /// What takes the frame of all tiles out of the device's memory.
    pub fn copies_out(&self) -> Option<&Batch> {
        self.copy_out.as_ref()
    }

    /// Bounds of the run, as bits.
    pub fn set_bounds(&self, bounds: [u32; 2]) {
        self.bounds.write()[..8].copy_from_slice(bytemuck::cast_slice(&bounds));
    }

    /// Takes a command of all worlds, to be sent with the next frame.
    pub fn stage(&mut self, command: Command, values: &[f32], columns: usize) {
        let own = self.worlds.start * columns..self.worlds.end * columns;
        let inbox = &mut self.inboxes[command.0];
        let bytes: &[u8] = bytemuck::cast_slice(&values[own]);
        inbox.rows.write()[..bytes.len()].copy_from_slice(bytes);
        inbox.waits = !bytes.is_empty();
    }

    /// Commands that wait.
    pub fn pending(&self) -> impl Iterator<Item = &Batch> {
        let waiting = self.inboxes.iter().filter(|inbox| inbox.waits);
        waiting.filter_map(|inbox| inbox.batch.as_ref())
    }

    /// They were sent.
    pub fn sent(&mut self) {
        self.inboxes
            .iter_mut()
            .for_each(|inbox| inbox.waits = false);
    }

    /// Writes neighbouring numbers of some of its worlds.
    pub fn send(
        &mut self,
        device: &Device,
        target: Rows,
        first: u32,
        columns: u32,
        worlds: &[usize],
        row: impl Fn(usize, &mut [u32]),
    ) -> Result<(), BackendError> {
        {
            let (mut rows, mut what) = (self.door.rows.write(), self.door.what.write());
            let rows: &mut [u32] = bytemuck::cast_slice_mut(&mut rows);
            let what: &mut [u32] = bytemuck::cast_slice_mut(&mut what);
            what[..ROWS_HEAD].copy_from_slice(&[worlds.len() as u32, columns, first, 1]);
            for (j, &world) in worlds.iter().enumerate() {
                what[ROWS_HEAD + j] = (world - self.worlds.start) as u32;
                let n = columns as usize;
                row(j, &mut rows[j * n..(j + 1) * n]);
            }
        }
        let batch = match target {
            Rows::Fields => &self.door.to_fields,
            Rows::Counters => &self.door.to_counters,
        };
        Ok(device.run(&[batch])?)
    }

    /// Gives every lane the same state.
    pub fn fill(&mut self, device: &Device, state: &[u32]) -> Result<(), BackendError> {
        let first = self.worlds.start;
        let lanes: Vec<usize> = (0..self.width as usize).map(|lane| first + lane).collect();
        self.send(
            device,
            Rows::Fields,
            0,
            state.len() as u32,
            &lanes,
            |_, to| {
                to.copy_from_slice(state);
            },
        )
    }

    /// State and counters, four numbers of every lane after each other. Commands that wait are among them, and wait on: they are
    /// sent again with the frame.
    pub fn fetch(&self, device: &Device) -> Result<&Staging, BackendError> {
        let batches: Vec<_> = self.pending().chain([&self.keep]).collect();
        device.run(&batches)?;
        Ok(&self.kept)
    }
}

fn placed(
    batch: &mut BatchBuilder,
    program: &Program,
    target: &Buffer,
    rows: &Buffer,
    what: &Buffer,
    width: u32,
) {
    let buffers = [
        (0, target, 0..target.bytes()),
        (1, rows, 0..rows.bytes()),
        (2, what, 0..what.bytes()),
    ];
    batch.dispatch(program, &buffers, width.div_ceil(WORKGROUP));
}
