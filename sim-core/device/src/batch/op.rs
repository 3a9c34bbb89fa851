//! Commands of a batch, checked: dispatches and copies.

use crate::memory::Memory;
use crate::program::Compiled;
use crate::raw_op::{RawGroups, RawOp};
use crate::vulkan::{Handle, Pipeline};
use std::ops::Range;
use std::sync::Arc;

/// A staging buffer in a batch.
#[derive(Clone)]
pub(crate) struct Staged {
    pub memory: Arc<Memory>,
    pub written: bool,
}

/// One command.
pub(crate) enum BatchOp {
    Dispatch {
        program: Arc<Compiled>,
        slots: Vec<Slot>,
        groups: Groups,
    },
    Copy {
        from: Arc<Memory>,
        from_at: u64,
        to: Arc<Memory>,
        to_at: u64,
        bytes: u64,
    },
}

/// How many workgroups run.
pub(crate) enum Groups {
    Given(u32),
    /// Three `u32` at a byte of a buffer when the command runs; the last two are 1.
    Found {
        buffer: Arc<Memory>,
        at: u64,
    },
}

/// A buffer at a binding of a program.
pub(crate) struct Slot {
    pub binding: u32,
    pub read_only: bool,
    pub buffer: Arc<Memory>,
    pub range: Range<u64>,
}

impl BatchOp {
    /// Name of its program.
    pub fn label(&self) -> &str {
        match self {
            BatchOp::Dispatch { program, .. } => &program.source.label,
            BatchOp::Copy { .. } => "copy",
        }
    }

    /// The command for the Vulkan route.
    pub fn raw(&self) -> RawOp<'_, Pipeline, Handle> {
        match self {
            BatchOp::Dispatch {
                program,
                slots,
                groups,
            } => RawOp::Dispatch {
                pipeline: program.pipeline(),
                slots: slots
                    .iter()
                    .map(|slot| (slot.binding, slot.buffer.raw(), slot.range.clone()))
                    .collect(),
                groups: match groups {
                    Groups::Given(groups) => RawGroups::Given(*groups),
                    Groups::Found { buffer, at } => RawGroups::Found(buffer.raw(), *at),
                },
            },
            BatchOp::Copy {
                from,
                from_at,
                to,
                to_at,
                bytes,
            } => RawOp::Copy {
                from: from.raw(),
                from_at: *from_at,
                to: to.raw(),
                to_at: *to_at,
                bytes: *bytes,
            },
        }
    }
}

/// The staging buffers of some commands, without repetition.
pub(crate) fn staged_buffers(ops: &[BatchOp]) -> Vec<Staged> {
    let mut buffers: Vec<Staged> = Vec::new();
    let mut note = |memory: &Arc<Memory>, written: bool| {
        if memory.host.is_none() {
            return;
        }
        match buffers.iter_mut().find(|s| Arc::ptr_eq(&s.memory, memory)) {
            Some(staged) => staged.written |= written,
            None => buffers.push(Staged {
                memory: memory.clone(),
                written,
            }),
        }
    };
    for op in ops {
        match op {
            BatchOp::Dispatch { slots, groups, .. } => {
                for slot in slots {
                    note(&slot.buffer, !slot.read_only);
                }
                if let Groups::Found { buffer, .. } = groups {
                    note(buffer, false);
                }
            }
            BatchOp::Copy { from, to, .. } => {
                note(from, false);
                note(to, true);
            }
        }
    }
    buffers
}
