//! Sensors of contacts: touch, and records of contacts (MuJoCo: `touch`, `contact`).
//!
//! ```text
//! touch = Σ f      over the contacts of a body whose ray from the body outwards meets the zone; f the normal force
//! ```
//!
//! A record is a contact as seen from the first object of a sensor: its normal points to the second object, and its force acts
//! on it. With our normal e n, tangents (d t₁, s t₂), s = ±1 where MuJoCo's normal is ±n and d = e s:
//!
//! ```text
//! force = (n · F, s t₁ · F, d t₂ · F)
//! ```
//!
//! Tangents are MuJoCo's: with elliptic cones the solver has others, and none without friction.

use super::contact_rates::moving;
use super::zone::{holds, meets};
use super::{has, put, put_at};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::{row, turning};
use crate::constants::sensors::{
    ContactSensor, LONG_SLOT, RECORD, Reduction, SLOT, Sensor, SensorKind, TouchSensor, Zone,
};
use crate::each;
use crate::lane::{Cx, MaskOf, Num, Real, map};
use crate::math::vec3::{Mat3, Vec3, load_vec3};
use crate::step::constraints::contact_rows::{class_list, tangents, turning_scales};
use crate::step::outputs::sites::{position, reference, to_local};
use crate::step::{BlockOf, ConstantsOf, Stage};

/// Key of an empty slot.
const EMPTY: f64 = 1e30;

/// Sensors of contacts.
pub struct Contacts;

impl Stage for Contacts {
    const READS: &'static [A] = &[
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Velocity,
        A::ContactForces,
        A::Sensordata,
    ];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        use SensorKind::*;
        has(m, |kind| matches!(kind, Touch(_) | Contact(_)))
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for sensor in &m.sensors.all {
            match &sensor.kind {
                SensorKind::Touch(touch) => {
                    let sum = touched(cx, m, b, touch);
                    put(&mut b.work.sensordata, sensor, &[sum]);
                }
                SensorKind::Contact(contact) => match contact.reduction {
                    Reduction::NetForce => net_force(cx, m, b, sensor, contact),
                    _ => records(cx, m, b, sensor, contact),
                },
                _ => {}
            }
        }
    }
}

/// A contact that a sensor may be of.
pub(super) struct Contact<F> {
    /// In the world [m].
    point: Vec3<F>,
    /// Normal and tangents.
    pub(super) frame: Mat3<F>,
    /// Along them [N].
    force: Vec3<F>,
    /// About them [N·m].
    torque: Vec3<F>,
    /// [m]
    distance: F,
    /// 1 where MuJoCo's normal is ours, else -1.
    order: F,
    /// 1 where our normal points from the first object to the second, -1 where it is the other way, 0 for none.
    sense: F,
}

/// Contact `r` of a class, for the sensor with a column in the table of pairs.
#[inline(always)]
fn contact<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    (class, column): (usize, usize),
    r: C::I,
) -> Contact<C::F> {
    let t = &m.contacts;
    let rows = t.memory.rows;
    // normal and tangents of the solver
    let pair = cx.load(rows, r, row::PAIR);
    let frame = [
        load_vec3(cx, rows, r, row::NORMAL),
        load_vec3(cx, rows, r, row::TANGENTS),
        load_vec3(cx, rows, r, row::TANGENTS + 3),
    ];
    let mut torque = Vec3::zero();
    // torsional and rolling rows are scaled by their friction over that of sliding, so a torque is too
    if let Some(block) = t.classes[class].turns {
        let Vec3([x, y, z]) = load_vec3(cx, rows, r, block + turning::FORCE);
        let Vec3([twist, first, second]) = turning_scales(cx, t, pair);
        torque = Vec3([x * twist, y * first, z * second]);
    }
    // rows have points from the reference point of the second tree
    let there = b.work.reference[t.classes[class].trees.1];
    Contact {
        point: load_vec3(cx, rows, r, row::POINT) + there,
        frame: Mat3(frame),
        force: load_vec3(cx, rows, r, row::FORCE),
        torque,
        distance: cx.load(rows, r, row::DISTANCE),
        order: cx.pick(m.sensors.pairs, pair, 0),
        sense: cx.pick(m.sensors.pairs, pair, column),
    }
}

