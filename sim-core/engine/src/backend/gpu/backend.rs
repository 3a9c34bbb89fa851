//! The backend itself: what a group of worlds keeps on a GPU, and how each request is carried out.

use super::compiled::Compiled;
use super::imported::Imported;
use super::kernels::places::Places;
use super::mirror::HostMirror;
use super::recipe::{Extent, Recipe};
use super::shared::Shared;
use super::tile::Tile;
use super::uploads::{Bounds, Rows};
use crate::backend::noise::Noise;
use crate::backend::sharing::Sharing;
use crate::backend::{
    Backend, BackendError, Faults, FirstFrozen, Frozen, Input, ProgramInfo, Values,
};
use crate::random::{Episode, Numbering};
use crate::start::StartDraw;
use sim_device::{Buffer, Device, HostPages, Staging};
use sim_physics::arrays::Array;
use sim_physics::arrays::{Layout, status};
use sim_physics::constants::Constants;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

/// The backend of one group of worlds. Field order matters: batches are dropped before buffers and programs, and those before the device.
pub(super) struct Gpu {
    /// Memory that a client maps.
    pub shared: Option<Shared>,
    pub tiles: Vec<Tile>,
    pub bounds: Bounds,
    pub compiled: Compiled,
    pub recipe: Recipe,
    pub extent: Extent,
    /// The frame in host memory.
    pub frame: Staging,
    /// The frame in device memory, where it is not written to host memory at once.
    pub drawn: Option<Buffer>,
    /// Whether the driver imports the memory of readers.
    pub imports: bool,
    /// Imported memory, by address.
    pub imported: Vec<(usize, Imported)>,
    pub device: Device,
    pub constants: Constants<f32>,
    /// Duration of a frame [s].
    pub frame_s: f64,
    pub layout: Layout,
    pub places: Places,
    /// The place of each value of a world's record.
    pub record: Vec<u32>,
    pub start: Vec<f32>,
    pub draw: StartDraw,
    pub numbering: Numbering,
    pub noise: Noise,
    pub faults: Faults,
    pub mirror: HostMirror,
    pub name: String,
    pub lost: OnceLock<BackendError>,
    pub copied: u64,
}

impl Gpu {
    /// Keeps the first error: nothing is computed after it.
    fn check(&self, result: Result<(), BackendError>) {
        if let Err(error) = result {
            self.lost.get_or_init(|| error);
        }
    }

    /// Forgets the memory that a client maps, once the commands that wait in it are written.
    pub(super) fn forget_shared(&mut self) {
        if self.shared.is_some() && self.lost.get().is_none() {
            let sent = self.flush();
            self.check(sent);
        }
        self.shared = None;
    }

    /// Stages a command of all worlds for the next frame; false if these columns are no whole command.
    fn stage(&mut self, input: Input, columns: &Range<usize>, values: &[f32]) -> bool {
        let mut staged = true;
        for tile in &mut self.tiles {
            staged &= tile.stage(input, columns, values);
        }
        staged
    }
}

impl Backend for Gpu {
    fn device(&self) -> &str {
        &self.name
    }

    fn threads(&self) -> usize {
        1
    }

    fn programs(&self) -> &[ProgramInfo] {
        &self.compiled.info
    }

    fn seconds(&self) -> Vec<(&str, f64)> {
        self.tiles.first().map_or_else(Vec::new, Tile::seconds)
    }

    fn contact_room(&self) -> Option<usize> {
        let grows = self.constants.contacts.room_grows;
        grows.then(|| self.extent.room.most())
    }

    fn set_faults(&mut self, faults: Faults) {
        self.faults = faults;
        let bounds = [faults.joint_q_max, faults.joint_qd_max].map(|x| (x as f32).to_bits());
        self.bounds.set(bounds);
    }

    fn freeze_others(&mut self, good: &[bool]) {
        let is_well = |world: &usize| self.mirror.status[*world] & status::FROZEN == 0;
        let bad: Vec<usize> = (0..good.len())
            .filter(|&w| !good[w])
            .filter(is_well)
            .collect();
        for &world in &bad {
            self.mirror.frozen.count(FirstFrozen {
                frame: self.mirror.frames,
                world,
                steps: self.mirror.steps[world],
                is_finite: false,
            });
            self.mirror.status[world] = status::NOT_FINITE;
        }
        let sent = self.send(&bad, Rows::Counters, 2, 1, |_, to| {
            to[0] = status::NOT_FINITE
        });
        self.check(sent);
    }

