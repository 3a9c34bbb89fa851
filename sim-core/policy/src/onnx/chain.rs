//! Chains of layers in a graph: what each value is, node by node.

use std::borrow::Cow;
use std::collections::HashMap;

use super::layers::{Step, folded, refused, steps};
use super::message::{Graph, Node};
use super::tensor::Tensor;
use crate::{Layer, PolicyError};

/// Values that computed constants and layers of a file may have together, and the parameters of its policy.
/// Tests have fewer, to take little memory.
pub(super) const CONSTANTS_MAX: usize = if cfg!(test) { 1 << 20 } else { 1 << 28 };

/// What a name of the graph stands for.
enum Value<'a> {
    Constant(Cow<'a, Tensor>),
    /// The end of a chain.
    Link(usize),
    /// What cannot be computed here. It matters only where the output needs it.
    Broken(PolicyError),
}

/// A layer of a chain, after another one.
struct Link {
    before: Option<usize>,
    step: Step,
}

/// All values of a graph.
pub(super) struct Chains<'a> {
    graph: &'a Graph,
    values: HashMap<&'a str, Value<'a>>,
    links: Vec<Link>,
}

/// The chain that ends in an output.
pub(super) struct Path {
    pub(super) input: String,
    pub(super) inputs: usize,
    pub(super) layers: Vec<Layer>,
    pub(super) parameters: Vec<f32>,
}

impl<'a> Chains<'a> {
    /// Follows all nodes of a graph, in their order.
    ///
    /// # Errors
    /// More constants than anybody has.
    pub(super) fn follow(graph: &'a Graph) -> Result<Chains<'a>, PolicyError> {
        let mut chains = Chains {
            graph,
            values: HashMap::new(),
            links: Vec::new(),
        };
        for (place, input) in graph.inputs.iter().enumerate() {
            let link = chains.link(None, Step::Input(place));
            chains.values.insert(&input.name, link);
        }
        // older files list constants among the inputs, too
        for (name, tensor) in &graph.constants {
            let constant = Value::Constant(Cow::Borrowed(tensor));
            chains.values.insert(name, constant);
        }
        let (mut computed, mut counted) = (0, 0);
        for node in &graph.nodes {
            let value = chains.value(node).unwrap_or_else(Value::Broken);
            if let Value::Constant(tensor) = &value {
                computed += tensor.values.len();
            }
            let links = &chains.links[counted..];
            computed += links.iter().map(|link| link.step.kept()).sum::<usize>();
            counted = chains.links.len();
            if computed > CONSTANTS_MAX {
                let problem =
                    format!("computes more than {CONSTANTS_MAX} constants; export the policy anew");
                return Err(PolicyError::Graph { problem });
            }
            if let Some(output) = node.outputs.first() {
                chains.values.insert(output, value);
            }
            for output in node.outputs.iter().skip(1).filter(|name| !name.is_empty()) {
                let problem = "its further results are not computed";
                let broken = Value::Broken(refused(node, problem));
                chains.values.insert(output, broken);
            }
        }
        Ok(chains)
    }

    /// The chain that ends in a value.
    pub(super) fn path(&self, name: &str) -> Result<Path, PolicyError> {
        let graph_error = |problem: String| PolicyError::Graph { problem };
        let end = match self.values.get(name) {
            Some(Value::Link(link)) => *link,
            Some(Value::Broken(error)) => return Err(error.clone()),
            Some(Value::Constant(_)) => {
                return Err(graph_error(format!(
                    "`{name}` depends on no input; give the output with the actions"
                )));
            }
            None => {
                return Err(graph_error(format!(
                    "no node gives the output `{name}`; export the policy anew"
                )));
            }
        };
        let mut steps = Vec::new();
        let mut link = Some(end);
        // a link comes after those before it, so this ends
        while let Some(place) = link {
            steps.push(&self.links[place].step);
            link = self.links[place].before;
        }
        steps.reverse();
        let Some((Step::Input(place), steps)) = steps.split_first() else {
            return Err(graph_error(format!("`{name}` depends on no input")));
        };
        let port = &self.graph.inputs[*place];
        let sized = steps.iter().find_map(|step| match step {
            Step::Row(_, row) => Some(row.len()),
            Step::Width(width) => Some(*width),
            Step::Linear(weights, _) => weights.matrix().map(|(_, inputs)| inputs),
            _ => None,
        });
        let inputs = port.size.or(sized).ok_or_else(|| {
            let problem = format!(
                "says nothing of the size of `{}`; export it with a fixed one",
                port.name
            );
            graph_error(problem)
        })?;
        if inputs > crate::network::SIZE_MAX {
            return Err(graph_error(format!(
                "takes {inputs} values by `{}`",
                port.name
            )));
        }
        let (mut layers, mut parameters, mut size) = (Vec::new(), Vec::new(), inputs);
        for step in steps {
            let more = match step {
                Step::Linear(weights, _) => {
                    weights.values.len() + weights.matrix().unwrap_or_default().0
                }
                Step::Single(..) => size,
                other => other.kept(),
            };
            if more > CONSTANTS_MAX - parameters.len() {
                return Err(graph_error(format!(
                    "has more than {CONSTANTS_MAX} parameters; give a smaller policy"
                )));
            }
            let (layer, taken) = match step {
                Step::Input(_) => continue,
                Step::Width(width) if *width == size => continue,
                Step::Width(width) => {
                    return Err(graph_error(format!(
                        "makes rows of {width} numbers of rows of {size}; give those of the same width"
                    )));
                }
                Step::Layer(layer) => (*layer, size),
                Step::Single(layer, value) => {
                    parameters.extend(std::iter::repeat_n(*value, size));
                    (*layer, size)
                }
                Step::Row(layer, row) => {
                    parameters.extend_from_slice(row);
                    (*layer, row.len())
                }
                Step::Linear(weights, biases) => {
                    let (outputs, inputs) = weights.matrix().unwrap_or_default();
                    parameters.extend_from_slice(&weights.values);
                    match biases.len() {
                        0 => parameters.extend(std::iter::repeat_n(0.0, outputs)),
                        1 => parameters.extend(std::iter::repeat_n(biases[0], outputs)),
                        _ => parameters.extend_from_slice(biases),
                    }
                    (Layer::Linear { inputs, outputs }, inputs)
                }
            };
            if taken != size {
                return Err(graph_error(format!(
                    "has a layer of {taken} numbers ({layer:?}) after one of {size}; export the policy anew"
                )));
            }
            if let Layer::Linear { outputs, .. } = layer {
                size = outputs;
            }
            layers.push(layer);
        }
        Ok(Path {
            input: port.name.clone(),
            inputs,
            layers,
            parameters,
        })
    }

    fn link(&mut self, before: Option<usize>, step: Step) -> Value<'a> {
        self.links.push(Link { before, step });
        Value::Link(self.links.len() - 1)
    }

