//! A network: layers, and their parameters in one array.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::PolicyError;

/// Most values of a row, so that sizes do not overflow.
pub(crate) const SIZE_MAX: usize = 1 << 24;

/// One layer. Those with parameters say how many of [`Network`]'s array are theirs, in order.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Layer {
    /// `y = W x + b`. Parameters: W by rows, `outputs * inputs`, then b, `outputs`.
    Linear {
        /// Values of x.
        inputs: usize,
        /// Values of y.
        outputs: usize,
    },
    /// `y = x + c`. Parameters: c.
    Add,
    /// `y = x - c`. Parameters: c.
    Subtract,
    /// `y = x c`. Parameters: c.
    Multiply,
    /// `y = x / c`. Parameters: c.
    Divide,
    /// x within bounds.
    Clip {
        /// Lower bound.
        low: f32,
        /// Upper bound.
        high: f32,
    },
    /// `max(x, 0)`
    Relu,
    /// x where it is positive, else `slope * x`.
    LeakyRelu {
        /// Slope of negative values.
        slope: f32,
    },
    /// `scale * x` where x is positive, else `scale * alpha (exp(x) - 1)`.
    Elu {
        /// Limit of negative values.
        alpha: f32,
        /// Factor of the result: 1, but for SELU.
        scale: f32,
    },
    /// `tanh(x)`
    Tanh,
    /// `1 / (1 + exp(-x))`
    Sigmoid,
    /// `log(1 + exp(x))`
    Softplus,
    /// `x / (1 + exp(-x))`
    Silu,
}

impl Layer {
    /// Parameters, of a layer that takes rows of `size`.
    fn parameters(self, size: usize) -> usize {
        match self {
            Layer::Linear { inputs, outputs } => (inputs + 1) * outputs,
            Layer::Add | Layer::Subtract | Layer::Multiply | Layer::Divide => size,
            _ => 0,
        }
    }
}

/// Layers in the order in which they are evaluated.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    inputs: usize,
    outputs: usize,
    layers: Vec<Layer>,
    parameters: Vec<f32>,
}

impl Network {
    /// A network of layers that take rows of `inputs`.
    ///
    /// # Errors
    /// [`PolicyError::Layer`] where sizes do not fit each other or the parameters.
    pub fn new(
        inputs: usize,
        layers: Vec<Layer>,
        parameters: Vec<f32>,
    ) -> Result<Network, PolicyError> {
        let (mut size, mut used) = (inputs, 0usize);
        let fits = |size: usize| (1..=SIZE_MAX).contains(&size);
        for (index, &layer) in layers.iter().enumerate() {
            let problem = |problem: String| PolicyError::Layer {
                layer: index,
                problem,
            };
            if !fits(size) {
                return Err(problem(format!(
                    "takes {size} values; give 1 to {SIZE_MAX}"
                )));
            }
            if let Layer::Linear { inputs, outputs } = layer {
                if inputs != size {
                    return Err(problem(format!(
                        "takes {inputs} values, and the one before it gives {size}"
                    )));
                }
                if !fits(outputs) {
                    return Err(problem(format!(
                        "gives {outputs} values; give 1 to {SIZE_MAX}"
                    )));
                }
                size = outputs;
            }
            if let Layer::Clip { low, high } = layer
                && (low.is_nan() || high.is_nan() || low > high)
            {
                return Err(problem(format!("clips to [{low}, {high}], which is empty")));
            }
            used += layer.parameters(size);
            if used > parameters.len() {
                return Err(problem(format!(
                    "needs {used} parameters with those before it, and there are {}",
                    parameters.len()
                )));
            }
        }
        if used != parameters.len() || !fits(size) {
            return Err(PolicyError::Layer {
                layer: layers.len(),
                problem: format!("{} parameters are left over", parameters.len() - used),
            });
        }
        Ok(Network {
            inputs,
            outputs: size,
            layers,
            parameters,
        })
    }

    /// Values of a row that it takes.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Values of a row that it gives.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// The layers.
    pub fn layers(&self) -> &[Layer] {
        &self.layers
    }

    /// Parameters of all layers, one after another.
    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// Each layer with its parameters.
    pub(crate) fn with_parameters(&self) -> impl Iterator<Item = (Layer, &[f32])> {
        let (mut size, mut rest) = (self.inputs, &self.parameters[..]);
        self.layers.iter().map(move |&layer| {
            if let Layer::Linear { outputs, .. } = layer {
                size = outputs;
            }
            let (own_part, after) = rest.split_at(layer.parameters(size));
            rest = after;
            (layer, own_part)
        })
    }
}

impl fmt::Display for Network {
    /// Sizes and activations: `50 subtract divide clip 128 elu 64 elu 12`.
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(to, "{}", self.inputs)?;
        for layer in &self.layers {
            match layer {
                Layer::Linear { outputs, .. } => write!(to, " {outputs}")?,
                Layer::Add => to.write_str(" add")?,
                Layer::Subtract => to.write_str(" subtract")?,
                Layer::Multiply => to.write_str(" multiply")?,
                Layer::Divide => to.write_str(" divide")?,
                Layer::Clip { .. } => to.write_str(" clip")?,
                Layer::Relu => to.write_str(" relu")?,
                Layer::LeakyRelu { .. } => to.write_str(" leaky_relu")?,
                Layer::Elu { .. } => to.write_str(" elu")?,
                Layer::Tanh => to.write_str(" tanh")?,
                Layer::Sigmoid => to.write_str(" sigmoid")?,
                Layer::Softplus => to.write_str(" softplus")?,
                Layer::Silu => to.write_str(" silu")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINEAR: Layer = Layer::Linear {
        inputs: 2,
        outputs: 3,
    };

    #[test]
    fn layers_that_do_not_fit_are_refused_by_their_place() {
        let refused = |inputs, layers: &[Layer], parameters: usize| {
            let made = Network::new(inputs, layers.to_vec(), vec![0.0; parameters]);
            made.unwrap_err().to_string()
        };
        let taken = refused(2, &[LINEAR, LINEAR], 18);
        assert!(taken.contains("layer 1"), "{taken}");
        let missing = refused(2, &[LINEAR], 8);
        assert!(missing.contains("needs 9 parameters"), "{missing}");
        let left = refused(2, &[LINEAR], 10);
        assert!(left.contains("1 parameters are left over"), "{left}");
        let huge = Layer::Linear {
            inputs: 2,
            outputs: usize::MAX,
        };
        assert!(refused(2, &[huge], 0).contains("layer 0"));
        assert!(refused(0, &[LINEAR], 9).contains("takes 0 values"));
        let empty = Layer::Clip {
            low: 1.0,
            high: 0.0,
        };
        assert!(refused(2, &[empty], 0).contains("[1, 0]"));
    }

    #[test]
    fn each_layer_has_its_own_parameters() {
        let layers = vec![Layer::Subtract, LINEAR, Layer::Tanh, Layer::Add];
        let parameters: Vec<f32> = (0..14).map(|n| n as f32).collect();
        let network = Network::new(2, layers, parameters).unwrap();
        let first: Vec<_> = network
            .with_parameters()
            .map(|(_, own_part)| own_part.first().copied())
            .collect();
        assert_eq!(first, [Some(0.0), Some(2.0), None, Some(11.0)]);
        assert_eq!(network.outputs(), 3);
        assert_eq!(network.to_string(), "2 subtract 3 tanh add");
    }
}
