//! Time stamps of the commands of a recording.

use ash::vk;

/// A stamp before the first command, and one after each.
pub(super) struct Stamps {
    pool: vk::QueryPool,
    count: u32,
    device: ash::Device,
}

impl Stamps {
    /// Stamps for so many commands; `None` where there is no command.
    pub fn new(device: &ash::Device, commands: usize) -> Result<Option<Stamps>, vk::Result> {
        if commands == 0 {
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

    /// From stamp to stamp [s]; empty before the first run.
    pub fn seconds(&self, tick_s: f64) -> Vec<f64> {
        let mut ticks = vec![0u64; self.count as usize];
        let flags = vk::QueryResultFlags::TYPE_64;
        // SAFETY: the pool has these numbers, and no run is under way: runs are waited for.
        let read = unsafe {
            self.device
                .get_query_pool_results(self.pool, 0, &mut ticks, flags)
        };
        if read.is_err() {
            return Vec::new();
        }
        let pairs = ticks.windows(2);
        pairs
            .map(|pair| pair[1].wrapping_sub(pair[0]) as f64 * tick_s)
            .collect()
    }
}

impl Drop for Stamps {
    fn drop(&mut self) {
        // SAFETY: runs are waited for, and the pool is this recording's own.
        unsafe { self.device.destroy_query_pool(self.pool, None) };
    }
}
