//! Merges classes of contacts, for kernels in which several threads share a world.
//!
//! Physics code iterates natively over classes, and the threads of a world share the rows of one class at a time. So many classes make
//! long kernels and idle threads: each foot of a quadruped is a class with one contact. Classes of the same trees become one, whose
//! columns are the dofs of all. A contact's levers are 0 for dofs that do not move its bodies. Where a robot can touch itself in many
//! places, as a humanoid can, one class would have mostly zeros: then some stay apart, as long as all their code is short.
//!
//! In a heap of bodies each pair of them is a class of its own. Where these are too many, one class has the contacts of all trees, and
//! Jacobians as wide as the model: the shortest code, though it mostly computes zeros. Its points are relative to the reference point of
//! one tree, one with a fixed base if there is any, so levers are known to 6e-8 of the distance from there.

use super::rolled::LONGEST;
use super::room::{others, size};
use sim_physics::constants::Constants;
use sim_physics::constants::contact::{Class, Column, Contacts, Pair, Run, pair, row, turning};
use sim_physics::constants::sensors::{ContactSensor, SensorKind as Kind, TouchSensor};
use sim_physics::lane::{Fixed, Table};
use sim_physics::math::factor::UpdatePath;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Most columns of a merged class, and how many times those of its widest part they may be: other columns are zeros that are computed
/// with.
const COLUMNS_MAX: usize = 24;
const WIDER_MAX: usize = 2;
/// Columns of all classes together, as the solver's code has them: more classes are merged beyond these limits, those first whose contacts
/// get the fewest zeros. Or twice the dofs, if that is more: one class with the ground and one of the robot with itself have so many.
const COLUMNS_ALL: usize = 64;

/// Instructions of the solver's kernel for a class, and for each of its columns: about those of 60 balls on the ground, and of 100 in a heap.
const OF_CLASS: usize = 1000;
const OF_COLUMN: usize = 50;
/// Most instructions for all classes: beyond, the kernel would be refused ([`LONGEST`]). Then classes of different trees are merged, too.
const APART_MAX: usize = LONGEST;

/// The constants with fewer classes of contacts, where that helps.
pub(in crate::backend::gpu) fn merged(m: &Constants<f64>) -> Cow<'_, Constants<f64>> {
    let t = &m.contacts;
    let parts = parts(&t.classes, COLUMNS_ALL.max(2 * m.dofs.len()));
    if parts.len() == t.classes.len() {
        return Cow::Borrowed(m);
    }
    let mut m = m.clone();
    m.contacts = with_classes(&m, &parts);
    // sensors of contacts list the classes that they read
    for sensor in &mut m.sensors.all {
        if let Kind::Touch(TouchSensor { classes, .. })
        | Kind::Contact(ContactSensor { classes, .. }) = &mut sensor.kind
        {
            let merged: BTreeSet<usize> = classes.iter().map(|&k| new_class(&parts, k)).collect();
            *classes = merged.into_iter().collect();
        }
    }
    Cow::Owned(m)
}

/// Classes that become one.
struct Part {
    trees: (Option<usize>, usize),
    classes: Vec<usize>,
    /// Their dofs, each with its bit.
    dofs: Vec<u64>,
    columns: usize,
    /// Contacts that there may be.
    contacts: usize,
}

impl Part {
    fn new(classes: &[Class<f64>], group: Vec<usize>) -> Part {
        let columns: Vec<usize> = (group.iter())
            .flat_map(|&k| classes[k].columns.iter().map(|column| column.dof))
            .collect();
        let mut dofs = vec![0; columns.iter().max().map_or(0, |last| last / 64 + 1)];
        columns
            .iter()
            .for_each(|dof| dofs[dof / 64] |= 1 << (dof % 64));
        Part {
            trees: classes[group[0]].trees,
            columns: count(dofs.iter().copied()),
            dofs,
            contacts: group.iter().map(|&k| classes[k].capacity).sum(),
            classes: group,
        }
    }

