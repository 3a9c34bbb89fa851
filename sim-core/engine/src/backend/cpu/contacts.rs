//! Contact fields of a block: the lists of each world, one class after the other.

use super::chunk::{Chunk, Job};
use super::transfer::Arena;
use sim_model::SensedShapes;
use sim_physics::arrays::{Dtype, Field, Slot};
use sim_physics::constants::Constants;
use sim_physics::constants::contact::{Class, Memory, row};
use sim_physics::lane::{Lane, Real};

/// A product, rounded once: that of two floats is exact in double precision.
#[inline(always)]
fn times<R: Real>(a: R, b: R) -> R {
    R::from_f64(a.to_f64() * b.to_f64())
}

/// A sum, rounded once, or as if so: double precision has more than twice the digits (Figueroa, SIGNUM Newsletter 30, 1995).
#[inline(always)]
fn plus<R: Real>(a: R, b: R) -> R {
    R::from_f64(a.to_f64() + b.to_f64())
}

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
    #[inline(always)]
    fn number(&self, row: usize, k: usize) -> F::Real {
        let rows = self.memory.rows;
        self.cells[rows.base + row * rows.stride + k].lane(self.lane)
    }

    #[inline(always)]
    fn three(&self, row: usize, k: usize) -> [F::Real; 3] {
        [
            self.number(row, k),
            self.number(row, k + 1),
            self.number(row, k + 2),
        ]
    }

    #[inline(always)]
    fn pair(&self, row: usize) -> usize {
        self.number(row, row::PAIR).to_usize()
    }

    #[inline(always)]
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

    /// Force on the second body, in world axes [N]; a GPU rounds as often (`backend/gpu/kernels/show.rs`).
    #[inline(always)]
    fn force(&self, row: usize) -> [F::Real; 3] {
        let along = self.three(row, row::FORCE);
        let first = [row::NORMAL, row::TANGENTS, row::TANGENTS + 3];
        let axes = first.map(|k| self.three(row, k));
        [0, 1, 2].map(|i| {
            let [x, y, z] = [0, 1, 2].map(|a| times(along[a], axes[a][i]));
            plus(plus(x, y), z)
        })
    }
}

/// Writes a field of contacts of the worlds of a block.
///
/// # Safety
/// As [`Arena::rows`].
#[inline(always)]
pub(super) unsafe fn export<F: Lane>(
    chunk: &Chunk<F>,
    job: &Job<F>,
    slot: &Slot,
    block: usize,
    arena: Arena,
) {
    let m = &job.constants;
    for (lane, place) in chunk.lanes_of(block).enumerate() {
        let world = World {
            memory: &m.contacts.memory,
            cells: &chunk.memory,
            lane,
        };
        let outside = chunk.worlds.start + chunk.assignment.world(place);
        if slot.dtype == Dtype::I32 {
            // SAFETY: by contract.
            let to = unsafe { arena.row::<i32>(slot, outside) };
            put_whole(&world, m, slot.field, to);
        } else {
            // SAFETY: by contract.
            let to = unsafe { arena.row::<F::Real>(slot, outside) };
            put_real(&world, chunk, job, slot.field, to);
        }
    }
}

/// An integer field of a world.
#[inline(always)]
fn put_whole<F: Lane>(world: &World<'_, F>, m: &Constants<F::Real>, field: Field, to: &mut [i32]) {
    let contacts = world.contacts(&m.contacts.classes);
    if field == Field::ContactCount {
        to[0] = contacts.count() as i32;
        return;
    }
    to.fill(-1);
    for (contact, to) in contacts.zip(to.chunks_exact_mut(2)) {
        let pair = &m.contacts.pairs[world.pair(contact.row)];
        to.copy_from_slice(&pair.shapes.map(|shape| shape as i32));
    }
}

/// A floating-point field of a world.
#[inline(always)]
fn put_real<F: Lane>(
    world: &World<'_, F>,
    chunk: &Chunk<F>,
    job: &Job<F>,
    field: Field,
    to: &mut [F::Real],
) {
    let m = &job.constants;
    to.fill(F::Real::default());
    let contacts = world.contacts(&m.contacts.classes);
    if field == Field::BodyContactForce {
        add_forces(world, m, contacts, to);
        return;
    }
    if field == Field::ContactSensor {
        add_sensed(world, m, &job.contact_sensors, contacts, to);
        return;
    }
    let size = if field == Field::ContactDistance {
        1
    } else {
        3
    };
    for (contact, to) in contacts.zip(to.chunks_exact_mut(size)) {
        let row = contact.row;
        match field {
            Field::ContactDistance => to[0] = world.number(row, row::DISTANCE),
            Field::ContactNormal => to.copy_from_slice(&world.three(row, row::NORMAL)),
            Field::ContactForce => to.copy_from_slice(&world.force(row)),
            _ => {
                let origin = &chunk.block.work.reference[contact.class.trees.1];
                let point = world.three(row, row::POINT);
                for i in 0..3 {
                    to[i] = plus(origin[i].lane(world.lane), point[i]);
                }
            }
        }
    }
}

/// What the contact sensors add up, `(contact_sensors, 3)` [N].
#[inline(always)]
fn add_sensed<'c, F: Lane>(
    world: &World<'_, F>,
    m: &Constants<F::Real>,
    sensors: &[SensedShapes],
    contacts: impl Iterator<Item = Contact<'c, F::Real>>,
    to: &mut [F::Real],
) {
    for contact in contacts {
        let [a, b] = m.contacts.pairs[world.pair(contact.row)].shapes;
        for (sensor, to) in sensors.iter().zip(to.chunks_exact_mut(3)) {
            for (on, from, sign) in [(b, a, 1.0), (a, b, -1.0)] {
                let sign = Real::from_f64(sign);
                if sensor.of[on] && sensor.against[from] {
                    // of few contacts, and so not before
                    let force = world.force(contact.row);
                    for i in 0..3 {
                        to[i] = plus(to[i], times(sign, force[i]));
                    }
                }
            }
        }
    }
}

/// Net contact force on every link, `(bodies, 3)` [N].
#[inline(always)]
fn add_forces<'c, F: Lane>(
    world: &World<'_, F>,
    m: &Constants<F::Real>,
    contacts: impl Iterator<Item = Contact<'c, F::Real>>,
    to: &mut [F::Real],
) {
    for contact in contacts {
        let force = world.force(contact.row);
        let pair = &m.contacts.pairs[world.pair(contact.row)];
        for (link, sign) in pair.links.into_iter().zip([-1.0, 1.0].map(Real::from_f64)) {
            let Some(link) = link else { continue };
            for i in 0..3 {
                let cell = &mut to[3 * link + i];
                *cell = plus(*cell, times(sign, force[i]));
            }
        }
    }
}
