//! Memory of readers that a device writes frames to.

use super::compiled::Compiled;
use super::tile::Tile;
use super::words;
use crate::backend::BackendError;
use sim_device::{Batch, Buffer, Device};

/// Reader memory that frames are written to.
pub(super) struct Imported {
    /// One batch per tile.
    pub shown: Vec<Batch>,
}

impl Imported {
    /// Imports the pages of an arena.
    ///
    /// # Safety
    /// The pages stay mapped where they are, to the same memory, until the backend is dropped.
    pub unsafe fn new(
        device: &Device,
        compiled: &Compiled,
        tiles: &[Tile],
        arena: &mut [u64],
        bytes: usize,
        drawn: Option<&Buffer>,
    ) -> Result<Imported, BackendError> {
        const PAGE: usize = 4096;
        let place = arena.as_mut_ptr() as usize;
        let (first, end) = (place / PAGE * PAGE, (place + bytes).next_multiple_of(PAGE));
        let before = place - first;
        let at = words::bytes(arena).as_mut_ptr().wrapping_sub(before);
        // SAFETY: whole pages, mapped by contract.
        let pages = unsafe { device.import(at, (end - first) as u64)? };
        let mut shown = Vec::new();
        for (k, tile) in tiles.iter().enumerate() {
            let mut batch = device.batch(compiled.replay);
            match drawn {
                Some(drawn) => {
                    tile.show(&mut batch, compiled, drawn, 0..drawn.bytes());
                    if k + 1 == tiles.len() {
                        batch.copy(drawn, 0, &pages, before as u64, bytes as u64);
                    }
                }
                None => {
                    let part = before as u64..(before + bytes) as u64;
                    tile.show(&mut batch, compiled, &pages, part);
                }
            }
            shown.push(batch.finish()?);
        }
        Ok(Imported { shown })
    }
}