    /// The zeros that contacts of both get if they are merged.
    fn zeros_with(&self, other: &Part) -> usize {
        let (long, short) = match self.dofs.len() < other.dofs.len() {
            true => (&other.dofs, &self.dofs),
            false => (&self.dofs, &other.dofs),
        };
        let more = short.iter().chain(std::iter::repeat(&0));
        let wide = count(long.iter().zip(more).map(|(a, b)| a | b));
        (wide - self.columns) * self.contacts + (wide - other.columns) * other.contacts
    }
}

fn count(words: impl Iterator<Item = u64>) -> usize {
    words.map(|word| word.count_ones() as usize).sum()
}

/// The classes that each new class is made of; those of all have as many columns as `all` together, if that can be.
fn parts(classes: &[Class<f64>], all: usize) -> Vec<Vec<usize>> {
    // contacts that move nothing, such as those of a mocap body with the ground, stay apart: some sums leave them out
    let key = |class: &Class<f64>| (class.columns.is_empty(), class.trees);
    let mut by_key: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (k, class) in classes.iter().enumerate() {
        by_key.entry(key(class)).or_default().push(k);
    }
    let mut parts: Vec<Part> = Vec::new();
    for group in by_key.into_values() {
        let widest = group.iter().map(|&k| classes[k].columns.len()).max();
        let wide = Part::new(classes, group.clone());
        match wide.columns <= COLUMNS_MAX && wide.columns <= WIDER_MAX * widest.unwrap_or(0) {
            true => parts.push(wide),
            false => parts.extend(group.into_iter().map(|k| Part::new(classes, vec![k]))),
        }
    }
    while parts.iter().map(|part| part.columns).sum::<usize>() > all {
        // those of the same trees follow each other
        let key = |k: usize| (parts[k].columns == 0, parts[k].trees);
        let mergeable = (0..parts.len()).flat_map(|a| {
            let others = (a + 1..parts.len()).take_while(move |&b| key(a) == key(b));
            others.map(move |b| (a, b))
        });
        // the first of those with the fewest zeros
        let Some((a, b)) = mergeable.min_by_key(|&(a, b)| parts[a].zeros_with(&parts[b])) else {
            break;
        };
        let mut group = parts.remove(b).classes;
        group.extend(&parts[a].classes);
        group.sort_unstable();
        parts[a] = Part::new(classes, group);
    }
    // contacts that move nothing come last, as their key has it
    let (mut moving, still): (Vec<Part>, Vec<Part>) =
        parts.into_iter().partition(|part| part.columns > 0);
    let cost = |part: &Part| OF_CLASS + OF_COLUMN * part.columns;
    let apart: usize = moving.iter().map(cost).sum();
    if apart > APART_MAX {
        let all = moving.iter().flat_map(|part| part.classes.iter().copied());
        let together = Part::new(classes, all.collect::<BTreeSet<_>>().into_iter().collect());
        if WIDER_MAX * cost(&together) <= apart {
            moving = vec![together];
        }
    }
    moving
        .into_iter()
        .chain(still)
        .map(|part| part.classes)
        .collect()
}

/// Dofs of some classes, rising, each with its column in one of them.
fn columns(classes: &[Class<f64>], part: &[usize]) -> Vec<Column> {
    let columns = part.iter().flat_map(|&k| &classes[k].columns);
    let columns: BTreeMap<usize, Column> = columns.map(|column| (column.dof, *column)).collect();
    columns.into_values().collect()
}

/// The new class that has an old one.
fn new_class(parts: &[Vec<usize>], class: usize) -> usize {
    let index = parts.iter().position(|part| part.contains(&class));
    index.expect("every class is part of one")
}

