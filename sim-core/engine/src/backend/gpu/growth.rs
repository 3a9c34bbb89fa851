//! More room for contacts. A tile reports that a world had too little, and that its frame is undone (`kernels::bookkeeping`). Tiles with
//! twice the room replace all tiles, and the frame is repeated.

use super::backend::Gpu;
use super::compiled::Compiled;
use super::lacks::Again;
use super::recipe::{Extent, Recipe};
use super::sizing::{self, check_memory};
use super::tile::{Tile, TileInputs};
use super::uploads::has_own_memory;
use crate::backend::BackendError;
use sim_device::Buffer;
use std::ops::Range;

/// Tiles of these worlds, with all batches but those of readers. Each lies within one of the ranges.
pub(super) fn tiles(
    inputs: TileInputs<'_>,
    recipe: &Recipe,
    extent: &Extent,
    worlds: impl Iterator<Item = Range<usize>>,
    (drawn, frame, bytes): (Option<&Buffer>, &Buffer, u64),
) -> Result<Vec<Tile>, BackendError> {
    let width = extent.width as usize;
    let parts = worlds.flat_map(|all| {
        let firsts = all.clone().step_by(width);
        firsts.map(move |first| first..(first + width).min(all.end))
    });
    let (device, compiled) = (inputs.device, inputs.compiled);
    let mut tiles = Vec::new();
    for part in parts {
        let mut tile = Tile::new(inputs, recipe, extent, part)?;
        tile.record(device, compiled, drawn.unwrap_or(frame))?;
        tiles.push(tile);
    }
    if let (Some(last), Some(drawn)) = (tiles.last_mut(), drawn) {
        last.copy_out(device, compiled, drawn, frame, bytes)?;
    }
    Ok(tiles)
}

impl Gpu {
    /// What of each tile's frame has to run again, if a world lacked room.
    pub(super) fn lacking(&self) -> Option<Vec<Again>> {
        let again = self.tiles.iter().map(Tile::again);
        let lacks = again.clone().any(|again| again.is_some());
        // the others show their worlds again: the rows of their contacts are not kept
        let again = again.map(|again| again.unwrap_or(Again::Evaluation));
        lacks.then(|| again.collect())
    }

    /// Makes room for a frame that is repeated; each new tile runs the part of the one that its worlds were in. Where the adapter has no
    /// memory for more room, or its driver compiles programs for narrower tiles too long, contacts that have none are left out until the
    /// next restart, and their worlds report it.
    pub(super) fn make_room(&mut self, parts: &mut Vec<Again>) -> Result<(), BackendError> {
        let old: Vec<Range<usize>> = self.tiles.iter().map(|tile| tile.worlds.clone()).collect();
        let more = self.larger();
        let made = match more.filter(|extent| self.has_memory(extent)) {
            Some(extent) => self.remake(extent),
            None => Ok(false),
        };
        let grew = match made {
            Err(BackendError::DeviceMemory { .. } | BackendError::CompileTimeout { .. }) => false,
            made => made?,
        };
        if grew {
            let part = |tile: &Tile| {
                let place = old.iter().position(|o| o.contains(&tile.worlds.start));
                parts[place.expect("it lies in an old one")]
            };
            *parts = self.tiles.iter().map(part).collect();
        }
        let may_grow = grew && self.extent.room.can_grow(&self.constants);
        self.bounds.set_may_grow(may_grow);
        Ok(())
    }

    /// Tiles with twice the room, if that is more.
    fn larger(&self) -> Option<Extent> {
        let (m, places) = (&self.constants, &self.places);
        let room = self.extent.room.twice(m)?;
        let (worlds, threads) = (self.mirror.seeds.len(), self.recipe.threads);
        let width = sizing::widest(&self.device, m, places, &room, worlds, threads);
        let width = width.min(self.extent.width);
        Some(Extent { room, width })
    }

    /// Whether the adapter has memory for such tiles, beside those that there are.
    fn has_memory(&self, extent: &Extent) -> bool {
        let bytes = |extent: &Extent| {
            let width = extent.width as usize;
            let tiles = self.tiles.iter();
            let tiles = tiles.map(|tile| tile.worlds.len().div_ceil(width) as u64);
            tiles.sum::<u64>() * sizing::memory(&self.constants, &self.places, extent)
        };
        // of all groups on a card, whose whole memory counts; what a computer has free lacks those that there are
        let (groups, held) = match has_own_memory(&self.device) {
            true => (self.recipe.groups, bytes(&self.extent)),
            false => (1, 0),
        };
        let needed = groups as u64 * bytes(extent) + held;
        let worlds = groups * self.mirror.seeds.len();
        check_memory(&self.device, worlds, needed).is_ok()
    }

    /// Replaces all tiles; true. An error leaves those that there are.
    fn remake(&mut self, extent: Extent) -> Result<bool, BackendError> {
        let (device, m, recipe) = (&self.device, &self.constants, &self.recipe);
        let compiled = match extent.width == self.extent.width {
            true => self.compiled.with_room(device, m, &extent.room)?,
            false => Compiled::new(device, m, &self.places, recipe, &extent)?,
        };
        let inputs = TileInputs {
            device,
            constants: m,
            places: &self.places,
            compiled: &compiled,
            bounds: &self.bounds.buffer,
        };
        let bytes = self.layout.bytes as u64;
        let worlds = self.tiles.iter().map(|tile| tile.worlds.clone());
        let frame = (self.drawn.as_ref(), &*self.frame, bytes);
        let tiles = tiles(inputs, recipe, &extent, worlds, frame)?;
        self.pad(&tiles)?;
        for tile in &tiles {
            tile.take(device, &self.tiles)?;
        }
        (self.compiled, self.tiles, self.extent) = (compiled, tiles, extent);
        let run = (&self.device, &self.compiled, &self.tiles[..]);
        for (_, imported) in &mut self.imported {
            imported.record(run, self.drawn.as_ref(), bytes)?;
        }
        self.record_shared()?;
        Ok(true)
    }
}
