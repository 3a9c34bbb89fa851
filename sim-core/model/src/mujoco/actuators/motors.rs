//! DC motors of a model: what their parameters mean.

use super::Activations;
use crate::error::ModelError;
use crate::mujoco::format::ModelFile;
use sim_physics::constants::actuators::Motor;

/// The smallest resistance (MuJoCo: `mjMINVAL`) [Ω].
const TINY: f64 = 1e-15;

/// Bits of `actuator_ctrlspec`: what a control of a motor means.
const POSITION: i64 = 1;
const VELOCITY: i64 = 2;
const FORCE: i64 = 4;
const VOLTAGE: i64 = 8;
const NONE: i64 = 16;

/// Arrays of motors; empty where a file has none.
pub(in crate::mujoco) struct Motors {
    /// Whether each actuator is one, in its gain, bias and activation.
    kinds: Vec<[bool; 3]>,
    controls: Vec<i64>,
    gains: Vec<[f64; 10]>,
    biases: Vec<[f64; 10]>,
    dynamics: Vec<[f64; 10]>,
}

/// Resistance and constant of a motor, and gains of its controller.
struct Parameters {
    resistance: f64,
    constant: f64,
    stiffness: f64,
    damping: f64,
}

impl Motors {
    pub(in crate::mujoco) fn read(file: &ModelFile, count: usize) -> Result<Motors, ModelError> {
        let gains = file.kinds("actuator_gaintype", count)?;
        let biases = file.kinds("actuator_biastype", count)?;
        let dynamics = file.kinds("actuator_dyntype", count)?;
        let kinds = (0..count)
            .map(|k| [&gains[k], &biases[k], &dynamics[k]].map(|kind| kind.ends_with("_DCMOTOR")));
        Ok(Motors {
            kinds: kinds.collect(),
            controls: file.integers_or("actuator_ctrlspec", count, 0)?,
            gains: file.vectors("actuator_gainprm", count)?,
            biases: file.vectors("actuator_biasprm", count)?,
            dynamics: file.vectors("actuator_dynprm", count)?,
        })
    }

    /// What of actuator `k`, if it is a motor, is not supported.
    pub(in crate::mujoco) fn refused(&self, k: usize) -> Vec<&'static str> {
        if self.kinds[k] == [false; 3] {
            return Vec::new();
        }
        let is_known = matches!(self.controls[k], POSITION | VELOCITY | FORCE | VOLTAGE);
        // refused by their number
        let are_several = self.controls[k].count_ones() > 1 || self.controls[k] == NONE;
        let [.., leak, capacity, _, bristle, friction, slew, _, _] = self.dynamics[k];
        let wrong = [
            (
                self.kinds[k] != [true; 3],
                "a law that is a DC motor's in part",
            ),
            (!is_known && !are_several, "a DC motor of this MuJoCo"),
            (
                self.gains[k][5] != 0.0,
                "an integral gain of a DC motor's controller",
            ),
            (slew != 0.0, "a slew rate of a DC motor's controller"),
            (
                leak != 0.0 || capacity != 0.0,
                "the temperature of a DC motor",
            ),
            (
                bristle != 0.0 || friction != 0.0,
                "LuGre friction of a DC motor",
            ),
        ];
        let wrong = wrong.into_iter().filter(|(is_wrong, _)| *is_wrong);
        wrong.map(|(_, what)| what).collect()
    }

    fn is_motor(&self, k: usize) -> bool {
        self.kinds[k] == [true; 3]
    }

    fn parameters(&self, k: usize) -> Parameters {
        let [resistance, constant, _, _, stiffness, _, damping, ..] = self.gains[k];
        Parameters {
            resistance: resistance.max(TINY),
            constant,
            stiffness,
            damping,
        }
    }

    /// Gain and bias of the torque that actuator `k` has without inductance and bounds, if it is a motor.
    pub(super) fn laws(&self, k: usize) -> Option<[[f64; 3]; 2]> {
        if !self.is_motor(k) {
            return None;
        }
        let Parameters {
            resistance,
            constant,
            stiffness,
            damping,
        } = self.parameters(k);
        // controls that a motor does not have are 0
        let controlled = [0.0, -stiffness, -damping];
        let per_volt = constant / resistance;
        let (gain, bias) = match self.controls[k] {
            POSITION => (stiffness, controlled),
            VELOCITY => (damping, controlled),
            FORCE => (1.0, controlled),
            _ => (per_volt, [0.0, 0.0, -constant * per_volt]),
        };
        Some([[gain, 0.0, 0.0], bias])
    }

    /// What actuator `k` has besides, if it is a motor.
    pub(super) fn motor(&self, k: usize) -> Option<Motor<f64>> {
        if !self.is_motor(k) {
            return None;
        }
        let Parameters {
            resistance,
            constant,
            ..
        } = self.parameters(k);
        let positive = |bound: f64| (bound > 0.0).then_some(bound);
        let [amplitude, poles, phase, ..] = self.biases[k];
        Some(Motor {
            constant,
            per_volt: constant / resistance,
            // the voltage of a terminal is given, not bounded
            voltage: positive(self.gains[k][7]).filter(|_| self.controls[k] != VOLTAGE),
            current_rate: positive(self.dynamics[k][1]),
            cogging: [amplitude, poles, phase],
        })
    }
}

impl Activations {
    /// Time constant of the current of actuator `k`; none of a motor without inductance [s].
    pub(super) fn current_time(&self, k: usize) -> Option<f64> {
        let time = self.parameters[k][0];
        (time > 0.0).then_some(time)
    }
}
