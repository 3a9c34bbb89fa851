//! How a number of a scene varies from world to world, and from reset to reset.

use super::checks::{not_negative, within};
use super::error::ModelError;

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
    /// Gauss's.
    Normal {
        /// Its mean.
        mean: f64,
        /// Its standard deviation.
        std: f64,
    },
}

impl Distribution {
    /// Are all its draws 0?
    pub(super) fn is_always_0(&self) -> bool {
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
