//! Transfers of staging buffers where host memory cannot stay mapped: the portable route.

use crate::error::DeviceError;
use crate::memory::{HostBytes, Memory};
use std::sync::Arc;

/// Sends the host's copy of a staging buffer ahead of the next submission.
pub(crate) fn upload(queue: &wgpu::Queue, memory: &Memory, bytes: &HostBytes) {
    if let HostBytes::Copied(words) = bytes {
        queue.write_buffer(&memory.wgpu, 0, bytemuck::cast_slice(words));
    }
}

/// Copies a staging buffer into its mirror, at the end of a submission.
pub(crate) fn fetch(encoder: &mut wgpu::CommandEncoder, memory: &Memory) {
    if let Some(mirror) = mirror(memory) {
        encoder.copy_buffer_to_buffer(&memory.wgpu, 0, mirror, 0, mirror.size());
    }
}

/// Reads the mirror that `fetch` filled, once the submission is done.
pub(crate) fn receive(
    device: &wgpu::Device,
    memory: &Arc<Memory>,
    bytes: &mut HostBytes,
) -> Result<(), DeviceError> {
    let Some(mirror) = mirror(memory) else {
        return Ok(());
    };
    let failed = |e: String| DeviceError::Driver {
        reason: format!("mapping `{}`: {e}", memory.label),
    };
    mirror.slice(..).map_async(wgpu::MapMode::Read, |_| ());
    device
        .poll(wgpu::PollType::wait_indefinitely())
        .map_err(|e| failed(e.to_string()))?;
    let view = mirror
        .slice(..)
        .get_mapped_range()
        .map_err(|e| failed(e.to_string()))?;
    bytes.slice_mut().copy_from_slice(&view);
    drop(view);
    mirror.unmap();
    Ok(())
}

fn mirror(memory: &Memory) -> Option<&wgpu::Buffer> {
    memory.host.as_ref()?.mirror.as_ref()
}
