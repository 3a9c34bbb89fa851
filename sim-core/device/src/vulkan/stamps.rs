//! Time stamps of the commands of a recording.

use ash::vk;
use std::sync::atomic::{AtomicBool, Ordering};

/// A stamp before the first command, and one after each.
pub(super) struct Stamps {
    pool: vk::QueryPool,
    count: u32,
    clock: Clock,
    /// Whether a run has written them.
    is_written: AtomicBool,
    device: ash::Device,
}

/// The clock of a queue.
#[derive(Clone, Copy)]
pub(super) struct Clock {
    /// Duration of a tick [s].
    pub tick_s: f64,
    /// Bits of a stamp that count; none where the queue has no clock.
    pub bits: u32,
}

impl Stamps {
    /// Stamps for so many commands; `None` where there is no command or no clock.
    pub fn new(
        device: &ash::Device,
        clock: Clock,
        commands: usize,
    ) -> Result<Option<Stamps>, vk::Result> {
        if commands == 0 || clock.bits == 0 {
            return Ok(None);
        }
        let count = commands as u32 + 1;
        let description = vk::QueryPoolCreateInfo::default()
            .query_type(vk::QueryType::TIMESTAMP)
            .query_count(count);
        // SAFETY: the device is alive, and the pool goes with what is returned.
        let pool = unsafe { device.create_query_pool(&description, None)? };
        let device = device.clone();
        Ok(Some(Stamps {
            pool,
            count,
            clock,
            is_written: AtomicBool::new(false),
            device,
        }))
    }

    /// Forgets the last run, and stamps what comes before all commands.
    ///
    /// # Safety
    /// `commands` is being recorded.
    pub unsafe fn begin(&self, commands: vk::CommandBuffer) {
        // SAFETY: as promised by the caller; the pool has these numbers.
        unsafe {
            self.device
                .cmd_reset_query_pool(commands, self.pool, 0, self.count);
            self.stamp(commands, 0);
        }
    }

    /// Stamps the end of a command, by its number.
    ///
    /// # Safety
    /// `commands` is being recorded, and has so many commands.
    pub unsafe fn note(&self, commands: vk::CommandBuffer, number: usize) {
        // SAFETY: as promised by the caller.
        unsafe { self.stamp(commands, number as u32 + 1) };
    }

    unsafe fn stamp(&self, commands: vk::CommandBuffer, number: u32) {
        let end = vk::PipelineStageFlags::BOTTOM_OF_PIPE;
        // SAFETY: as promised by the callers.
        unsafe {
            self.device
                .cmd_write_timestamp(commands, end, self.pool, number);
        }
    }

    /// A run is done.
    pub fn written(&self) {
        self.is_written.store(true, Ordering::Relaxed);
    }

    /// From stamp to stamp [s]; empty before the first run.
    pub fn seconds(&self) -> Vec<f64> {
        if !self.is_written.load(Ordering::Relaxed) {
            return Vec::new();
        }
        let mut ticks = vec![0u64; self.count as usize];
        let flags = vk::QueryResultFlags::TYPE_64;
        // SAFETY: the pool has these numbers, a run has reset and written them, and none is under way: runs are waited for.
        let read = unsafe {
            self.device
                .get_query_pool_results(self.pool, 0, &mut ticks, flags)
        };
        if read.is_err() {
            return Vec::new();
        }
        let counted = u64::MAX >> (64 - self.clock.bits.min(64));
        let pairs = ticks.windows(2);
        pairs
            .map(|pair| (pair[1].wrapping_sub(pair[0]) & counted) as f64 * self.clock.tick_s)
            .collect()
    }
}

impl Drop for Stamps {
    fn drop(&mut self) {
        // SAFETY: runs are waited for, and the pool is this recording's own.
        unsafe { self.device.destroy_query_pool(self.pool, None) };
    }
}
