//! A control frame: commands are sent, the recorded batches run, and the mirror is updated from the counters.

use super::backend::Gpu;
use super::lacks::Again;
use super::tile::Tile;
use super::uploads::Rows;
use super::words;
use crate::backend::clocks;
use crate::backend::noise::sample;
use crate::backend::{BackendError, FirstFrozen};
use crate::canonical::make_floats_canonical;
use crate::random::{Draw, Stream};
use sim_physics::arrays::{Array, Dtype, Field, status};

impl Gpu {
    /// Draws the noise of the commands of this frame.
    fn send_command_noise(&mut self) -> Result<(), BackendError> {
        if self.noise.commands.iter().all(|(_, first)| first.is_none()) {
            return Ok(());
        }
        let dofs = self.shape().dofs;
        let worlds = self.selected(None);
        let rows: Vec<Vec<u32>> = (worlds.iter())
            .map(|&world| {
                let mut row = vec![0; 3 * dofs];
                for (k, &(stream, first)) in self.noise.commands.iter().enumerate() {
                    let Some(first) = first else { continue };
                    let draw = self.draw_of(world, stream);
                    for dof in 0..dofs {
                        let std = f64::from(self.mirror.params(world)[first + dof]);
                        row[k * dofs + dof] = (sample(&draw, dof, std) as f32).to_bits();
                    }
                }
                row
            })
            .collect();
        let place = self.places.range(Array::CommandNoise);
        self.send(
            &worlds,
            Rows::Fields,
            place.start,
            3 * dofs as u32,
            |k, to| {
                to.copy_from_slice(&rows[k]);
            },
        )
    }

    fn draw_of(&self, world: usize, stream: Stream) -> Draw {
        let number = self.numbering.number(world);
        let (seed, episode) = (self.mirror.seeds[world], self.mirror.episodes[world]);
        Draw::at_step(seed, number, episode, self.mirror.steps[world], stream)
    }

    /// Adds noise to the fields that have some; it is drawn on the host.
    fn add_noise(&self, arena: &mut [u64]) {
        for slot in &self.layout.slots {
            let Some(noise) = self.noise.for_field(slot.field) else {
                continue;
            };
            let columns: usize = slot.shape[1..].iter().product();
            if columns == 0 || slot.dtype != Dtype::F32 {
                continue;
            }
            let rows: &mut [f32] = words::array(arena, slot.offset, slot.bytes);
            for (world, row) in rows.chunks_exact_mut(columns).enumerate() {
                let draw = self.draw_of(world, noise.1);
                let deviation = |number: usize| f64::from(self.mirror.params(world)[number]);
                self.noise.add_to(noise, row, &draw, deviation);
            }
            if self.recipe.canonical {
                make_floats_canonical(words::array(arena, slot.offset, slot.bytes));
            }
        }
    }

    /// The frame of a lost device: every world reports that it is not finite.
    pub(super) fn show_lost(&self, arena: &mut [u64]) {
        let worlds = self.mirror.seeds.len();
        let shown_status: &mut [u32] = words::array(arena, self.offset(Field::Status), 4 * worlds);
        shown_status.fill(status::NOT_FINITE);
    }

    fn offset(&self, field: Field) -> usize {
        let slot = self.layout.slots.iter().find(|slot| slot.field == field);
        slot.expect("counters are part of every frame").offset
    }

    /// Writes the clocks among the sensors.
    fn put_clocks(&self, arena: &mut [u64]) {
        let slot = self.layout.slots.iter();
        let Some(slot) = slot.clone().find(|slot| slot.field == Field::Sensordata) else {
            return;
        };
        let width: usize = slot.shape[1..].iter().product();
        let rows: &mut [f32] = words::array(arena, slot.offset, slot.bytes);
        for (row, &steps) in rows.chunks_exact_mut(width.max(1)).zip(&self.mirror.steps) {
            clocks::put(&self.constants, steps as f64 * self.frame_s, row);
        }
    }

