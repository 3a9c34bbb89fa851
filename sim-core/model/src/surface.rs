//! How a shape touches: its surface, and which groups of shapes touch each other.

use crate::error::ModelError;
use crate::value_checks::{in_range, not_negative, positive, within};

/// Largest stiffness, damping and friction, each in its unit: products of three stay within f32.
const FACTOR_MAX: f64 = 1e12;
/// Largest margin and gap [m]: f32 keeps a tenth of a metre there.
const LENGTH_MAX: f64 = 1e6;

/// Contact parameters of a shape. Margins and gaps of two shapes are added; the other values are combined as MuJoCo does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Coefficient of sliding friction; of two shapes the larger counts, or what the scene's rule makes of both [–].
    pub mu: f64,
    /// Stiffness, Newton's shape `ke`: with `kd` it is MuJoCo's `solref` (2/kd, kd/(2 √ke)), per unit of effective mass [1/s²].
    pub ke: f64,
    /// Damping, Newton's shape `kd`, per unit of effective mass [1/s].
    pub kd: f64,
    /// Friction damping, Newton's shape `kf`, from which comes MuJoCo's `solreffriction` [N·s/m].
    pub kf: f64,
    /// How near another shape must be for a force to act, at most [m].
    pub margin: f64,
    /// Extra distance at which contacts are listed without a force [m].
    pub gap: f64,
    /// Directions in which a contact acts: 1 along the normal alone, 3 with sliding friction; the larger of two shapes counts.
    pub condim: usize,
    /// Newton's `collision_group`: 0 touches nothing, a positive group touches itself and the negative ones, a negative one
    /// touches all but itself.
    pub group: i32,
}

impl Default for Surface {
    fn default() -> Surface {
        Surface {
            mu: 1.0,
            ke: 2500.0,
            kd: 100.0,
            kf: 1000.0,
            margin: 0.0,
            gap: 0.0,
            condim: 3,
            group: 1,
        }
    }
}

impl Surface {
    /// Whether shapes of these two surfaces touch, as far as their groups say.
    pub fn meets(&self, other: &Surface) -> bool {
        match (self.group, other.group) {
            (0, _) | (_, 0) => false,
            (a, b) if a > 0 => b == a || b < 0,
            (a, b) => a != b,
        }
    }

    /// Refuses values that no contact can have; `what` names the shape.
    pub(crate) fn validate(&self, what: &str) -> Result<(), ModelError> {
        let rule = "give at most 1e12";
        let mu = format!("{what}: mu");
        not_negative(&mu, self.mu)?;
        within(&mu, self.mu, FACTOR_MAX, rule)?;
        for (field, value) in [("ke", self.ke), ("kd", self.kd), ("kf", self.kf)] {
            let field = format!("{what}: {field}");
            positive(&field, value)?;
            within(&field, value, FACTOR_MAX, rule)?;
        }
        for (field, value) in [("margin", self.margin), ("gap", self.gap)] {
            let field = format!("{what}: {field}");
            not_negative(&field, value)?;
            within(&field, value, LENGTH_MAX, "give at most 1e6 m")?;
        }
        let rule = match self.condim {
            4 | 6 => {
                "friction against turning and rolling is not supported yet; give 3, or 1 for no friction"
            }
            _ => "give 3, or 1 for no friction",
        };
        let known = matches!(self.condim, 1 | 3);
        in_range(&format!("{what}: condim"), self.condim as f64, known, rule)
    }
}
