//! Where the numbers of a world lie in device memory.
//!
//! Memory is a structure of arrays of four numbers, the world innermost: number i of world w is component i % 4 of
//! `fields[(i / 4) * worlds + w]`. Every array begins at a multiple of four.

use crate::backend::state::{RECORD, Shape, is_motion};
use sim_physics::arrays::{Array, Field, Writer};
use sim_physics::constants::Constants;
use std::ops::Range;

/// The arrays of a record as they lie here: what a frame changes first.
fn record() -> impl Iterator<Item = Array> {
    let motion = RECORD.into_iter().filter(is_motion);
    motion.chain(RECORD.into_iter().filter(|array| !is_motion(array)))
}

/// First number of every array.
pub(in crate::backend::gpu) struct Places {
    arrays: Vec<(Array, Range<u32>)>,
    /// Numbers of the state that a frame changes; they come first.
    pub moving: u32,
    /// A copy of them from before the frame.
    pub before: u32,
    /// Numbers of state and commands, gaps included; they come first.
    pub state: u32,
    /// Accelerations of the state that is shown: the solver's next start stays as it is.
    pub shown_qdd: u32,
    computed: Vec<(Field, u32)>,
    /// Numbers of a world.
    pub len: u32,
}

impl Places {
    /// Room for the arrays of a model, and for fields that are computed for output.
    pub fn new(m: &Constants<f32>, computed: &[(Field, usize)]) -> Places {
        let mut end = 0;
        let mut take = |numbers: usize| {
            let first = end;
            end = (end + u32::try_from(numbers).expect("numbers of a world")).next_multiple_of(4);
            first..first + numbers as u32
        };
        let mut arrays = Vec::new();
        let (mut moving, mut state) = (0, 0);
        for array in record() {
            let place = take(array.scalars(m));
            state = place.end.next_multiple_of(4);
            if is_motion(&array) {
                moving = state;
            }
            arrays.push((array, place));
        }
        for &array in Array::ALL {
            let is_known = arrays.iter().any(|(known, _)| *known == array);
            if !is_known && array.writer() != Writer::Scratch {
                arrays.push((array, take(array.scalars(m))));
            }
        }
        let before = take(moving as usize).start;
        let shown_qdd = take(m.dofs.len()).start;
        let computed = computed
            .iter()
            .map(|&(field, numbers)| (field, take(numbers).start))
            .collect();
        Places {
            arrays,
            moving,
            before,
            state,
            shown_qdd,
            computed,
            len: end,
        }
    }

    /// The numbers of an array.
    pub fn range(&self, array: Array) -> Range<u32> {
        let entry = self.arrays.iter().find(|(known, _)| *known == array);
        entry
            .map(|(_, place)| place.clone())
            .expect("an array of the table")
    }

    /// The first number of a field that is computed for output.
    pub fn computed(&self, field: Field) -> u32 {
        let entry = self.computed.iter().find(|(known, _)| *known == field);
        entry.map(|(_, place)| *place).expect("a computed field")
    }

    /// Where each number of a world's record lies, in the order of [`Shape`].
    pub fn record(&self, shape: Shape) -> Vec<u32> {
        let mut places = vec![0; shape.total()];
        for array in RECORD {
            let first = shape.start(array);
            for (k, place) in self.range(array).enumerate() {
                places[first + k] = place;
            }
        }
        places
    }
}
