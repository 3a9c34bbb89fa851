//! Programs that write a frame: arrays of all worlds, world-major, out of a structure of arrays.

use super::bookkeeping;
use super::places::Places;
use super::workgroups::BOOKKEEPING;
use sim_physics::arrays::{Array, Field, Layout, Slot, Source};
use sim_physics::constants::Constants;
use sim_physics::constants::contact::row;
use std::fmt::Write;
use std::ops::Range;

/// Neighbouring numbers of a world that go to neighbouring places of its row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::backend::gpu) struct Run {
    /// First number.
    pub from: u32,
    /// Word of the frame at which it begins in the row of the first world.
    pub to: u32,
    /// How many; rows of neighbouring worlds follow each other.
    pub len: u32,
}

/// Is it a field that a program of its own makes of several arrays?
fn is_computed(field: Field) -> bool {
    matches!(field.row().source, Source::Computed(_))
}

/// The fields of a layout that programs of their own make of several arrays, with their values per world.
pub(in crate::backend::gpu) fn computed(layout: &Layout) -> Vec<(Field, usize)> {
    let slots = layout.slots.iter();
    let slots = slots.filter(|slot| is_computed(slot.field) && slot.bytes > 0);
    slots
        .map(|slot| (slot.field, slot.shape[1..].iter().product()))
        .collect()
}

/// The arrays that a field is copied from, after an evaluation has written them.
pub(in crate::backend::gpu) fn copied(field: Field) -> Vec<Array> {
    match field.row().source {
        Source::Array(array) => vec![array],
        Source::Contacts(arrays) => arrays.to_vec(),
        Source::Computed(_) | Source::Counter => Vec::new(),
    }
}

/// Is it a field that is made of the lists of contacts?
fn is_of_contacts(field: Field) -> bool {
    matches!(field.row().source, Source::Contacts(_))
}

/// Where the elements of a field's row come from; none for counters and contacts.
fn sources(
    m: &Constants<f32>,
    places: &Places,
    field: Field,
    elements: usize,
) -> Option<Range<u32>> {
    match field.row().source {
        // the accelerations of the state that is shown
        Source::Array(Array::JointQdd) => {
            Some(places.shown_qdd..places.shown_qdd + m.dofs.len() as u32)
        }
        Source::Array(array) => Some(places.range(array)),
        Source::Computed(_) => {
            let first = places.computed(field);
            Some(first..first + elements as u32)
        }
        Source::Contacts(_) | Source::Counter => None,
    }
}

/// What is copied of every world: a field's scalars lie side by side, here and there.
pub(in crate::backend::gpu) fn runs(
    m: &Constants<f32>,
    places: &Places,
    layout: &Layout,
) -> Vec<Run> {
    let mut runs = Vec::new();
    for array in layout.slots.iter().filter(|array| array.bytes > 0) {
        let elements: usize = array.shape[1..].iter().product();
        if let Some(from) = sources(m, places, array.field, elements) {
            assert_eq!(from.len(), elements, "a field is a whole array");
            runs.push(Run {
                from: from.start,
                to: array.offset as u32 / 4,
                len: from.end - from.start,
            });
        }
    }
    runs
}

/// Most words that a thread copies: 2^30 words of a frame then take 2^8 workgroups.
const WORDS_MAX: u32 = 1 << 16;

/// The table that [`SHOW`] reads, and how many workgroups it takes.
pub(in crate::backend::gpu) struct ShowTable {
    pub words: Vec<[u32; 4]>,
    pub groups: u32,
}

impl ShowTable {
    /// For the worlds of a tile. A thread copies at least `words` of a run.
    pub fn new(runs: &[Run], worlds: &Range<usize>, words: u32, groups_max: u32) -> ShowTable {
        let (first, shown) = (worlds.start as u32, worlds.len() as u32);
        let counting = shown.div_ceil(BOOKKEEPING);
        let groups = |run: &Run, words: u32| (run.len * shown).div_ceil(BOOKKEEPING * words);
        let mut words = words;
        let all = |words| runs.iter().map(|run| groups(run, words)).sum::<u32>() + counting;
        while all(words) > groups_max && words < WORDS_MAX {
            words *= 2;
        }
        let mut end = 0;
        let mut table = vec![[0; 4]; 2];
        for run in runs {
            table.push([run.from, run.to + first * run.len, run.len, end]);
            end += groups(run, words);
        }
        table[0] = [first, shown, runs.len() as u32, end];
        table[1][0] = words;
        ShowTable {
            words: table,
            groups: end + counting,
        }
    }
}

