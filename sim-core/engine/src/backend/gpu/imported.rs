//! Memory of readers that a device writes frames to.

use super::compiled::Compiled;
use super::tile::Tile;
use crate::backend::BackendError;
use sim_device::{Batch, Buffer, Device, DeviceError, HostPages};
use std::ops::Range;
use std::sync::Arc;

/// Reader memory that frames are written to.
pub(super) struct Imported {
    /// One batch per tile.
    pub shown: Vec<Batch>,
    /// The pages of an arena.
    pub pages: Buffer,
    /// The arena's first byte in them.
    pub before: u64,
}

/// Where the programs of a frame write it.
pub(super) enum Drawn<'a> {
    /// Where its reader is.
    InPlace,
    /// In a part of the device's own memory, from where it is copied.
    Apart(&'a Buffer, Range<u64>),
}

/// Where the reader of a frame is: the buffer and the frame's first byte in it.
#[derive(Clone, Copy)]
pub(super) struct Target<'a>(pub &'a Buffer, pub u64);

/// Records what writes a frame of `bytes` for its reader: one batch per tile.
pub(super) fn record(
    (device, compiled, tiles): (&Device, &Compiled, &[Tile]),
    drawn: Drawn<'_>,
    Target(reader, at): Target<'_>,
    bytes: u64,
) -> Result<Vec<Batch>, BackendError> {
    let mut shown = Vec::new();
    for (k, tile) in tiles.iter().enumerate() {
        let mut batch = device.batch(compiled.replay);
        match &drawn {
            Drawn::Apart(buffer, part) => {
                tile.show(&mut batch, compiled, buffer, part.clone());
                if k + 1 == tiles.len() {
                    batch.copy(buffer, part.start, reader, at, bytes);
                }
            }
            Drawn::InPlace => tile.show(&mut batch, compiled, reader, at..at + bytes),
        }
        shown.push(batch.finish()?);
    }
    Ok(shown)
}

impl Imported {
    /// Imports the pages of an arena, which the batches own from then on.
    pub fn new(
        device: &Device,
        compiled: &Compiled,
        tiles: &[Tile],
        arena: &[u64],
        bytes: usize,
        (owner, drawn): (Arc<dyn HostPages>, Option<&Buffer>),
    ) -> Result<Imported, BackendError> {
        const PAGE: usize = 4096;
        let place = arena.as_ptr() as usize;
        let (first, end) = (place / PAGE * PAGE, (place + bytes).next_multiple_of(PAGE));
        let start = owner.start().as_ptr() as usize;
        let inside = first.checked_sub(start).zip(end.checked_sub(start));
        let (first_inside, end_inside) = inside.ok_or_else(|| DeviceError::Import {
            reason: "the arena lies before its pages".to_owned(),
        })?;
        // SAFETY: batches write the arena alone, and run only while `Backend::run` borrows it.
        let pages = unsafe { device.import(owner, first_inside..end_inside)? };
        let before = (place - first) as u64;
        let mut imported = Imported {
            shown: Vec::new(),
            pages,
            before,
        };
        imported.record((device, compiled, tiles), drawn, bytes as u64)?;
        Ok(imported)
    }

    /// Records what writes a frame of `bytes`, for these tiles.
    pub fn record(
        &mut self,
        run: (&Device, &Compiled, &[Tile]),
        drawn: Option<&Buffer>,
        bytes: u64,
    ) -> Result<(), BackendError> {
        let drawn = drawn.map_or(Drawn::InPlace, |buffer| {
            Drawn::Apart(buffer, 0..buffer.bytes())
        });
        self.shown = record(run, drawn, Target(&self.pages, self.before), bytes)?;
        Ok(())
    }
}
