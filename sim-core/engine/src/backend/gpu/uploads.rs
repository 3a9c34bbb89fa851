//! Values from the host: rows for a tile, and the bounds of a run.
//!
//! A command of all worlds waits in a staging buffer and goes with the next frame ([`StagedCommand`]). All other rows are sent at once
//! ([`RowUpload`]). Both run the same kernel, [`bookkeeping::ROWS`].
//!
//! On a card with its own memory, a program that reads host memory waits for the bus. There the words are copied first ([`Upload`]).

use super::compiled::{Compiled, constant};
use super::kernels::bookkeeping;
use super::kernels::places::Places;
use super::kernels::workgroups::BOOKKEEPING;
use crate::backend::state::array_of;
use crate::backend::{BackendError, Input};
use sim_device::{
    AdapterKind, Batch, BatchBuilder, Buffer, Device, DeviceError, Program, Replay, Staging,
};
use sim_physics::constants::Constants;
use std::ops::Range;
use std::sync::OnceLock;

/// Words of the head that [`bookkeeping::ROWS`] reads before its list of worlds.
const HEAD: usize = 4;

/// The buffer that rows are written to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rows {
    Fields,
    Counters,
}

/// The commands that a model has, with their columns.
pub(super) fn commands(m: &Constants<f32>) -> impl Iterator<Item = (Input, usize)> {
    Input::commands().filter_map(move |input| {
        let columns = match input {
            Input::Field(field) => array_of(field).scalars(m),
            Input::Param(param) => m.varying.range(param)?.len(),
        };
        let is_of_joints = matches!(input, Input::Field(field) if field.is_of_joints());
        (is_of_joints || columns > 0).then_some((input, columns))
    })
}

/// Whether programs reach host memory only over a bus: they then read copies in the adapter's memory.
pub(super) fn has_own_memory(device: &Device) -> bool {
    device.info().kind == AdapterKind::Discrete
}

/// Words that the host writes and programs read.
struct Upload {
    staged: Staging,
    /// Where programs read them, on a card with its own memory.
    on_device: Option<Buffer>,
}

impl Upload {
    fn new(device: &Device, label: &str, bytes: u64) -> Result<Upload, DeviceError> {
        let on_device = has_own_memory(device).then(|| device.buffer(label, bytes));
        Ok(Upload {
            staged: device.staging(label, bytes)?,
            on_device: on_device.transpose()?,
        })
    }

    /// Records what brings the first bytes to where programs read them.
    fn send(&self, batch: &mut BatchBuilder, bytes: u64) {
        if let Some(buffer) = &self.on_device {
            batch.copy(&self.staged, 0, buffer, 0, bytes.min(buffer.bytes()));
        }
    }

    /// What programs read.
    fn buffer(&self) -> &Buffer {
        self.on_device.as_ref().unwrap_or(&self.staged)
    }
}

/// Bounds of the run in device memory, and whether worlds can get more room for contacts. They go with the next frame after they change.
pub(super) struct Bounds {
    // dropped before the buffers that it names
    batch: Batch,
    staged: Staging,
    pub buffer: Buffer,
    is_waiting: bool,
}

impl Bounds {
    const BYTES: u64 = 16;

    pub fn new(device: &Device) -> Result<Bounds, DeviceError> {
        let staged = device.staging("bounds", Bounds::BYTES)?;
        let buffer = device.buffer("bounds", Bounds::BYTES)?;
        let mut batch = device.batch(Replay::Recorded);
        batch.copy(&staged, 0, &buffer, 0, Bounds::BYTES);
        Ok(Bounds {
            batch: batch.finish()?,
            staged,
            buffer,
            is_waiting: false,
        })
    }

    /// Sets the bounds, as bits.
    pub fn set(&mut self, bounds: [u32; 2]) {
        self.put(0, &bounds);
    }

    /// Can worlds get more room for contacts?
    pub fn set_may_grow(&mut self, may: bool) {
        self.put(bookkeeping::MAY_GROW, &[u32::from(may)]);
    }

