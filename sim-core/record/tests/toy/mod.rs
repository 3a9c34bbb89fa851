//! Texts of tests, and what runs and checks them.
#![allow(dead_code, unused_imports)] // each test binary uses its part

pub mod contacts;
mod program;

pub use program::*;

use sim_physics::lane::memory::Cpu;
use sim_physics::lane::{Lane, Real, Tables};
use sim_record::Recording;
use sim_record::split::{Limits, Prices, Split, split};
use sim_record::wgsl::ProgramOptions;

/// SplitMix64 (Steele, Lea and Flood 2014): the same numbers from a seed on every computer.
pub struct Random(pub u64);

impl Random {
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }
    /// Uniform in [-1, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Runs any code on the CPU, `F::WIDTH` worlds at a time, with scratch memory full of zeros.
#[inline(always)]
pub fn on_cpu_with<F: Lane, const N: usize>(
    worlds: &[[F::Real; N]],
    scratch: usize,
    tables: &Tables<F::Real>,
    text: impl Fn(&mut Cpu<'_, F>, &[F]) -> Vec<F>,
) -> Vec<Vec<F::Real>> {
    let mut results = Vec::new();
    for block in worlds.chunks(F::WIDTH) {
        // a block that is not full repeats its first world
        let lane = |i: usize, k: usize| block.get(i).unwrap_or(&block[0])[k];
        let inputs: Vec<F> = (0..N)
            .map(|k| F::load(&(0..F::WIDTH).map(|i| lane(i, k)).collect::<Vec<_>>()))
            .collect();
        let mut memory = vec![F::c(0.0); scratch];
        let outputs = text(&mut Cpu::new(&mut memory, tables), &inputs);
        let mut columns = vec![F::Real::default(); F::WIDTH];
        let first = results.len();
        results.resize(first + block.len(), Vec::new());
        for x in outputs {
            x.store(&mut columns);
            for (world, x) in results[first..].iter_mut().zip(&columns) {
                world.push(*x);
            }
        }
    }
    results
}

/// Worlds with random numbers in [-2, 2), some exactly 0 or 1.
pub fn worlds<const N: usize>(random: &mut Random, n: usize) -> Vec<[f32; N]> {
    let mut number = || match random.below(8) {
        0 => 0.0,
        1 => 1.0,
        _ => random.unit() as f32 * 2.0,
    };
    (0..n).map(|_| std::array::from_fn(|_| number())).collect()
}

/// Bits of finite numbers, with one zero only: folding may turn -0 into 0.
pub fn bits(x: f32) -> u32 {
    assert!(x.is_finite());
    (x + 0.0).to_bits()
}

/// Parses and validates a shader without optional capabilities; panics with its source.
pub fn validated(wgsl: &str) -> naga::Module {
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    let module = naga::front::wgsl::parse_str(wgsl)
        .unwrap_or_else(|e| panic!("{}\n{wgsl}", e.emit_to_string(wgsl)));
    // naga cannot know which threads share a world, and so branch alike
    let flags = ValidationFlags::all() - ValidationFlags::CONTROL_FLOW_UNIFORMITY;
    Validator::new(
        flags,
        Capabilities::SUBGROUP | Capabilities::SUBGROUP_BARRIER | Capabilities::FLOAT64,
    )
    .validate(&module)
    .unwrap_or_else(|e| panic!("{}\n{wgsl}", e.emit_to_string(wgsl)));
    module
}

/// A recording as kernels of at most a cost, whose programs are valid; what crosses goes after the outputs.
pub fn in_kernels(recording: &Recording, most: usize) -> Split {
    let spare = (recording.inputs() + recording.outputs()) as u32;
    let limits = Limits {
        kernel: most,
        repeated: most,
        repeated_dispatch: 0,
        dispatch: 0,
        prices: Prices::SOFTWARE,
    };
    let split = split(recording, &ProgramOptions::default(), limits, spare);
    for kernel in &split.kernels {
        validated(&kernel.wgsl());
    }
    split
}
