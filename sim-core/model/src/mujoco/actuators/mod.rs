//! Actuators of a model: their laws, activations and delays.

mod delays;
pub(super) mod motors;
pub(super) mod muscles;
mod transmissions;

use super::format::ModelFile;
use super::names::names;
use super::options::has_flag;
use crate::description::{Actuator, ActuatorActivation, Robot};
use crate::error::ModelError;
use motors::Motors;
use muscles::{Law, Muscles};
use sim_physics::constants::actuators::{ActivationRate, MuscleRate};
use transmissions::Transmissions;

/// Adds the actuators; [`super::refusals`] has named those that are not supported.
pub(super) fn add_actuators(file: &ModelFile, robot: &mut Robot) -> Result<(), ModelError> {
    let count = file.rows("actuator_trntype");
    let names = names(file, "actuator", count)?;
    let transmissions = Transmissions::read(file, robot, count)?;
    let activations = Activations::read(file, count)?;
    let (gain_kinds, gains) = laws(file, "gain", count)?;
    let (bias_kinds, biases) = laws(file, "bias", count)?;
    let muscles = Muscles::read(file, count)?;
    let motors = Motors::read(file, count)?;
    let delays = delays::read(file, count)?;
    let clamps = !has_flag(file, "mjDSBL_CLAMPCTRL")?;
    let ctrl_ranges = ranges(file, "ctrl", count)?;
    let force_ranges = ranges(file, "force", count)?;
    let acts = !has_flag(file, "mjDSBL_ACTUATION")?;
    let disabled = file.integer("opt.disableactuator")?;
    let groups = file.integers("actuator_group", count)?;
    let mut actuators = Vec::new();
    for k in 0..count {
        let length = transmissions.length(k)?;
        let is_on = acts && !((0..31).contains(&groups[k]) && disabled >> groups[k] & 1 == 1);
        let on = |law: [f64; 3]| if is_on { law } else { [0.0; 3] };
        let motor_laws = motors.laws(k);
        actuators.push(Actuator {
            name: names[k].clone(),
            length,
            activation: activations.activation(k, is_on, acts),
            delay: delays[k].filter(|_| is_on),
            ctrl_range: ctrl_ranges[k].filter(|_| clamps),
            force_range: force_ranges[k].filter(|_| is_on),
            gain: on(match (motor_laws, gain_kinds[k].as_str()) {
                (Some([gain, _]), _) => gain,
                (_, "mjGAIN_AFFINE") => gains[k],
                (_, "mjGAIN_MUSCLE") => [0.0; 3],
                _ => [gains[k][0], 0.0, 0.0],
            }),
            bias: on(match (motor_laws, bias_kinds[k].as_str()) {
                (Some([_, bias]), _) => bias,
                (_, "mjBIAS_AFFINE") => biases[k],
                _ => [0.0; 3],
            }),
            muscle_gain: muscles.law(k, gain_kinds[k] == "mjGAIN_MUSCLE" && is_on, Law::Gain),
            muscle_bias: muscles.law(k, bias_kinds[k] == "mjBIAS_MUSCLE" && is_on, Law::Bias),
            motor: motors.motor(k).filter(|_| is_on),
        });
    }
    if let Some(parts) = &mut robot.precompiled {
        parts.actuators = actuators;
        if !acts {
            for joint in &mut parts.joints {
                joint.actuator_range = None;
            }
        }
    }
    Ok(())
}

pub(super) type Laws = (Vec<String>, Vec<[f64; 3]>);

/// Kinds of gains or biases, and their first three parameters.
pub(super) fn laws(file: &ModelFile, which: &str, count: usize) -> Result<Laws, ModelError> {
    let kinds = file.kinds(&format!("actuator_{which}type"), count)?;
    let parameters = file.vectors::<10>(&format!("actuator_{which}prm"), count)?;
    let parameters = parameters.into_iter().map(|[a, b, c, ..]| [a, b, c]);
    Ok((kinds, parameters.collect()))
}

fn ranges(
    file: &ModelFile,
    which: &str,
    count: usize,
) -> Result<Vec<Option<[f64; 2]>>, ModelError> {
    let limited = file.integers(&format!("actuator_{which}limited"), count)?;
    let ranges = file.vectors::<2>(&format!("actuator_{which}range"), count)?;
    let both = limited.into_iter().zip(ranges);
    Ok(both
        .map(|(limited, range)| (limited != 0).then_some(range))
        .collect())
}

/// Arrays of activations.
struct Activations {
    kinds: Vec<String>,
    parameters: Vec<[f64; 10]>,
    ranges: Vec<Option<[f64; 2]>>,
    early: Vec<i64>,
}

impl Activations {
    fn read(file: &ModelFile, count: usize) -> Result<Activations, ModelError> {
        let counts = file.integers("actuator_actnum", count)?;
        let firsts = file.integers("actuator_actadr", count)?;
        let kinds = file.kinds("actuator_dyntype", count)?;
        let parameters = file.vectors::<10>("actuator_dynprm", count)?;
        let mut next = 0;
        let parts = kinds.iter().zip(&parameters);
        for ((kind, [time, ..]), (count, first)) in parts.zip(counts.iter().zip(firsts)) {
            if *count > 0 && first != next {
                return Err(file.fault("has activations in another order".to_owned()));
            }
            // a motor has one if it has inductance
            let has_one = match kind.as_str() {
                "mjDYN_NONE" => false,
                "mjDYN_DCMOTOR" => *time > 0.0,
                _ => true,
            };
            if *count != i64::from(has_one) {
                return Err(file.fault(format!("has {count} activations of kind {kind}")));
            }
            next += count;
        }
        Ok(Activations {
            kinds,
            parameters,
            ranges: ranges(file, "act", count)?,
            early: file.integers("actuator_actearly", count)?,
        })
    }

    /// The activation of actuator `k`. Where it is switched off it is held; within its bounds, unless all are off.
    fn activation(&self, k: usize, is_on: bool, acts: bool) -> Option<ActuatorActivation> {
        let time = self.parameters[k][0].max(TIME_MIN);
        let rate = match self.kinds[k].as_str() {
            "mjDYN_NONE" => return None,
            "mjDYN_DCMOTOR" => ActivationRate::Current(self.current_time(k)?),
            "mjDYN_INTEGRATOR" => ActivationRate::Control,
            "mjDYN_MUSCLE" => {
                let [rise, fall, width, ..] = self.parameters[k];
                ActivationRate::Muscle(MuscleRate { rise, fall, width })
            }
            _ => ActivationRate::Filter(time),
        };
        Some(ActuatorActivation {
            rate: if is_on { rate } else { ActivationRate::Held },
            exact: self.kinds[k] == "mjDYN_FILTEREXACT",
            range: self.ranges[k].filter(|_| acts),
            early: self.early[k] != 0,
        })
    }
}

/// Smallest time constant of a filter [s] (MuJoCo: `mjMINVAL`).
const TIME_MIN: f64 = 1e-15;
