//! Rows of values from the host to a tile.
//!
//! A command of all worlds waits in a staging buffer and goes with the next frame ([`StagedCommand`]). All other rows are sent at once
//! ([`RowUpload`]). Both run the same kernel, [`bookkeeping::ROWS`].

#[cfg(doc)]
use super::bookkeeping;
use super::compiled::Compiled;
use super::places::Places;
use super::workgroups::BOOKKEEPING;
use crate::backend::{BackendError, Input};
use sim_device::{Batch, BatchBuilder, Buffer, Device, Program, Replay, Staging};
use sim_physics::arrays::Field;
use sim_physics::constants::Constants;
use std::ops::Range;

/// Words of the head that [`bookkeeping::ROWS`] reads before its list of worlds.
const HEAD: usize = 4;

/// The buffer that rows are written to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rows {
    Fields,
    Counters,
}

/// The commands of a model, with their columns: those of the joints, of models from MuJoCo, and the loads that vary.
pub(super) fn commands(m: &Constants<f32>) -> impl Iterator<Item = (Input, usize)> {
    let joints = [Field::JointF, Field::JointTargetQ, Field::JointTargetQd];
    let joints = joints.map(|field| (Input::Field(field), m.dofs.len()));
    let actuators = m.mujoco.actuators.len();
    let mocaps = m.mujoco.mocaps;
    let models = [
        (Field::Ctrl, actuators),
        (Field::MocapPos, 3 * mocaps),
        (Field::MocapQuat, 4 * mocaps),
        (Field::EqActive, m.mujoco.equalities),
    ];
    let models = models.into_iter().filter(|&(_, columns)| columns > 0);
    let models = models.map(|(field, columns)| (Input::Field(field), columns));
    let loads = m.varying.params().filter(|param| param.is_load());
    let loads = loads.map(|param| {
        let columns = m.varying.range(param).map_or(0, |range| range.len());
        (Input::Param(param), columns)
    });
    joints.into_iter().chain(models).chain(loads)
}

/// A command of all worlds that waits for the next frame.
pub(super) struct StagedCommand {
    input: Input,
    columns: usize,
    // dropped before the buffer that it names
    batch: Batch,
    rows: Staging,
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
            let first = places.of(group).start + part.start as u32;
            let bytes = 4 * columns.max(4) as u64 * u64::from(width);
            let rows = device.staging("commands", bytes)?;
            let head = device.staging("head of commands", 4 * HEAD as u64)?;
            let words = [worlds.len() as u32, columns as u32, first, 0];
            head.write().copy_from_slice(bytemuck::cast_slice(&words));
            let mut batch = device.batch(compiled.replay);
            write_rows(&mut batch, &compiled.rows, fields, &rows, &head, width);
            Ok(StagedCommand {
                input,
                columns,
                batch: batch.finish()?,
                rows,
                is_waiting: false,
            })
        });
        staged.collect()
    }

    /// Whether these columns of an array are the whole command.
    pub fn is(&self, input: Input, columns: &Range<usize>) -> bool {
        self.input == input && *columns == (0..self.columns)
    }

    /// Takes the command's values, `(worlds, columns)`.
    pub fn stage(&mut self, values: &[f32], worlds: &Range<usize>) {
        let own = worlds.start * self.columns..worlds.end * self.columns;
        let bytes: &[u8] = bytemuck::cast_slice(&values[own]);
        self.rows.write()[..bytes.len()].copy_from_slice(bytes);
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
    to_fields: Batch,
    to_counters: Batch,
    rows: Staging,
    head: Staging,
}

impl RowUpload {
    /// For a tile, with rows of at most `columns` values.
    pub fn new(
        device: &Device,
        compiled: &Compiled,
        fields: &Buffer,
        counters: &Buffer,
        columns: u32,
        width: u32,
    ) -> Result<RowUpload, BackendError> {
        let lanes = u64::from(width);
        let rows = device.staging("rows", 4 * u64::from(columns.max(4)) * lanes)?;
        let head = device.staging("worlds of rows", 4 * (HEAD as u64 + lanes))?;
        let to = |target: &Buffer| {
            let mut batch = device.batch(Replay::Recorded);
            write_rows(&mut batch, &compiled.rows, target, &rows, &head, width);
            batch.finish()
        };
        Ok(RowUpload {
            to_fields: to(fields)?,
            to_counters: to(counters)?,
            rows,
            head,
        })
    }

    /// Writes `columns` neighbouring values, from `first` on, of some lanes of the tile. `row` gives those of the lane at a place.
    pub fn send(
        &self,
        device: &Device,
        target: Rows,
        first: u32,
        columns: u32,
        lanes: impl ExactSizeIterator<Item = usize>,
        row: impl Fn(usize, &mut [u32]),
    ) -> Result<(), BackendError> {
        {
            let (mut rows, mut head) = (self.rows.write(), self.head.write());
            let rows: &mut [u32] = bytemuck::cast_slice_mut(&mut rows);
            let head: &mut [u32] = bytemuck::cast_slice_mut(&mut head);
            head[..HEAD].copy_from_slice(&[lanes.len() as u32, columns, first, 1]);
            for (j, lane) in lanes.enumerate() {
                head[HEAD + j] = lane as u32;
                let n = columns as usize;
                row(j, &mut rows[j * n..(j + 1) * n]);
            }
        }
        let batch = match target {
            Rows::Fields => &self.to_fields,
            Rows::Counters => &self.to_counters,
        };
        Ok(device.run(&[batch])?)
    }
}

/// Runs [`bookkeeping::ROWS`] once.
fn write_rows(
    batch: &mut BatchBuilder,
    program: &Program,
    target: &Buffer,
    rows: &Buffer,
    head: &Buffer,
    width: u32,
) {
    let buffers = [
        (0, target, 0..target.bytes()),
        (1, rows, 0..rows.bytes()),
        (2, head, 0..head.bytes()),
    ];
    batch.dispatch(program, &buffers, width.div_ceil(BOOKKEEPING));
}
