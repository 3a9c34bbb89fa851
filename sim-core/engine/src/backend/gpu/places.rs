//! Where the numbers of a world lie in device memory.
//!
//! Memory is a structure of arrays of four numbers, the world innermost: number i of world w is component i % 4 of
//! `fields[(i / 4) * worlds + w]`. Every array begins at a multiple of four.

use crate::backend::state::{Shape, StateField};
use sim_physics::arrays::{Field, WorkSlot as Slot};
use sim_physics::constants::Constants;
use stages_recorded::{SLOTS, length};
use std::ops::Range;

/// State that a frame changes, then commands and parameters: all that a step begins from.
const STATE: [(StateField, Slot); 9] = [
    (StateField::Qd, Slot::JointQd),
    (StateField::Qdd, Slot::JointQdd),
    (StateField::Q, Slot::JointQ),
    (StateField::QRest, Slot::JointQRest),
    (StateField::F, Slot::JointF),
    (StateField::TargetQ, Slot::JointTargetQ),
    (StateField::TargetQd, Slot::JointTargetQd),
    (StateField::History, Slot::CommandHistory),
    (StateField::Params, Slot::Params),
];
/// How many of them a frame changes.
const MOVING: usize = 4;

/// First number of every array.
pub(super) struct Places {
    slots: Vec<(Slot, Range<u32>)>,
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
        let mut slots = Vec::new();
        let (mut moving, mut state) = (0, 0);
        for (k, (_, slot)) in STATE.into_iter().enumerate() {
            let place = take(length(m, slot));
            state = place.end.next_multiple_of(4);
            if k < MOVING {
                moving = state;
            }
            slots.push((slot, place));
        }
        for slot in SLOTS {
            if !slots.iter().any(|(known, _)| *known == slot) {
                slots.push((slot, take(length(m, slot))));
            }
        }
        let before = take(moving as usize).start;
        let shown_qdd = take(m.dofs.len()).start;
        let computed = computed
            .iter()
            .map(|&(field, numbers)| (field, take(numbers).start))
            .collect();
        Places {
            slots,
            moving,
            before,
            state,
            shown_qdd,
            computed,
            len: end,
        }
    }

    /// The numbers of a slot.
    pub fn of(&self, slot: Slot) -> Range<u32> {
        let found = self.slots.iter().find(|(known, _)| *known == slot);
        found.map(|(_, place)| place.clone()).expect("a slot")
    }

    /// The first number of a field that is computed for output.
    pub fn computed(&self, field: Field) -> u32 {
        let found = self.computed.iter().find(|(known, _)| *known == field);
        found.map(|(_, place)| *place).expect("a computed field")
    }

    /// The first number of a group of the state.
    pub fn group(&self, group: StateField) -> u32 {
        let (_, slot) = STATE
            .into_iter()
            .find(|(known, _)| *known == group)
            .expect("a group");
        self.of(slot).start
    }

    /// Where each number of a world's record lies, in the order of [`Shape`].
    pub fn record(&self, shape: Shape) -> Vec<u32> {
        let mut places = vec![0; shape.total()];
        for (group, slot) in STATE {
            let first = shape.start(group);
            for (k, place) in self.of(slot).enumerate() {
                places[first + k] = place;
            }
        }
        places
    }
}
