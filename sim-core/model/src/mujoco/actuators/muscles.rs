//! Muscles of a model: what their parameters mean.

use crate::error::ModelError;
use crate::mujoco::format::ModelFile;
use sim_physics::constants::actuators::Muscle;

/// The smallest divisor (MuJoCo: `mjMINVAL`).
const TINY: f64 = 1e-15;

/// Which law of a muscle.
#[derive(Clone, Copy)]
pub(super) enum Law {
    Gain,
    Bias,
}

/// Arrays of muscles; empty where a file has none.
pub(in crate::mujoco) struct Muscles {
    gains: Vec<[f64; 10]>,
    biases: Vec<[f64; 10]>,
    /// Shortest and longest length of each actuator [m].
    ranges: Vec<[f64; 2]>,
    /// Acceleration by a unit of force in the pose that the model was built in.
    accelerations: Vec<f64>,
}

impl Muscles {
    pub(in crate::mujoco) fn read(file: &ModelFile, count: usize) -> Result<Muscles, ModelError> {
        let gains = file.kinds("actuator_gaintype", count)?;
        let biases = file.kinds("actuator_biastype", count)?;
        let mut both = gains.iter().chain(&biases);
        if !both.any(|kind| kind == "mjGAIN_MUSCLE" || kind == "mjBIAS_MUSCLE") {
            return Ok(Muscles {
                gains: Vec::new(),
                biases: Vec::new(),
                ranges: Vec::new(),
                accelerations: Vec::new(),
            });
        }
        Ok(Muscles {
            gains: file.vectors::<10>("actuator_gainprm", count)?,
            biases: file.vectors::<10>("actuator_biasprm", count)?,
            ranges: file.vectors::<2>("actuator_lengthrange", count)?,
            accelerations: file.reals("actuator_acc0", count)?,
        })
    }

    /// Has actuator `k`, a muscle, a range of lengths, and numbers that are finite?
    pub(in crate::mujoco) fn is_whole(&self, k: usize) -> bool {
        let [shortest, longest] = self.ranges[k];
        let mut numbers = self.gains[k].iter().chain(&self.biases[k]);
        shortest < longest
            && (longest - shortest).is_finite()
            && self.accelerations[k].is_finite()
            && numbers.all(|number| number.is_finite())
    }

    /// The law of actuator `k`, if that is a muscle's.
    pub(super) fn law(&self, k: usize, is_muscle: bool, law: Law) -> Option<Muscle<f64>> {
        if !is_muscle {
            return None;
        }
        let all = match law {
            Law::Gain => &self.gains,
            Law::Bias => &self.biases,
        };
        let [
            low,
            high,
            force,
            scale,
            l_min,
            l_max,
            v_max,
            fp_max,
            fv_max,
            _,
        ] = all[k];
        let [shortest, longest] = self.ranges[k];
        let optimum = (longest - shortest) / (high - low).max(TINY);
        Some(Muscle {
            // a negative force stands for one that the inertia asks for
            peak: match force < 0.0 {
                true => scale / self.accelerations[k].max(TINY),
                false => force,
            },
            shortest,
            l_shortest: low,
            inverse_optimum: 1.0 / optimum.max(TINY),
            inverse_speed: 1.0 / (optimum * v_max).max(TINY),
            l_min,
            l_max,
            fp_max,
            fv_max,
        })
    }
}