    fn write(
        &mut self,
        input: Input,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) {
        let (group, columns_of_group) = input.place(&self.constants, columns.clone());
        if let (None, Values::F32(values)) = (mask, values)
            && self.stage(input, &columns, values)
        {
            if group == Array::Params {
                self.mirror.set_params(&columns_of_group, values);
            }
            return;
        }
        // commands that wait must not arrive after this array
        let sent = self.flush();
        self.check(sent);
        let written = self.write_columns(group, &columns_of_group, values, mask);
        self.check(written);
    }

    fn params(&self, columns: Range<usize>, to: &mut [f64]) {
        let n = columns.len();
        for (world, row) in to.chunks_exact_mut(n.max(1)).enumerate() {
            for (x, from) in row
                .iter_mut()
                .zip(&self.mirror.params(world)[columns.clone()])
            {
                *x = f64::from(*from);
            }
        }
    }

    fn numbers(&self) -> usize {
        self.shape().total()
    }

    fn save(&self, records: &mut [u8]) {
        self.check(self.save_records(records));
    }

    fn restore(&mut self, records: &[u8], mask: Option<&[bool]>, from_world: Option<usize>) {
        let restored = self.restore_records(records, mask, from_world);
        self.check(restored);
    }

    fn episodes(&self, to: &mut [Episode]) {
        let counted = self.mirror.seeds.iter().zip(&self.mirror.episodes);
        for (world, (to, (&seed, &episode))) in to.iter_mut().zip(counted).enumerate() {
            let world = self.numbering.number(world);
            *to = Episode {
                seed,
                world,
                episode,
            };
        }
    }

    fn reset(&mut self, mask: Option<&[bool]>, seeds: Option<&[u64]>) {
        let sent = self.flush();
        self.check(sent);
        let worlds = self.selected(mask);
        for &world in &worlds {
            self.mirror.steps[world] = 0;
            match seeds {
                Some(seeds) => {
                    self.mirror.seeds[world] = if let [seed] = seeds {
                        *seed
                    } else {
                        seeds[world]
                    };
                    self.mirror.episodes[world] = 0;
                }
                None => self.mirror.episodes[world] = self.mirror.episodes[world].wrapping_add(1),
            }
        }
        let begun = self.begin(&worlds);
        self.check(begun);
    }

    fn restart(&mut self) -> bool {
        let shape = self.shape();
        self.mirror
            .fill_params(&self.start[shape.start(Array::Params)..]);
        self.reset(None, Some(&[0]));
        let may_grow = self.extent.room.can_grow(&self.constants);
        self.bounds.set_may_grow(may_grow);
        self.mirror.frames = 0;
        self.mirror.frozen = Frozen::default();
        self.copied = 0;
        true
    }

    fn take_frozen(&mut self) -> Frozen {
        let mut all = std::mem::take(&mut self.mirror.frozen);
        if all.first.is_some() {
            let frozen = |status: &&u32| **status & status::FROZEN != 0;
            all.now = self.mirror.status.iter().filter(frozen).count();
        }
        all
    }

    fn run(&mut self, substeps: usize, arena: &mut [u64]) {
        assert!(
            arena.len() * 8 >= self.layout.bytes,
            "the arena is smaller than the layout"
        );
        if self.lost.get().is_none() {
            let run = self.run_frame(substeps > 0, arena);
            self.check(run);
        }
        if self.lost.get().is_some() {
            self.show_lost(arena);
        }
    }

    fn lost(&self) -> Option<&BackendError> {
        self.lost.get()
    }

    fn lose(&mut self) {
        self.device.lose();
    }

    fn adapter(&self) -> &str {
        &self.device.info().name
    }

    fn delivery(&self) -> &'static str {
        if self.imports { "imported" } else { "copied" }
    }

    fn copied(&self) -> u64 {
        self.copied
    }

    fn forget(&mut self) {
        self.forget_shared();
        self.imported.clear();
    }

    fn sharing(&mut self) -> Option<&mut dyn Sharing> {
        Some(self)
    }

    fn import(&mut self, arena: &[u64], owner: &dyn Fn() -> Option<Arc<dyn HostPages>>) -> bool {
        let place = arena.as_ptr() as usize;
        // nothing else can lie there: its pages are owned
        if self.imported.iter().any(|(known, _)| *known == place) {
            return true;
        }
        let Some(owner) = self.imports.then(owner).flatten() else {
            return false;
        };
        let imported = Imported::new(
            &self.device,
            &self.compiled,
            &self.tiles,
            arena,
            self.layout.bytes,
            (owner, self.drawn.as_ref()),
        );
        match imported {
            Ok(imported) => {
                self.imported.push((place, imported));
                true
            }
            Err(_) => {
                self.imports = false;
                false
            }
        }
    }
}