    fn put(&mut self, first: usize, words: &[u32]) {
        let new: &[u8] = bytemuck::cast_slice(words);
        let mut staged = self.staged.write();
        let old = &mut staged[4 * first..][..new.len()];
        self.is_waiting |= *old != *new;
        old.copy_from_slice(new);
    }

    /// What sends the bounds, if they changed.
    pub fn pending(&self) -> Option<&Batch> {
        self.is_waiting.then_some(&self.batch)
    }

    /// The bounds were sent.
    pub fn sent(&mut self) {
        self.is_waiting = false;
    }
}

/// A command of all worlds that waits for the next frame.
pub(super) struct StagedCommand {
    input: Input,
    columns: usize,
    // dropped before the buffer that it names
    batch: Batch,
    rows: Upload,
    /// What [`bookkeeping::ROWS`] reads of them.
    head: Buffer,
    is_waiting: bool,
}

impl StagedCommand {
    /// One for each command of the model, for a tile of these worlds.
    pub fn all(
        device: &Device,
        m: &Constants<f32>,
        places: &Places,
        compiled: &Compiled,
        fields: &Buffer,
        worlds: &Range<usize>,
        width: u32,
    ) -> Result<Vec<StagedCommand>, BackendError> {
        let staged = commands(m).map(|(input, columns)| {
            let (group, part) = input.place(m, 0..columns);
            let first = places.range(group).start + part.start as u32;
            let bytes = 4 * columns.max(4) as u64 * u64::from(width);
            let rows = Upload::new(device, "commands", bytes)?;
            let head = [worlds.len() as u32, columns as u32, first, 0];
            let head = constant(device, "head of commands", &head)?;
            let mut batch = device.batch(compiled.replay);
            let words = (worlds.len() * columns) as u64;
            if words > 0 {
                rows.send(&mut batch, 4 * words);
                let target = (device, &compiled.rows, fields);
                write_rows(&mut batch, target, rows.buffer(), &head, words);
            }
            Ok(StagedCommand {
                input,
                columns,
                batch: batch.finish()?,
                rows,
                head,
                is_waiting: false,
            })
        });
        staged.collect()
    }

    /// Whether it is of this array.
    pub fn is_of(&self, input: Input) -> bool {
        self.input == input
    }

    /// What writes the command of these worlds out of memory that a client shares, where that of all worlds begins at a byte.
    pub fn write_shared(
        &self,
        device: &Device,
        compiled: &Compiled,
        fields: &Buffer,
        (shared, at): (&Buffer, u64),
        worlds: &Range<usize>,
    ) -> Result<Batch, BackendError> {
        let row = 4 * self.columns as u64;
        let words = (worlds.len() * self.columns) as u64;
        let mut batch = device.batch(compiled.replay);
        // a part of a buffer that begins anywhere can be copied, but not be bound
        let first = at + row * worlds.start as u64;
        batch.copy(shared, first, self.rows.buffer(), 0, 4 * words);
        let target = (device, &compiled.rows, fields);
        write_rows(&mut batch, target, self.rows.buffer(), &self.head, words);
        Ok(batch.finish()?)
    }

    /// Whether these columns of an array are the whole command.
    pub fn is(&self, input: Input, columns: &Range<usize>) -> bool {
        self.input == input && *columns == (0..self.columns)
    }

    /// Takes the command's values, `(worlds, columns)`.
    pub fn stage(&mut self, values: &[f32], worlds: &Range<usize>) {
        let range = worlds.start * self.columns..worlds.end * self.columns;
        let bytes: &[u8] = bytemuck::cast_slice(&values[range]);
        self.rows.staged.write()[..bytes.len()].copy_from_slice(bytes);
        self.is_waiting = !bytes.is_empty();
    }

    /// What sends the command, if it waits.
    pub fn pending(&self) -> Option<&Batch> {
        self.is_waiting.then_some(&self.batch)
    }

    /// The command was sent.
    pub fn sent(&mut self) {
        self.is_waiting = false;
    }
}

