//! Commands as a driver records them: handles instead of programs and buffers.

use std::ops::Range;

/// A command on pipelines `P` and buffers `B` of a driver.
pub(crate) enum RawOp<'a, P, B> {
    Dispatch {
        pipeline: &'a P,
        /// Binding, buffer and range [bytes].
        slots: Vec<(u32, &'a B, Range<u64>)>,
        groups: RawGroups<'a, B>,
    },
    Copy {
        from: &'a B,
        from_at: u64,
        to: &'a B,
        to_at: u64,
        bytes: u64,
    },
}

/// How many workgroups run.
pub(crate) enum RawGroups<'a, B> {
    Given(u32),
    /// Read from a byte of a buffer when the command runs.
    Found(&'a B, u64),
}
