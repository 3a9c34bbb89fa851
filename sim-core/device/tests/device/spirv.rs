//! The SPIR-V of a program: how its sums are rounded, its loops are kept and its indices are bounded.

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

/// Opcode and operands of each instruction.
fn instructions(wgsl: &str) -> Vec<(u32, Vec<u32>)> {
    let source = Source {
        label: "words".to_owned(),
        wgsl: wgsl.to_owned(),
        entry: "main".to_owned(),
        constants: Vec::new(),
    };
    let words = translated(&source).expect("it is valid");
    let mut rest = &words[5..];
    let mut found = Vec::new();
    while let Some(head) = rest.first() {
        let (this, others) = rest.split_at(*head as usize >> 16);
        found.push((head & 0xffff, this[1..].to_vec()));
        rest = others;
    }
    found
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
