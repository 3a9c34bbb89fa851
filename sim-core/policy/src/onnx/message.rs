//! The messages of an ONNX file, as far as a chain of layers needs them.
//! Numbers of fields are those of onnx.proto, <https://github.com/onnx/onnx/blob/main/onnx/onnx.proto>.

use super::protobuf::{damaged, entry, fields};
use super::tensor::{ReadExternal, Tensor};
use crate::PolicyError;

/// A model: its graph, and texts by name.
#[derive(Debug, Default)]
pub(super) struct Model {
    pub(super) graph: Graph,
    pub(super) metadata: Vec<(String, String)>,
}

/// A graph.
#[derive(Debug, Default)]
pub(super) struct Graph {
    pub(super) nodes: Vec<Node>,
    /// Constants by name.
    pub(super) constants: Vec<(String, Tensor)>,
    pub(super) inputs: Vec<Port>,
    pub(super) outputs: Vec<Port>,
}

/// An input or output of a graph.
#[derive(Debug, Default)]
pub(super) struct Port {
    pub(super) name: String,
    /// Size of the last axis, if the file has it.
    pub(super) size: Option<usize>,
}

/// An operator with its arguments.
#[derive(Debug, Default)]
pub(super) struct Node {
    pub(super) name: String,
    pub(super) operator: String,
    pub(super) domain: String,
    pub(super) inputs: Vec<String>,
    pub(super) outputs: Vec<String>,
    attributes: Vec<(String, Attribute)>,
}

#[derive(Debug, Default)]
struct Attribute {
    float: Option<f32>,
    integer: Option<i64>,
    floats: Vec<f32>,
    integers: Vec<i64>,
    tensor: Option<Tensor>,
}

impl Node {
    fn attribute(&self, name: &str) -> Option<&Attribute> {
        let named = self.attributes.iter().find(|(known, _)| known == name);
        named.map(|(_, attribute)| attribute)
    }

    pub(super) fn float(&self, name: &str) -> Option<f32> {
        self.attribute(name)?.float
    }

    pub(super) fn integer(&self, name: &str) -> Option<i64> {
        self.attribute(name)?.integer
    }

    pub(super) fn integers(&self, name: &str) -> Option<&[i64]> {
        Some(&self.attribute(name)?.integers)
    }

    /// The value of a `Constant`.
    pub(super) fn constant(&self) -> Option<Tensor> {
        self.attributes.iter().find_map(|(name, own_value)| {
            Some(match name.as_str() {
                "value" => own_value.tensor.clone()?,
                "value_float" => Tensor::scalar(own_value.float?),
                "value_int" => Tensor::scalar(own_value.integer? as f32),
                "value_floats" => Tensor::row(own_value.floats.clone()),
                "value_ints" => Tensor::row(own_value.integers.iter().map(|&n| n as f32).collect()),
                _ => return None,
            })
        })
    }

    /// Its name for messages.
    pub(super) fn title(&self) -> &str {
        match (&*self.name, self.outputs.first()) {
            ("", Some(output)) => output,
            (name, _) => name,
        }
    }
}

impl Model {
    pub(super) fn parse(bytes: &[u8], external: ReadExternal<'_>) -> Result<Model, PolicyError> {
        let (mut model, mut has_graph) = (Model::default(), false);
        fields(bytes, |number, value| {
            match number {
                7 => {
                    has_graph = true;
                    model.graph.parse(value.bytes()?, external)?;
                }
                14 => model.metadata.push(entry(value.bytes()?)?),
                _ => {}
            }
            Ok(())
        })?;
        match has_graph {
            true => Ok(model),
            false => Err(damaged("it has no graph")),
        }
    }
}

impl Graph {
    fn parse(&mut self, bytes: &[u8], external: ReadExternal<'_>) -> Result<(), PolicyError> {
        fields(bytes, |number, value| {
            match number {
                1 => self.nodes.push(node(value.bytes()?, external)?),
                5 => self
                    .constants
                    .push(Tensor::parse(value.bytes()?, external)?),
                11 => self.inputs.push(port(value.bytes()?)?),
                12 => self.outputs.push(port(value.bytes()?)?),
                _ => {}
            }
            Ok(())
        })
    }
}

fn node(bytes: &[u8], external: ReadExternal<'_>) -> Result<Node, PolicyError> {
    let mut node = Node::default();
    fields(bytes, |number, value| {
        match number {
            1 => node.inputs.push(value.text()?.to_owned()),
            2 => node.outputs.push(value.text()?.to_owned()),
            3 => node.name = value.text()?.to_owned(),
            4 => node.operator = value.text()?.to_owned(),
            5 => node.attributes.push(attribute(value.bytes()?, external)?),
            7 => node.domain = value.text()?.to_owned(),
            _ => {}
        }
        Ok(())
    })?;
    Ok(node)
}

fn attribute(bytes: &[u8], external: ReadExternal<'_>) -> Result<(String, Attribute), PolicyError> {
    let (mut name, mut own_value) = (String::new(), Attribute::default());
    fields(bytes, |number, value| {
        match number {
            1 => name = value.text()?.to_owned(),
            2 => own_value.float = Some(value.float()?),
            3 => own_value.integer = Some(value.integer()?),
            5 => own_value.tensor = Some(Tensor::parse(value.bytes()?, external)?.1),
            7 => value.floats(&mut own_value.floats)?,
            8 => value.integers(&mut own_value.integers)?,
            _ => {}
        }
        Ok(())
    })?;
    Ok((name, own_value))
}

fn port(bytes: &[u8]) -> Result<Port, PolicyError> {
    let mut port = Port::default();
    fields(bytes, |number, value| {
        match number {
            1 => port.name = value.text()?.to_owned(),
            2 => port.size = last_axis(value.bytes()?)?,
            _ => {}
        }
        Ok(())
    })?;
    Ok(port)
}

/// Size of the last axis of a tensor's type: `tensor_type` 1, its `shape` 2, each `dim` 1, its `dim_value` 1.
fn last_axis(bytes: &[u8]) -> Result<Option<usize>, PolicyError> {
    let mut size = None;
    fields(bytes, |number, value| {
        if number != 1 {
            return Ok(());
        }
        fields(value.bytes()?, |number, value| {
            if number != 2 {
                return Ok(());
            }
            fields(value.bytes()?, |number, value| {
                if number != 1 {
                    return Ok(());
                }
                size = None;
                fields(value.bytes()?, |number, value| {
                    if number == 1 {
                        size = usize::try_from(value.integer()?).ok();
                    }
                    Ok(())
                })
            })
        })
    })?;
    Ok(size.filter(|&size| size > 0))
}
