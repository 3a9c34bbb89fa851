//! Evaluates a network, compiled for each instruction set: all have the same bits.
//!
//! A register holds 16 outputs of one row, so that a single row is as quick as many. A tile of rows shares the loads of
//! weights. Each sum begins with the bias and runs over the inputs in order, with fused multiplications.

use crate::activation;
use crate::network::{Layer, Network};

/// Outputs side by side.
pub(crate) const GROUP: usize = 16;
/// Rows that share the loads of weights.
const TILE: usize = 4;

/// A layer as the kernel takes it.
#[derive(Clone, Debug)]
pub(crate) enum Packed {
    /// Weights of each group of outputs, `(groups, 1 + inputs, GROUP)`: the biases, then by input.
    Linear { inputs: usize, groups: Vec<f32> },
    /// Any other layer, with its parameters.
    Other(Layer, Vec<f32>),
}

/// A network for the kernel.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub(crate) layers: Vec<Packed>,
    /// Values that a row takes at most between layers, whole groups.
    pub(crate) widest: usize,
}

impl Plan {
    pub(crate) fn new(network: &Network) -> Plan {
        let mut widest = network.inputs();
        let layers = network.with_parameters().map(|(layer, parameters)| {
            let Layer::Linear { inputs, outputs } = layer else {
                return Packed::Other(layer, parameters.to_vec());
            };
            widest = widest.max(outputs);
            let (weights, biases) = parameters.split_at(inputs * outputs);
            let mut groups = vec![0.0; outputs.div_ceil(GROUP) * (1 + inputs) * GROUP];
            for output in 0..outputs {
                let group = &mut groups[output / GROUP * (1 + inputs) * GROUP..];
                group[output % GROUP] = biases[output];
                for input in 0..inputs {
                    group[(1 + input) * GROUP + output % GROUP] = weights[output * inputs + input];
                }
            }
            Packed::Linear { inputs, groups }
        });
        Plan {
            layers: layers.collect(),
            widest: widest.next_multiple_of(GROUP),
        }
    }

    /// Values of memory that a call needs.
    pub(crate) fn scratch(&self) -> usize {
        2 * TILE * self.widest
    }
}

/// Rows in, rows out, and memory in between.
pub(crate) struct Rows<'a> {
    pub(crate) inputs: &'a [f32],
    pub(crate) outputs: &'a mut [f32],
    pub(crate) scratch: &'a mut [f32],
}

/// Evaluates rows of `inputs` values into rows of `outputs` values.
#[inline(always)]
fn evaluate(plan: &Plan, inputs: usize, outputs: usize, rows: &mut Rows<'_>) {
    let taken = rows.inputs.chunks(TILE * inputs);
    for (taken, given) in taken.zip(rows.outputs.chunks_mut(TILE * outputs)) {
        let count = taken.len() / inputs;
        let (mut from, mut to) = rows.scratch.split_at_mut(TILE * plan.widest);
        for row in 0..count {
            from[row * plan.widest..][..inputs].copy_from_slice(&taken[row * inputs..][..inputs]);
        }
        let mut size = inputs;
        for layer in &plan.layers {
            match layer {
                Packed::Linear { inputs, groups } => {
                    let step = (1 + inputs) * GROUP;
                    for (group, weights) in groups.chunks_exact(step).enumerate() {
                        match count {
                            TILE => linear::<TILE>(weights, from, to, plan.widest, group),
                            _ => (0..count).for_each(|row| {
                                let start = row * plan.widest;
                                linear::<1>(
                                    weights,
                                    &from[start..],
                                    &mut to[start..],
                                    plan.widest,
                                    group,
                                );
                            }),
                        }
                    }
                    size = groups.len() / step * GROUP;
                    (from, to) = (to, from);
                }
                Packed::Other(layer, parameters) => {
                    for row in 0..count {
                        activation::apply(
                            *layer,
                            parameters,
                            &mut from[row * plan.widest..][..size],
                        );
                    }
                }
            }
        }
        for row in 0..count {
            given[row * outputs..][..outputs]
                .copy_from_slice(&from[row * plan.widest..][..outputs]);
        }
    }
}

/// One group of outputs of some rows.
#[inline(always)]
fn linear<const ROWS: usize>(
    weights: &[f32],
    from: &[f32],
    to: &mut [f32],
    stride: usize,
    group: usize,
) {
    let (weights, _) = weights.as_chunks::<GROUP>();
    let (biases, weights) = (&weights[0], &weights[1..]);
    let rows: [&[f32]; ROWS] = std::array::from_fn(|row| &from[row * stride..][..weights.len()]);
    let mut sums = [*biases; ROWS];
    for (input, weights) in weights.iter().enumerate() {
        for row in 0..ROWS {
            let x = rows[row][input];
            for lane in 0..GROUP {
                sums[row][lane] = weights[lane].mul_add(x, sums[row][lane]);
            }
        }
    }
    for row in 0..ROWS {
        to[row * stride + group * GROUP..][..GROUP].copy_from_slice(&sums[row]);
    }
}

/// One compiled version.
pub(crate) type Compiled = fn(&Plan, usize, usize, &mut Rows<'_>);

/// The version for this processor.
pub(crate) fn compiled() -> Compiled {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
        fn avx512(plan: &Plan, inputs: usize, outputs: usize, rows: &mut Rows<'_>) {
            evaluate(plan, inputs, outputs, rows);
        }
        #[target_feature(enable = "avx2,fma")]
        fn avx2(plan: &Plan, inputs: usize, outputs: usize, rows: &mut Rows<'_>) {
            evaluate(plan, inputs, outputs, rows);
        }
        let has_avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        let has_avx512 = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
            && is_x86_feature_detected!("avx512bw");
        if has_avx2 && has_avx512 {
            // SAFETY: the processor has the instructions
            return |plan, inputs, outputs, rows| unsafe { avx512(plan, inputs, outputs, rows) };
        }
        if has_avx2 {
            // SAFETY: as above
            return |plan, inputs, outputs, rows| unsafe { avx2(plan, inputs, outputs, rows) };
        }
    }
    portable
}

/// The version for any processor.
pub(crate) fn portable(plan: &Plan, inputs: usize, outputs: usize, rows: &mut Rows<'_>) {
    evaluate(plan, inputs, outputs, rows);
}
