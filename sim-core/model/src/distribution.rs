//! Distributions that a reset draws values from.

use std::collections::BTreeMap;

use crate::error::ModelError;
use crate::value_checks::{not_negative, within};
use sim_physics::constants::params::Param;

/// Largest offset [rad, m, rad/s or m/s]: a draw of it stays within f32, and within what a scene can hold.
const OFFSET_MAX: f64 = 1e6;

/// A distribution of one number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Distribution {
    /// Every number between the ends is as likely as any other.
    Uniform {
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// The normal distribution.
    Normal {
        /// Its mean.
        mean: f64,
        /// Its standard deviation.
        std: f64,
    },
}

impl Distribution {
    /// Whether all its draws are 0.
    pub(crate) fn is_always_0(&self) -> bool {
        let numbers = match *self {
            Distribution::Uniform { low, high } => [low, high],
            Distribution::Normal { mean, std } => [mean, std],
        };
        numbers == [0.0; 2]
    }

    /// Checks its numbers; `what` is whose they are.
    ///
    /// # Errors
    /// A number that is not finite or above 1e6, ends in the wrong order, a standard deviation that is negative.
    pub fn validate(&self, what: &str) -> Result<(), ModelError> {
        let bounded = |part, value| {
            let rule = "give at most 1e6";
            within(&format!("{what}: {part}"), value, OFFSET_MAX, rule)
        };
        match *self {
            Distribution::Uniform { low, high } => {
                bounded("low", low)?;
                bounded("high", high)?;
                if low > high {
                    let what = what.to_owned();
                    return Err(ModelError::EmptyUniform { what, low, high });
                }
                Ok(())
            }
            Distribution::Normal { mean, std } => {
                bounded("mean", mean)?;
                not_negative(&format!("{what}: std"), std)?;
                bounded("std", std)
            }
        }
    }
}

/// What the numbers of parameters are drawn from, by the names of what they are of.
///
/// A name is a robot's or body's for all that it has, `robot/joint`, `robot/joint.part`, `robot/link`, or a shape's as
/// [`crate::Description::shape_names`] has it; of gravity `x`, `y`, `z`; empty where a parameter has one number. Of several names of
/// a number the most special one holds.
pub type ParamRanges = BTreeMap<Param, BTreeMap<String, Distribution>>;
