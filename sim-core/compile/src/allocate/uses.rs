//! Where each value is used.

use crate::code::{Code, Instruction};

/// Positions of the instructions that use a value, rising.
pub(super) struct Uses {
    positions: Vec<Vec<u32>>,
    /// The first of them that is not behind.
    next: Vec<u32>,
    /// Where each loop ends, by its number.
    pub ends: Vec<u32>,
}

impl Uses {
    /// A value from before a loop that is used in it counts as used at the loop's end: the next iteration needs it.
    pub fn find(code: &Code) -> Uses {
        let mut positions: Vec<Vec<u32>> = vec![Vec::new(); code.kinds.len()];
        let mut assigned = vec![0; code.kinds.len()];
        let mut ends = vec![0; code.loops as usize];
        let mut open: Vec<(usize, Vec<u32>)> = Vec::new();
        for (at, instruction) in code.instructions.iter().enumerate() {
            instruction.each_value(|value| {
                positions[value as usize].push(at as u32);
                for (start, used) in &mut open {
                    if assigned[value as usize] <= *start {
                        used.push(value);
                    }
                }
            });
            if let Some(value) = instruction.assigned() {
                assigned[value as usize] = at;
            }
            match instruction {
                Instruction::LoopStart { .. } => open.push((at, Vec::new())),
                Instruction::LoopEnd { number, .. } => {
                    ends[*number as usize] = at as u32;
                    let (_, mut used) = open.pop().expect("loops end in the order of their starts");
                    used.sort_unstable();
                    used.dedup();
                    for value in used {
                        positions[value as usize].push(at as u32);
                    }
                }
                _ => {}
            }
        }
        Uses {
            next: vec![0; positions.len()],
            positions,
            ends,
        }
    }

    /// The next use behind a position, if any. Positions that are asked for never fall.
    pub fn after(&mut self, value: u32, at: u32) -> Option<u32> {
        let (positions, next) = (
            &self.positions[value as usize],
            &mut self.next[value as usize],
        );
        while positions
            .get(*next as usize)
            .is_some_and(|use_| *use_ <= at)
        {
            *next += 1;
        }
        positions.get(*next as usize).copied()
    }

    /// The last use, if any.
    pub fn last(&self, value: u32) -> Option<u32> {
        self.positions[value as usize].last().copied()
    }
}
