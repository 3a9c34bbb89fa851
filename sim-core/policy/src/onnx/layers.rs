//! Nodes as layers after a chain, or as constants.

use super::message::Node;
use super::tensor::Tensor;
use crate::{Layer, PolicyError};

/// Bound of a clip that has none. JSON, in which layers travel, has no infinity.
const UNBOUNDED: f32 = f32::MAX;
/// Constants of SELU (Klambauer et al. 2017, arXiv 1706.02515).
const SELU: (f32, f32) = (1.673_263_2, 1.050_701);

/// Parameters of a layer for each value, or one for all.
pub(super) enum Step {
    Input(usize),
    Layer(Layer),
    Linear(Tensor, Vec<f32>),
    Row(Layer, Vec<f32>),
    Single(Layer, f32),
    /// No layer, where rows have that many values.
    Width(usize),
}

impl Step {
    /// Values that it keeps.
    pub(super) fn kept(&self) -> usize {
        match self {
            Step::Linear(weights, biases) => weights.values.len() + biases.len(),
            Step::Row(_, row) => row.len(),
            _ => 0,
        }
    }
}

/// The layers of a node whose argument `place` is the chain, which is none of the constants.
pub(super) fn steps(
    node: &Node,
    place: usize,
    constants: &[Option<&Tensor>],
) -> Result<Vec<Step>, PolicyError> {
    let refuse = |problem: &str| Err(refused(node, problem));
    let constant = |place: usize| constants.get(place).copied().flatten();
    let float = |name, otherwise| node.float(name).unwrap_or(otherwise);
    let is_set = |name| node.integer(name).is_some_and(|value| value != 0);
    let one = |layer| Ok(vec![Step::Layer(layer)]);
    let is_second = place == 1;
    let takes_either = matches!(
        &*node.operator,
        "Add" | "Mul" | "Sub" | "Div" | "Max" | "Min"
    );
    if place > 1 || is_second && !takes_either {
        return refuse("what depends on the input is not its first argument");
    }
    let join = |layer| {
        let Some(tensor) = constant(usize::from(!is_second)) else {
            return refuse("it lacks an argument");
        };
        let (mut steps, layer) = match (layer, is_second) {
            // c - x = -x + c
            (Layer::Subtract, true) => (vec![Step::Single(Layer::Multiply, -1.0)], Layer::Add),
            (Layer::Divide, true) => return refuse("it divides a constant by the input"),
            (layer, _) => (Vec::new(), layer),
        };
        steps.push(match (tensor.single(), tensor.as_row()) {
            (Some(value), _) => Step::Single(layer, value),
            (None, Some(row)) => Step::Row(layer, row.to_vec()),
            _ => return refuse("its constant is neither a number nor a row of them"),
        });
        Ok(steps)
    };
    let bounds = |low: Option<f32>, high: Option<f32>| {
        one(Layer::Clip {
            low: low.unwrap_or(-UNBOUNDED).max(-UNBOUNDED),
            high: high.unwrap_or(UNBOUNDED).min(UNBOUNDED),
        })
    };
    match &*node.operator {
        "Identity" | "Dropout" => Ok(Vec::new()),
        "Cast" if node.integer("to") == Some(1) => Ok(Vec::new()),
        "Flatten" if matches!(node.integer("axis"), None | Some(1 | -1)) => Ok(Vec::new()),
        "Reshape" => match constant(1).map(|shape| &shape.values[..]) {
            // 0 is an axis as before
            Some([0.0, -1.0] | [0.0 | -1.0, 0.0]) if !is_set("allowzero") => Ok(Vec::new()),
            Some(&[rows, width])
                if width >= 1.0 && (rows == -1.0 || rows == 0.0 && !is_set("allowzero")) =>
            {
                Ok(vec![Step::Width(width as usize)])
            }
            _ => refuse("it changes the shape to other than rows; give it (-1, width)"),
        },
        "Gemm" | "MatMul" => linear(node, constants),
        "BatchNormalization" => batch_normalization(node, constants),
        "Add" => join(Layer::Add),
        "Mul" => join(Layer::Multiply),
        "Sub" => join(Layer::Subtract),
        "Div" => join(Layer::Divide),
        "Neg" => Ok(vec![Step::Single(Layer::Multiply, -1.0)]),
        "Clip" => {
            let bound = |place: usize, name| match constant(place) {
                Some(tensor) => tensor.single().map(Some).ok_or(()),
                None => Ok(node.float(name)),
            };
            match (bound(1, "min"), bound(2, "max")) {
                (Ok(low), Ok(high)) => bounds(low, high),
                _ => refuse("its bounds are no single numbers"),
            }
        }
        "Max" | "Min" if constants.len() == 2 => {
            let tensor = constant(usize::from(!is_second));
            match (tensor.and_then(Tensor::single), &*node.operator) {
                (Some(bound), "Max") => bounds(Some(bound), None),
                (Some(bound), _) => bounds(None, Some(bound)),
                _ => refuse("its bound is no single number"),
            }
        }
        "Relu" => one(Layer::Relu),
        "LeakyRelu" => one(Layer::LeakyRelu {
            slope: float("alpha", 0.01),
        }),
        "Elu" => one(Layer::Elu {
            alpha: float("alpha", 1.0),
            scale: 1.0,
        }),
        "Selu" => one(Layer::Elu {
            alpha: float("alpha", SELU.0),
            scale: float("gamma", SELU.1),
        }),
        "Tanh" => one(Layer::Tanh),
        "Sigmoid" => one(Layer::Sigmoid),
        "Softplus" => one(Layer::Softplus),
        "Swish" if float("alpha", 1.0) == 1.0 => one(Layer::Silu),
        _ => refuse("no layer does what it does"),
    }
}

