//! What is wrong with a policy.

/// A policy that cannot be run, as a sentence with a cure.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PolicyError {
    /// The bytes are no ONNX model.
    #[error(
        "is no ONNX file: {problem}; give one that an exporter wrote, such as torch.onnx.export"
    )]
    File {
        /// What does not fit.
        problem: String,
    },
    /// An operator that a multilayer perceptron does not have.
    #[error(
        "operator {operator} of node `{node}` cannot run here: {problem}; a rollout runs multilayer perceptrons: linear \
         layers, activations, and constants that shift, scale or clip"
    )]
    Operator {
        /// The type of the operator.
        operator: String,
        /// The name of the node, or of its result.
        node: String,
        /// Why it cannot run.
        problem: String,
    },
    /// A tensor of weights that cannot be read.
    #[error("tensor `{tensor}`: {problem}")]
    Tensor {
        /// Its name.
        tensor: String,
        /// What does not fit, with a cure.
        problem: String,
    },
    /// The graph is no chain from an input to an output.
    #[error("{problem}")]
    Graph {
        /// What does not fit, with a cure.
        problem: String,
    },
    /// Layers that do not fit each other, in a network that came from elsewhere.
    #[error("layer {layer} of the policy: {problem}")]
    Layer {
        /// Its place.
        layer: usize,
        /// What does not fit.
        problem: String,
    },
}
