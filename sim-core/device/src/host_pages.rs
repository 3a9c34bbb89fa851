//! Memory of the host that a device imports, and who keeps it mapped.

use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::memory::{Buffer, Memory};
use std::ops::Range;
use std::ptr::NonNull;
use std::sync::Arc;

/// Pages of the host that stay mapped until the last owner is gone.
///
/// # Safety
/// `start` and `bytes` never change, and all that lies between is mapped, readable and writable, until the value is dropped.
pub unsafe trait HostPages: Send + Sync {
    /// The first page.
    fn start(&self) -> NonNull<u8>;
    /// Size, a multiple of a page [bytes].
    fn bytes(&self) -> usize;
}

/// Pages that a buffer lies in. What a lost device had begun may not have ended: it keeps them until it closes.
pub(crate) struct Pinned {
    pages: Arc<dyn HostPages>,
    device: Arc<Inner>,
}

impl Drop for Pinned {
    fn drop(&mut self) {
        if self.device.alive().is_err() {
            let kept = self.device.kept_pages.lock();
            let mut kept = kept.unwrap_or_else(|e| e.into_inner());
            kept.push(self.pages.clone());
        }
    }
}

impl Device {
    /// Imports a range of the host's pages as a buffer: programs and copies access them in place. The buffer, and every batch that
    /// names it, owns the pages too.
    ///
    /// Errors: `DeviceError::Import` if the range is not inside, or the driver refuses; nothing has changed then.
    ///
    /// # Safety
    /// While a batch that writes the buffer runs, no other code relies on what it overwrites.
    pub unsafe fn import(
        &self,
        pages: Arc<dyn HostPages>,
        range: Range<usize>,
    ) -> Result<Buffer, DeviceError> {
        self.inner.alive()?;
        let refused = |reason: String| DeviceError::Import { reason };
        if range.start > range.end || range.end > pages.bytes() {
            let all = pages.bytes();
            return Err(refused(format!("{range:?} is not inside of {all} bytes")));
        }
        let at = pages.start().as_ptr().wrapping_add(range.start);
        let bytes = range.len() as u64;
        let made = match &self.inner.vulkan {
            // SAFETY: it is mapped as long as its owner lives, which the buffer's memory drops after the buffer.
            Some(vulkan) => unsafe { vulkan.import(&self.inner.wgpu, at, bytes) },
            None => Err("only Vulkan can".to_owned()),
        };
        let (wgpu, raw, _) = made.map_err(refused)?;
        Ok(Buffer(Arc::new(Memory {
            label: "imported".to_owned(),
            bytes,
            raw: Some(raw),
            wgpu,
            host: None,
            device: self.inner.clone(),
            _pinned: Some(Pinned {
                pages,
                device: self.inner.clone(),
            }),
        })))
    }
}