/// A point of the world in the axes of a zone.
#[inline(always)]
fn in_zone<F: Num, V>(
    b: &crate::arrays::Block<F, V>,
    zone: &Zone<F::Real>,
    point: Vec3<F>,
) -> Vec3<F> {
    let center = position(&b.work, &zone.site) + reference(&b.work, &zone.site);
    to_local(&b.work, &zone.site, point - center)
}

#[inline(always)]
fn touched<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    touch: &TouchSensor<<C::F as Num>::Real>,
) -> C::F {
    let zero = C::F::c(0.0);
    let mut sum = cx.var(zero);
    for &class in &touch.classes {
        let list = class_list(cx, &m.contacts, class);
        each!(cx, r in list, {
            let contact = contact(cx, m, b, (class, touch.column), r);
            // the ray along the normal out of the body that the sensor is on
            let point = in_zone(b, &touch.zone, contact.point);
            let outwards = to_local(&b.work, &touch.zone.site, contact.frame[0] * contact.sense);
            // a contact counts if it pushes, is one of the body, and its ray meets the zone
            let normal = contact.force[0];
            let counts: MaskOf<C> = zero.lt(normal)
                & zero.lt(contact.sense.abs())
                & meets(&touch.zone, point, outwards);
            let more = cx.get(&sum) + C::F::select(counts, normal, zero);
            cx.set(&mut sum, more);
        });
    }
    cx.get(&sum)
}

/// Gives a contact MuJoCo's tangents.
#[inline(always)]
fn turn<F: Num, V>(
    m: &Constants<F::Real>,
    b: &crate::arrays::Block<F, V>,
    sensor: &ContactSensor<F::Real>,
    pair: F,
    contact: &mut Contact<F>,
) {
    // of a plane and a capsule the first tangent lies along the capsule; which pair it is differs per world
    let mut along = None;
    for &(number, solid) in &sensor.capsules {
        let solid = &m.contacts.solids[solid];
        let axis = Vec3::constant(solid.axes[2]);
        let axis = match solid.body {
            Some(body) => b.work.rotation[body] * axis,
            None => axis,
        };
        let is_it = (pair - F::c(number as f64)).abs().lt(F::c(0.5));
        let before = along.unwrap_or(Vec3::zero());
        along = Some(Vec3([
            F::select(is_it, axis[0], before[0]),
            F::select(is_it, axis[1], before[1]),
            F::select(is_it, axis[2], before[2]),
        ]));
    }
    // the same force and torque along the new tangents
    let normal = contact.frame[0];
    let [first, second] = tangents(normal, along);
    let frame = Mat3([normal, first, second]);
    [contact.force, contact.torque] = map([contact.force, contact.torque], |v| {
        // both share the normal: no rounding there, so that equal forces stay equal
        let Vec3([_, x, y]) = frame.transpose_mul(contact.frame.mul_add(v, Vec3::zero()));
        Vec3([v[0], x, y])
    });
    contact.frame = frame;
}

/// The worlds in which a contact is one of a sensor's.
#[inline(always)]
fn matches<C: Cx>(
    b: &BlockOf<C>,
    sensor: &ContactSensor<<C::F as Num>::Real>,
    contact: &Contact<C::F>,
) -> MaskOf<C> {
    // sense is 0 for pairs of other sensors
    let is_of = C::F::c(0.5).lt(contact.sense.abs());
    match &sensor.zone {
        Some(zone) => is_of & holds(zone, in_zone(b, zone, contact.point)),
        None => is_of,
    }
}

/// A vector that changes its sign with the order of the shapes, as MuJoCo shows it.
#[inline(always)]
pub(super) fn seen<F: Num>(contact: &Contact<F>, v: Vec3<F>) -> Vec3<F> {
    // (n · F, s t₁ · F, d t₂ · F) with d = e s, and torques alike
    let (s, e) = (contact.order, contact.sense);
    Vec3([v[0], v[1] * s, v[2] * (s * e)])
}

