//! Lists of the active worlds of a split loop, one list per iteration, so that an iteration costs what its active worlds cost.
//!
//! The software driver's kernels are split inside the solver's loop (`Limits::repeated`), and each kernel is then dispatched once per
//! iteration. After an iteration a kernel compacts the list: it appends every world that is still in the loop to the other list.
//!
//! There are two lists, since an iteration reads one while the next one is written. In front of them stand the number of workgroups and
//! the number of worlds of every iteration, all cleared when the loop begins. The order in a list is the order in which threads
//! arrive. It does not affect results.

use crate::backend::BackendError;
use crate::backend::gpu::kernels::workgroups;
use sim_device::{BatchBuilder, Buffer, Device, Program, Source};
use sim_record::split::Part;
use std::ops::Range;

/// Words of a header: workgroups, 1, 1, worlds.
const HEADER: u64 = 4;

/// Threads that clear the headers.
const CLEAR_THREADS: u32 = 64;

/// Clears the headers of both lists.
const CLEAR: &str = "
override worlds: u32;
override workgroup: u32 = 64u;
override stride: u32;
override places: u32;
@group(0) @binding(0) var<storage, read_write> even: array<u32>;
@group(0) @binding(1) var<storage, read_write> odd: array<u32>;
@compute @workgroup_size(workgroup)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    for (var k = id.x; k < places; k += workgroup) {
        let at = k * stride;
        even[at] = 0u; even[at + 1u] = 1u; even[at + 2u] = 1u; even[at + 3u] = 0u;
        odd[at] = 0u; odd[at + 1u] = 1u; odd[at + 2u] = 1u; odd[at + 3u] = 0u;
    }
}
";

/// Lists the worlds, of all worlds, in which a field is 0.
const FIRST: &str = "
override worlds: u32;
override workgroup: u32 = 32u;
override out: u32;
@group(0) @binding(0) var<storage, read> fields: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> next: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> next_list: array<u32>;
@compute @workgroup_size(workgroup)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let world = id.x;
    if (world >= worlds) { return; }
";

/// Lists the worlds of a list in which a field is 0.
const AGAIN: &str = "
override worlds: u32;
override workgroup: u32 = 32u;
override out: u32;
@group(0) @binding(0) var<storage, read> fields: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> left: array<u32>;
@group(0) @binding(2) var<storage, read> list: array<u32>;
@group(0) @binding(3) var<storage, read_write> next: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> next_list: array<u32>;
@compute @workgroup_size(workgroup)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= left[3]) { return; }
    let world = list[id.x];
";

/// End of both kernels: appends the world.
const APPEND: &str = "
    if (fields[(out / 4u) * worlds + world][out % 4u] == 0.0f) {
        let place = atomicAdd(&next[3], 1u);
        next_list[place] = world;
        atomicMax(&next[0], place / workgroup + 1u);
    }
}
";

/// A split loop.
#[derive(Clone, Copy, Debug)]
pub(in crate::backend::gpu) struct Loop {
    /// The field that is 0 in the worlds that are in the loop.
    exited: u32,
    iterations: usize,
}

/// The split loops of some orders of dispatch, without repetition.
pub(in crate::backend::gpu) fn loops<'a>(
    orders: impl IntoIterator<Item = &'a Vec<Part>>,
) -> Vec<Loop> {
    let mut distinct: Vec<Loop> = Vec::new();
    for part in orders.into_iter().flatten() {
        let Part::Repeat {
            iterations,
            parts,
            exited,
        } = part
        else {
            continue;
        };
        match exited {
            Some(exited) if *iterations > 1 => {
                let (exited, iterations) = (*exited, *iterations);
                match distinct.iter_mut().find(|known| known.exited == exited) {
                    Some(known) => known.iterations = known.iterations.max(iterations),
                    None => distinct.push(Loop { exited, iterations }),
                }
            }
            _ => distinct.extend(loops([parts])),
        }
    }
    distinct
}

/// Bytes from one header to the next: a program binds one header alone.
fn stride(device: &Device) -> u64 {
    device.info().binding_align.max(4 * HEADER)
}

/// Headers per list: half the iterations of the longest loop.
fn headers(loops: &[Loop]) -> u64 {
    let iterations = loops.iter().map(|entry| entry.iterations as u64);
    iterations.max().unwrap_or(0).div_ceil(2)
}

