//! Contacts out of a block: lists of each world by itself, one class after the other.

use super::chunk::{Chunk, Job};
use super::transfer::Arena;
use sim_core::batch::{Dtype, Field, Slot};
use sim_core::lane::{Lane, Real};
use sim_core::model::SensedShapes;
use sim_core::model::constants::Constants;
use sim_core::model::contact::{Class, Memory, row};
use std::ops::Range;

/// A contact of one world: its row, and the class that it is of.
struct Contact<'a, R> {
    class: &'a Class<R>,
    row: usize,
}

/// What a world (a lane of a block) has found.
struct World<'a, F: Lane> {
    memory: &'a Memory,
    cells: &'a [F],
    lane: usize,
}

impl<F: Lane> World<'_, F> {
    fn number(&self, row: usize, k: usize) -> F::Real {
        let rows = self.memory.rows;
        self.cells[rows.base + row * rows.stride + k].lane(self.lane)
    }

    fn three(&self, row: usize, k: usize) -> [F::Real; 3] {
        [0, 1, 2].map(|i| self.number(row, k + i))
    }

    fn pair(&self, row: usize) -> usize {
        self.number(row, row::PAIR).to_usize()
    }

    fn contacts<'c, R>(&self, classes: &'c [Class<R>]) -> impl Iterator<Item = Contact<'c, R>> {
        let counts = self.memory.counts;
        classes.iter().enumerate().flat_map(move |(k, class)| {
            let cell = self.cells[counts.base + k * counts.stride];
            let count = cell.lane(self.lane).to_usize().min(class.capacity);
            (0..count).map(move |i| Contact {
                class,
                row: class.first + i,
            })
        })
    }

    /// Force on the second body, in world axes [N].
    fn force(&self, row: usize) -> [f64; 3] {
        let along = self.three(row, row::FORCE).map(Real::to_f64);
        let axes = [row::NORMAL, row::TANGENTS, row::TANGENTS + 3]
            .map(|k| self.three(row, k).map(Real::to_f64));
        [0, 1, 2].map(|i| (0..3).map(|a| along[a] * axes[a][i]).sum())
    }
}

/// Is it one of the fields that this page writes?
pub(super) fn is_of_contacts(field: Field) -> bool {
    matches!(
        field,
        Field::ContactCount
            | Field::ContactPos
            | Field::ContactNormal
            | Field::ContactDistance
            | Field::ContactForce
            | Field::ContactPair
            | Field::BodyContactForce
            | Field::ContactSensor
    )
}

/// Writes a field of contacts of a block, for the worlds of `worlds` (one a lane, from lane 0).
///
/// # Safety
/// As [`Arena::rows`].
pub(super) unsafe fn export<F: Lane>(
    chunk: &Chunk<F>,
    job: &Job<F>,
    slot: &Slot,
    worlds: Range<usize>,
    arena: Arena,
) {
    let m = &job.constants;
    let n: usize = slot.shape[1..].iter().product();
    if slot.dtype == Dtype::I32 {
        // SAFETY: by contract.
        let rows = unsafe { arena.rows::<i32>(slot, &worlds) };
        for (lane, to) in rows.chunks_exact_mut(n.max(1)).enumerate() {
            let world = world(chunk, m, lane);
            let contacts = world.contacts(&m.contacts.classes);
            if slot.field == Field::ContactCount {
                to[0] = contacts.count() as i32;
                continue;
            }
            to.fill(-1);
            for (contact, to) in contacts.zip(to.chunks_exact_mut(2)) {
                let pair = &m.contacts.pairs[world.pair(contact.row)];
                to.copy_from_slice(&pair.shapes.map(|shape| shape as i32));
            }
        }
        return;
    }
    // SAFETY: by contract.
    let rows = unsafe { arena.rows::<F::Real>(slot, &worlds) };
    for (lane, to) in rows.chunks_exact_mut(n.max(1)).enumerate() {
        to.fill(F::Real::default());
        let world = world(chunk, m, lane);
        let contacts = world.contacts(&m.contacts.classes);
        if slot.field == Field::BodyContactForce {
            add_forces(&world, m, contacts, to);
            continue;
        }
        if slot.field == Field::ContactSensor {
            add_sensed(&world, m, &job.contact_sensors, contacts, to);
            continue;
        }
        let size = if slot.field == Field::ContactDistance {
            1
        } else {
            3
        };
        for (contact, to) in contacts.zip(to.chunks_exact_mut(size)) {
            let row = contact.row;
            match slot.field {
                Field::ContactDistance => to[0] = world.number(row, row::DISTANCE),
                Field::ContactNormal => to.copy_from_slice(&world.three(row, row::NORMAL)),
                Field::ContactForce => to.copy_from_slice(&world.force(row).map(Real::of)),
                _ => {
                    let origin = &chunk.block.work.reference[contact.class.trees.1];
                    let point = world.three(row, row::POINT);
                    for i in 0..3 {
                        let x = origin[i].lane(lane).to_f64() + point[i].to_f64();
                        to[i] = Real::of(x);
                    }
                }
            }
        }
    }
}

fn world<'a, F: Lane>(chunk: &'a Chunk<F>, m: &'a Constants<F::Real>, lane: usize) -> World<'a, F> {
    World {
        memory: &m.contacts.memory,
        cells: &chunk.memory,
        lane,
    }
}

/// What the contact sensors add up, `(contact_sensors, 3)` [N].
fn add_sensed<'c, F: Lane>(
    world: &World<'_, F>,
    m: &Constants<F::Real>,
    sensors: &[SensedShapes],
    contacts: impl Iterator<Item = Contact<'c, F::Real>>,
    to: &mut [F::Real],
) {
    for contact in contacts {
        let force = world.force(contact.row);
        let [a, b] = m.contacts.pairs[world.pair(contact.row)].shapes;
        for (sensor, to) in sensors.iter().zip(to.chunks_exact_mut(3)) {
            for (on, from, sign) in [(b, a, 1.0), (a, b, -1.0)] {
                if sensor.of[on] && sensor.against[from] {
                    for i in 0..3 {
                        to[i] = Real::of(to[i].to_f64() + sign * force[i]);
                    }
                }
            }
        }
    }
}

/// Net contact force on every link, `(bodies, 3)` [N].
fn add_forces<'c, F: Lane>(
    world: &World<'_, F>,
    m: &Constants<F::Real>,
    contacts: impl Iterator<Item = Contact<'c, F::Real>>,
    to: &mut [F::Real],
) {
    for contact in contacts {
        let force = world.force(contact.row);
        let pair = &m.contacts.pairs[world.pair(contact.row)];
        for (link, sign) in pair.links.into_iter().zip([-1.0, 1.0]) {
            let Some(link) = link else { continue };
            for i in 0..3 {
                let cell = &mut to[3 * link + i];
                *cell = Real::of(cell.to_f64() + sign * force[i]);
            }
        }
    }
}
