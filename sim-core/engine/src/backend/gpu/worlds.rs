//! Values of worlds between host and device: starts, records, and columns that are written.

use super::backend::Gpu;
use super::tile::Tile;
use super::uploads::Rows;
use super::words;
use crate::backend::state::{Shape, array_of};
use crate::backend::{BackendError, COUNTERS, Values};
use sim_physics::arrays::Array;
use std::ops::Range;

impl Gpu {
    pub(super) fn shape(&self) -> Shape {
        Shape::from_constants(&self.constants)
    }

    /// Sets every lane of some tiles to the scene's start, padding included.
    pub(super) fn pad(&self, tiles: &[Tile]) -> Result<(), BackendError> {
        let mut row = vec![0; self.places.state as usize];
        place(&self.record, &self.start, &mut row);
        for tile in tiles {
            tile.fill(&self.device, &row)?;
        }
        Ok(())
    }

    /// Begins episodes of these worlds, which the mirror has counted already.
    pub(super) fn begin(&mut self, worlds: &[usize]) -> Result<(), BackendError> {
        let params = self.shape().start(Array::Params);
        let starts = self.constants.varying.starts().to_vec();
        let mut records = Vec::with_capacity(worlds.len());
        for &world in worlds {
            let mut record = self.start.clone();
            let (seed, episode) = (self.mirror.seeds[world], self.mirror.episodes[world]);
            let number = self.numbering.number(world);
            let shape = self.shape();
            // parameters stay as they are, but for loads and what is drawn
            for (k, x) in self.mirror.params_mut(world).iter_mut().enumerate() {
                match starts[k].0.is_load() {
                    true => *x = record[params + k],
                    false => record[params + k] = *x,
                }
            }
            self.draw
                .draw(seed, number, episode, |field, column, value| {
                    record[shape.start(array_of(field)) + column] = value as f32;
                });
            let world_params = self.mirror.params_mut(world);
            self.draw.draw_params(seed, number, episode, |k, value| {
                record[params + k] = value as f32;
                world_params[k] = value as f32;
            });
            records.push(record);
        }
        self.set_records(worlds, &records, |_| [0; 4])
    }

    /// Sets state, commands and counters of some worlds.
    fn set_records(
        &mut self,
        worlds: &[usize],
        records: &[Vec<f32>],
        counters: impl Fn(usize) -> [u32; 4],
    ) -> Result<(), BackendError> {
        let (places, columns) = (self.record.clone(), self.places.state);
        self.send(worlds, Rows::Fields, 0, columns, |k, to| {
            place(&places, &records[k], to);
        })?;
        for (k, &world) in worlds.iter().enumerate() {
            self.mirror.status[world] = counters(k)[2];
        }
        self.send(worlds, Rows::Counters, 0, 4, |k, to| {
            to.copy_from_slice(&counters(k))
        })
    }

    /// Writes neighbouring values of some worlds, which are in ascending order.
    pub(super) fn send(
        &mut self,
        worlds: &[usize],
        target: Rows,
        first: u32,
        columns: u32,
        row: impl Fn(usize, &mut [u32]),
    ) -> Result<(), BackendError> {
        let mut from = 0;
        for tile in &self.tiles {
            let end = worlds.partition_point(|&world| world < tile.worlds.end);
            if from < end && columns > 0 {
                tile.send(
                    &self.device,
                    target,
                    first,
                    columns,
                    &worlds[from..end],
                    |j, to| {
                        row(from + j, to);
                    },
                )?;
            }
            from = end;
        }
        Ok(())
    }

    /// The worlds of a mask; none = all.
    pub(super) fn selected(&self, mask: Option<&[bool]>) -> Vec<usize> {
        let worlds = 0..self.mirror.seeds.len();
        worlds
            .filter(|&world| mask.is_none_or(|mask| mask[world]))
            .collect()
    }

