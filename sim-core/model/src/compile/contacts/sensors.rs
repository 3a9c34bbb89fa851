//! Which bodies of MuJoCo models contacts act on, and which sensors they are of.

use super::pieces::{PlacedShape, Rules, named_pair_place};
use crate::description::{Description, Precompiled, Sense, Shape, Touching};
use sim_physics::constants::Constants;
use sim_physics::constants::contact::{Contacts, Kind, Pair, TouchedBodies};
use sim_physics::constants::sensors::{Reduction, SensorKind, Sensors};
use sim_physics::lane::Fixed;
use std::collections::{BTreeMap, BTreeSet};

/// Gives each class of contacts the bodies of MuJoCo models that it acts on, and each pair their places in that list.
pub(super) fn add_touched_bodies(constants: &mut Constants<f64>) {
    let bodies = &constants.outputs.bodies;
    if bodies.is_empty() {
        return;
    }
    // the worlds of models take no forces
    let body_of = |link: usize| {
        let place = bodies.iter().position(|body| body.link == link);
        place.filter(|&place| bodies[place].parent != place)
    };
    let contacts = &mut constants.contacts;
    let mut of_classes: Vec<Vec<usize>> = vec![Vec::new(); contacts.classes.len()];
    let mut places = Vec::with_capacity(2 * contacts.pairs.len());
    for pair in &contacts.pairs {
        let bodies = &mut of_classes[pair.class];
        for link in pair.links {
            let body = link.and_then(body_of);
            let place = body.map(
                |body| match bodies.iter().position(|other| *other == body) {
                    Some(place) => place,
                    None => {
                        bodies.push(body);
                        bodies.len() - 1
                    }
                },
            );
            places.push(place.map_or(0.0, |place| (place + 1) as f64));
        }
    }
    contacts.bodies = TouchedBodies {
        of_pair: Fixed {
            base: contacts.tables.numbers.len(),
            stride: 2,
            rows: contacts.pairs.len(),
        },
        of_classes,
    };
    contacts.tables.numbers.extend(places);
}

/// A shape as sensors of contacts of a model see it.
#[derive(Clone, Copy)]
struct Side {
    /// The robot, the link and the geom that it is.
    of: Option<(usize, usize, usize)>,
    /// MuJoCo orders the geoms of a contact by kind, then by number.
    rank: usize,
}

