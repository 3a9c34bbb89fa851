//! Commands that a client leaves in shared device memory: checked and written to the fields without passing through the host.

use crate::backend::gpu::compiled::{Compiled, constant};
use crate::backend::gpu::kernels::workgroups::BOOKKEEPING;
use crate::backend::gpu::tile::Tile;
use crate::backend::gpu::uploads::commands;
use crate::backend::sharing::SharedCommand;
use crate::backend::{BackendError, Input};
use sim_device::{Batch, Buffer, Device, DeviceError, Moment, Program, Replay, Source, Staging};
use sim_physics::arrays::Takes;
use sim_physics::constants::{Constants, Motion};
use std::time::Duration;

/// Limit on the compile time of [`CHECK`], which is short.
const COMPILE_LIMIT: Duration = Duration::from_secs(60);

/// The commands of a model with their places, from the byte `first` on, and the end of the last one.
///
/// Switches of equalities are no part of it, nor are loads on bodies, which are parameters that the host mirrors.
pub(super) fn places(
    m: &Constants<f32>,
    worlds: usize,
    first: u64,
    align: u64,
) -> (Vec<SharedCommand>, u64) {
    let mut end = first;
    let shared = commands(m).filter(|(input, columns)| {
        matches!(input, Input::Field(_)) && !takes(*input, Takes::Switches) && *columns > 0
    });
    let placed = shared.map(|(input, columns)| {
        let offset = end;
        end = (offset + 4 * (worlds * columns) as u64).next_multiple_of(align);
        SharedCommand {
            input,
            columns,
            offset,
        }
    });
    (placed.collect(), end)
}

fn takes(input: Input, values: Takes) -> bool {
    input.kept().is_some_and(|command| command.takes == values)
}

/// Commands in shared memory. Field order matters: batches are dropped before what they name.
pub(in crate::backend::gpu) struct SharedCommands {
    all: Vec<OnDevice>,
    clear: Batch,
    read: Batch,
    flag_read: Staging,
    /// Those that go with the next frame.
    waiting: Vec<usize>,
}

/// One command.
struct OnDevice {
    /// One per tile.
    write: Vec<Batch>,
    check: Batch,
    place: SharedCommand,
}

impl SharedCommands {
    /// The commands at these places of a shared buffer.
    pub fn new(
        device: &Device,
        m: &Constants<f32>,
        compiled: &Compiled,
        tiles: &[Tile],
        buffer: &Buffer,
        places: &[SharedCommand],
    ) -> Result<SharedCommands, BackendError> {
        let check = device.programs(&[check()], COMPILE_LIMIT)?.remove(0);
        let (none, flag) = (
            constant(device, "no flag", &[0; 4])?,
            device.buffer("flag", 16)?,
        );
        let flag_read = device.staging("flag", 16)?;
        let (mut clear, mut read) = (
            device.batch(Replay::Recorded),
            device.batch(Replay::Recorded),
        );
        clear.copy(&none, 0, &flag, 0, 16);
        read.copy(&flag, 0, &flag_read, 0, 16);
        let worlds = tiles.last().map_or(0, |tile| tile.worlds.end);
        let all = places.iter().map(|place| -> Result<_, BackendError> {
            Ok(OnDevice {
                write: writes(device, compiled, tiles, (buffer, place))?,
                check: check_batch(device, m, &check, (buffer, place, worlds), &flag)?,
                place: *place,
            })
        });
        Ok(SharedCommands {
            all: all.collect::<Result<_, _>>()?,
            clear: clear.finish()?,
            read: read.finish()?,
            flag_read,
            waiting: Vec::new(),
        })
    }

    /// Records what writes the commands to other tiles.
    pub fn record(
        &mut self,
        device: &Device,
        compiled: &Compiled,
        tiles: &[Tile],
        buffer: &Buffer,
    ) -> Result<(), BackendError> {
        for command in &mut self.all {
            command.write = writes(device, compiled, tiles, (buffer, &command.place))?;
        }
        Ok(())
    }

