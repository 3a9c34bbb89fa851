//! Draws around 1 of parameters that a draw replaces: most likely factors of the model's values.

use std::collections::BTreeMap;

use sim_model::{Description, Distribution, Model};
use sim_physics::constants::params::{NO_LIMIT, Param};

use super::some;

/// Factors of the values of a model are between these [–].
const FACTORS: [f64; 2] = [0.1, 10.0];
/// A value of the model this far outside of a range around 1 is not among what is meant [–].
const BESIDE: f64 = 1.25;
/// Ranges without 1 look like factors, too, if a value of the model is this many times as large [–].
const FAR: f64 = 10.0;
/// How far the middle of a range of frictions may be from 1: they are near 1 themselves [–].
const CENTRE: f64 = 0.05;
/// The same of other parameters, whose own values are rarely about 1.
const ABOUT: f64 = 0.15;

/// Advice on draws that look like factors, a sentence or two for each parameter and range.
pub(super) fn advice(scene: &Description, model: &Model) -> Vec<String> {
    let mut all = Vec::new();
    for (&param, ranges) in &scene.param_ranges {
        let mut told: Vec<Distribution> = Vec::new();
        for distribution in ranges.values() {
            if told.contains(distribution) {
                continue;
            }
            told.push(*distribution);
            let values = drawn_values(model, param, distribution);
            if !is_factor(param, distribution, &values) {
                continue;
            }
            let names = ranges.iter().filter(|(_, other)| *other == distribution);
            let names: Vec<String> = names.map(|(name, _)| format!("`{name}`")).collect();
            all.push(sentence(param, distribution, &names, &values));
        }
    }
    all
}

/// Whether the draws of a gravity or another parameter are reported as factors.
pub(super) fn is_told(param: Param, distribution: &Distribution, value: f64) -> bool {
    is_factor(param, distribution, &[value])
}

/// The model's values, without 0, that a distribution replaces.
fn drawn_values(model: &Model, param: Param, distribution: &Distribution) -> Vec<f64> {
    let starts = model.constants().varying.starts().iter();
    let starts: Vec<f64> = starts
        .filter(|(of, _)| *of == param)
        .map(|&(_, value)| value)
        .collect();
    let draws = model.start().params.iter();
    let columns: BTreeMap<usize, Distribution> = draws
        .filter(|draw| draw.param == param)
        .map(|draw| (draw.column, draw.distribution))
        .collect();
    let drawn = columns.iter().filter(|(_, of)| *of == distribution);
    drawn
        .filter_map(|(&column, _)| starts.get(column).copied())
        .filter(|value| *value != 0.0 && value.abs() < NO_LIMIT)
        .collect()
}

fn is_factor(param: Param, distribution: &Distribution, values: &[f64]) -> bool {
    if !replaces(param) {
        return false;
    }
    let [low, high] = ends(distribution);
    if low >= high || low < FACTORS[0] || high > FACTORS[1] {
        return false;
    }
    let is_beside = |value: &f64| *value < low / BESIDE || *value > high * BESIDE;
    let is_near_1 = match param {
        Param::ShapeMu => (0.5 * (low + high) - 1.0).abs() <= CENTRE,
        // factors are about 1, by difference or by ratio
        _ => {
            let middles = [0.5 * (low + high), (low * high).sqrt()];
            let is_about_1 = middles.iter().any(|middle| (middle - 1.0).abs() <= ABOUT);
            low <= 1.0 && high >= 1.0 && is_about_1
        }
    };
    if is_near_1 {
        return values.iter().any(is_beside);
    }
    param != Param::ShapeMu && values.iter().any(|value| *value > high * FAR)
}

/// Whether a draw replaces a value of the model that is other than 0 or 1 as a rule.
fn replaces(param: Param) -> bool {
    matches!(
        param,
        Param::Gravity
            | Param::JointArmature
            | Param::JointDamping
            | Param::JointFriction
            | Param::JointTargetKe
            | Param::JointTargetKd
            | Param::JointEffortLimit
            | Param::ShapeMu
            | Param::BodyMass
            | Param::BodyInertia
            | Param::ActuatorGain
            | Param::ActuatorBias
            | Param::ActuatorForcerange
    )
}