/// Rows for some worlds of a tile, sent at once.
pub(super) struct RowUpload {
    // dropped before the buffers that they name
    to_fields: Sizes,
    to_counters: Sizes,
    program: Program,
    rows: Upload,
    head: Upload,
}

/// A batch for each power of two of words, recorded when it is first needed: a reset of one world copies and writes little.
type Sizes = [OnceLock<Batch>; 33];

impl RowUpload {
    /// For a tile, with rows of at most `columns` values.
    pub fn new(
        device: &Device,
        compiled: &Compiled,
        columns: u32,
        width: u32,
    ) -> Result<RowUpload, BackendError> {
        let lanes = u64::from(width);
        let rows = 4 * u64::from(columns.max(4)) * lanes;
        Ok(RowUpload {
            to_fields: std::array::from_fn(|_| OnceLock::new()),
            to_counters: std::array::from_fn(|_| OnceLock::new()),
            program: compiled.rows.clone(),
            rows: Upload::new(device, "rows", rows)?,
            head: Upload::new(device, "worlds of rows", 4 * (HEAD as u64 + lanes))?,
        })
    }

    /// Writes `columns` neighbouring values, from `first` on, of some lanes of a tile. `row` gives those of the lane at a place.
    pub fn send(
        &self,
        device: &Device,
        target: (Rows, &Buffer),
        first: u32,
        columns: u32,
        lanes: impl ExactSizeIterator<Item = usize>,
        row: impl Fn(usize, &mut [u32]),
    ) -> Result<(), BackendError> {
        let words = lanes.len() as u64 * u64::from(columns);
        if words == 0 {
            return Ok(());
        }
        {
            let (mut rows, mut head) = (self.rows.staged.write(), self.head.staged.write());
            let rows: &mut [u32] = bytemuck::cast_slice_mut(&mut rows);
            let head: &mut [u32] = bytemuck::cast_slice_mut(&mut head);
            head[..HEAD].copy_from_slice(&[lanes.len() as u32, columns, first, 1]);
            for (j, lane) in lanes.enumerate() {
                head[HEAD + j] = lane as u32;
                let n = columns as usize;
                row(j, &mut rows[j * n..(j + 1) * n]);
            }
        }
        let (rows, buffer) = target;
        let sizes = match rows {
            Rows::Fields => &self.to_fields,
            Rows::Counters => &self.to_counters,
        };
        let size = words.next_power_of_two();
        let known = &sizes[size.trailing_zeros() as usize];
        let batch = match known.get() {
            Some(batch) => batch,
            None => {
                let batch = self.batch(device, buffer, size)?;
                known.get_or_init(|| batch)
            }
        };
        Ok(device.run(&[batch])?)
    }

    /// A batch for at most `words` words. A row has one at least, so there are no more worlds.
    fn batch(&self, device: &Device, target: &Buffer, words: u64) -> Result<Batch, DeviceError> {
        let mut batch = device.batch(Replay::Recorded);
        self.head.send(&mut batch, 4 * (HEAD as u64 + words));
        self.rows.send(&mut batch, 4 * words);
        let target = (device, &self.program, target);
        write_rows(
            &mut batch,
            target,
            self.rows.buffer(),
            self.head.buffer(),
            words,
        );
        batch.finish()
    }
}

/// Runs [`bookkeeping::ROWS`] once, with a thread per word as far as the adapter has workgroups.
fn write_rows(
    batch: &mut BatchBuilder,
    (device, program, target): (&Device, &Program, &Buffer),
    rows: &Buffer,
    head: &Buffer,
    words: u64,
) {
    let buffers = [
        (0, target, 0..target.bytes()),
        (1, rows, 0..rows.bytes()),
        (2, head, 0..head.bytes()),
    ];
    let groups = words.div_ceil(u64::from(BOOKKEEPING));
    let groups = groups.min(u64::from(device.info().workgroups_max));
    batch.dispatch(program, &buffers, groups as u32);
}