    /// Their names.
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.all.iter().map(|command| command.place.input.name())
    }

    /// True if all values are finite and free bodies have no targets. Begins once the client's timeline has its value.
    pub fn check(
        &self,
        device: &Device,
        commands: &[usize],
        after: Option<Moment<'_>>,
    ) -> Result<bool, BackendError> {
        let mut batches = vec![&self.clear];
        batches.extend(commands.iter().map(|&command| &self.all[command].check));
        batches.push(&self.read);
        device.run_between(&batches, after, None)?;
        Ok(self.flag_read.read()[..4] == [0; 4])
    }

    /// Takes these commands with the next frame, instead of what the host has staged.
    pub fn stage(&mut self, commands: &[usize], tiles: &mut [Tile]) {
        for &command in commands {
            let input = self.all[command].place.input;
            tiles.iter_mut().for_each(|tile| tile.unstage(input));
            self.waiting.push(command);
        }
    }

    /// What writes the commands that wait.
    pub fn pending(&self) -> impl Iterator<Item = &Batch> {
        let waiting = self.waiting.iter();
        waiting.flat_map(|&command| &self.all[command].write)
    }

    /// The commands that waited were written.
    pub fn sent(&mut self) {
        self.waiting.clear();
    }

    /// The values of a command.
    pub fn values(
        &self,
        device: &Device,
        buffer: &Buffer,
        command: usize,
        worlds: usize,
    ) -> Result<Vec<f32>, BackendError> {
        let place = self.all[command].place;
        let bytes = 4 * (worlds * place.columns) as u64;
        let values = device.staging("commands of a client", bytes)?;
        let mut batch = device.batch(Replay::Recorded);
        batch.copy(buffer, place.offset, &values, 0, bytes);
        device.run(&[&batch.finish()?])?;
        let values = values.read();
        Ok(bytemuck::cast_slice(&values).to_vec())
    }
}

/// What writes a command to each tile.
fn writes(
    device: &Device,
    compiled: &Compiled,
    tiles: &[Tile],
    (buffer, place): (&Buffer, &SharedCommand),
) -> Result<Vec<Batch>, BackendError> {
    let tiles = tiles.iter();
    let writes =
        tiles.map(|tile| tile.write_shared(device, compiled, place.input, (buffer, place.offset)));
    writes.collect()
}

fn check() -> Source {
    Source {
        label: "check commands".to_owned(),
        wgsl: CHECK.to_owned(),
        entry: "main".to_owned(),
        constants: vec![("workgroup".to_owned(), f64::from(BOOKKEEPING))],
    }
}

/// Records [`CHECK`] of a command.
fn check_batch(
    device: &Device,
    m: &Constants<f32>,
    program: &Program,
    (buffer, place, worlds): (&Buffer, &SharedCommand, usize),
    flag: &Buffer,
) -> Result<Batch, DeviceError> {
    let words = (worlds * place.columns) as u64;
    let mut what = vec![words as u32, place.columns as u32];
    let is_target = takes(place.input, Takes::Targets);
    let mut no_target = vec![0; place.columns];
    let free = m.bodies.iter().filter(|body| body.motion == Motion::Free);
    for dof in free.filter(|_| is_target).flat_map(|body| body.dofs()) {
        no_target[dof] = 1;
    }
    what.extend(no_target);
    let what = constant(device, "check of commands", &what)?;
    let part = place.offset..place.offset + 4 * words;
    let groups = words.div_ceil(u64::from(BOOKKEEPING));
    let groups = groups.min(u64::from(device.info().workgroups_max));
    let mut batch = device.batch(Replay::Recorded);
    batch.dispatch(
        program,
        &[
            (0, buffer, part),
            (1, &what, 0..what.bytes()),
            (2, flag, 0..flag.bytes()),
        ],
        groups as u32,
    );
    batch.finish()
}

/// Sets a flag if a value is not finite, or not 0 where a free body has no target. It compares bits: WGSL may assume finite floats.
const CHECK: &str = "
override workgroup: u32 = 64u;
@group(0) @binding(0) var<storage, read> values: array<u32>;
// how many values, columns, then of each column: 1 where it must be 0
@group(0) @binding(1) var<storage, read> what: array<u32>;
@group(0) @binding(2) var<storage, read_write> found: array<atomic<u32>>;
@compute @workgroup_size(workgroup)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    for (var n = id.x; n < what[0]; n += groups.x * workgroup) {
        let size = values[n] & 0x7fffffffu;
        if (size >= 0x7f800000u || (size != 0u && what[2u + n % what[1]] == 1u)) {
            atomicStore(&found[0], 1u);
        }
    }
}
";
