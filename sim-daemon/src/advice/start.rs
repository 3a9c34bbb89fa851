//! Shapes that are deep inside of others at the start: the contacts throw them apart.

use std::sync::Arc;

use sim_engine::simulation::{Options, Precision, Simulation};
use sim_model::{Description, Model};
use sim_physics::arrays::Field;

/// Depth at the start that is reported [m]: grippers and feet are made with less.
const DEPTH: f64 = 0.01;
/// Pairs that are named.
const NAMED: usize = 3;

/// Advice on where bodies start. A model that cannot be evaluated has none; the simulation says why.
pub(super) fn advice(scene: &Description, model: &Arc<Model>) -> Vec<String> {
    deep_pairs(scene, model).unwrap_or_default()
}

fn deep_pairs(scene: &Description, model: &Arc<Model>) -> Option<Vec<String>> {
    if model.contacts_max() == 0 {
        return Some(Vec::new());
    }
    let options = Options {
        worlds: 1,
        precision: Precision::F64,
        threads: Some(1),
        fields: vec![
            Field::ContactCount,
            Field::ContactDistance,
            Field::ContactPair,
        ],
        ..Options::default()
    };
    let mut simulation = Simulation::new(Arc::clone(model), &options).ok()?;
    let mut arena = vec![0; simulation.layout().bytes.div_ceil(8)];
    simulation.forward(&mut arena);
    let words = |field| {
        let slot = simulation
            .layout()
            .slots
            .iter()
            .find(|slot| slot.field == field)?;
        Some(&arena[slot.offset / 8..(slot.offset + slot.bytes).div_ceil(8)])
    };
    let count = words(Field::ContactCount)?[0] as u32 as usize;
    let distances: &[f64] = bytemuck::cast_slice(words(Field::ContactDistance)?);
    let pairs: &[i32] = bytemuck::cast_slice(words(Field::ContactPair)?);
    let mut deep: Vec<(f64, [i32; 2])> = Vec::new();
    // models from MuJoCo begin where their makers put them, often at a keyframe
    let names = model.shape_names();
    let is_geom = |shape: i32| {
        let owner = names[shape as usize].split('/').next();
        let mut models = scene
            .robots
            .iter()
            .filter(|robot| robot.precompiled.is_some());
        models.any(|robot| Some(robot.name.as_str()) == owner)
    };
    let contacts = distances.iter().zip(pairs.as_chunks().0).take(count);
    for (&distance, &pair) in contacts {
        if distance > -DEPTH || pair.into_iter().all(is_geom) {
            continue;
        }
        match deep.iter_mut().find(|(_, other)| *other == pair) {
            Some((least, _)) => *least = least.min(distance),
            None => deep.push((distance, pair)),
        }
    }
    deep.sort_by(|a, b| a.0.total_cmp(&b.0));
    let named: Vec<String> = deep
        .iter()
        .take(NAMED)
        .map(|(distance, [a, b])| {
            let (a, b) = (&names[*a as usize], &names[*b as usize]);
            format!("`{b}` is {:.2} m deep in `{a}`", -distance)
        })
        .collect();
    if named.is_empty() {
        return Some(Vec::new());
    }
    let more = match deep.len() - named.len() {
        0 => String::new(),
        more => format!(", and {more} more pairs"),
    };
    Some(vec![format!(
        "At the start, {}{more}: contacts will throw them apart. Start higher (pos=), change joint_q, or let the pair pass \
         (filter_contacts).",
        named.join(", ")
    )])
}