/// The record of a contact.
#[inline(always)]
fn record<F: Num>(contact: &Contact<F>) -> [F; RECORD] {
    let (s, e) = (contact.order, contact.sense);
    let d = s * e;
    let seen = |v: Vec3<F>| seen(contact, v);
    // place 6, which no part covers, keeps the distance
    let mut all = [contact.distance; RECORD];
    let parts = [
        (0, seen(contact.force)),
        (3, seen(contact.torque)),
        (7, contact.point),
        (10, contact.frame[0] * e),
        (13, contact.frame[1] * d),
    ];
    for (first, part) in parts {
        all[first..first + 3].copy_from_slice(&part.0);
    }
    all
}

/// Writes the first records of a sensor.
#[inline(always)]
fn records<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    sensor: &Sensor<<C::F as Num>::Real>,
    contact_sensor: &ContactSensor<<C::F as Num>::Real>,
) {
    let zero = C::F::c(0.0);
    let mut total = cx.var(zero);
    // empty slots: any contact has a smaller key
    let width = match contact_sensor.rates {
        Some(_) => LONG_SLOT,
        None => SLOT,
    };
    for slot in 0..contact_sensor.records {
        for k in 0..width {
            let start = if k == RECORD { C::F::c(EMPTY) } else { zero };
            cx.set(&mut b.contact_records[slot * width + k], start);
        }
    }
    for &class in &contact_sensor.classes {
        let list = class_list(cx, &m.contacts, class);
        each!(cx, r in list, {
            // the contact with the tangents of MuJoCo, and whether the sensor counts it
            let mut contact = contact(cx, m, b, (class, contact_sensor.column), r);
            let pair = cx.load(m.contacts.memory.rows, r, row::PAIR);
            turn(m, b, contact_sensor, pair, &mut contact);
            let is_found = matches::<C>(b, contact_sensor, &contact);
            // slots are sorted by rising keys: distance, -|F|², or the pair's place in MuJoCo's order
            let key = match contact_sensor.reduction {
                Reduction::LeastDistance => contact.distance,
                Reduction::LargestForce => -contact.force.dot(contact.force),
                Reduction::First | Reduction::NetForce => cx.pick(m.sensors.ranks, pair, 0),
            };
            // the total also counts contacts for which no slot is left
            let more = cx.get(&total) + C::F::select(is_found, C::F::c(1.0), zero);
            cx.set(&mut total, more);
            // the record and its key; a contact that does not count has the key of an empty slot and stays out
            let mut carried = [C::F::select(is_found, key, C::F::c(EMPTY)); LONG_SLOT];
            carried[..RECORD].copy_from_slice(&record(&contact));
            // velocities follow the key
            if let Some(rates) = &contact_sensor.rates {
                let [linear, angular] = moving(cx, m, b, (class, r), rates, &contact);
                carried[SLOT..SLOT + 3].copy_from_slice(&linear.0);
                carried[SLOT + 3..].copy_from_slice(&angular.0);
            }
            // insertion: what a slot loses goes on to the next one
            for slot in 0..contact_sensor.records {
                let cells = slot * width..(slot + 1) * width;
                let kept = cx.get(&b.contact_records[slot * width + RECORD]);
                let is_better = carried[RECORD].lt(kept);
                for (x, cell) in carried.iter_mut().zip(&mut b.contact_records[cells]) {
                    let old = cx.get(cell);
                    cx.set(cell, C::F::select(is_better, *x, old));
                    *x = C::F::select(is_better, old, *x);
                }
            }
        });
    }
    let total = cx.get(&total);
    // slots beyond the total are 0, count included
    for slot in 0..contact_sensor.records {
        let is_there = C::F::c(slot as f64 + 0.5).lt(total);
        let mut kept = [zero; LONG_SLOT];
        for (x, cell) in kept
            .iter_mut()
            .zip(&b.contact_records[slot * width..][..width])
        {
            *x = cx.get(cell);
        }
        let shown = map(kept, |x| C::F::select(is_there, x, zero));
        let count = C::F::select(is_there, total, zero);
        show(
            &mut b.work.sensordata,
            sensor,
            contact_sensor,
            slot,
            count,
            &shown,
        );
    }
}