    /// What a node gives.
    fn value(&mut self, node: &'a Node) -> Result<Value<'a>, PolicyError> {
        if !matches!(&*node.domain, "" | "ai.onnx") {
            return Err(refused(
                node,
                &format!("it is of the domain {}", node.domain),
            ));
        }
        if node.operator == "Constant" {
            let constant = node.constant();
            let problem = "it has no number";
            let constant = constant.ok_or_else(|| refused(node, problem))?;
            return Ok(Value::Constant(Cow::Owned(constant)));
        }
        let (mut link, mut other, mut constants) = (None, None, Vec::new());
        let mut chained = 0;
        for (argument, name) in node.inputs.iter().enumerate() {
            match self.values.get(name.as_str()) {
                _ if name.is_empty() => constants.push(None),
                Some(Value::Constant(tensor)) => constants.push(Some(tensor.as_ref())),
                Some(Value::Broken(error)) => return Err(error.clone()),
                Some(Value::Link(place)) => {
                    constants.push(None);
                    match link {
                        None => (link, chained) = (Some(*place), argument),
                        Some(_) => other = Some(*place),
                    }
                }
                None => {
                    let problem = format!(
                        "node `{}` reads `{name}`, which no node before it gives; export the policy anew",
                        node.title()
                    );
                    return Err(PolicyError::Graph { problem });
                }
            }
        }
        let steps = match (link, other) {
            (None, _) => {
                let folded = folded(node, &constants)?;
                return Ok(Value::Constant(Cow::Owned(folded)));
            }
            (Some(first), Some(second)) => {
                let (before, step) = self.gated(node, first, second)?;
                return Ok(self.link(before, step));
            }
            (Some(_), None) => steps(node, chained, &constants)?,
        };
        let mut end = link;
        for step in steps {
            self.links.push(Link { before: end, step });
            end = Some(self.links.len() - 1);
        }
        Ok(Value::Link(end.expect("a link is there")))
    }

    /// The product of a chain and its own sigmoid, the only operator with two chains.
    fn gated(
        &self,
        node: &Node,
        first: usize,
        second: usize,
    ) -> Result<(Option<usize>, Step), PolicyError> {
        for (x, gate) in [(first, second), (second, first)] {
            let gate = &self.links[gate];
            if node.operator == "Mul"
                && gate.before == Some(x)
                && matches!(gate.step, Step::Layer(Layer::Sigmoid))
            {
                return Ok((Some(x), Step::Layer(Layer::Silu)));
            }
        }
        Err(refused(node, "it joins two values that depend on an input"))
    }
}
