//! Kernels around the steps of a world: they save its state, note what it lacks, detect faults, age commands, and write rows from the
//! host.
//!
//! They move bits and compare them as integers, since WGSL may assume that no float is infinite or NaN. The CPU does the same in
//! `backend/cpu/faults.rs` and `delay.rs`.

use super::places::Places;
use sim_physics::arrays::{Array, status};
use sim_physics::constants::Constants;
use std::fmt::Write;
use std::ops::Range;

/// The word of the bounds that is 1 while worlds can get more room for contacts.
pub(in crate::backend::gpu) const MAY_GROW: usize = 2;

/// Head of every kernel. The counters are `step` (low and high word), `status`, `contacts_left_out`.
const HEAD: &str = "
override worlds: u32;
override workgroup: u32 = 64u;
@group(0) @binding(0) var<storage, read_write> fields: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read_write> counters: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read> bounds: array<u32>;
fn number(i: u32, w: u32) -> u32 { return fields[(i / 4u) * worlds + w][i % 4u]; }
fn put(i: u32, w: u32, x: u32) { fields[(i / 4u) * worlds + w][i % 4u] = x; }
@compute @workgroup_size(workgroup)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let w = id.x;
    if (w >= worlds) { return; }
";

/// Sets an array to 0.
fn clear(wgsl: &mut String, place: Range<u32>) {
    let (first, end) = (place.start / 4, place.end.div_ceil(4));
    let _ = writeln!(
        wgsl,
        "    for (var q = {first}u; q < {end}u; q++) {{ fields[q * worlds + w] = vec4<u32>(); }}"
    );
}

/// A binding for models whose worlds can get more room for contacts. Words 0 and 1 are 1 if a world had too little in the substeps, or in
/// the evaluation. Word 2 is the number of worlds.
const LACKS: &str =
    "@group(0) @binding(3) var<storage, read_write> lacks: array<atomic<u32>, 4>;\n";

/// The head of kernels for a model.
fn head(m: &Constants<f32>) -> String {
    match m.contacts.room_grows {
        true => LACKS.to_owned() + HEAD,
        false => HEAD.to_owned(),
    }
}

/// Before the substeps of a frame (`saves`), or before an evaluation alone.
pub(in crate::backend::gpu) fn begin(places: &Places, m: &Constants<f32>, saves: bool) -> String {
    let mut wgsl = head(m);
    if m.contacts.room_grows {
        wgsl += "    if (w == 0u) { atomicStore(&lacks[0], 0u); atomicStore(&lacks[1], 0u); }\n";
    }
    if saves {
        let (quads, before) = (places.moving / 4, places.before / 4);
        let _ = writeln!(
            wgsl,
            "    for (var q = 0u; q < {quads}u; q++) {{ fields[({before}u + q) * worlds + w] = fields[q * worlds + w]; }}"
        );
    }
    for slot in [Array::Unconverged, Array::LeftOut, Array::Substep] {
        clear(&mut wgsl, places.range(slot));
    }
    wgsl + "}\n"
}

/// After the substeps: a world that is not finite or beyond its bounds returns to the state before the frame and is frozen; the others
/// count a step. `counts`: nothing detects contacts after the substeps, so those that did not fit are counted here.
pub(in crate::backend::gpu) fn check_faults(
    places: &Places,
    m: &Constants<f32>,
    counts: bool,
) -> String {
    let mut wgsl = head(m);
    if m.contacts.room_grows {
        wgsl += "    if (atomicLoad(&lacks[0]) != 0u) {\n";
        restore(&mut wgsl, places);
        wgsl += "        return;\n    }\n";
    }
    wgsl += "    var lost = false;\n    var outside = false;\n";
    for (slot, bound) in [(Array::JointQ, 0), (Array::JointQd, 1)] {
        let Range { start, end } = places.range(slot);
        let _ = write!(
            wgsl,
            "    for (var i = {start}u; i < {end}u; i++) {{
        let size = number(i, w) & 0x7fffffffu;
        lost = lost || size >= 0x7f800000u;
        outside = outside || size > bounds[{bound}];
    }}
"
        );
    }
    let q = places.range(Array::JointQ).start;
    for first in m.quaternions() {
        let part = |k: usize| format!("bitcast<f32>(number({}u, w))", q + (first + k) as u32);
        // a rotation that overflows leaves a quaternion of zeros
        let _ = writeln!(
            wgsl,
            "    {{ let a = {}; let b = {}; let c = {}; let d = {};
      lost = lost || !(0.5 < fma(d, d, fma(c, c, fma(b, b, a * a)))); }}",
            part(0),
            part(1),
            part(2),
            part(3)
        );
    }
    let (not_finite, bounds, frozen) = (status::NOT_FINITE, status::OUT_OF_BOUNDS, status::FROZEN);
    let converged = status::NOT_CONVERGED;
    let unconverged = places.range(Array::Unconverged).start;
    let mut restored = String::new();
    restore(&mut restored, places);
    if m.contacts.room_grows {
        // the evaluation notes what the state that is kept lacks
        clear(&mut restored, places.range(Array::LeftOut));
    }
    let count = match counts {
        true => count_left_out(places),
        false => String::new(),
    };
    let _ = write!(
        wgsl,
        "    var count = counters[w];
    let stays = (count.z & {frozen}u) != 0u;
    count.z = count.z & ~{converged}u;
    if (!stays && number({unconverged}u, w) != 0u) {{ count.z = count.z | {converged}u; }}
    if (!stays && outside) {{ count.z = select({bounds}u, {not_finite}u, lost); }}
    if (!stays && lost) {{ count.z = {not_finite}u; }}
    if ((count.z & {frozen}u) != 0u) {{
{restored}    }} else {{
        count.x = count.x + 1u;
        if (count.x == 0u) {{ count.y = count.y + 1u; }}
    }}
{count}    counters[w] = count;
"
    );
    // outputs are a function of the state: the noise of the next frame is not drawn yet
    clear(&mut wgsl, places.range(Array::CommandNoise));
    age(&mut wgsl, places, m);
    wgsl + "}\n"
}