fn sentence(param: Param, distribution: &Distribution, names: &[String], draws: &[f64]) -> String {
    let row = param.row();
    let [least, most] = draws
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], x| {
            [least.min(*x), most.max(*x)]
        });
    let unit = match row.unit {
        "–" => String::new(),
        unit => format!(" {unit}"),
    };
    let values = match least == most {
        true => format!("{}{unit}", number(least)),
        false => format!("{} to {}{unit}", number(least), number(most)),
    };
    let (call, [a, b]) = match *distribution {
        Distribution::Uniform { low, high } => ("Uniform", [low, high]),
        Distribution::Normal { mean, std } => ("Normal", [mean, std]),
    };
    let cure = match param {
        Param::BodyMass | Param::BodyInertia => {
            "For factors, draw body_mass_scale, which scales mass and inertia of a link together"
                .to_owned()
        }
        _ => format!(
            "For factors, give each its range, such as {call}({a} * {most}, {b} * {most})",
            most = number(if most > 0.0 { most } else { least })
        ),
    };
    format!(
        "randomize: {} of {} is drawn from {call}({a}, {b}), which looks like factors, and a draw replaces the value: {values} in \
         the model. {cure}.",
        row.name,
        some(names)
    )
}

/// Where most draws are.
fn ends(distribution: &Distribution) -> [f64; 2] {
    match *distribution {
        Distribution::Uniform { low, high } => [low, high],
        Distribution::Normal { mean, std } => [mean - std, mean + std],
    }
}

/// A value with three significant digits.
fn number(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    let scale = 10_f64.powi(2 - value.abs().log10().floor() as i32);
    (value * scale).round() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    const AROUND_1: Distribution = Distribution::Uniform {
        low: 0.8,
        high: 1.2,
    };

    #[test]
    fn a_range_around_1_of_values_elsewhere_is_a_factor() {
        for param in [Param::BodyMass, Param::JointTargetKe, Param::JointDamping] {
            assert!(is_factor(param, &AROUND_1, &[1.0, 3.5]), "{param:?}");
            assert!(!is_factor(param, &AROUND_1, &[0.9, 1.1]), "{param:?}");
            assert!(!is_factor(param, &AROUND_1, &[]), "{param:?}");
        }
        assert!(!is_factor(Param::BodyMassScale, &AROUND_1, &[3.0]));
        assert!(!is_factor(Param::JointQNoise, &AROUND_1, &[3.0]));
        let gravity = Distribution::Normal {
            mean: 1.0,
            std: 0.1,
        };
        assert!(is_factor(Param::Gravity, &gravity, &[-9.81]));
        let upwards = Distribution::Uniform {
            low: 9.0,
            high: 10.0,
        };
        assert!(!is_factor(Param::Gravity, &upwards, &[-9.81]));
    }

    #[test]
    fn weaker_gains_are_factors_and_frictions_of_usual_surfaces_are_none() {
        let weaker = Distribution::Uniform {
            low: 0.5,
            high: 0.9,
        };
        assert!(is_factor(Param::JointTargetKe, &weaker, &[400.0]));
        assert!(!is_factor(Param::JointTargetKd, &weaker, &[2.0]));
        assert!(!is_factor(Param::ShapeMu, &weaker, &[0.05]));
        let rough = Distribution::Uniform {
            low: 0.5,
            high: 1.25,
        };
        assert!(!is_factor(Param::ShapeMu, &rough, &[0.3]));
        assert!(is_factor(Param::ShapeMu, &AROUND_1, &[0.3]));
    }

    #[test]
    fn values_are_shown_with_three_digits() {
        assert_eq!([number(0.017_43), number(-1234.5)], [0.0174, -1230.0]);
    }
}
