//! Worlds that are left in a loop whose rounds are dispatched one by one: a list for each round, so that a round costs what its worlds cost.
//!
//! Two lists take turns, since a round reads one while the next one is written. Before it stand how many workgroups its worlds are,
//! and how many worlds: a place a round, all zeroed when the loop begins. The order in a list is that in which threads came; a world
//! does not notice where it stands.

use super::compiled::PHYSICS;
use crate::backend::BackendError;
use sim_device::{BatchBuilder, Buffer, Device, Program, Source};
use sim_record::split::Part;
use std::ops::Range;

/// Words of a place: workgroups, 1, 1, worlds.
const WORDS: u64 = 4;

/// Threads that zero the places.
const CLEARS: u32 = 64;

/// Zeroes the places of both lists.
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

/// Lists the worlds in which a field is 0: of all worlds.
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

/// The same, of the worlds of a list.
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

/// What both end with.
const ENLISTS: &str = "
    if (fields[(out / 4u) * worlds + world][out % 4u] == 0.0f) {
        let place = atomicAdd(&next[3], 1u);
        next_list[place] = world;
        atomicMax(&next[0], place / workgroup + 1u);
    }
}
";

/// A loop that is cut, by the field that is 0 in its worlds, and its rounds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Loop {
    out: u32,
    rounds: usize,
}

/// The loops of which lists are kept, each once.
pub(super) fn loops<'a>(orders: impl IntoIterator<Item = &'a Vec<Part>>) -> Vec<Loop> {
    let mut found: Vec<Loop> = Vec::new();
    for part in orders.into_iter().flatten() {
        let Part::Repeat { rounds, parts, out } = part else {
            continue;
        };
        match out {
            Some(out) if *rounds > 1 => {
                let (out, rounds) = (*out, *rounds);
                match found.iter_mut().find(|known| known.out == out) {
                    Some(known) => known.rounds = known.rounds.max(rounds),
                    None => found.push(Loop { out, rounds }),
                }
            }
            _ => found.extend(loops([parts])),
        }
    }
    found
}

/// Bytes from a place to the next one: programs see a place by itself.
fn stride(device: &Device) -> u64 {
    device.info().binding_align.max(4 * WORDS)
}

/// Places in a list, of the loop that has most rounds.
fn places(loops: &[Loop]) -> u64 {
    let rounds = loops.iter().map(|one| one.rounds as u64);
    rounds.max().unwrap_or(0).div_ceil(2)
}

/// The texts of [`Enlisting::new`], for tiles of `width` worlds.
pub(super) fn sources(device: &Device, loops: &[Loop], width: u32) -> Vec<Source> {
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
        ("places", places(loops)),
        ("workgroup", u64::from(CLEARS)),
    ];
    let mut sources = vec![source("clear lists", CLEAR.to_owned(), &constants)];
    for one in loops {
        let constants = [
            ("out", u64::from(one.out)),
            ("workgroup", u64::from(PHYSICS)),
        ];
        sources.push(source("list", FIRST.to_owned() + ENLISTS, &constants));
        sources.push(source("list again", AGAIN.to_owned() + ENLISTS, &constants));
    }
    sources
}

/// Of a loop the programs of its first list and of the others.
type Listing = (Loop, [Program; 2]);

/// Programs of the lists.
pub(super) struct Enlisting {
    /// The one that clears, and those of the loops.
    programs: Option<(Program, Vec<Listing>)>,
    places: u64,
}

impl Enlisting {
    /// From the programs of [`sources`], in their order.
    pub fn new(loops: Vec<Loop>, mut next: impl FnMut() -> Program) -> Enlisting {
        let places = places(&loops);
        let programs = (!loops.is_empty()).then(|| {
            let clear = next();
            let listing = loops.into_iter().map(|one| (one, [next(), next()]));
            (clear, listing.collect())
        });
        Enlisting { programs, places }
    }

    fn clear(&self) -> &Program {
        let (clear, _) = self.programs.as_ref().expect("there are loops");
        clear
    }

    fn of(&self, out: u32) -> &[Program; 2] {
        let mut loops = self.programs.iter().flat_map(|(_, loops)| loops);
        let found = loops.find(|(one, _)| one.out == out);
        found.map(|(_, programs)| programs).expect("a known loop")
    }

    /// Room for the lists of a tile, if there are any.
    pub fn room(&self, device: &Device, width: u32) -> Result<Option<Left>, BackendError> {
        if self.programs.is_none() {
            return Ok(None);
        }
        let stride = stride(device);
        let list = stride * self.places;
        let bytes = list + 4 * u64::from(width);
        Ok(Some(Left {
            buffers: [
                device.buffer("even rounds", bytes)?,
                device.buffer("odd rounds", bytes)?,
            ],
            stride,
            list,
        }))
    }
}

/// The lists of a tile.
pub(super) struct Left {
    buffers: [Buffer; 2],
    stride: u64,
    /// First byte of a list.
    list: u64,
}

type Bound<'a> = (u32, &'a Buffer, Range<u64>);

impl Left {
    /// The place of a round and its list, from binding `first` on.
    fn of(&self, round: usize, first: u32) -> [Bound<'_>; 2] {
        let (buffer, at) = self.groups(round);
        [
            (first, buffer, at..at + 4 * WORDS),
            (first + 1, buffer, self.list..buffer.bytes()),
        ]
    }

    /// What a kernel of a round sees of them.
    pub fn seen(&self, round: usize) -> [Bound<'_>; 2] {
        self.of(round, 4)
    }

    /// Where the number of workgroups of a round stands.
    pub fn groups(&self, round: usize) -> (&Buffer, u64) {
        (&self.buffers[round % 2], self.stride * (round as u64 / 2))
    }

    /// Lists the worlds of a loop's first round.
    pub fn begin(
        &self,
        batch: &mut BatchBuilder,
        enlisting: &Enlisting,
        out: u32,
        fields: &Buffer,
        groups: u32,
    ) {
        let [even, odd] = &self.buffers;
        let both = [(0, even, 0..self.list), (1, odd, 0..self.list)];
        batch.dispatch(enlisting.clear(), &both, 1);
        let [place, list] = self.of(0, 3);
        let seen = [(0, fields, 0..fields.bytes()), place, list];
        batch.dispatch(&enlisting.of(out)[0], &seen, groups);
    }

    /// Lists the worlds of the next round.
    pub fn go_on(
        &self,
        batch: &mut BatchBuilder,
        enlisting: &Enlisting,
        out: u32,
        fields: &Buffer,
        round: usize,
    ) {
        let ([left, list], [next, next_list]) = (self.of(round, 1), self.of(round + 1, 3));
        let seen = [(0, fields, 0..fields.bytes()), left, list, next, next_list];
        let (found, at) = self.groups(round);
        batch.dispatch_found(&enlisting.of(out)[1], &seen, found, at);
    }
}
