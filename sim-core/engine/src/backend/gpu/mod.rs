//! A GPU: worlds live in its memory, a control frame is one recorded batch. Sole user of sim-device.
//!
//! The programs are the one text of physics, recorded for the model (`programs`), and a few that keep books (`upkeep`, `show`). Randomness
//! stays on the host, and so do seeds, episodes and the parameters' last values.

mod compiled;
mod frame;
mod host;
mod imported;
mod left;
mod places;
mod programs;
mod show;
mod tile;
mod upkeep;
mod worlds;

use super::state::{Shape, array_of, finds_contacts, start};
use super::{
    Backend, BackendError, Backends, Faults, FirstFrozen, Frozen, Groups, ProgramFacts, Values,
    available_memory,
};
use crate::backend::noise::Noise;
use crate::random::Numbering;
use crate::start::StartDraw;
use compiled::{Books, Compiled};
use host::Host;
use imported::Imported;
use places::Places;
use programs::Programs;
use sim_device::{AdapterKind, Buffer, Choice, Device, Replay, Staging};
use sim_model::Model;
use sim_physics::arrays::Array;
use sim_physics::arrays::{Field, Layout, status};
use sim_physics::constants::Constants;
use sim_physics::schedule::evaluation_stages;
use sim_record::split::Limits;
use std::ops::Range;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;
use tile::{Rows, Tile};

/// What kernels may cost where software plays the GPU: every access to memory is a loop there, and its compiler's time grows with
/// their square. The grasp's Newton loop takes one thread longer than all other kernels four; in three kernels it is compiled like
/// these. What goes from one to the next costs about a tenth of a step, so they are few.
const SOFTWARE: Limits = Limits {
    kernel: 16_000,
    repeated: 20_000,
    dispatch: 4_000,
};
/// The same of hardware: few kernels, so that numbers stay in registers. A guess, with others that ARCHITECTURE.md lists.
const HARDWARE: Limits = Limits {
    kernel: 40_000,
    repeated: usize::MAX,
    dispatch: 0,
};

pub(super) struct Gpu {
    // batches go before the buffers and programs that they name, and those before the device
    tiles: Vec<Tile>,
    compiled: Compiled,
    /// The frame, in memory that the host sees.
    frame: Staging,
    /// The frame, in memory of the device, where that is another.
    drawn: Option<Buffer>,
    /// Does the driver take memory of readers?
    imports: bool,
    /// That memory, by its address.
    imported: Vec<(usize, Imported)>,
    device: Device,
    constants: Constants<f32>,
    layout: Layout,
    places: Places,
    /// Where each number of a world's record lies.
    record: Vec<u32>,
    start: Vec<f32>,
    draw: StartDraw,
    numbering: Numbering,
    noise: Noise,
    faults: Faults,
    host: Host,
    name: String,
    lost: OnceLock<BackendError>,
    copied: u64,
}

/// What is asked of a GPU, besides a model and its worlds.
pub struct Wanted<'a> {
    /// Which one it is.
    pub adapter: &'a Choice,
    /// Where programs are kept, if anywhere.
    pub cache: Option<&'a Path>,
    /// How it gets the batches of a frame.
    pub replay: Replay,
    /// How long its driver may take over a program.
    pub compile_limit: Duration,
}

/// Worlds of a group.
#[derive(Clone, Copy)]
struct Part {
    worlds: usize,
    numbering: Numbering,
    /// Groups of as many worlds that are not there yet, this one included: there must be memory for all.
    coming: usize,
}

/// A backend for each group on the adapter that is meant, with a device of its own, so that none waits for another's batch.
///
/// # Errors
/// No such adapter, out of memory, a driver that cannot compile the programs.
pub fn create(
    model: &Model,
    groups: Groups,
    layout: &Layout,
    wanted: &Wanted<'_>,
) -> Result<Backends, BackendError> {
    let parts = groups.numberings().zip((1..=groups.count).rev());
    let made = parts.map(
        |(numbering, coming)| -> Result<Box<dyn Backend>, BackendError> {
            let part = Part {
                worlds: groups.worlds,
                numbering,
                coming,
            };
            Ok(Box::new(Gpu::new(model, part, layout, wanted)?))
        },
    );
    made.collect()
}

const MB: u64 = 1 << 20;

/// Refuses a frame that no program can see as a whole.
fn check_frame(device: &Device, bytes: u64) -> Result<(), BackendError> {
    let most = device.info().binding_max;
    if bytes > most {
        let (bytes, most) = (bytes.div_ceil(MB), most / MB);
        return Err(BackendError::DeviceMemory {
            reason: format!(
                "a frame is {bytes} MB, and this adapter shows a program {most} MB of it; ask for fewer worlds or fields"
            ),
        });
    }
    Ok(())
}