/// `Gemm` and `MatMul`, with weights as `(outputs, inputs)`.
fn linear(node: &Node, constants: &[Option<&Tensor>]) -> Result<Vec<Step>, PolicyError> {
    let refuse = |problem: &str| refused(node, problem);
    let constant = |place: usize| constants.get(place).copied().flatten();
    let is_set = |name| node.integer(name).is_some_and(|value| value != 0);
    let is_gemm = node.operator == "Gemm";
    if is_set("transA") {
        return Err(refuse("its first factor is transposed"));
    }
    let weights = constant(1).filter(|weights| weights.matrix().is_some());
    let weights = weights.ok_or_else(|| refuse("its weights are no constant matrix"))?;
    let by_outputs = is_gemm && is_set("transB");
    let (rows, columns) = weights.matrix().unwrap_or_default();
    let outputs = if by_outputs { rows } else { columns };
    let [alpha, beta] = ["alpha", "beta"].map(|name| node.float(name).unwrap_or(1.0));
    let mut biases = Vec::new();
    if is_gemm && let Some(tensor) = constant(2) {
        let row = tensor.single().map(|value| vec![value]);
        let row = row.or_else(|| tensor.as_row().map(<[f32]>::to_vec));
        biases = row.ok_or_else(|| refuse("its biases are no row"))?;
        biases.iter_mut().for_each(|bias| *bias *= beta);
    }
    if !matches!(biases.len(), 0 | 1) && biases.len() != outputs {
        let counts = format!("it has {} biases for {outputs} outputs", biases.len());
        return Err(refuse(&counts));
    }
    // copied last: nodes that are refused take no memory
    let mut weights = match by_outputs {
        true => weights.clone(),
        false => weights.transposed().expect("it is a matrix"),
    };
    if is_gemm {
        weights
            .values
            .iter_mut()
            .for_each(|weight| *weight *= alpha);
    }
    Ok(vec![Step::Linear(weights, biases)])
}

/// `y = (x - mean) / √(variance + ε) · scale + shift`
fn batch_normalization(
    node: &Node,
    constants: &[Option<&Tensor>],
) -> Result<Vec<Step>, PolicyError> {
    let row = |place: usize| {
        let tensor = constants.get(place).copied().flatten();
        let row = tensor.and_then(Tensor::as_row).map(<[f32]>::to_vec);
        row.ok_or_else(|| refused(node, "its statistics are no constant rows"))
    };
    if node.integer("training_mode").is_some_and(|mode| mode != 0) {
        return Err(refused(
            node,
            "it is in training mode; export the policy by eval()",
        ));
    }
    let epsilon = node.float("epsilon").unwrap_or(1e-5);
    let mut spread = row(4)?;
    spread
        .iter_mut()
        .for_each(|variance| *variance = (*variance + epsilon).sqrt());
    Ok(vec![
        Step::Row(Layer::Subtract, row(3)?),
        Step::Row(Layer::Divide, spread),
        Step::Row(Layer::Multiply, row(1)?),
        Step::Row(Layer::Add, row(2)?),
    ])
}

/// The value of a node of constants alone.
pub(super) fn folded(node: &Node, constants: &[Option<&Tensor>]) -> Result<Tensor, PolicyError> {
    let refuse = || {
        refused(
            node,
            "it computes a constant in a way that is not known here",
        )
    };
    let constant = |place: usize| constants.get(place).copied().flatten().ok_or_else(refuse);
    let each = |change: fn(f32) -> f32| {
        let tensor = constant(0)?;
        Ok(Tensor {
            shape: tensor.shape.clone(),
            values: tensor.values.iter().map(|&x| change(x)).collect(),
        })
    };
    let join = |join: fn(f32, f32) -> f32| {
        let joined = constant(0)?.joined(constant(1)?, join);
        joined.ok_or_else(|| refused(node, "its constants have shapes that do not fit"))
    };
    match &*node.operator {
        "Identity" => constant(0).cloned(),
        "Cast" if node.integer("to") == Some(1) => constant(0).cloned(),
        "Neg" => each(|x| -x),
        "Sqrt" => each(f32::sqrt),
        "Reciprocal" => each(|x| 1.0 / x),
        "Exp" => each(libm::expf),
        "Add" => join(|a, b| a + b),
        "Sub" => join(|a, b| a - b),
        "Mul" => join(|a, b| a * b),
        "Div" => join(|a, b| a / b),
        "Max" if constants.len() == 2 => join(f32::max),
        "Min" if constants.len() == 2 => join(f32::min),
        "Transpose" if matches!(node.integers("perm"), None | Some([1, 0])) => {
            constant(0)?.transposed().ok_or_else(refuse)
        }
        "Unsqueeze" | "Squeeze" => {
            let row = constant(0)?.as_row().ok_or_else(refuse)?.to_vec();
            Ok(match &*node.operator {
                "Squeeze" => Tensor::row(row),
                _ => Tensor {
                    shape: vec![1, row.len()],
                    values: row,
                },
            })
        }
        _ => Err(refuse()),
    }
}

pub(super) fn refused(node: &Node, problem: &str) -> PolicyError {
    PolicyError::Operator {
        operator: node.operator.clone(),
        node: node.title().to_owned(),
        problem: problem.to_owned(),
    }
}
