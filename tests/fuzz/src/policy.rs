//! Policies from ONNX files.

use sim_policy::{Runner, onnx};

/// Most parameters of a network that is run.
const PARAMETERS_MAX: usize = 1 << 16;
/// Most bytes of weights beside the file.
const BESIDE_MAX: u64 = 1 << 16;

/// An ONNX file. What is read runs; a world's result does not depend on another world.
pub fn onnx(bytes: &[u8]) {
    let external = |_: &str, _: u64, length: u64| match length <= BESIDE_MAX {
        true => Ok(vec![0; length as usize]),
        false => Err("lacks a file".to_owned()),
    };
    let policy = match onnx::read(bytes, None, &external) {
        Ok(policy) => policy,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return;
        }
    };
    let network = &policy.network;
    let width = network.inputs().max(network.outputs());
    if network.parameters().len() > PARAMETERS_MAX || width > PARAMETERS_MAX {
        return;
    }
    assert!(!network.to_string().is_empty());
    let mut runner = Runner::new(network);
    let inputs: Vec<f32> = (0..2 * network.inputs())
        .map(|place| (place % network.inputs()) as f32 - 1.5)
        .collect();
    let mut outputs = vec![0.0; 2 * network.outputs()];
    runner.run(&inputs, &mut outputs, 1).expect("the sizes fit");
    let (one, other) = outputs.split_at(network.outputs());
    let bits = |row: &[f32]| row.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(one), bits(other));
}