/// Copies runs of numbers into the frame, and writes the counters. A workgroup has a part of one run, so neighbouring threads write
/// neighbouring words; the last workgroups have a world per thread. `time` is `step` times the duration of a frame, rounded as a
/// processor rounds it. `counts`: the evaluation has found contacts, so those that did not fit are counted first. `canonical`: numbers
/// are as [`crate::canonical`] has them.
pub(in crate::backend::gpu) fn show(
    places: &Places,
    layout: &Layout,
    frame_s: f64,
    counts: bool,
    canonical: bool,
) -> String {
    let word = |field: Field| {
        let array = layout.slots.iter().find(|array| array.field == field);
        array.expect("counters are part of every frame").offset / 4
    };
    let count = match counts {
        true => bookkeeping::count_left_out(places) + "    counters[w] = count;\n",
        false => String::new(),
    };
    // frame_s = mantissa * 2^exponent
    let bits = frame_s.to_bits();
    let mantissa = (bits & ((1 << 52) - 1)) | (1 << 52);
    let exponent = (bits >> 52) as i64 - 1075;
    SHOW.replace("SHOWN", shown(canonical))
        .replace("ACCESS", if counts { "read_write" } else { "read" })
        .replace("COUNT_LEFT_OUT\n", &count)
        .replace("LOW", &format!("{}u", mantissa as u32))
        .replace("HIGH", &format!("{}u", (mantissa >> 32) as u32))
        .replace("EXPONENT", &format!("{}", exponent + 1023))
        .replace("AT_TIME", &format!("{}u", word(Field::Time)))
        .replace("AT_STEP", &format!("{}u", word(Field::Step)))
        .replace("AT_STATUS", &format!("{}u", word(Field::Status)))
        .replace("AT_LEFT_OUT", &format!("{}u", word(Field::ContactsLeftOut)))
}

/// What a number is in a frame: a function of its bits.
fn shown(canonical: bool) -> &'static str {
    match canonical {
        true => "fn shown(x: u32) -> u32 { return select(x, 0u, (x & 0x7f800000u) == 0u); }",
        false => "fn shown(x: u32) -> u32 { return x; }",
    }
}