/// Gives sensors of contacts the pairs of shapes that they are of.
pub(in crate::compile) fn add_contact_sensors(
    constants: &mut Constants<f64>,
    scene: &Description,
    shapes: &[PlacedShape<'_>],
    rules: &Rules<'_>,
) {
    let sides = sides(scene, shapes);
    let pairs = &constants.contacts.pairs;
    let both: Vec<[Side; 2]> = pairs
        .iter()
        .map(|pair| pair.shapes.map(|shape| sides[shape]))
        .collect();
    let orders = both.iter().map(|[a, b]| match a.rank <= b.rank {
        true => 1.0,
        false => -1.0,
    });
    let mut columns: Vec<Vec<f64>> = vec![orders.collect()];
    let mut sensors = constants.sensors.all.iter_mut();
    let mut records = 0;
    for (robot, robot_parts) in scene.robots.iter().enumerate() {
        let Some(parts) = &robot_parts.precompiled else {
            continue;
        };
        for sense in parts
            .sensors
            .all
            .iter()
            .filter_map(|sensor| sensor.sense.as_ref())
        {
            let Some(sensor) = sensors.next() else { break };
            let senses: Vec<f64> = match sense {
                Sense::Touch(zone) => {
                    let is_on_link = |side: &Side| {
                        side.of
                            .is_some_and(|owner| (owner.0, owner.1) == (robot, zone.site.link))
                    };
                    let sense = |[a, b]: &[Side; 2]| match (is_on_link(a), is_on_link(b)) {
                        (true, _) => 1.0,
                        (_, true) => -1.0,
                        _ => 0.0,
                    };
                    both.iter().map(sense).collect()
                }
                Sense::Contact { first, second, .. } => {
                    let belongs = |side: &Side, what: Touching| is_of(parts, robot, side, what);
                    let sense = |[a, b]: &[Side; 2]| {
                        let (lower, higher) = if a.rank <= b.rank { (a, b) } else { (b, a) };
                        let order = if a.rank <= b.rank { 1.0 } else { -1.0 };
                        let matches = [lower, higher]
                            .map(|side| (belongs(side, *first), belongs(side, *second)));
                        order * direction(*first, *second, matches)
                    };
                    both.iter().map(sense).collect()
                }
                _ => continue,
            };
            let classes: BTreeSet<usize> = pairs
                .iter()
                .zip(&senses)
                .filter(|(_, sense)| **sense != 0.0)
                .map(|(pair, _)| pair.class)
                .collect();
            match &mut sensor.kind {
                SensorKind::Touch(touch) => {
                    (touch.column, touch.classes) = (columns.len(), classes.into_iter().collect());
                }
                SensorKind::Contact(contact) => {
                    (contact.column, contact.classes) =
                        (columns.len(), classes.into_iter().collect());
                    records = records.max(contact.records);
                    contact.capsules = capsules(&constants.contacts, &senses);
                }
                _ => {}
            }
            columns.push(senses);
        }
    }
    add_rates(&mut constants.sensors, &constants.contacts, &mut columns);
    // the first column alone is of no sensor
    if columns.len() > 1 {
        let table = Fixed {
            base: constants.contacts.tables.numbers.len(),
            stride: columns.len(),
            rows: both.len(),
        };
        let numbers =
            (0..both.len()).flat_map(|pair| columns.iter().map(move |column| column[pair]));
        constants.contacts.tables.numbers.extend(numbers);
        constants.sensors.pairs = table;
        constants.sensors.records = records;
    }
    if constants.solver.noslip.is_some() || takes_first(&constants.sensors) {
        let ranks = ranks(&constants.contacts.pairs, &sides, shapes, rules);
        constants.sensors.ranks = Fixed {
            base: constants.contacts.tables.numbers.len(),
            stride: 1,
            rows: ranks.len(),
        };
        constants.contacts.tables.numbers.extend(ranks);
    }
}

/// Gives sensors that show velocities the moving bodies of their pairs, and the table of pairs two
/// columns with those of each.
fn add_rates(sensors: &mut Sensors<f64>, contacts: &Contacts<f64>, columns: &mut Vec<Vec<f64>>) {
    let body_of = |shape: usize| {
        let solid = contacts.solids.iter().find(|solid| solid.shape == shape);
        solid.and_then(|solid| solid.body)
    };
    let first = columns.len();
    let mut is_shown = false;
    for sensor in &mut sensors.all {
        let SensorKind::Contact(contact) = &mut sensor.kind else {
            continue;
        };
        let Some(rates) = &mut contact.rates else {
            continue;
        };
        let senses = contacts.pairs.iter().zip(&columns[contact.column]);
        let sensed = senses.filter(|(_, sense)| **sense != 0.0);
        let bodies: BTreeSet<usize> = sensed
            .flat_map(|(pair, _)| pair.shapes.map(body_of))
            .flatten()
            .collect();
        (rates.column, rates.bodies) = (first, bodies.into_iter().collect());
        is_shown = true;
    }
    if is_shown {
        for side in 0..2 {
            let pairs = contacts.pairs.iter();
            let numbers = pairs.map(|pair| body_of(pair.shapes[side]).map_or(0, |body| body + 1));
            columns.push(numbers.map(|number| number as f64).collect());
        }
    }
}

/// Does a sensor take the first of its contacts?
fn takes_first(sensors: &Sensors<f64>) -> bool {
    sensors.all.iter().any(|sensor| match &sensor.kind {
        SensorKind::Contact(contact) => contact.reduction == Reduction::First,
        _ => false,
    })
}

/// Place of each pair in MuJoCo's order of contacts (`mj_collision`): by the two bodies, then pairs that a model names, then by
/// the two geoms in their order in a contact.
fn ranks(
    pairs: &[Pair],
    sides: &[Side],
    shapes: &[PlacedShape<'_>],
    rules: &Rules<'_>,
) -> Vec<f64> {
    let key = |pair: &Pair| {
        let mut numbers = pair.shapes;
        numbers.sort_by_key(|&shape| sides[shape].rank);
        let [first, second] = numbers.map(|number| &shapes[number]);
        let mut bodies = [first, second].map(|shape| (shape.robot, shape.own_link));
        bodies.sort_unstable();
        let named = named_pair_place(first, second, rules);
        (bodies, named.unwrap_or(usize::MAX), numbers)
    };
    let keys: BTreeSet<_> = pairs.iter().map(key).collect();
    let places: BTreeMap<_, usize> = keys.into_iter().zip(0..).collect();
    pairs.iter().map(|pair| places[&key(pair)] as f64).collect()
}

/// Pairs of a plane and a capsule that a sensor is of, each with the capsule among the solids.
fn capsules(contacts: &Contacts<f64>, senses: &[f64]) -> Vec<(usize, usize)> {
    let Some(group) = contacts.group((Kind::Plane, Kind::Capsule)) else {
        return Vec::new();
    };
    let sensed = (group.first..group.end).filter(|&pair| senses[pair] != 0.0);
    let solid = |pair: usize| {
        let shapes = contacts.pairs[pair].shapes;
        let mut solids = contacts.solids.iter();
        solids.position(|solid| solid.kind == Kind::Capsule && shapes.contains(&solid.shape))
    };
    sensed
        .filter_map(|pair| Some((pair, solid(pair)?)))
        .collect()
}

/// The shapes of a scene, by their numbers.
fn sides(scene: &Description, shapes: &[PlacedShape<'_>]) -> Vec<Side> {
    let mut place = (None, 0, 0);
    let sides = shapes.iter().map(|shape| {
        place = match place {
            (robot, link, count) if (robot, link) == (shape.robot, shape.own_link) => {
                (robot, link, count + 1)
            }
            _ => (shape.robot, shape.own_link, 1),
        };
        let collision = place.2 - 1;
        let geom = shape.robot.and_then(|robot| {
            let parts = scene.robots[robot].precompiled.as_ref()?;
            let geoms = parts.frames.geoms.iter().zip(&parts.frames.collisions);
            geoms.enumerate().find_map(|(geom, (on, geom_collision))| {
                (on.link == shape.own_link && *geom_collision == Some(collision)).then_some(geom)
            })
        });
        let kind = match shape.shape {
            Shape::Plane => 0,
            Shape::HeightField(_) => 1,
            Shape::Sphere { .. } => 2,
            Shape::Capsule { .. } => 3,
            Shape::Ellipsoid { .. } => 4,
            Shape::Cylinder { .. } => 5,
            Shape::Box { .. } => 6,
            Shape::Mesh(_) => 7,
        };
        Side {
            of: shape
                .robot
                .zip(geom)
                .map(|(robot, geom)| (robot, shape.own_link, geom)),
            rank: kind * shapes.len() + shape.number,
        }
    });
    sides.collect()
}

/// Is a shape of an object of a model?
fn is_of(parts: &Precompiled, robot: usize, side: &Side, what: Touching) -> bool {
    let Some((_, link, geom)) = side.of.filter(|(other, ..)| *other == robot) else {
        return matches!(what, Touching::Anything | Touching::InZone);
    };
    match what {
        Touching::Anything | Touching::InZone => true,
        Touching::Geom(wanted) => wanted == geom,
        Touching::Link(wanted) => wanted == link,
        Touching::Subtree(wanted) => {
            let mut next = link;
            while next > wanted {
                next = parts.parents[next];
            }
            next == wanted
        }
    }
}

/// 1 where a contact goes from the first object of a sensor to the second, -1 where it is the other way, 0 for none. Of each
/// shape: whether it is of the first, and of the second object.
fn direction(first: Touching, second: Touching, [lower, higher]: [(bool, bool); 2]) -> f64 {
    if !(lower.0 || higher.0) || !(lower.1 || higher.1) {
        return 0.0;
    }
    let (has_first, has_second) = (first != Touching::Anything, second != Touching::Anything);
    let is_regular = match (has_first, has_second) {
        (true, true) => match (lower.0 && higher.1, higher.0 && lower.1) {
            (true, _) => true,
            (_, true) => false,
            _ => return 0.0,
        },
        (true, false) => lower.0,
        (false, true) => higher.1,
        (false, false) => true,
    };
    if is_regular { 1.0 } else { -1.0 }
}
