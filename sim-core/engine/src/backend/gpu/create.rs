//! Creates the backend of each group: records and compiles the programs, allocates the tiles, and starts the worlds.

use super::backend::Gpu;
use super::compiled::Compiled;
use super::growth::tiles;
use super::kernels::blocks::with_blocks;
use super::kernels::merged::merged;
use super::kernels::places::Places;
use super::kernels::programs::{How, Programs};
use super::kernels::rolled::{check_software, is_large, rolled};
use super::kernels::room::{Room, growing};
use super::kernels::show;
use super::kernels::workgroups;
use super::mirror::HostMirror;
use super::recipe::{Extent, OutputSources, Recipe};
use super::rounding;
use super::sizing::{self, check_frame, check_memory};
use super::software;
use super::tile::TileInputs;
use super::uploads::{Bounds, has_own_memory};
use crate::backend::noise::Noise;
use crate::backend::state::{Shape, finds_contacts, start};
use crate::backend::{Backend, BackendError, Backends, Faults, Groups};
use crate::random::Numbering;
use crate::start::StartDraw;
use sim_device::{AdapterInfo, AdapterKind, Choice, Device, Replay};
use sim_model::Model;
use sim_physics::arrays::{Array, Layout};
use sim_physics::constants::Constants;
use sim_physics::schedule::evaluation_stages;
use sim_physics::step::StageId;
use sim_record::split::{Limits, Prices};
use std::borrow::Cow;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

/// Limits of kernels for hardware GPUs. A unit is about an instruction. A kernel's code should fit the instruction cache, some 128 kB
/// on NVIDIA's cards. A dispatch and its barrier take as long as a lone warp takes for some 1,500 instructions.
pub(super) const HARDWARE: Limits = Limits {
    kernel: 6_000,
    repeated: usize::MAX,
    repeated_dispatch: 0,
    dispatch: 1_500,
    prices: Prices::HARDWARE,
};

/// Frames begin at a multiple of this in the memory of their readers, as sim-protocol lays it out [bytes].
const ARENA_ALIGN: u64 = 64;

/// Where the kernels of a GPU are cut; none = what suits the adapter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cuts {
    /// Largest kernel [simple statements].
    pub kernel: Option<usize>,
    /// Price of one more dispatch [simple statements].
    pub dispatch: Option<usize>,
}

impl Cuts {
    /// Limits where these cuts replace what is usual.
    pub(super) fn replace(self, usual: Limits) -> Limits {
        Limits {
            kernel: self.kernel.unwrap_or(usual.kernel),
            dispatch: self.dispatch.unwrap_or(usual.dispatch),
            ..usual
        }
    }
}

/// The limits of kernels with so many threads per world.
fn limits(info: &AdapterInfo, threads: usize, cuts: Cuts) -> Limits {
    // loops that are cut inside cannot be shared
    let usual = match threads {
        1 => software::limits(info).unwrap_or(HARDWARE),
        _ => HARDWARE,
    };
    cuts.replace(usual)
}

/// The constants of a model, as kernels with so many threads per world have them. `cpu_bits`: classes of contacts are the CPU's, so that
/// sums have its order.
pub(super) fn constants(
    model: &Model,
    threads: usize,
    layout: &Layout,
    cpu_bits: bool,
) -> Constants<f32> {
    let fields = layout.slots.iter().map(|slot| slot.field);
    let shown = evaluation_stages(model.constants(), fields);
    let solves = |stage: &StageId| stage.writes().contains(&Array::JointQdd);
    let m = match threads {
        _ if cpu_bits => Cow::Borrowed(model.constants()),
        1 if !is_large(model.constants()) => Cow::Borrowed(model.constants()),
        1 => merged(model.constants()),
        _ => with_blocks(merged(model.constants())),
    };
    growing(rolled(m, threads, shown.iter().any(solves))).cast()
}

/// The programs of frames with this layout, where their numbers lie, and the stages of the evaluation.
pub(super) fn programs(
    m: &Constants<f32>,
    layout: &Layout,
    substeps: usize,
    how: How,
) -> Result<(Programs, Places, Vec<StageId>), BackendError> {
    let computed = show::computed(layout);
    let mut places = Places::new(m, &computed);
    let fields = layout.slots.iter().map(|slot| slot.field);
    let shown = evaluation_stages(m, fields.clone());
    let wanted: Vec<Array> = fields.flat_map(show::copied).collect();
    let programs = Programs::new(m, &places, substeps, &shown, &computed, &wanted, how)?;
    places.len += programs.spare;
    Ok((programs, places, shown))
}

/// What a caller asks of a GPU, besides a model and its worlds.
pub struct Wanted<'a> {
    /// The adapter.
    pub adapter: &'a Choice,
    /// Folder of compiled programs, if any.
    pub cache: Option<&'a Path>,
    /// Whether the batches of a frame are recorded or encoded.
    pub replay: Replay,
    /// Threads that share a world; none = what suits the adapter.
    pub world_threads: Option<usize>,
    /// Whether worlds have the CPU's bits.
    pub cpu_bits: bool,
    /// Where kernels are cut.
    pub cuts: Cuts,
    /// Limit on the compile time of a program.
    pub compile_limit: Duration,
}

