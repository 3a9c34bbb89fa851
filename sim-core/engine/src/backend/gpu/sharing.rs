//! What a client of another process asks of a GPU's memory.

use super::backend::Gpu;
use super::imported::{Imported, Target};
use super::shared::{Run, Shared};
use crate::backend::BackendError;
use crate::backend::clocks;
use crate::backend::sharing::{SharedMemory, Sharing};
use sim_device::Buffer;
use sim_physics::arrays::{Field, Slot};
use std::ops::Range;
use std::time::Duration;

impl Gpu {
    /// Whether the host adds something to a field of each frame: noise, clocks.
    fn is_finished_by_host(&self, slot: &Slot) -> bool {
        let has_clocks = slot.field == Field::Sensordata && clocks::are_in(&self.constants);
        slot.bytes > 0 && (self.noise.for_field(slot.field).is_some() || has_clocks)
    }

    /// Records what names the tiles in shared memory.
    pub(super) fn record_shared(&mut self) -> Result<(), BackendError> {
        let Some(shared) = &mut self.shared else {
            return Ok(());
        };
        let (imported, frame) = (&self.imported, &self.frame);
        let run = (&self.device, &self.compiled, &self.tiles[..]);
        shared.record(run, |place| target(imported, frame, place))
    }

    /// Runs something of shared memory. An error loses the device.
    fn with_shared<T: Default>(
        &mut self,
        call: impl FnOnce(&Gpu, &Shared) -> Result<T, BackendError>,
    ) -> Result<T, BackendError> {
        let Some(shared) = &self.shared else {
            return Ok(T::default());
        };
        let done = call(self, shared);
        done.inspect_err(|error| {
            self.lost.get_or_init(|| error.clone());
        })
    }
}

/// Where the frames of the arena at an address are copied to.
fn target<'a>(imported: &'a [(usize, Imported)], frame: &'a Buffer, place: usize) -> Target<'a> {
    match imported.iter().find(|(known, _)| *known == place) {
        Some((_, imported)) => Target(&imported.pages, imported.before),
        None => Target(frame, 0),
    }
}

impl Sharing for Gpu {
    fn share(&mut self, slots: usize) -> Result<SharedMemory, BackendError> {
        // its batches name the old memory
        self.forget_shared();
        let finished = self.layout.slots.iter();
        let finished = finished.filter(|slot| self.is_finished_by_host(slot));
        let finished: Vec<Range<u64>> = finished
            .map(|slot| slot.offset as u64..(slot.offset + slot.bytes).next_multiple_of(4) as u64)
            .collect();
        let run = Run {
            device: &self.device,
            constants: &self.constants,
            compiled: &self.compiled,
            tiles: &self.tiles,
            bytes: self.layout.bytes as u64,
            finished_by_host: finished,
        };
        let (shared, memory) = Shared::new(run, slots)?;
        self.shared = Some(shared);
        Ok(memory)
    }

    fn names(&self) -> Vec<&'static str> {
        let shared = self.shared.iter();
        shared.flat_map(|shared| shared.commands.names()).collect()
    }

    fn assign_slot(&mut self, arena: &[u64]) {
        let place = arena.as_ptr() as usize;
        let Some(shared) = self.shared.as_mut().filter(|shared| shared.is_new(place)) else {
            return;
        };
        let target = target(&self.imported, &self.frame, place);
        let run = (&self.device, &self.compiled, &self.tiles[..]);
        if let Err(error) = shared.assign(run, place, target) {
            self.lost.get_or_init(|| error);
        }
    }

    fn slot_shown(&self) -> Option<(usize, u64)> {
        self.shared.as_ref().and_then(Shared::shown)
    }

    fn await_client(&mut self, value: u64, timeout: Duration) -> Result<bool, BackendError> {
        self.with_shared(|_, shared| match shared.ready(value) {
            Some((timeline, value)) => Ok(timeline.wait(value, timeout)?),
            None => Ok(true),
        })
    }

    fn accepts(&mut self, commands: &[usize], value: u64) -> Result<bool, BackendError> {
        self.with_shared(|gpu, shared| {
            let after = shared.ready(value);
            shared.commands.check(&gpu.device, commands, after)
        })
    }

    fn stage_shared(&mut self, commands: &[usize]) {
        if let Some(shared) = &mut self.shared {
            shared.commands.stage(commands, &mut self.tiles);
        }
    }

    fn read_shared(&mut self, command: usize) -> Result<Vec<f32>, BackendError> {
        self.with_shared(|gpu, shared| {
            let worlds = gpu.mirror.seeds.len();
            let (device, buffer) = (&gpu.device, &shared.buffer);
            shared.commands.values(device, buffer, command, worlds)
        })
    }
}
