//! The SPIR-V of a program: how its sums are rounded, its loops are kept and its indices are bounded.

use crate::common::{PATIENCE, device};
use sim_device::{Source, translated};

/// A sum, difference, product, quotient and `fma`, two loops, and floats that become indices.
const PROGRAM: &str = "
    @group(0) @binding(0) var<storage, read_write> a: array<f32>;
    @compute @workgroup_size(32) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
        var x = a[id.x];
        for (var i = 0u; i < u32(x); i++) {
            for (var k = 0u; k < 3u; k++) { x = fma(x, a[k], x + 1.0) - x * x; }
            x = fma(x, x, 2.0) / a[u32(abs(x))];
        }
        a[id.x] = x;
    }";

fn source(wgsl: &str) -> Source {
    Source {
        label: "words".to_owned(),
        wgsl: wgsl.to_owned(),
        entry: "main".to_owned(),
        constants: Vec::new(),
    }
}

fn words(wgsl: &str) -> Vec<u32> {
    translated(&source(wgsl), true).expect("it is valid")
}

/// Opcode and operands of each instruction.
fn instructions(wgsl: &str) -> Vec<(u32, Vec<u32>)> {
    let words = words(wgsl);
    let mut rest = &words[5..];
    let mut instructions = Vec::new();
    while let Some(head) = rest.first() {
        let (instruction, others) = rest.split_at(*head as usize >> 16);
        instructions.push((head & 0xffff, instruction[1..].to_vec()));
        rest = others;
    }
    instructions
}

/// Results that are decorated with `NoContraction`.
fn exact(all: &[(u32, Vec<u32>)]) -> Vec<u32> {
    let decorated = all
        .iter()
        .filter(|(code, operands)| *code == 71 && operands[1] == 42);
    decorated.map(|(_, operands)| operands[0]).collect()
}

#[test]
fn sums_products_quotients_and_fma_are_rounded_as_written() {
    let all = instructions(PROGRAM);
    let exact = exact(&all);
    let (mut sums, mut fused) = (0, 0);
    for (code, operands) in &all {
        let is_sum = [129, 131, 133, 136].contains(code);
        let is_fused = *code == 12 && operands[3] == 50;
        assert!(
            !(is_sum || is_fused) || exact.contains(&operands[1]),
            "{code} {operands:?}"
        );
        sums += usize::from(is_sum);
        fused += usize::from(is_fused);
    }
    assert_eq!((sums, fused, exact.len()), (4, 2, 6));
}

#[test]
fn decorations_stand_before_all_types() {
    let codes: Vec<u32> = instructions(PROGRAM)
        .iter()
        .map(|(code, _)| *code)
        .collect();
    let last = codes.iter().rposition(|code| *code == 71).unwrap();
    let first = codes
        .iter()
        .position(|code| (19..=39).contains(code))
        .unwrap();
    assert!(last < first);
}

#[test]
fn loops_are_not_unrolled() {
    let all = instructions(PROGRAM);
    let controls: Vec<u32> = (all.iter())
        .filter(|(code, _)| *code == 246)
        .map(|(_, operands)| operands[2])
        .collect();
    assert_eq!(controls, [2, 2]);
}

#[test]
fn a_float_that_becomes_an_index_is_clamped_even_if_it_is_no_number() {
    let all = instructions(PROGRAM);
    let clamps = |which: u32| {
        let clamps = all
            .iter()
            .filter(|(code, operands)| *code == 12 && operands[3] == which);
        clamps.count()
    };
    assert_eq!((clamps(43), clamps(81)), (0, 2));
}

const SHUFFLE: &str = "enable subgroups;
    @group(0) @binding(0) var<storage, read_write> a: array<f32>;
    @compute @workgroup_size(32) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
        var x = a[id.x];
        x += subgroupShuffleXor(x, 1u);
        x += subgroupShuffleDown(x, 2u);
        a[id.x] = x;
    }";

#[test]
fn shuffles_of_a_subgroup_ask_for_their_capabilities() {
    const CAPABILITY: u32 = 17;
    let all = instructions(SHUFFLE);
    for capability in [65, 66] {
        assert!(
            all.contains(&(CAPABILITY, vec![capability])),
            "{capability}"
        );
    }
    for code in [346, 348] {
        assert!(all.iter().any(|(opcode, _)| *opcode == code), "{code}");
    }
    assert_eq!(words(SHUFFLE)[1], 0x1_0300, "SPIR-V 1.3");
}

#[test]
fn shuffles_are_refused_where_the_device_has_none() {
    let refused = translated(&source(SHUFFLE), false).unwrap_err();
    assert!(refused.to_lowercase().contains("subgroup"), "{refused}");
    let device = device();
    let made = device.programs(&[source(SHUFFLE)], PATIENCE);
    assert_eq!(made.is_ok(), device.info().shuffles);
    assert!(device.info().subgroup_min <= device.info().subgroup_max);
}

#[test]
fn a_barrier_of_a_subgroup_orders_storage_buffers() {
    const SOURCE: &str = "
        @group(0) @binding(0) var<storage, read_write> a: array<f32>;
        @compute @workgroup_size(32) fn main(@builtin(global_invocation_id) id: vec3<u32>) {
            a[id.x] = 136.0;
            subgroupBarrier();
            a[id.x] = a[id.x ^ 136u];
            subgroupBarrier();
        }";
    const CONSTANT: u32 = 43;
    const CONTROL_BARRIER: u32 = 224;
    let all = instructions(SOURCE);
    let values: Vec<(u32, u32)> = (all.iter())
        .filter(|(code, operands)| *code == CONSTANT && operands.len() == 3)
        .map(|(_, operands)| (operands[1], operands[2]))
        .collect();
    let barriers = all.iter().filter(|(code, _)| *code == CONTROL_BARRIER);
    let semantics: Vec<u32> = barriers.map(|(_, operands)| operands[2]).collect();
    assert_eq!(semantics.len(), 2);
    for id in semantics {
        let constants: Vec<u32> = values
            .iter()
            .filter(|constant| constant.0 == id)
            .map(|constant| constant.1)
            .collect();
        // acquire and release, storage buffers, memory of the subgroup
        assert_eq!(constants, [0x8 | 0x40 | 0x80]);
    }
    // the index is what it was
    assert!(values.iter().any(|(_, value)| *value == 136));
    assert!(words(SOURCE)[3] > values.iter().map(|constant| constant.0).max().unwrap());
}