    pub(super) fn write_columns(
        &mut self,
        target: Array,
        columns: &Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) -> Result<(), BackendError> {
        let n = columns.len();
        if n == 0 {
            return Ok(());
        }
        let worlds = self.selected(mask);
        let quaternions: Vec<usize> = match target {
            Array::JointQ => self
                .constants
                .quaternions()
                .filter(|q| columns.contains(q))
                .collect(),
            _ => Vec::new(),
        };
        let value = |world: usize, k: usize| match values {
            Values::F32(v) => v[world * n + k],
            Values::F64(v) => v[world * n + k] as f32,
        };
        let first = self.places.range(target).start + columns.start as u32;
        self.send(&worlds, Rows::Fields, first, n as u32, |j, to| {
            let mut row: Vec<f32> = (0..n).map(|k| value(worlds[j], k)).collect();
            for quaternion in &quaternions {
                normalize(&mut row[quaternion - columns.start..][..4]);
            }
            for (to, x) in to.iter_mut().zip(row) {
                *to = x.to_bits();
            }
        })?;
        match target {
            Array::Params => {
                for &world in &worlds {
                    for k in 0..n {
                        self.mirror.params_mut(world)[columns.start + k] = value(world, k);
                    }
                }
            }
            Array::JointQ | Array::JointQd => {
                let qdd = self.places.range(Array::JointQdd).start;
                let dofs = self.shape().dofs as u32;
                self.send(&worlds, Rows::Fields, qdd, dofs, |_, to| to.fill(0))?;
                if target == Array::JointQ {
                    let rest = self.places.range(Array::JointQRest).start + columns.start as u32;
                    self.send(&worlds, Rows::Fields, rest, n as u32, |_, to| to.fill(0))?;
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Writes the records of the first worlds.
    pub(super) fn save_records(&self, records: &mut [u8]) -> Result<(), BackendError> {
        let size = COUNTERS + 4 * self.shape().total();
        let asked = records.len() / size;
        for tile in self.tiles.iter().filter(|tile| tile.worlds.start < asked) {
            let state = tile.fetch(&self.device)?;
            let read = state.read();
            let words: &[u32] = words::words(&read);
            let at = |i: usize, w: usize| words[((i / 4) * tile.width as usize + w) * 4 + i % 4];
            let counters = self.places.state as usize;
            for (w, world) in (tile.worlds.start..tile.worlds.end.min(asked)).enumerate() {
                let (head, numbers) =
                    records[world * size..(world + 1) * size].split_at_mut(COUNTERS);
                for k in 0..4 {
                    head[4 * k..4 * k + 4].copy_from_slice(&at(counters + k, w).to_le_bytes());
                }
                head[16..24].copy_from_slice(&self.mirror.seeds[world].to_le_bytes());
                head[24..].copy_from_slice(&self.mirror.episodes[world].to_le_bytes());
                for (to, place) in numbers.chunks_exact_mut(4).zip(&self.record) {
                    to.copy_from_slice(&at(*place as usize, w).to_le_bytes());
                }
            }
        }
        Ok(())
    }

    /// Sets worlds to their records, or to that of one world.
    pub(super) fn restore_records(
        &mut self,
        records: &[u8],
        mask: Option<&[bool]>,
        from_world: Option<usize>,
    ) -> Result<(), BackendError> {
        self.flush()?;
        let size = COUNTERS + 4 * self.shape().total();
        let params = self.shape().start(Array::Params);
        let worlds = self.selected(mask);
        let mut states = Vec::with_capacity(worlds.len());
        let mut counts = Vec::with_capacity(worlds.len());
        for &world in &worlds {
            let first = from_world.unwrap_or(world) * size;
            let (head, numbers) = records[first..first + size].split_at(COUNTERS);
            let word = |k: usize| u32::from_le_bytes(std::array::from_fn(|i| head[4 * k + i]));
            counts.push([word(0), word(1), word(2), word(3)]);
            self.mirror.steps[world] = u64::from(word(0)) | u64::from(word(1)) << 32;
            self.mirror.seeds[world] = u64::from(word(4)) | u64::from(word(5)) << 32;
            self.mirror.episodes[world] = word(6);
            let record: Vec<f32> = (numbers.chunks_exact(4))
                .map(|x| f32::from_le_bytes(std::array::from_fn(|i| x[i])))
                .collect();
            self.mirror
                .params_mut(world)
                .copy_from_slice(&record[params..]);
            states.push(record);
        }
        self.set_records(&worlds, &states, |k| counts[k])
    }
}

/// Puts a world's record at its places in device memory, and 0 between them.
fn place(places: &[u32], record: &[f32], to: &mut [u32]) {
    to.fill(0);
    for (place, x) in places.iter().zip(record) {
        to[*place as usize] = x.to_bits();
    }
}

/// Normalizes a quaternion. One of length 1, up to rounding, keeps its bits.
fn normalize(quaternion: &mut [f32]) {
    let square: f64 = quaternion.iter().map(|x| f64::from(*x).powi(2)).sum();
    if (square - 1.0).abs() > 4.0 * f64::from(f32::EPSILON) {
        for x in quaternion {
            *x = (f64::from(*x) / square.sqrt()) as f32;
        }
    }
}