    /// Reads the counters of a frame and counts the worlds that were frozen in it.
    fn read_counters(&mut self, arena: &mut [u64], counts: bool) {
        let worlds = self.mirror.seeds.len();
        let (at_status, at_step) = (self.offset(Field::Status), self.offset(Field::Step));
        self.mirror
            .steps
            .copy_from_slice(words::array::<u64>(arena, at_step, 8 * worlds));
        let shown_status: &mut [u32] = words::array(arena, at_status, 4 * worlds);
        if *shown_status == self.mirror.status[..] {
            return;
        }
        for (world, &now) in shown_status.iter().enumerate() {
            let before = self.mirror.status[world];
            if counts && now & status::FROZEN != 0 && before & status::FROZEN == 0 {
                self.mirror.frozen.count(FirstFrozen {
                    frame: self.mirror.frames,
                    world,
                    steps: self.mirror.steps[world],
                    is_finite: now & status::NOT_FINITE == 0,
                });
            }
            self.mirror.status[world] = now;
        }
    }

    pub(super) fn run_frame(&mut self, steps: bool, arena: &mut [u64]) -> Result<(), BackendError> {
        if steps {
            self.mirror.frames += 1;
            self.send_command_noise()?;
        }
        let place = arena.as_ptr() as usize;
        let first = match steps {
            true => Again::Substeps,
            false => Again::Evaluation,
        };
        self.run_parts(place, |_| first)?;
        while let Some(mut parts) = self.lacking() {
            self.make_room(&mut parts)?;
            if let Some(shared) = &mut self.shared {
                let slot = shared.slot(place);
                shared.repeat(slot);
            }
            self.run_parts(place, |tile| parts[tile])?;
        }
        let slot = self.shared.as_ref().and_then(|shared| shared.slot(place));
        let is_staged = !self.imported.iter().any(|(known, _)| *known == place);
        if is_staged {
            let bytes = self.layout.bytes;
            words::bytes(arena)[..bytes].copy_from_slice(&self.frame.read()[..bytes]);
            self.copied += bytes as u64;
        }
        self.read_counters(arena, steps);
        self.put_clocks(arena);
        self.add_noise(arena);
        if let Some(shared) = &mut self.shared {
            shared.finish(&self.device, slot, words::bytes(arena))?;
        }
        if steps && self.faults.resets {
            let frozen = |world: &usize| self.mirror.status[*world] & status::FROZEN != 0;
            let again: Vec<usize> = (0..self.mirror.seeds.len()).filter(frozen).collect();
            if !again.is_empty() {
                for &world in &again {
                    self.mirror.episodes[world] = self.mirror.episodes[world].wrapping_add(1);
                    self.mirror.steps[world] = 0;
                }
                self.begin(&again)?;
            }
        }
        Ok(())
    }

    /// Runs these parts of the tiles' frames, and draws them for the arena at an address.
    fn run_parts(
        &mut self,
        place: usize,
        part: impl Fn(usize) -> Again,
    ) -> Result<(), BackendError> {
        let imported = self.imported.iter().find(|(known, _)| *known == place);
        let shared = self.shared.as_ref();
        let slot = shared.and_then(|shared| shared.slot(place));
        let shown = shared.zip(slot).map(|(shared, slot)| shared.shows(slot));
        let shown = shown.or(imported.map(|(_, imported)| &imported.shown[..]));
        let mut batches = Vec::with_capacity(3 * self.tiles.len());
        batches.extend(self.bounds.pending());
        batches.extend(shared.iter().flat_map(|shared| shared.commands.pending()));
        for (k, tile) in self.tiles.iter().enumerate() {
            batches.extend(tile.pending());
            batches.push(tile.computes(part(k)));
            batches.push(shown.map_or_else(|| tile.shows(), |shown| &shown[k]));
        }
        if shown.is_none() {
            batches.extend(self.tiles.iter().filter_map(Tile::copies_out));
        }
        let done = shared.and_then(|shared| shared.drawn(slot));
        self.device.run_between(&batches, None, done)?;
        self.bounds.sent();
        self.commands_sent();
        Ok(())
    }

    /// Sends the commands that wait for a frame.
    pub(super) fn flush(&mut self) -> Result<(), BackendError> {
        let shared = self.shared.iter();
        let shared = shared.flat_map(|shared| shared.commands.pending());
        let tiles = self.tiles.iter().flat_map(Tile::pending);
        let batches: Vec<_> = shared.chain(tiles).collect();
        if !batches.is_empty() {
            self.device.run(&batches)?;
        }
        self.commands_sent();
        Ok(())
    }

    /// All commands that waited were sent.
    fn commands_sent(&mut self) {
        if let Some(shared) = &mut self.shared {
            shared.commands.sent();
        }
        for tile in &mut self.tiles {
            tile.sent();
        }
    }
}
