//! The programs of a run before they are compiled: recorded physics, bookkeeping around it, and the programs that write a frame.

pub(super) mod blocks;
pub(super) mod bookkeeping;
pub(super) mod merged;
pub(super) mod places;
pub(super) mod programs;
pub(super) mod rolled;
pub(super) mod room;
pub(super) mod show;
pub(super) mod workgroups;