/// Refuses worlds that do not fit into the adapter's memory, before any is taken: of memory that is also the processor's, what is
/// free counts.
fn check_memory(device: &Device, worlds: usize, needed: u64) -> Result<(), BackendError> {
    let info = device.info();
    let available = match info.kind {
        // what its driver tells of memory is a constant
        AdapterKind::Software => available_memory(),
        AdapterKind::Integrated => info.memory.into_iter().chain(available_memory()).min(),
        _ => info.memory,
    };
    let Some(available) = available else {
        return Ok(());
    };
    match needed > available {
        true => Err(BackendError::Memory {
            worlds,
            needed_mb: needed / MB,
            available_mb: available / MB,
        }),
        false => Ok(()),
    }
}

impl Gpu {
    fn new(
        model: &Model,
        part: Part,
        layout: &Layout,
        asked: &Wanted<'_>,
    ) -> Result<Gpu, BackendError> {
        let Part {
            worlds,
            numbering,
            coming,
        } = part;
        let limit = asked.compile_limit;
        let device = Device::open(asked.adapter, asked.cache)?;
        check_frame(&device, layout.bytes as u64)?;
        let constants: Constants<f32> = model.constants().cast();
        let m = &constants;
        let computed: Vec<(Field, usize)> = (layout.slots.iter())
            .filter(|slot| show::is_computed(slot.field) && slot.bytes > 0)
            .map(|slot| (slot.field, slot.shape[1..].iter().product()))
            .collect();
        let mut places = Places::new(m, &computed);
        let fields = layout.slots.iter().map(|slot| slot.field);
        let shown = evaluation_stages(m, fields.clone());
        let wanted: Vec<Array> = fields.flat_map(show::copied).collect();
        let limits = match device.info().kind {
            AdapterKind::Software => SOFTWARE,
            _ => HARDWARE,
        };
        let substeps = model.substeps();
        let programs = Programs::new(m, &places, substeps, &shown, &computed, &wanted, limits)
            .map_err(|e| BackendError::Program {
                reason: e.to_string(),
            })?;
        places.len += programs.spare;
        let sensors = model.contact_sensors();
        let shapes = sensors.first().map_or(0, |sensor| sensor.of.len());
        let frame_s = model.substeps() as f64 * model.dt();
        let books = Books {
            counters: show::counters(layout, frame_s),
            contacts: show::contacts(m, &places, layout, shapes),
        };
        let widest = tile::widest(&device, m, &places, worlds);
        let tiles = (worlds as u64).div_ceil(u64::from(widest));
        let needed = tiles * tile::memory(m, &places, widest) + 2 * layout.bytes as u64;
        check_memory(&device, coming * worlds, coming as u64 * needed)?;
        let mut compiled = Compiled::new(&device, m, &places, &programs, books, widest, limit)?;
        compiled.replay = asked.replay;
        let frame = device.staging("frame", layout.bytes.max(64) as u64)?;
        let drawn = match device.info().kind {
            AdapterKind::Discrete => Some(device.buffer("frame", layout.bytes.max(64) as u64)?),
            _ => None,
        };
        let pairs = tile::pairs(m, sensors);
        let runs = show::runs(m, &places, layout);
        let finds_contacts = finds_contacts(&shown);
        let target = drawn.as_ref().unwrap_or(&frame);
        let mut tiles = Vec::new();
        for first in (0..worlds).step_by(widest as usize) {
            let part = first..(first + widest as usize).min(worlds);
            let tile = Tile::new(&device, m, &places, &compiled, part, widest, &runs, &pairs)?;
            tiles.push(tile);
        }
        for tile in &mut tiles {
            tile.record(&device, &compiled, finds_contacts, target)?;
        }
        if let Some(last) = tiles.last_mut()
            && let Some(drawn) = &drawn
        {
            last.copy_out(&device, drawn, &frame, layout.bytes as u64)?;
        }
        let shape = Shape::of(m);
        let mut gpu = Gpu {
            tiles,
            compiled,
            frame,
            drawn,
            imports: device.info().imports,
            imported: Vec::new(),
            name: format!("gpu ({}, {})", device.info().name, device.info().driver),
            device,
            record: places.record(shape),
            start: start(model),
            draw: StartDraw::new(model),
            numbering,
            noise: Noise::new(model),
            faults: Faults::default(),
            host: Host::new(worlds, m.varying.len()),
            layout: layout.clone(),
            places,
            constants,
            lost: OnceLock::new(),
            copied: 0,
        };
        // those past the last world run along from the scene's start
        let all: Vec<usize> = (0..worlds).collect();
        gpu.host
            .fill_params(&gpu.start[shape.start(Array::Params)..]);
        let padding = gpu.start.clone();
        gpu.pad(&padding)?;
        gpu.begin(&all)?;
        Ok(gpu)
    }

