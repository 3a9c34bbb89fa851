//! Room for contacts, by need: a world begins with room for few of each class, and all get twice as much when one has too little.
//!
//! A model says how many contacts there may be at most. Worlds have a fraction of that, and memory for the rest would be most of what a
//! world takes. So rows lie behind the other tables, and programs read the room of each class when they run. Then more room is longer
//! buffers and another table, but the same programs, unless tiles get narrower. A frame in which a world had too little is undone and
//! repeated (`backend::gpu::growth`), so results do not depend on the room. A world beyond the limits of its scene, or with more candidates
//! on a height field than one can have, gets all the room, too: it counts all that it left out in one number.

use sim_physics::constants::Constants;
use sim_physics::constants::contact::Contacts;
use sim_physics::lane::Table;
use std::borrow::Cow;

/// Contacts of a class that worlds have room for at the start. Most worlds of a legged robot or a gripper have fewer.
const LEAST: usize = 16;

/// The constants with rows that can get more room, if some class may have more contacts than worlds have room for at the start.
pub(in crate::backend::gpu) fn growing(m: Cow<'_, Constants<f64>>) -> Cow<'_, Constants<f64>> {
    let t = &m.contacts;
    if t.classes.iter().all(|class| class.capacity <= LEAST) {
        return m;
    }
    let mut m = m.into_owned();
    let t = &mut m.contacts;
    let (first, size) = (t.memory.rows.base, size(t.memory.rows));
    for table in others(t) {
        if table.base > first {
            table.base -= size;
        }
    }
    t.memory.rows.base = t.memory.len - size;
    t.room_grows = true;
    Cow::Owned(m)
}

/// The tables besides rows.
pub(super) fn others(t: &mut Contacts<f64>) -> Vec<&mut Table> {
    let memory = &mut t.memory;
    let mut tables = vec![
        &mut memory.poses,
        &mut memory.origins,
        &mut memory.counts,
        &mut memory.mu,
        &mut memory.cut.corners,
        &mut memory.cut.candidates,
        &mut memory.cut.edges,
        &mut memory.field_candidates,
        &mut memory.field_cells,
        &mut memory.field_prisms,
    ];
    if let Some(system) = &mut t.rolled {
        tables.extend([&mut system.matrix, &mut system.sides]);
    }
    tables
}

/// Numbers that a table takes.
pub(super) fn size(table: Table) -> usize {
    (table.stride * table.rows).next_multiple_of(4)
}

/// The room that each class has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::backend::gpu) struct Room {
    /// First row and capacity of each class.
    classes: Vec<[usize; 2]>,
    /// No class has more.
    limit: usize,
}

impl Room {
    /// What worlds have at the start.
    pub fn at_start(m: &Constants<f32>) -> Room {
        match m.contacts.room_grows {
            true => Room::new(m, LEAST),
            false => Room::at_most(m),
        }
    }

    fn new(m: &Constants<f32>, limit: usize) -> Room {
        let mut first = 0;
        let classes = m.contacts.classes.iter().map(|class| {
            let capacity = class.capacity.min(limit);
            first += capacity;
            [first - capacity, capacity]
        });
        Room {
            classes: classes.collect(),
            limit,
        }
    }

    /// What worlds have at the end, if they need all.
    pub fn at_most(m: &Constants<f32>) -> Room {
        Room::new(m, usize::MAX)
    }

    /// Most contacts that a class has room for.
    pub fn most(&self) -> usize {
        let capacities = self.classes.iter().map(|[_, capacity]| *capacity);
        capacities.max().unwrap_or(0)
    }

    /// Twice as much; none if every class has all that it may need.
    pub fn twice(&self, m: &Constants<f32>) -> Option<Room> {
        let more = self.can_grow(m);
        more.then(|| Room::new(m, self.limit.saturating_mul(2)))
    }

    /// May a class need more?
    pub fn can_grow(&self, m: &Constants<f32>) -> bool {
        let mut classes = m.contacts.classes.iter();
        classes.any(|class| class.capacity > self.limit)
    }