/// Sets a world to its state before the frame.
fn restore(wgsl: &mut String, places: &Places) {
    let (quads, before) = (places.moving / 4, places.before / 4);
    let _ = writeln!(
        wgsl,
        "        for (var q = 0u; q < {quads}u; q++) {{ fields[q * worlds + w] = fields[({before}u + q) * worlds + w]; }}"
    );
}

/// After the substeps (`lacking` is 0) or the evaluation (1): notes whether a world had too little room for contacts, while it may get
/// more. Padding is left out, and so are the substeps of frozen worlds, which are not kept.
pub(in crate::backend::gpu) fn note_room(places: &Places, m: &Constants<f32>) -> String {
    let (frozen, left_out) = (status::FROZEN, places.range(Array::LeftOut).start);
    let mut wgsl = "override lacking: u32;\n".to_owned() + &head(m);
    let _ = write!(
        wgsl,
        "    let had_less = w < atomicLoad(&lacks[2]) && bitcast<f32>(number({left_out}u, w)) > 0.0;
    let counts = lacking == 1u || (counters[w].z & {frozen}u) == 0u;
    if (bounds[{MAY_GROW}] != 0u && had_less && counts) {{ atomicStore(&lacks[lacking], 1u); }}
}}
"
    );
    wgsl
}

/// Makes the commands of this frame those of the frame before, in worlds that are not frozen.
fn age(wgsl: &mut String, places: &Places, m: &Constants<f32>) {
    if m.delay.frames == 0 {
        return;
    }
    let history = places.range(Array::CommandHistory);
    let dofs = m.dofs.len() as u32;
    let frozen = status::FROZEN;
    let _ = write!(
        wgsl,
        "    if ((count.z & {frozen}u) == 0u) {{
        for (var i = {end}u - 1u; i >= {second}u; i--) {{ put(i, w, number(i - {frame}u, w)); }}
",
        end = history.end,
        second = history.start + 3 * dofs,
        frame = 3 * dofs,
    );
    for (k, group) in [Array::JointF, Array::JointTargetQ, Array::JointTargetQd]
        .into_iter()
        .enumerate()
    {
        let _ = writeln!(
            wgsl,
            "        for (var i = 0u; i < {dofs}u; i++) {{ put({}u + i, w, number({}u + i, w)); }}",
            history.start + k as u32 * dofs,
            places.range(group).start,
        );
    }
    *wgsl += "    }\n";
    clear(wgsl, places.range(Array::Substep));
}

/// Counts in `count` the contacts that did not fit, after a detection of contacts that a world's state keeps.
pub(in crate::backend::gpu) fn count_left_out(places: &Places) -> String {
    let (frozen, bit) = (status::FROZEN, status::CONTACTS_LEFT_OUT);
    let left_out = places.range(Array::LeftOut).start;
    format!(
        "    count.w = select(u32(bitcast<f32>(number({left_out}u, w))), 0u, (count.z & {frozen}u) != 0u);
    count.z = select(count.z & ~{bit}u, count.z | {bit}u, count.w > 0u);
"
    )
}

/// Writes rows from the host: row j of `rows`, `columns` wide, becomes values `first..` of a world. The world is j or, where `listed` is
/// 1, entry j of the list. A thread writes a word: neighbours read neighbouring words.
pub(in crate::backend::gpu) const ROWS: &str = "
override worlds: u32;
override workgroup: u32 = 64u;
@group(0) @binding(0) var<storage, read_write> numbers: array<u32>;
@group(0) @binding(1) var<storage, read> rows: array<u32>;
// count, columns, first, listed, then the list
@group(0) @binding(2) var<storage, read> what: array<u32>;
@compute @workgroup_size(workgroup)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let columns = what[1];
    let end = what[0] * columns;
    for (var n = id.x; n < end; n += groups.x * workgroup) {
        let j = n / columns;
        var w = j;
        if (what[3] == 1u) { w = what[4u + j]; }
        let i = what[2] + n - j * columns;
        numbers[((i / 4u) * worlds + w) * 4u + i % 4u] = rows[n];
    }
}
";