fn with_classes(m: &Constants<f64>, parts: &[Vec<usize>]) -> Contacts<f64> {
    let mut t = m.contacts.clone();
    let columns: Vec<_> = parts.iter().map(|part| columns(&t.classes, part)).collect();
    // the scalars of pairs, with the levers of the new columns
    let old = t.handles.pair_numbers;
    let widest = columns.iter().map(Vec::len).max().unwrap_or(0);
    let stride = pair::LEVERS + widest;
    let base = t.tables.numbers.len();
    for (p, pair) in t.pairs.iter_mut().enumerate() {
        let first = old.base + p * old.stride;
        let was = &t.classes[pair.class].columns;
        let mut numbers = t.tables.numbers[first..first + pair::LEVERS].to_vec();
        pair.class = new_class(parts, pair.class);
        numbers.extend(columns[pair.class].iter().map(|new| {
            let column = was.iter().find(|column| column.dof == new.dof);
            column.map_or(0.0, |column| t.tables.numbers[first + column.lever])
        }));
        numbers.resize(stride, 0.0);
        t.tables.numbers.extend(numbers);
        let indices = t.handles.pair_indices;
        t.tables.indices[indices.base + p * indices.stride + pair::CLASS] = pair.class as u32;
    }
    let rows = t.pairs.len();
    t.handles.pair_numbers = Fixed { base, stride, rows };
    let mut first = 0;
    let mut classes: Vec<Class<f64>> = Vec::new();
    for (k, part) in parts.iter().enumerate() {
        let capacity: usize = part.iter().map(|&k| t.classes[k].capacity).sum();
        let capacity = capacity.min(t.contacts_max);
        classes.push(Class {
            first,
            capacity,
            ..class(m, &t, part, k, &columns[k])
        });
        first += capacity;
    }
    t.handles.class_rows = Fixed {
        base: t.tables.indices.len(),
        stride: 2,
        rows: classes.len(),
    };
    let room = classes
        .iter()
        .flat_map(|class| [class.first, class.capacity]);
    t.tables.indices.extend(room.map(|x| x as u32));
    t.classes = classes;
    // points of a class are relative to one reference point
    let indices = t.handles.pair_indices;
    for (p, pair) in t.pairs.iter().enumerate() {
        let class = &t.classes[pair.class];
        if class.mixes {
            let place = indices.base + p * indices.stride + pair::ORIGIN;
            t.tables.indices[place] = class.trees.1 as u32;
        }
    }
    merge_impedances(&mut t, parts);
    merge_bodies(&mut t, parts, &m.contacts.pairs);
    let [first_end, capacity_end] = t.row_ends();
    // as sim-model lays out rows
    let row_len = match t.classes.iter().any(|class| class.turns.is_some()) {
        true => row::JACOBIAN + turning::JACOBIAN + 6 * widest,
        false => row::JACOBIAN + 3 * widest,
    };
    let rows = Table {
        base: t.memory.rows.base,
        stride: row_len.next_multiple_of(4),
        rows: first_end + capacity_end - 2,
    };
    replace_rows(&mut t, rows);
    t
}

/// Lists the impedances of each new class.
fn merge_impedances(t: &mut Contacts<f64>, parts: &[Vec<usize>]) {
    let old = &t.impedances.of_classes;
    if !old.is_empty() {
        let of_part = |part: &Vec<usize>| {
            let kinds: BTreeSet<usize> = part.iter().flat_map(|&k| old[k].clone()).collect();
            kinds.into_iter().collect()
        };
        t.impedances.of_classes = parts.iter().map(of_part).collect();
    }
}

