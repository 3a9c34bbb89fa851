//! The CPU backend: blocks of worlds, one world per SIMD lane, spread over threads.
//!
//! A control frame is one pass per block: all substeps run while the block's state is in cache. Where blocks gather, it is one pass
//! per cluster of blocks, whose slowest worlds share further blocks (`gathering`). A frame allocates nothing, except for a
//! few words per chunk where groups share their threads.
//!
//! # Groups
//! Groups of worlds share one pool of threads. A chunk of worlds is a job, and jobs run in the order in which they arrive: all cores
//! work on the group that was asked first, so its frame is ready while the next group is computed.
//!
//! # Arithmetic
//! The physics code uses hardware FMA wherever it says fma, so x86 needs AVX2 with FMA, for scalar runs too. A build for older
//! processors would take as long to compile as the others. There are no estimates of reciprocals or square roots, and sine and cosine
//! are the project's own on every backend. All instruction sets therefore give the same bits.

mod backend;
mod chunk;
mod compiled;
mod contact_kinds;
mod contacts;
mod delay;
mod dispatch;
mod faults;
mod gathered;
mod gathering;
mod lane_assignment;
mod lane_move;
mod noise;
mod probe;
mod records;
mod regroup;
mod reset;
mod run;
mod space;
mod transfer;

pub use compiled::{ProgramListing, SectionListing, listing};
pub use dispatch::available;
pub(crate) use dispatch::{CpuOptions, create};
pub(crate) use gathered::spaces_max;
