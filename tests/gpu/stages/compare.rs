//! What a stage leaves, part by part, and how far apart two machines are in it.

use super::worlds::Left;
use sim_physics::arrays::Array;
use sim_physics::constants::Constants;
use sim_physics::constants::contact::{Kind, row};
use sim_physics::lane::Table;
use sim_physics::step::StageId;
use std::fmt;

/// Numbers of a kind that a stage leaves in a world.
pub struct Part {
    pub name: String,
    pub numbers: Vec<f64>,
}

/// Begins the names of what rows of contacts say.
const CONTACTS: &str = "contacts' ";
/// Positions with what rounding has left out of them.
pub const POSITIONS: &str = "positions and rests";

/// What is compared of the rows of contacts: name, first number, numbers.
const ROWS: [(&str, usize, usize); 9] = [
    ("point", row::POINT, 3),
    ("distance", row::DISTANCE, 1),
    ("normal", row::NORMAL, 3),
    ("stiffness", row::STIFFNESS, 1),
    ("friction", row::MU, 1),
    ("reference", row::AREF, 3),
    ("forces", row::FORCE, 3),
    ("tangents", row::TANGENTS, 6),
    ("jacobian", row::JACOBIAN, usize::MAX),
];

/// The parts of what a stage leaves: its slots, where shapes are, and the lists of contacts.
pub fn parts(m: &Constants<f32>, stage: StageId, left: &Left) -> Vec<Part> {
    let mut parts = Vec::new();
    let mut add = |name: &str, numbers: Vec<f64>| {
        let name = name.to_owned();
        parts.push(Part { name, numbers });
    };
    let mut numbers = left.numbers.iter().copied();
    let mut arrays: Vec<(Array, Vec<f64>)> = (stage.writes().iter())
        .map(|&array| {
            let count = array.scalars(m);
            (array, numbers.by_ref().take(count).collect())
        })
        .collect();
    if let Some(rest) = arrays
        .iter()
        .position(|(array, _)| *array == Array::JointQRest)
    {
        let (_, rests) = arrays.remove(rest);
        let (_, q) = (arrays.iter_mut())
            .find(|(array, _)| *array == Array::JointQ)
            .expect("what has rests");
        let turns = |k: usize| m.quaternions().any(|first| (first..first + 4).contains(&k));
        let straight = (0..q.len()).filter(|&k| !turns(k));
        add(POSITIONS, straight.map(|k| q[k] + rests[k]).collect());
        *q = (0..q.len()).filter(|&k| turns(k)).map(|k| q[k]).collect();
    }
    for (array, numbers) in arrays {
        add(&format!("{array:?}"), numbers);
    }
    let memory = &m.contacts.memory;
    for (name, table) in [
        ("poses", memory.poses),
        ("origins", memory.origins),
        ("mu", memory.mu),
    ] {
        let end = table.base + table.rows * table.stride;
        add(name, left.memory[table.base..end].to_vec());
    }
    let rows: Vec<usize> = rows(m, &left.memory).collect();
    for (name, first, count) in ROWS {
        let width = count.min(memory.rows.stride - first.min(memory.rows.stride));
        let numbers = rows
            .iter()
            .flat_map(|row| &left.memory[row + first..row + first + width]);
        add(&format!("{CONTACTS}{name}"), numbers.copied().collect());
    }
    parts
}

/// Where the rows of contacts begin that are in use.
fn rows(m: &Constants<f32>, memory: &[f64]) -> impl Iterator<Item = usize> {
    let Table { base, stride, .. } = m.contacts.memory.rows;
    let counts = m.contacts.memory.counts.base;
    (m.contacts.classes.iter().enumerate()).flat_map(move |(k, class)| {
        let count = (memory[counts + k] as usize).min(class.capacity);
        (class.first..class.first + count).map(move |row| base + row * stride)
    })
}

/// The list of contacts: how many there are of each class, in all and left out, then the pair of each.
pub fn list(m: &Constants<f32>, left: &Left) -> Vec<usize> {
    let counts = m.contacts.memory.counts;
    let counted = left.memory[counts.base..counts.base + counts.rows].iter();
    let pairs = rows(m, &left.memory).map(|row| left.memory[row + self::row::PAIR]);
    counted.copied().chain(pairs).map(|x| x as usize).collect()
}

/// Does a world have contacts of two kinds of shapes, by their stage?
pub fn touches(m: &Constants<f32>, kinds: (Kind, Kind), left: &Left) -> bool {
    let group = m.contacts.group(kinds).expect("the model has such pairs");
    let pair = |row: usize| left.memory[row + self::row::PAIR] as usize;
    rows(m, &left.memory).any(|row| (group.first..group.end).contains(&pair(row)))
}

/// Deviation of a backend's output from the reference, in one part.
pub struct Errors {
    pub part: String,
    /// Largest number of the part in the reference.
    largest: f64,
    /// Largest difference in each world over that number, rising; infinite where the list of contacts is another.
    worlds: Vec<f64>,
}

impl Errors {
    /// The largest but for so many worlds.
    pub fn but_for(&self, worlds: usize) -> f64 {
        self.worlds[self.worlds.len() - 1 - worlds]
    }
}

impl fmt::Display for Errors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [tenth, worst] = [self.worlds.len() / 10, 0].map(|worlds| self.but_for(worlds));
        write!(
            f,
            "{tenth:.1e} in nine worlds of ten, {worst:.1e} in all, of {:.1e}",
            self.largest
        )
    }
}

/// Less than this is no size of a part: the shapes and masses of these cases are some centimetres and kilograms, and what is all
/// rounding has no size of its own.
const SMALLEST: f64 = 1e-2;

/// Errors in each part; `passed_over` are worlds whose accelerations the stage leaves to another.
pub fn errors(
    m: &Constants<f32>,
    stage: StageId,
    reference: &[Left],
    machine: &[Left],
    passed_over: &[bool],
) -> Vec<Errors> {
    let parts_of = |left: &[Left]| -> Vec<Vec<Part>> {
        left.iter().map(|left| parts(m, stage, left)).collect()
    };
    let (expected, got) = (parts_of(reference), parts_of(machine));
    let same_list: Vec<bool> = (reference.iter().zip(machine))
        .map(|(a, b)| list(m, a) == list(m, b))
        .collect();
    (0..expected[0].len())
        .map(|k| {
            let part = expected[0][k].name.clone();
            let all = expected.iter().flat_map(|world| &world[k].numbers);
            let largest = all.fold(SMALLEST, |most, x| most.max(x.abs()));
            let mut worlds: Vec<f64> = (0..expected.len())
                .map(|world| match &part[..] {
                    "JointQdd" if passed_over[world] => 0.0,
                    _ if part.starts_with(CONTACTS) && !same_list[world] => f64::INFINITY,
                    _ => distance(&expected[world][k].numbers, &got[world][k].numbers) / largest,
                })
                .collect();
            worlds.sort_by(f64::total_cmp);
            Errors {
                part,
                largest,
                worlds,
            }
        })
        .collect()
}

/// Largest difference; infinite where there is a number that is none.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let differences = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    differences.fold(0.0, |most, x| {
        if x.is_nan() {
            f64::INFINITY
        } else {
            most.max(x)
        }
    })
}