/// Writes the parts of a record that a sensor shows.
#[inline(always)]
fn show<F: Num>(
    data: &mut [F],
    sensor: &Sensor<F::Real>,
    contact_sensor: &ContactSensor<F::Real>,
    slot: usize,
    count: F,
    record: &[F],
) {
    // scalars of count, force, torque, distance, position, normal, tangent
    let sizes = [1, 3, 3, 1, 3, 3, 3];
    let mut width: usize = sizes
        .iter()
        .zip(contact_sensor.shows)
        .map(|(size, shows)| size * usize::from(shows))
        .sum();
    let rates = contact_sensor
        .rates
        .as_ref()
        .map_or([false; 2], |rates| rates.shows);
    width += 3 * rates.iter().filter(|shows| **shows).count();
    // the sensor's parts follow each other. The record does not contain the count
    let (mut place, mut first) = (sensor.first + slot * width, 0);
    for (part, (size, shows)) in sizes.into_iter().zip(contact_sensor.shows).enumerate() {
        let scalars = match part {
            0 => std::slice::from_ref(&count),
            _ => &record[first..first + size],
        };
        if part > 0 {
            first += size;
        }
        if shows {
            put_at(data, place, sensor.cutoff.as_ref(), scalars);
            place += size;
        }
    }
    // velocities are behind the key of the record
    for (part, shows) in rates.into_iter().enumerate() {
        if shows {
            let scalars = &record[SLOT + 3 * part..][..3];
            put_at(data, place, sensor.cutoff.as_ref(), scalars);
            place += 3;
        }
    }
}

/// Writes the sum of the forces of a sensor's contacts at the centre of their points, weighted by their forces.
#[inline(always)]
fn net_force<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    sensor: &Sensor<<C::F as Num>::Real>,
    contact_sensor: &ContactSensor<<C::F as Num>::Real>,
) {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    // count, sum of forces, weight, force, torque about the world's origin, weighted point
    let mut sums: [C::V; 11] = std::array::from_fn(|_| cx.var(zero));
    for &class in &contact_sensor.classes {
        let list = class_list(cx, &m.contacts, class);
        each!(cx, r in list, {
            let contact = contact(cx, m, b, (class, contact_sensor.column), r);
            let is_found = matches::<C>(b, contact_sensor, &contact);
            // force and torque in world axes, on the second object of the sensor
            let [force, torque] = map([contact.force, contact.torque], |v| {
                contact.frame.mul_add(v, Vec3::zero()) * contact.sense
            });
            // torque about the origin τ + p × F, and p weighted by |F|
            let moment = contact.point.cross_add(force, torque);
            let weight = force.dot(force).sqrt();
            let point = contact.point * weight;
            let mut more = [one; 11];
            more[1] = weight;
            for (first, part) in [(2, force), (5, moment), (8, point)] {
                more[first..first + 3].copy_from_slice(&part.0);
            }
            // worlds whose contact does not count add 0
            for (sum, x) in sums.iter_mut().zip(more) {
                let whole = cx.get(sum) + C::F::select(is_found, x, zero);
                cx.set(sum, whole);
            }
        });
    }
    let sums: [C::F; 11] = std::array::from_fn(|k| cx.get(&sums[k]));
    let three = |first: usize| Vec3([sums[first], sums[first + 1], sums[first + 2]]);
    // centre of the points p, and the torque about it, τ - p × F; the guard is for contacts without force
    let is_there = C::F::c(0.5).lt(sums[0]);
    let inverse = one.div(sums[1].max(C::F::c(1e-15)));
    let (force, point) = (three(2), three(8) * inverse);
    let torque = three(5) - point.cross(force);
    // the record is in world axes: normal x, tangent y
    let mut record = [zero; RECORD];
    let axis = |k: usize| Vec3(std::array::from_fn(|i| if i == k { one } else { zero }));
    let parts = [
        (0, force),
        (3, torque),
        (7, point),
        (10, axis(0)),
        (13, axis(1)),
    ];
    for (first, part) in parts {
        record[first..first + 3].copy_from_slice(&part.0);
    }
    let record = map(record, |x| C::F::select(is_there, x, zero));
    show(
        &mut b.work.sensordata,
        sensor,
        contact_sensor,
        0,
        sums[0],
        &record,
    );
}
