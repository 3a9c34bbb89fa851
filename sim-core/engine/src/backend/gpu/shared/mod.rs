//! Device memory that a client maps: slots of frames, one per arena, then its commands.
//!
//! A frame of a leased arena is drawn in the arena's slot and copied from there to the reader's pages. The transport hands an arena out
//! again only after its readers gave it back. So the GPU writes to no slot that a client still holds.

mod commands;

use commands::SharedCommands;

use super::compiled::Compiled;
use super::imported::{Drawn, Target, record};
use super::tile::Tile;
use crate::backend::BackendError;
use crate::backend::sharing::SharedMemory;
use sim_device::{Batch, Buffer, Device, DeviceError, Moment, Replay, Staging, Timeline};
use sim_physics::constants::Constants;
use std::ops::Range;

/// Slots begin at multiples of this, which every adapter can bind and a client can map [bytes].
const PAGE: u64 = 4096;

/// Shared memory. Field order matters: batches are dropped before what they name.
pub(super) struct Shared {
    slots: Vec<Slot>,
    pub commands: SharedCommands,
    pub buffer: Buffer,
    /// Distance of neighbouring slots [bytes].
    stride: u64,
    /// Slots there may be.
    count: usize,
    /// Bytes of a frame.
    bytes: u64,
    /// What the host adds to a frame, such as noise.
    finished_by_host: Vec<Range<u64>>,
    finish: Staging,
    /// Of done frames and of ready commands.
    timelines: Option<[Timeline; 2]>,
    /// Frames that went to slots.
    frames: u64,
    /// The slot of the last frame.
    shown: Option<usize>,
}

/// The slot of an arena.
struct Slot {
    /// Address of the arena.
    place: usize,
    /// Its bytes in the buffer.
    part: Range<u64>,
    /// Draws a frame and copies it out: one batch per tile.
    shown: Vec<Batch>,
    /// Sends what the host adds.
    finished: Batch,
}

/// What shared memory is made for.
pub(super) struct Run<'a> {
    pub device: &'a Device,
    pub constants: &'a Constants<f32>,
    pub compiled: &'a Compiled,
    pub tiles: &'a [Tile],
    /// Bytes of a frame.
    pub bytes: u64,
    /// What the host adds to a frame.
    pub finished_by_host: Vec<Range<u64>>,
}

impl Shared {
    /// Memory of so many slots, and what a client imports.
    pub fn new(run: Run<'_>, count: usize) -> Result<(Shared, SharedMemory), BackendError> {
        let device = run.device;
        let align = device.info().binding_align.max(PAGE);
        let stride = run.bytes.next_multiple_of(align);
        let worlds = run.tiles.last().map_or(0, |tile| tile.worlds.end);
        let first = stride * count as u64;
        let (places, end) = commands::places(run.constants, worlds, first, align);
        let made = device.shared_buffer("frames and commands of a client", end)?;
        let pair = || -> Result<_, DeviceError> { Ok([device.timeline()?, device.timeline()?]) };
        let (timelines, exported) = match pair() {
            Ok([(frames, frames_exported), (commands, ready)]) => {
                (Some([frames, commands]), Ok([frames_exported, ready]))
            }
            Err(DeviceError::Export { reason }) => (None, Err(reason)),
            Err(error) => return Err(error.into()),
        };
        let (m, compiled, tiles) = (run.constants, run.compiled, run.tiles);
        let commands = SharedCommands::new(device, m, compiled, tiles, &made.buffer, &places)?;
        let memory = SharedMemory {
            memory: made.memory,
            allocated: made.allocated,
            dedicated: made.dedicated,
            timelines: exported,
            uuid: device.uuid().unwrap_or_default(),
            slots: count,
            stride,
            commands: places,
        };
        let shared = Shared {
            slots: Vec::new(),
            commands,
            buffer: made.buffer,
            stride,
            count,
            bytes: run.bytes,
            finished_by_host: run.finished_by_host,
            finish: device.staging("what the host adds", run.bytes)?,
            timelines,
            frames: 0,
            shown: None,
        };
        Ok((shared, memory))
    }