const SHOW: &str = "
override worlds: u32;
override workgroup: u32 = 64u;
@group(0) @binding(0) var<storage, read> fields: array<u32>;
// first world of the tile, its worlds, runs, their workgroups; words of a thread; then a run each: from, to, len, first workgroup
@group(0) @binding(1) var<storage, read> what: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> frame: array<u32>;
@group(0) @binding(3) var<storage, ACCESS> counters: array<vec4<u32>>;
fn number(i: u32, w: u32) -> u32 { return fields[((i / 4u) * worlds + w) * 4u + i % 4u]; }
SHOWN
// a * b + c, low and high word
fn wide(a: u32, b: u32, c: u32) -> vec2<u32> {
    let al = a & 0xffffu; let ah = a >> 16u; let bl = b & 0xffffu; let bh = b >> 16u;
    let ll = al * bl;
    let m = ah * bl + (ll >> 16u);
    let n = al * bh + (m & 0xffffu);
    var low = (n << 16u) | (ll & 0xffffu);
    var high = ah * bh + (m >> 16u) + (n >> 16u);
    low = low + c;
    if (low < c) { high = high + 1u; }
    return vec2<u32>(low, high);
}
fn bit(p: vec4<u32>, i: u32) -> u32 { return (p[i / 32u] >> (i % 32u)) & 1u; }
// a whole number times the duration of a frame, as the bits of a double
fn time_of(low: u32, high: u32) -> vec2<u32> {
    if (low == 0u && high == 0u) { return vec2<u32>(); }
    var p = vec4<u32>();
    let a = wide(low, LOW, 0u);
    let b = wide(low, HIGH, a.y);
    let c = wide(high, LOW, b.x);
    var d = wide(high, HIGH, c.y);
    d.x = d.x + b.y;
    if (d.x < b.y) { d.y = d.y + 1u; }
    p = vec4<u32>(a.x, c.x, d.x, d.y);
    var top = 127u;
    loop {
        if (bit(p, top) == 1u) { break; }
        top = top - 1u;
    }
    // 53 bits from the top one on, to the nearest, ties to even
    let r = top - 52u;
    var m = vec2<u32>();
    for (var i = 0u; i < 53u; i++) {
        m[i / 32u] = m[i / 32u] | (bit(p, r + i) << (i % 32u));
    }
    var rest = 0u;
    for (var i = 0u; i + 1u < r; i++) { rest = rest | bit(p, i); }
    if (r > 0u && bit(p, r - 1u) == 1u && (rest == 1u || (m.x & 1u) == 1u)) {
        m.x = m.x + 1u;
        if (m.x == 0u) { m.y = m.y + 1u; }
        if (m.y == 0x200000u) { m = vec2<u32>(0u, 0x100000u); top = top + 1u; }
    }
    let exponent = u32(i32(top) + (EXPONENT));
    return vec2<u32>(m.x, (m.y & 0xfffffu) | (exponent << 20u));
}
fn show_counters(w: u32) {
    if (w >= what[0].y) { return; }
    let world = what[0].x + w;
    var count = counters[w];
COUNT_LEFT_OUT
    let time = time_of(count.x, count.y);
    frame[AT_TIME + 2u * world] = time.x;
    frame[AT_TIME + 2u * world + 1u] = time.y;
    frame[AT_STEP + 2u * world] = count.x;
    frame[AT_STEP + 2u * world + 1u] = count.y;
    frame[AT_STATUS + world] = count.z;
    frame[AT_LEFT_OUT + world] = count.w;
}
@compute @workgroup_size(workgroup)
fn main(@builtin(workgroup_id) at: vec3<u32>, @builtin(local_invocation_index) thread: u32) {
    let head = what[0];
    if (at.x >= head.w) {
        show_counters((at.x - head.w) * workgroup + thread);
        return;
    }
    var r = 2u;
    while (r <= head.z && what[r + 1u].w <= at.x) { r++; }
    let run = what[r];
    let words = what[1].x;
    let first = (at.x - run.w) * workgroup * words + thread;
    let end = min(head.y * run.z, first + workgroup * words);
    for (var n = first; n < end; n += workgroup) {
        let w = n / run.z;
        frame[run.y + n] = shown(number(run.x + n - w * run.z, w));
    }
}
";

