//! Friction that is drawn and never counts, since of two shapes that touch the other's does.

use std::collections::{BTreeMap, BTreeSet};

use sim_model::{Description, Distribution, FrictionCombine, Model};
use sim_physics::constants::params::Param;

use super::some;

/// Draws of a normal distribution are within so many standard deviations, all but one in 16,000.
const DEVIATIONS: f64 = 4.0;

/// Advice on draws of `shape_mu` without an effect.
pub(super) fn advice(scene: &Description, model: &Model) -> Vec<String> {
    // contacts with geoms of MuJoCo models keep the larger one, whatever the rule
    let has_geoms = scene.robots.iter().any(|robot| robot.precompiled.is_some());
    let draws = model.start().params.iter();
    let drawn: BTreeMap<usize, [f64; 2]> = draws
        .filter(|draw| draw.param == Param::ShapeMu)
        .map(|draw| (draw.column, range(&draw.distribution)))
        .collect();
    if drawn.is_empty() {
        return Vec::new();
    }
    let starts = model.constants().varying.starts().iter();
    let of_shapes = starts.filter(|(param, _)| *param == Param::ShapeMu);
    let starts: Vec<f64> = of_shapes.map(|&(_, number)| number).collect();
    let range_of = |shape: usize| drawn.get(&shape).copied().unwrap_or([starts[shape]; 2]);
    let mut touched: BTreeMap<usize, BTreeSet<usize>> = BTreeMap::new();
    for pair in &model.constants().contacts.pairs {
        let [a, b] = pair.shapes;
        touched.entry(a).or_default().insert(b);
        touched.entry(b).or_default().insert(a);
    }
    let (word, other_rule) = match model.constants().contacts.combine {
        FrictionCombine::Max => ("larger", "min"),
        FrictionCombine::Min if !has_geoms => ("smaller", "max"),
        _ => return Vec::new(),
    };
    let names = model.shape_names();
    let mut all = Vec::new();
    for (&shape, &[low, high]) in &drawn {
        let Some(others) = touched.get(&shape).filter(|_| low < high) else {
            continue;
        };
        let hides = |other: usize| match word {
            "larger" => range_of(other)[0] >= high,
            _ => range_of(other)[1] <= low,
        };
        if !others.iter().all(|&other| hides(other)) {
            continue;
        }
        let others: Vec<String> = others
            .iter()
            .map(|&other| {
                let [least, most] = range_of(other);
                let number = if word == "larger" { least } else { most };
                format!("`{}` with {number}", names[other])
            })
            .collect();
        let rule = match has_geoms {
            true => String::new(),
            false => {
                format!(", or choose another rule, such as friction_combine=\"{other_rule}\"")
            }
        };
        all.push(format!(
            "shape `{}`: the friction drawn for it, {low} to {high}, has no effect, since of two shapes the {word} coefficient \
             counts, and it touches {}. Draw that of the others too{rule}.",
            names[shape],
            some(&others)
        ));
    }
    all
}

/// Where nearly all draws are.
fn range(distribution: &Distribution) -> [f64; 2] {
    match *distribution {
        Distribution::Uniform { low, high } => [low, high],
        Distribution::Normal { mean, std } => {
            [(mean - DEVIATIONS * std).max(0.0), mean + DEVIATIONS * std]
        }
    }
}
