//! What a driver rounds as the processor does: a program computes samples, which are compared bit by bit.

use crate::backend::BackendError;
use crate::random::philox;
use sim_device::{Device, Replay, Source};
use sim_record::wgsl::Corrections;
use std::time::Duration;

/// Samples; a driver that rounds otherwise errs in a tenth of them.
const SAMPLES: usize = 4096;
/// Threads of a workgroup.
const GROUP: usize = 64;
/// What is computed of each sample, for errors.
const NAMES: [&str; 6] = [
    "a * b + c",
    "the rest of a sum",
    "fma",
    "quotients",
    "reciprocals",
    "square roots",
];
/// Exponents of samples are smaller: of most, where sums cancel, and of others.
const EXPONENTS: [u32; 2] = [8, 60];
/// Numbers beside which a driver errs first: powers of 2 and 4.
const POWERS: [f32; 3] = [1.0, 2.0, 4.0];
/// `fma` of these, computed in doubles, lies halfway between two floats, but the exact sum does not.
const HALFWAY: [f32; 3] = [
    1.0 + f32::EPSILON,
    1.0 - f32::EPSILON,
    (1 << 24) as f32 + 2.0,
];

/// The corrections that give this device the processor's bits.
///
/// # Errors
/// A device that rounds otherwise even so; a device that is lost.
pub(super) fn corrections(
    device: &Device,
    replay: Replay,
    limit: Duration,
) -> Result<Corrections, BackendError> {
    let samples = samples();
    let differ = |corrections| differ(device, &samples, corrections, (replay, limit));
    let refuse = |what: String| {
        let adapter = &device.info().name;
        let reason = format!("the driver of {adapter} {what}");
        Err(BackendError::OtherBits { reason })
    };
    let otherwise = |name: &str| refuse(format!("rounds {name} otherwise than the processor"));
    let [sums, rests, fma, quotients, reciprocals, root] = differ(Corrections::default())?;
    let corrections = Corrections {
        fma,
        quotient: quotients || reciprocals,
        root,
    };
    if sums || rests {
        return otherwise(NAMES[usize::from(!sums)]);
    }
    if fma && !device.info().doubles {
        return refuse("rounds fma twice, and has no 64-bit floats to correct that".to_owned());
    }
    if corrections == Corrections::default() {
        return Ok(corrections);
    }
    let still = differ(corrections)?;
    match NAMES.iter().zip(still).find(|(_, differs)| *differs) {
        Some((name, _)) => otherwise(name),
        None => Ok(corrections),
    }
}

/// Three numbers, whose bits are random, or that are easily rounded otherwise.
fn samples() -> Vec<[f32; 3]> {
    let number = |bits: u32, most: u32| {
        let exponent = 127 - most + (bits >> 23) % (2 * most);
        f32::from_bits(bits & 0x807f_ffff | exponent << 23)
    };
    let sample = |k: u32| {
        let [a, b, c, _] = philox([k, 0, 0, 0], [0, 0]);
        let most = EXPONENTS[usize::from(k.is_multiple_of(4))];
        [a, b, c].map(|bits| number(bits, most))
    };
    let near = POWERS.map(f32::to_bits);
    let near = near.map(|bits| (bits - 4..bits + 5).map(f32::from_bits));
    let near: Vec<f32> = near.into_iter().flatten().collect();
    let pairs = near.iter().flat_map(|a| near.iter().map(|b| [*a, *b, *a]));
    let mut samples = vec![HALFWAY, [1.0, 2.0, 0.0]];
    samples.extend(pairs);
    let random = SAMPLES - samples.len();
    samples.extend((0..random as u32).map(sample));
    samples
}

/// What the processor computes of a sample, by [`NAMES`].
fn nearest([a, b, c]: [f32; 3]) -> [f32; NAMES.len()] {
    [
        a * b + c,
        b - ((a + b) - a),
        a.mul_add(b, c),
        a / b,
        1.0 / b,
        c.abs().sqrt(),
    ]
}

/// The program that computes the same on a device.
fn source(corrections: Corrections) -> Source {
    let (fma, root) = (corrections.fma(), corrections.root());
    let [quotient, reciprocal] = ["a", "1.0f"].map(|a| corrections.quotient(a, "b"));
    let results = NAMES.len();
    Source {
        label: "rounding".to_owned(),
        wgsl: format!(
            "@group(0) @binding(0) var<storage, read> samples: array<f32>;
@group(0) @binding(1) var<storage, read_write> results: array<f32>;
{functions}
@compute @workgroup_size({GROUP})
fn main(@builtin(global_invocation_id) thread: vec3<u32>) {{
    let k = thread.x;
    let a = samples[3u * k];
    let b = samples[3u * k + 1u];
    let c = samples[3u * k + 2u];
    let first = {results}u * k;
    results[first] = a * b + c;
    results[first + 1u] = b - ((a + b) - a);
    results[first + 2u] = {fma}(a, b, c);
    results[first + 3u] = {quotient};
    results[first + 4u] = {reciprocal};
    results[first + 5u] = {root}(abs(c));
}}
",
            functions = corrections.functions()
        ),
        entry: "main".to_owned(),
        constants: Vec::new(),
    }
}

/// Which results differ from the processor's.
fn differ(
    device: &Device,
    samples: &[[f32; 3]],
    corrections: Corrections,
    (replay, limit): (Replay, Duration),
) -> Result<[bool; NAMES.len()], BackendError> {
    let program = device.programs(&[source(corrections)], limit)?.remove(0);
    let given: &[u8] = bytemuck::cast_slice(samples);
    let results_bytes = 4 * NAMES.len() * samples.len();
    let from = device.staging("samples", given.len() as u64)?;
    from.write().copy_from_slice(given);
    let to = device.staging("results", results_bytes as u64)?;
    let mut batch = device.batch(replay);
    let ranges = [(0, &from, given.len()), (1, &to, results_bytes)];
    let bindings = ranges.map(|(number, memory, bytes)| (number, &**memory, 0..bytes as u64));
    batch.dispatch(&program, &bindings, (samples.len() / GROUP) as u32);
    device.run(&[&batch.finish()?])?;
    let mut differs = [false; NAMES.len()];
    let read = to.read();
    let results: &[[u32; NAMES.len()]] = bytemuck::cast_slice(&read[..results_bytes]);
    for (sample, got) in samples.iter().zip(results) {
        for (k, x) in nearest(*sample).into_iter().enumerate() {
            differs[k] |= x.to_bits() != got[k];
        }
    }
    Ok(differs)
}