/// Writes the fields of contacts: lists of each world by itself, one class after the other.
pub(in crate::backend::gpu) fn contacts(
    m: &Constants<f32>,
    places: &Places,
    layout: &Layout,
    shapes: usize,
    canonical: bool,
) -> Option<String> {
    let arrays: Vec<&Slot> = (layout.slots.iter())
        .filter(|array| is_of_contacts(array.field) && array.bytes > 0)
        .collect();
    if arrays.is_empty() {
        return None;
    }
    let (rows, counts) = (m.contacts.memory.rows, m.contacts.memory.counts);
    let mut text = format!(
        "
override worlds: u32;
override workgroup: u32 = 64u;
@group(0) @binding(0) var<storage, read> fields: array<vec4<f32>>;
@group(0) @binding(1) var<storage, read> scratch: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> what: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> frame: array<u32>;
// of each pair: two shapes, two links; then of each sensor and shape: 1 where it is of the sensor, 2 where against
@group(0) @binding(4) var<storage, read> pairs: array<vec4<i32>>;
@group(0) @binding(5) var<storage, read> indices: array<u32>;
fn kept(i: u32, w: u32) -> f32 {{ return scratch[(i / 4u) * worlds + w][i % 4u]; }}
fn at(row: u32, k: u32, w: u32) -> f32 {{ return kept({base}u + row * {stride}u + k, w); }}
fn three(row: u32, k: u32, w: u32) -> vec3<f32> {{ return vec3<f32>(at(row, k, w), at(row, k + 1u, w), at(row, k + 2u, w)); }}
{shown}
fn put(i: u32, x: f32) {{ frame[i] = shown(bitcast<u32>(x)); }}
fn put3(i: u32, x: vec3<f32>) {{ put(i, x.x); put(i + 1u, x.y); put(i + 2u, x.z); }}
fn add3(i: u32, x: vec3<f32>) {{
    put3(i, x + vec3<f32>(bitcast<f32>(frame[i]), bitcast<f32>(frame[i + 1u]), bitcast<f32>(frame[i + 2u])));
}}
@compute @workgroup_size(workgroup)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {{
    let w = id.x;
    if (w >= what[0].y) {{ return; }}
    let world = what[0].x + w;
    var n = 0u;
",
        shown = shown(canonical),
        base = rows.base,
        stride = rows.stride,
    );
    for array in &arrays {
        let width: usize = array.shape[1..].iter().product();
        let empty = match array.field {
            Field::ContactPair => "0xffffffffu",
            _ => "0u",
        };
        let _ = writeln!(
            text,
            "    for (var k = 0u; k < {width}u; k++) {{ frame[{}u + world * {width}u + k] = {empty}; }}",
            array.offset / 4
        );
    }
    for (k, class) in m.contacts.classes.iter().enumerate() {
        let reference = places.range(Array::Reference).start + 3 * class.trees.1 as u32;
        let table = m.contacts.handles.class_rows;
        let [first, capacity] = match m.contacts.room_grows {
            true => [0, 1].map(|i| format!("indices[{}]", table.base + k * table.stride + i)),
            false => [class.first, class.capacity].map(|rows| format!("{rows}u")),
        };
        let _ = write!(
            text,
            "    let end{k} = min(u32(kept({}u, w)), {capacity});
    for (var i = 0u; i < end{k}; i++) {{
        let row = {first} + i;
        let pair = pairs[u32(at(row, {}u, w))];
        let normal = three(row, {normal}u, w);
        let force = at(row, {force}u, w) * normal + at(row, {force}u + 1u, w) * three(row, {tangents}u, w)
            + at(row, {force}u + 2u, w) * three(row, {tangents}u + 3u, w);
",
            counts.base + k * counts.stride,
            row::PAIR,
            normal = row::NORMAL,
            force = row::FORCE,
            tangents = row::TANGENTS,
        );
        for array in &arrays {
            let (base, width) = (array.offset / 4, array.shape[1..].iter().product::<usize>());
            let first = format!("{base}u + world * {width}u");
            let _ = match array.field {
                Field::ContactCount => Ok(()),
                Field::ContactPos => writeln!(
                    text,
                    "        put3({first} + 3u * n, three(row, {}u, w) + vec3<f32>({}, {}, {}));",
                    row::POINT,
                    component(reference),
                    component(reference + 1),
                    component(reference + 2),
                ),
                Field::ContactNormal => writeln!(text, "        put3({first} + 3u * n, normal);"),
                Field::ContactForce => writeln!(text, "        put3({first} + 3u * n, force);"),
                Field::ContactDistance => {
                    writeln!(
                        text,
                        "        put({first} + n, at(row, {}u, w));",
                        row::DISTANCE
                    )
                }
                Field::ContactPair => writeln!(
                    text,
                    "        frame[{first} + 2u * n] = u32(pair.x); frame[{first} + 2u * n + 1u] = u32(pair.y);"
                ),
                Field::BodyContactForce => writeln!(
                    text,
                    "        if (pair.z >= 0) {{ add3({first} + 3u * u32(pair.z), -force); }}
        if (pair.w >= 0) {{ add3({first} + 3u * u32(pair.w), force); }}"
                ),
                _ => writeln!(
                    text,
                    "        for (var s = 0u; s < {sensors}u; s++) {{
            let a = pairs[{pairs}u + s * {shapes}u + u32(pair.x)].x;
            let b = pairs[{pairs}u + s * {shapes}u + u32(pair.y)].x;
            if ((b & 1) != 0 && (a & 2) != 0) {{ add3({first} + 3u * s, force); }}
            if ((a & 1) != 0 && (b & 2) != 0) {{ add3({first} + 3u * s, -force); }}
        }}",
                    sensors = width / 3,
                    pairs = m.contacts.pairs.len(),
                ),
            };
        }
        text += "        n = n + 1u;\n    }\n";
    }
    if let Some(array) = arrays.iter().find(|a| a.field == Field::ContactCount) {
        let _ = writeln!(text, "    frame[{}u + world] = n;", array.offset / 4);
    }
    Some(text + "}\n")
}

fn component(i: u32) -> String {
    let part = ["x", "y", "z", "w"][(i % 4) as usize];
    format!("fields[{}u * worlds + w].{part}", i / 4)
}