    /// Numbers of a world in the buffer of contacts.
    pub fn numbers(&self, m: &Constants<f32>) -> usize {
        if !m.contacts.room_grows {
            return m.contacts.memory.len;
        }
        let rows = self.classes.iter().map(|[_, capacity]| capacity).sum();
        let rows = Table {
            rows,
            ..m.contacts.memory.rows
        };
        rows.base + size(rows)
    }

    /// The indices of the model, with this room.
    pub fn indices(&self, m: &Constants<f32>) -> Vec<u32> {
        let mut indices = m.contacts.tables.indices.clone();
        let table = m.contacts.handles.class_rows;
        for (k, room) in self.classes.iter().enumerate() {
            let row = &mut indices[table.base + k * table.stride..][..2];
            row.copy_from_slice(&room.map(|x| x as u32));
        }
        indices
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim_model::{Body, Collision, Description, Pose, Shape};
    use sim_physics::constants::rolled::RolledSystem;

    /// Bodies of so many cylinders each over a height, so that tables of all sizes lie behind the rows.
    fn constants(cylinders: [usize; 2]) -> Constants<f64> {
        let mut scene = Description::new(0.01, 1);
        scene.add_ground("ground", 0.0);
        for (k, count) in cylinders.into_iter().enumerate() {
            let mut body = Body::new(&format!("body{k}"), Pose::identity());
            for _ in 0..count {
                let (radius, half_height) = (0.1, 0.1);
                let shape = Shape::Cylinder {
                    radius,
                    half_height,
                };
                let shape = Collision::new(None, shape, Pose::identity());
                body.shapes.push((shape, 400.0));
            }
            scene.add_body(body).unwrap();
        }
        scene.compile().unwrap().constants().clone()
    }

    #[test]
    fn rows_lie_behind_all_other_tables_and_rooms_follow_each_other() {
        let mut fixed = constants([9, 3]);
        RolledSystem::add_to(&mut fixed);
        let mut m = growing(Cow::Borrowed(&fixed)).into_owned();
        assert!(m.contacts.room_grows && !fixed.contacts.room_grows);
        let len = m.contacts.memory.len;
        assert_eq!(len, fixed.contacts.memory.len);
        let rows = m.contacts.memory.rows;
        let mut spans: Vec<_> = others(&mut m.contacts)
            .into_iter()
            .map(|table| (table.base, table.base + size(*table)))
            .filter(|(first, end)| first < end)
            .collect();
        assert!(spans.len() > 5);
        spans.push((rows.base, len));
        spans.sort_unstable();
        assert!(spans.windows(2).all(|pair| pair[0].1 <= pair[1].0));
        assert_eq!(spans.last(), Some(&(rows.base, len)));

        let m: Constants<f32> = m.cast();
        let mut room = Room::at_start(&m);
        assert_eq!(room.most(), LEAST);
        loop {
            let mut first = 0;
            for (class, [row, capacity]) in m.contacts.classes.iter().zip(&room.classes) {
                assert_eq!(*row, first);
                assert_eq!(*capacity, class.capacity.min(room.limit));
                first += capacity;
            }
            let end = rows.base + first * rows.stride;
            assert!((end..end + 4).contains(&room.numbers(&m)));
            assert!(room.numbers(&m) <= len);
            let Some(more) = room.twice(&m) else { break };
            assert!(more.numbers(&m) > room.numbers(&m));
            room = more;
        }
        assert_eq!(room.classes, Room::at_most(&m).classes);
    }

    #[test]
    fn a_model_with_few_contacts_stays_as_it_is() {
        let fixed = constants([1, 1]);
        let most = fixed.contacts.classes.iter().map(|class| class.capacity);
        assert!(most.max() <= Some(LEAST));
        assert!(matches!(growing(Cow::Borrowed(&fixed)), Cow::Borrowed(_)));
    }
}