/// Lists the bodies of each new class, and gives pairs their places in these lists.
fn merge_bodies(t: &mut Contacts<f64>, parts: &[Vec<usize>], old_pairs: &[Pair]) {
    let old = std::mem::take(&mut t.bodies.of_classes);
    if old.is_empty() {
        return;
    }
    let of_part = |part: &Vec<usize>| {
        let bodies: BTreeSet<usize> = part.iter().flat_map(|&k| old[k].clone()).collect();
        bodies.into_iter().collect()
    };
    let new: Vec<Vec<usize>> = parts.iter().map(of_part).collect();
    let places = t.bodies.of_pair;
    for (p, (pair, was)) in t.pairs.iter().zip(old_pairs).enumerate() {
        let first = places.base + p * places.stride;
        for place in &mut t.tables.numbers[first..first + 2] {
            // counted from 1; 0 is none
            if *place > 0.0 {
                let body = old[was.class][*place as usize - 1];
                let now = new[pair.class].iter().position(|other| *other == body);
                *place = (now.expect("the list has all bodies of its classes") + 1) as f64;
            }
        }
    }
    t.bodies.of_classes = new;
}

/// Gives the rows of contacts another room, and moves what lies behind them.
fn replace_rows(t: &mut Contacts<f64>, rows: Table) {
    let (old, new) = (size(t.memory.rows), size(rows));
    for table in others(t) {
        if table.base > rows.base {
            table.base = table.base + new - old;
        }
    }
    t.memory.len = t.memory.len + new - old;
    t.memory.rows = rows;
}

/// A class of the pairs of some classes; `t` has the new scalars of pairs already, and the old classes.
fn class(
    m: &Constants<f64>,
    t: &Contacts<f64>,
    part: &[usize],
    number: usize,
    columns: &[Column],
) -> Class<f64> {
    let old: Vec<&Class<f64>> = part.iter().map(|&k| &t.classes[k]).collect();
    let place = |dof: usize| {
        let index = columns.iter().position(|column| column.dof == dof);
        index.expect("a dof of the class")
    };
    let mut entries = vec![BTreeSet::new(); columns.len()];
    for class in &old {
        for (c, runs) in class.entries.iter().enumerate() {
            for other in runs.iter().flat_map(Run::columns) {
                let (a, b) = (place(class.columns[c].dof), place(class.columns[other].dof));
                entries[a.max(b)].insert(a.min(b));
            }
        }
    }
    let couples = old.iter().any(|class| class.couples);
    let pattern = match couples {
        true => &m.coupled.pattern,
        false => &m.pattern,
    };
    let entries = entries.into_iter().enumerate().map(|(c, others)| {
        let at = |o: usize| pattern.at(columns[c].dof, columns[o].dof);
        Run::from_columns(others.into_iter().map(|o| (o, at(o))))
    });
    let numbers = t.handles.pair_numbers;
    let pairs = (0..t.pairs.len()).filter(|&p| t.pairs[p].class == number);
    let pairs: Vec<usize> = pairs.collect();
    let scalar = |p: usize, k: usize| t.tables.numbers[numbers.base + p * numbers.stride + k];
    let shared = (0..pair::LEVERS + columns.len()).map(|k| {
        let x = scalar(pairs[0], k);
        let is_shared = pairs.iter().all(|&p| scalar(p, k).to_bits() == x.to_bits());
        is_shared.then_some(x)
    });
    let of_dofs = (columns.iter().enumerate()).map(|(c, column)| (c, column.dof));
    let parts: BTreeSet<usize> = old.iter().flat_map(|class| class.parts.clone()).collect();
    // a fixed base stays where it is
    let is_fixed = |class: &&&Class<f64>| m.trees[class.trees.1].free.is_none();
    Class {
        trees: old.iter().find(is_fixed).unwrap_or(&old[0]).trees,
        mixes: old.iter().any(|class| class.trees != old[0].trees),
        columns: (columns.iter().enumerate())
            .map(|(c, column)| Column {
                lever: pair::LEVERS + c,
                ..*column
            })
            .collect(),
        runs: Run::from_columns(of_dofs),
        entries: entries.collect(),
        couples,
        // kernels have no updates
        update_path: UpdatePath::default(),
        parts: parts.into_iter().collect(),
        shared: shared.collect(),
        first: 0,
        capacity: 0,
        turns: (old.iter().any(|class| class.turns.is_some()))
            .then_some(row::JACOBIAN + 3 * columns.len()),
    }
}