/// Kernel sources of [`Compaction::new`], for tiles of `width` worlds.
pub(in crate::backend::gpu) fn sources(device: &Device, loops: &[Loop], width: u32) -> Vec<Source> {
    let source = |label: &str, wgsl: String, constants: &[(&str, u64)]| Source {
        label: label.to_owned(),
        wgsl,
        entry: "main".to_owned(),
        constants: (constants.iter().chain(&[("worlds", u64::from(width))]))
            .map(|(name, value)| ((*name).to_owned(), *value as f64))
            .collect(),
    };
    if loops.is_empty() {
        return Vec::new();
    }
    let constants = [
        ("stride", stride(device) / 4),
        ("places", headers(loops)),
        ("workgroup", u64::from(CLEAR_THREADS)),
    ];
    let mut sources = vec![source("clear lists", CLEAR.to_owned(), &constants)];
    for entry in loops {
        let constants = [
            ("out", u64::from(entry.exited)),
            ("workgroup", u64::from(workgroups::physics(device.info()))),
        ];
        sources.push(source("list", FIRST.to_owned() + APPEND, &constants));
        sources.push(source("list again", AGAIN.to_owned() + APPEND, &constants));
    }
    sources
}

/// A loop, and the programs of its first list and of the others.
type ListPrograms = (Loop, [Program; 2]);

/// Programs that make the lists.
#[derive(Clone)]
pub(in crate::backend::gpu) struct Compaction {
    /// The program that clears, and those of the loops.
    programs: Option<(Program, Vec<ListPrograms>)>,
    headers: u64,
}

impl Compaction {
    /// From the programs of [`sources`], in their order.
    pub fn new(loops: Vec<Loop>, mut next: impl FnMut() -> Program) -> Compaction {
        let headers = headers(&loops);
        let programs = (!loops.is_empty()).then(|| {
            let clear = next();
            let programs = loops.into_iter().map(|entry| (entry, [next(), next()]));
            (clear, programs.collect())
        });
        Compaction { programs, headers }
    }

    fn clear(&self) -> &Program {
        let (clear, _) = self.programs.as_ref().expect("there are loops");
        clear
    }

    fn list_programs(&self, exited: u32) -> &[Program; 2] {
        let mut loops = self.programs.iter().flat_map(|(_, loops)| loops);
        let entry = loops.find(|(entry, _)| entry.exited == exited);
        entry.map(|(_, programs)| programs).expect("a known loop")
    }

    /// Buffers for the lists of a tile, if there are any.
    pub fn allocate(
        &self,
        device: &Device,
        width: u32,
    ) -> Result<Option<ActiveWorlds>, BackendError> {
        if self.programs.is_none() {
            return Ok(None);
        }
        let stride = stride(device);
        let list = stride * self.headers;
        let bytes = list + 4 * u64::from(width);
        Ok(Some(ActiveWorlds {
            buffers: [
                device.buffer("even iterations", bytes)?,
                device.buffer("odd iterations", bytes)?,
            ],
            stride,
            list,
        }))
    }
}

/// The lists of a tile.
pub(in crate::backend::gpu) struct ActiveWorlds {
    buffers: [Buffer; 2],
    stride: u64,
    /// First byte of a list.
    list: u64,
}

type Bound<'a> = (u32, &'a Buffer, Range<u64>);

impl ActiveWorlds {
    /// Header and list of an iteration, from binding `first` on.
    fn header_and_list(&self, iteration: usize, first: u32) -> [Bound<'_>; 2] {
        let (buffer, at) = self.groups(iteration);
        [
            (first, buffer, at..at + 4 * HEADER),
            (first + 1, buffer, self.list..buffer.bytes()),
        ]
    }

    /// Bindings of a kernel of an iteration.
    pub fn bindings(&self, iteration: usize) -> [Bound<'_>; 2] {
        self.header_and_list(iteration, 4)
    }

    /// Where the number of workgroups of an iteration stands.
    pub fn groups(&self, iteration: usize) -> (&Buffer, u64) {
        (
            &self.buffers[iteration % 2],
            self.stride * (iteration as u64 / 2),
        )
    }

    /// Lists the worlds of a loop's first iteration.
    pub fn begin(
        &self,
        batch: &mut BatchBuilder,
        compaction: &Compaction,
        exited: u32,
        fields: &Buffer,
        groups: u32,
    ) {
        let [even, odd] = &self.buffers;
        let both = [(0, even, 0..self.list), (1, odd, 0..self.list)];
        batch.dispatch(compaction.clear(), &both, 1);
        let [header, list] = self.header_and_list(0, 3);
        let bindings = [(0, fields, 0..fields.bytes()), header, list];
        batch.dispatch(&compaction.list_programs(exited)[0], &bindings, groups);
    }

    /// Lists the worlds of the next iteration.
    pub fn compact(
        &self,
        batch: &mut BatchBuilder,
        compaction: &Compaction,
        exited: u32,
        fields: &Buffer,
        iteration: usize,
    ) {
        let ([header, list], [next, next_list]) = (
            self.header_and_list(iteration, 1),
            self.header_and_list(iteration + 1, 3),
        );
        let bindings = [
            (0, fields, 0..fields.bytes()),
            header,
            list,
            next,
            next_list,
        ];
        let (groups, at) = self.groups(iteration);
        batch.dispatch_found(&compaction.list_programs(exited)[1], &bindings, groups, at);
    }
}
