//! Merges classes of contacts, for kernels in which several threads share a world.
//!
//! Physics code iterates natively over classes, and the threads of a world share the rows of one class at a time. So many classes make
//! long kernels and idle threads: each foot of a quadruped is a class with one contact. Classes of the same trees become one, whose
//! columns are the dofs of all. A contact's levers are 0 for dofs that do not move its bodies.

use sim_physics::constants::Constants;
use sim_physics::constants::contact::{Class, Column, Contacts, Memory, Run, pair, row};
use sim_physics::lane::{Fixed, Table};
use sim_physics::math::factor::UpdatePath;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Most columns of a merged class, and how many times those of its widest part they may be: other columns are zeros that are computed
/// with.
const COLUMNS_MAX: usize = 24;
const WIDER_MAX: usize = 2;

/// The constants with fewer classes of contacts, where that helps.
pub(in crate::backend::gpu) fn merged(m: &Constants<f64>) -> Cow<'_, Constants<f64>> {
    let t = &m.contacts;
    // bodies and impedances of MuJoCo's models are listed by class, and so are rows of torsional friction
    let is_listed = !m.outputs.bodies.is_empty() || !m.contacts.impedances.of_classes.is_empty();
    let turns = t.classes.iter().any(|class| class.turns.is_some());
    if is_listed || turns {
        return Cow::Borrowed(m);
    }
    let parts = parts(&t.classes);
    if parts.len() == t.classes.len() {
        return Cow::Borrowed(m);
    }
    let mut m = m.clone();
    m.contacts = with_classes(&m, &parts);
    Cow::Owned(m)
}

/// The classes that each new class is made of.
fn parts(classes: &[Class<f64>]) -> Vec<Vec<usize>> {
    let mut by_trees: BTreeMap<(Option<usize>, usize), Vec<usize>> = BTreeMap::new();
    for (k, class) in classes.iter().enumerate() {
        by_trees.entry(class.trees).or_default().push(k);
    }
    let mut parts = Vec::new();
    for group in by_trees.into_values() {
        let widest = group.iter().map(|&k| classes[k].columns.len()).max();
        let wide = columns(classes, &group).len();
        match wide <= COLUMNS_MAX && wide <= WIDER_MAX * widest.unwrap_or(0) {
            true => parts.push(group),
            false => parts.extend(group.into_iter().map(|k| vec![k])),
        }
    }
    parts
}

/// Dofs of some classes, rising, and whether they are of the first side's tree.
fn columns(classes: &[Class<f64>], part: &[usize]) -> Vec<(usize, bool)> {
    let columns = part.iter().flat_map(|&k| &classes[k].columns);
    let columns: BTreeSet<_> = columns
        .map(|column| (column.dof, column.is_first))
        .collect();
    columns.into_iter().collect()
}

fn with_classes(m: &Constants<f64>, parts: &[Vec<usize>]) -> Contacts<f64> {
    let mut t = m.contacts.clone();
    let columns: Vec<_> = parts.iter().map(|part| columns(&t.classes, part)).collect();
    let new_class = |class: usize| {
        let index = parts.iter().position(|part| part.contains(&class));
        index.expect("every class is part of one")
    };
    // the scalars of pairs, with the levers of the new columns
    let old = t.handles.pair_numbers;
    let widest = columns.iter().map(Vec::len).max().unwrap_or(0);
    let stride = pair::LEVERS + widest;
    let base = t.tables.numbers.len();
    for (p, pair) in t.pairs.iter_mut().enumerate() {
        let first = old.base + p * old.stride;
        let was = &t.classes[pair.class].columns;
        let mut numbers = t.tables.numbers[first..first + pair::LEVERS].to_vec();
        pair.class = new_class(pair.class);
        numbers.extend(columns[pair.class].iter().map(|(dof, _)| {
            let column = was.iter().find(|column| column.dof == *dof);
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
    let [first_end, capacity_end] = t.row_ends();
    let rows = Table {
        base: t.memory.rows.base,
        stride: (row::JACOBIAN + 3 * widest).next_multiple_of(4),
        rows: first_end + capacity_end - 2,
    };
    replace_rows(&mut t.memory, rows);
    t
}

/// Gives the rows of contacts another room, and moves what lies behind them.
fn replace_rows(memory: &mut Memory, rows: Table) {
    let size = |table: Table| (table.stride * table.rows).next_multiple_of(4);
    let (old, new) = (size(memory.rows), size(rows));
    let moved = [
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
    for table in moved {
        if table.base > rows.base {
            table.base = table.base + new - old;
        }
    }
    memory.len = memory.len + new - old;
    memory.rows = rows;
}

/// A class of the pairs of some classes; `t` has the new scalars of pairs already, and the old classes.
fn class(
    m: &Constants<f64>,
    t: &Contacts<f64>,
    part: &[usize],
    number: usize,
    columns: &[(usize, bool)],
) -> Class<f64> {
    let old: Vec<&Class<f64>> = part.iter().map(|&k| &t.classes[k]).collect();
    let place = |dof: usize| {
        let index = columns.iter().position(|column| column.0 == dof);
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
        let at = |o: usize| pattern.at(columns[c].0, columns[o].0);
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
    let of_dofs = columns.iter().enumerate().map(|(c, (dof, _))| (c, *dof));
    let parts: BTreeSet<usize> = old.iter().flat_map(|class| class.parts.clone()).collect();
    Class {
        trees: old[0].trees,
        columns: (columns.iter().enumerate())
            .map(|(c, &(dof, is_first))| Column {
                dof,
                is_first,
                lever: pair::LEVERS + c,
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
        turns: None,
    }
}