    /// Whether an arena at this address may get a slot and has none.
    pub fn is_new(&self, place: usize) -> bool {
        self.slots.len() < self.count && self.slot(place).is_none()
    }

    /// Gives the arena at an address the next slot. Its frames are copied to `target`.
    pub fn assign(
        &mut self,
        run: (&Device, &Compiled, &[Tile]),
        place: usize,
        target: Target<'_>,
    ) -> Result<(), BackendError> {
        let first = self.stride * self.slots.len() as u64;
        let part = first..first + self.bytes;
        let drawn = Drawn::Apart(&self.buffer, part.clone());
        let shown = record(run, drawn, target, self.bytes)?;
        let mut finished = run.0.batch(Replay::Recorded);
        for part in &self.finished_by_host {
            let bytes = part.end - part.start;
            finished.copy(
                &self.finish,
                part.start,
                &self.buffer,
                first + part.start,
                bytes,
            );
        }
        self.slots.push(Slot {
            place,
            part,
            shown,
            finished: finished.finish()?,
        });
        Ok(())
    }

    /// Records what writes commands and draws slots, for other tiles. The frames of an arena are copied to what `target` gives.
    pub fn record<'a>(
        &mut self,
        run: (&Device, &Compiled, &[Tile]),
        target: impl Fn(usize) -> Target<'a>,
    ) -> Result<(), BackendError> {
        let (device, compiled, tiles) = run;
        let buffer = &self.buffer;
        self.commands.record(device, compiled, tiles, buffer)?;
        for slot in &mut self.slots {
            let drawn = Drawn::Apart(buffer, slot.part.clone());
            slot.shown = record(run, drawn, target(slot.place), self.bytes)?;
        }
        Ok(())
    }

    /// The next frame is drawn again: its first drawing took a value of the timeline.
    pub fn repeat(&mut self, slot: Option<usize>) {
        if self.drawn(slot).is_some() {
            self.frames += 1;
        }
    }

    /// The slot of the arena at an address.
    pub fn slot(&self, place: usize) -> Option<usize> {
        self.slots.iter().position(|slot| slot.place == place)
    }

    /// What draws a slot's frame and copies it out: one batch per tile.
    pub fn shows(&self, slot: usize) -> &[Batch] {
        &self.slots[slot].shown
    }

    /// What the device signals when the next frame is drawn; none if the host adds something first.
    pub fn drawn(&self, slot: Option<usize>) -> Option<Moment<'_>> {
        slot.filter(|_| self.finished_by_host.is_empty())?;
        self.done()
    }

    /// The value of the timeline of frames when the next one is done.
    fn done(&self) -> Option<Moment<'_>> {
        let [frames, _] = self.timelines.as_ref()?;
        Some((frames, self.frames + 1))
    }

    /// The value that a client's commands wait for.
    pub fn ready(&self, value: u64) -> Option<Moment<'_>> {
        let [_, ready] = self.timelines.as_ref()?;
        Some((ready, value))
    }

    /// Sends what the host added to a frame, and counts it; `slot` is none of a frame that went to no slot.
    pub fn finish(
        &mut self,
        device: &Device,
        slot: Option<usize>,
        frame: &[u8],
    ) -> Result<(), BackendError> {
        self.shown = None;
        let Some(slot) = slot else { return Ok(()) };
        if !self.finished_by_host.is_empty() {
            let mut to = self.finish.write();
            for part in &self.finished_by_host {
                let part = part.start as usize..part.end as usize;
                to[part.clone()].copy_from_slice(&frame[part]);
            }
            drop(to);
            device.run_between(&[&self.slots[slot].finished], None, self.done())?;
        }
        self.frames += 1;
        self.shown = Some(slot);
        Ok(())
    }

    /// The slot of the last frame, and the value of the timeline of frames when it is done.
    pub fn shown(&self) -> Option<(usize, u64)> {
        self.shown.map(|slot| (slot, self.frames))
    }
}