    /// Keeps the first thing that went wrong: nothing is computed after it.
    fn check(&self, result: Result<(), BackendError>) {
        if let Err(error) = result {
            self.lost.get_or_init(|| error);
        }
    }
}

impl Backend for Gpu {
    fn device(&self) -> &str {
        &self.name
    }

    fn threads(&self) -> usize {
        1
    }

    fn programs(&self) -> &[ProgramFacts] {
        &self.compiled.facts
    }

    fn set_faults(&mut self, faults: Faults) {
        self.faults = faults;
        let bounds = [faults.joint_q_max, faults.joint_qd_max].map(|x| (x as f32).to_bits());
        for tile in &self.tiles {
            tile.set_bounds(bounds);
        }
    }

    fn freeze_others(&mut self, good: &[bool]) {
        let is_well = |world: &usize| self.host.status[*world] & status::FROZEN == 0;
        let bad: Vec<usize> = (0..good.len())
            .filter(|&w| !good[w])
            .filter(is_well)
            .collect();
        for &world in &bad {
            self.host.frozen.count(FirstFrozen {
                frame: self.host.frames,
                world,
                steps: self.host.steps[world],
                is_finite: false,
            });
            self.host.status[world] = status::NOT_FINITE;
        }
        let sent = self.send(&bad, Rows::Counters, 2, 1, |_, to| {
            to[0] = status::NOT_FINITE
        });
        self.check(sent);
    }

    fn write(
        &mut self,
        field: Field,
        columns: Range<usize>,
        values: Values<'_>,
        mask: Option<&[bool]>,
    ) {
        let target = array_of(field);
        if let (None, Some(command), Values::F32(values)) = (mask, tile::command(field), values)
            && columns.len() == self.shape().dofs
        {
            // what a frame brings: it goes with the frame
            for tile in &mut self.tiles {
                tile.stage(command, values, columns.len());
            }
            return;
        }
        // numbers that wait must not come after these
        let sent = self.flush();
        self.check(sent);
        let written = self.write_columns(target, &columns, values, mask);
        self.check(written);
    }

    fn write_params(&mut self, columns: Range<usize>, values: Values<'_>, mask: Option<&[bool]>) {
        let written = self.write_columns(Array::Params, &columns, values, mask);
        self.check(written);
    }

    fn params(&self, columns: Range<usize>, to: &mut [f64]) {
        let n = columns.len();
        for (world, row) in to.chunks_exact_mut(n.max(1)).enumerate() {
            for (x, from) in row
                .iter_mut()
                .zip(&self.host.params(world)[columns.clone()])
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

    fn reset(&mut self, mask: Option<&[bool]>, seeds: Option<&[u64]>) {
        let sent = self.flush();
        self.check(sent);
        let worlds = self.meant(mask);
        for &world in &worlds {
            self.host.steps[world] = 0;
            match seeds {
                Some(seeds) => {
                    self.host.seeds[world] = if let [seed] = seeds {
                        *seed
                    } else {
                        seeds[world]
                    };
                    self.host.episodes[world] = 0;
                }
                None => self.host.episodes[world] = self.host.episodes[world].wrapping_add(1),
            }
        }
        let begun = self.begin(&worlds);
        self.check(begun);
    }

    fn take_frozen(&mut self) -> Frozen {
        let mut all = std::mem::take(&mut self.host.frozen);
        if all.first.is_some() {
            let frozen = |status: &&u32| **status & status::FROZEN != 0;
            all.now = self.host.status.iter().filter(frozen).count();
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
        self.imported.clear();
    }

    unsafe fn import(&mut self, arena: &mut [u64]) -> bool {
        let place = arena.as_mut_ptr() as usize;
        if self.imported.iter().any(|(known, _)| *known == place) {
            return true;
        }
        if !self.imports {
            return false;
        }
        // SAFETY: by contract.
        let imported = unsafe {
            Imported::new(
                &self.device,
                &self.compiled,
                &self.tiles,
                arena,
                self.layout.bytes,
                self.drawn.as_ref(),
            )
        };
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
