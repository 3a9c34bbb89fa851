//! Softness of a constraint as MuJoCo gives it: `solref` and `solimp`.

use sim_physics::constants::{IMPEDANCE_BOUNDS, Impedance, SOLREF_DEFAULT, WIDTH_MIN};

/// Largest exponent of an impedance [–]: the curve is a product of so many factors.
pub(crate) const POWER_MAX: f64 = 16.0;

/// Softness of a constraint (MuJoCo documentation, "Solver parameters").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Softness {
    /// Time constant [s] and damping ratio [–]; or, both negative or zero, stiffness [1/s²] and damping [1/s].
    pub solref: [f64; 2],
    /// d_min, d_max, width, midpoint, power.
    pub solimp: [f64; 5],
}

impl Default for Softness {
    fn default() -> Softness {
        Softness {
            solref: SOLREF_DEFAULT,
            solimp: [0.9, 0.95, 0.001, 0.5, 2.0],
        }
    }
}

impl Softness {
    /// The impedance, its values in their bounds.
    pub(crate) fn impedance(&self) -> Impedance<f64> {
        let [d_min, d_max, width, midpoint, power] = self.solimp;
        let (mut d_min, mut d_max) = (bounded(d_min), bounded(d_max));
        let is_flat = d_min == d_max || width <= WIDTH_MIN;
        if is_flat {
            d_min = 0.5 * (d_min + d_max);
            d_max = d_min;
        }
        Impedance {
            d_min,
            d_max,
            inverse_width: if is_flat { 1.0 } else { 1.0 / width },
            midpoint: bounded(midpoint),
            power: power.max(1.0),
        }
    }

    /// Reference stiffness [1/s²] and damping [1/s]. Where `is_safe`, a time constant is at least two steps of `dt` [s].
    pub(crate) fn reference(&self, dt: f64, is_safe: bool) -> (f64, f64) {
        let d_max = bounded(self.solimp[1]);
        let [first, second] = match self.solref {
            // as MuJoCo: one positive value alone has no meaning
            [first, second] if (first > 0.0) != (second > 0.0) => SOLREF_DEFAULT,
            both => both,
        };
        if first <= 0.0 {
            return (-first / (d_max * d_max), -second / d_max);
        }
        let time_constant = if is_safe { first.max(2.0 * dt) } else { first };
        let natural = time_constant * second * d_max;
        (
            1.0 / (natural * natural).max(WIDTH_MIN),
            2.0 / (d_max * time_constant),
        )
    }

    /// A mixture of two, `share` of the first; direct references are not mixed, the smaller values count (MuJoCo:
    /// `mj_contactParam`).
    pub(crate) fn mixed(&self, other: &Softness, share: f64) -> Softness {
        let mix = |a: f64, b: f64| share * a + (1.0 - share) * b;
        let are_times = self.solref[0] > 0.0 && other.solref[0] > 0.0;
        let reference = |i: usize| match are_times {
            true => mix(self.solref[i], other.solref[i]),
            false => self.solref[i].min(other.solref[i]),
        };
        Softness {
            solref: [reference(0), reference(1)],
            solimp: std::array::from_fn(|i| mix(self.solimp[i], other.solimp[i])),
        }
    }
}

/// An impedance in MuJoCo's bounds.
fn bounded(x: f64) -> f64 {
    let [least, most] = IMPEDANCE_BOUNDS;
    x.clamp(least, most)
}
