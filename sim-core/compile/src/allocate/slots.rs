//! Slots for values that left the registers.

use crate::machine::{Machine, Memory, Source};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// When a value begins, when it is last used, and its number.
pub(super) struct Lifetime {
    pub value: u32,
    pub first: u32,
    pub last: u32,
}

/// Gives values slots from `first` on; those that do not live together may share one. Returns the slots of all, by value, and
/// how many there are.
pub(super) fn give(lifetimes: &mut [Lifetime], values: usize, first: u32) -> (Vec<u32>, u32) {
    lifetimes.sort_by_key(|life| life.first);
    let mut slots = vec![0; values];
    let mut busy: BinaryHeap<Reverse<(u32, u32)>> = BinaryHeap::new();
    // the lowest free one first: few lines of the cache
    let mut free: BinaryHeap<Reverse<u32>> = BinaryHeap::new();
    let mut end = first;
    for life in lifetimes {
        while let Some(Reverse((last, slot))) = busy.peek().copied() {
            if last >= life.first {
                break;
            }
            busy.pop();
            free.push(Reverse(slot));
        }
        let slot = match free.pop() {
            Some(Reverse(slot)) => slot,
            None => {
                end += 1;
                end - 1
            }
        };
        slots[life.value as usize] = slot;
        busy.push(Reverse((life.last, slot)));
    }
    (slots, end)
}

/// Writes the slots into an instruction.
pub(super) fn settle(machine: &mut Machine, slots: &[u32]) {
    let place = |memory: &mut Memory| {
        if let Memory::Spilled(value) = *memory {
            *memory = Memory::Slot(slots[value as usize]);
        }
    };
    match machine {
        Machine::Load { from: memory, .. } | Machine::Store { to: memory, .. } => place(memory),
        Machine::Unary { a: source, .. }
        | Machine::Binary { b: source, .. }
        | Machine::Fma { b: source, .. }
        | Machine::Less { b: source, .. }
        | Machine::Select { a: source, .. }
        | Machine::Keep { a: source, .. } => {
            if let Source::Memory(memory) = source {
                place(memory);
            }
        }
        _ => {}
    }
}