/// Worlds of a group.
#[derive(Clone, Copy)]
struct Part {
    worlds: usize,
    numbering: Numbering,
    /// Groups that are still to be created, this one included: there must be memory for all.
    coming: usize,
    /// All groups.
    groups: usize,
}

/// One backend per group on the chosen adapter, each with a device of its own, so that none waits for another's batch.
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
                groups: groups.count,
            };
            Ok(Box::new(Gpu::new(model, part, layout, wanted)?))
        },
    );
    made.collect()
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
            groups,
        } = part;
        let device = Device::open(asked.adapter, asked.cache)?;
        check_frame(&device, layout.bytes as u64)?;
        let usual = || workgroups::of_world(device.info(), model.constants());
        let threads = match (asked.world_threads, asked.cpu_bits) {
            (None | Some(1), true) => 1,
            (Some(threads), true) => {
                let reason = format!(
                    "world_threads is {threads}, and so many add in another order than the processor: leave it out, or give 1"
                );
                return Err(BackendError::OtherBits { reason });
            }
            (threads, false) => threads.unwrap_or_else(usual),
        };
        let probe = || rounding::corrections(&device, asked.replay, asked.compile_limit);
        let corrections = asked.cpu_bits.then(probe).transpose()?;
        let constants = constants(model, threads, layout, asked.cpu_bits);
        let m = &constants;
        if asked.cpu_bits && m.contacts.are_stiff && m.contacts.rolled.is_some() {
            let reason = format!(
                "contacts can join many of the {} dofs and are stiff, which kernels solve otherwise than the processor",
                m.dofs.len()
            );
            return Err(BackendError::OtherBits { reason });
        }
        let info = device.info();
        if info.kind == AdapterKind::Software {
            check_software(m)?;
        }
        let how = How {
            limits: limits(info, threads, asked.cuts),
            lanes: threads,
            exchange: workgroups::exchange(info, threads),
            corrections,
        };
        let (programs, places, shown) = programs(m, layout, model.substeps(), how)?;
        let sensors = model.contact_sensors();
        let shapes = sensors.first().map_or(0, |sensor| sensor.of.len());
        let frame_s = model.substeps() as f64 * model.dt();
        let finds_contacts = finds_contacts(&shown);
        let outputs = OutputSources {
            show: show::show(&places, layout, frame_s, finds_contacts, asked.cpu_bits),
            contacts: show::contacts(m, &places, layout, shapes, asked.cpu_bits),
            finds_contacts,
        };
        let scatters = outputs.contacts.is_some();
        let room = Room::at_start(m);
        let threads = threads as u32;
        let width = sizing::widest(&device, m, &places, &room, worlds, threads);
        let extent = Extent { room, width };
        let count = (worlds as u64).div_ceil(u64::from(width));
        let needed = count * sizing::memory(m, &places, &extent) + 2 * layout.bytes as u64;
        check_memory(&device, coming * worlds, coming as u64 * needed)?;
        let recipe = Recipe {
            programs,
            outputs,
            runs: show::runs(m, &places, layout),
            pairs: sizing::pairs(m, sensors),
            threads,
            canonical: asked.cpu_bits,
            limit: asked.compile_limit,
            replay: asked.replay,
            groups,
        };
        let compiled = Compiled::new(&device, m, &places, &recipe, &extent)?;
        let frame = device.staging("frame", layout.bytes.max(64) as u64)?;
        // whole lines cross the bus best as they are written; contacts are written here and there. Arenas begin at a multiple of
        // `ARENA_ALIGN`, where a program can write only if the adapter binds buffers there
        let is_bound = device.info().binding_align <= ARENA_ALIGN;
        let is_apart = has_own_memory(&device) && (scatters || !is_bound);
        let drawn = is_apart.then(|| device.buffer("frame", layout.bytes.max(64) as u64));
        let drawn = drawn.transpose()?;
        let mut bounds = Bounds::new(&device)?;
        bounds.set_may_grow(extent.room.can_grow(m));
        let inputs = TileInputs {
            device: &device,
            constants: m,
            places: &places,
            compiled: &compiled,
            bounds: &bounds.buffer,
        };
        let target = (drawn.as_ref(), &*frame, layout.bytes as u64);
        let tiles = tiles(inputs, &recipe, &extent, std::iter::once(0..worlds), target)?;
        let shape = Shape::from_constants(m);
        let mut gpu = Gpu {
            shared: None,
            tiles,
            bounds,
            compiled,
            recipe,
            extent,
            frame,
            drawn,
            imports: device.info().imports,
            imported: Vec::new(),
            name: format!(
                "gpu ({}, {}{})",
                device.info().name,
                device.info().driver,
                if asked.cpu_bits {
                    "; bits of the CPU"
                } else {
                    ""
                }
            ),
            device,
            record: places.record(shape),
            start: start(model),
            draw: StartDraw::new(model),
            numbering,
            noise: Noise::new(model),
            faults: Faults::default(),
            mirror: HostMirror::new(worlds, m.varying.len()),
            layout: layout.clone(),
            places,
            constants,
            frame_s,
            lost: OnceLock::new(),
            copied: 0,
        };
        // padding lanes run along from the scene's start
        let all: Vec<usize> = (0..worlds).collect();
        gpu.mirror
            .fill_params(&gpu.start[shape.start(Array::Params)..]);
        gpu.pad(&gpu.tiles)?;
        gpu.begin(&all)?;
        Ok(gpu)
    }
}
