//! Reads a multilayer perceptron from an ONNX file.
//!
//! The graph is followed from its inputs in the order of the file. Each value is a constant, or a chain of layers after
//! one input. Branches that the asked output does not need, such as a critic, may have any operators.

mod chain;
#[cfg(test)]
mod hostile;
mod layers;
mod message;
mod protobuf;
mod tensor;
#[cfg(test)]
mod tests;

pub use tensor::ReadExternal;

use self::chain::{Chains, Path};
use self::message::Model;
use self::tensor::within;
use crate::{Network, PolicyError};

/// Bytes that all weights beside a file may have, so that names alone cannot fill the memory.
const EXTERNAL_MAX: u64 = 1 << 30;

/// What an ONNX file has.
#[derive(Clone, Debug)]
pub struct Policy {
    /// Its layers.
    pub network: Network,
    /// Name of the input that it takes.
    pub input: String,
    /// Name of the output that it gives.
    pub output: String,
    /// Texts by name.
    pub metadata: Vec<(String, String)>,
}

/// Reads the policy of an ONNX file, as the chain that ends in an output: the one named, or the first.
///
/// `external` reads files with weights beside it.
///
/// # Errors
/// What the file has and no multilayer perceptron has, by name.
pub fn read(
    bytes: &[u8],
    output: Option<&str>,
    external: ReadExternal<'_>,
) -> Result<Policy, PolicyError> {
    let model = Model::parse(bytes, &within(external, EXTERNAL_MAX))?;
    let graph = &model.graph;
    let names = || {
        let names: Vec<_> = graph.outputs.iter().map(|port| &*port.name).collect();
        names.join(", ")
    };
    let port = match output {
        None => graph.outputs.first(),
        Some(name) => graph.outputs.iter().find(|port| port.name == name),
    };
    let port = port.ok_or_else(|| PolicyError::Graph {
        problem: match output {
            None => "has no output; export the policy with one".to_owned(),
            Some(name) => format!("has no output `{name}`; give one of: {}", names()),
        },
    })?;
    let chains = Chains::follow(graph)?;
    let Path {
        input,
        inputs,
        layers,
        parameters,
    } = chains.path(&port.name)?;
    let network = Network::new(inputs, layers, parameters)?;
    if let Some(size) = port.size
        && size != network.outputs()
    {
        return Err(PolicyError::Graph {
            problem: format!(
                "gives {} numbers, and says that `{}` has {size}; export the policy anew",
                network.outputs(),
                port.name
            ),
        });
    }
    Ok(Policy {
        network,
        input,
        output: port.name.clone(),
        metadata: model.metadata,
    })
}
