//! The recording backend: physics code is not executed but recorded, as a tree of statements that becomes a GPU program.
//!
//! [`record`] calls physics code with a [`Recorder`] as its execution context and [`Recorded`] scalars as inputs, and returns a
//! [`Recording`]. [`wgsl`] prints it as one kernel, [`split`](mod@split) as several, and [`Recording::evaluate`] runs it on the CPU. Native loops are
//! unrolled, constants folded in `f32`, equal values shared within a block and the blocks around it, and dead code removed.
//!
//! ```
//! use sim_physics::lane::{Cx, Num, Tables};
//! use sim_record::record;
//! use sim_physics::times;
//!
//! let doubled_thrice = record(1, |cx, x| {
//!     let mut sum = cx.var(x[0]);
//!     times!(cx, 3, {
//!         let twice = cx.get(&sum) * Num::c(2.0);
//!         cx.set(&mut sum, twice);
//!     });
//!     vec![cx.get(&sum)]
//! })
//! .unwrap();
//! assert_eq!(doubled_thrice.evaluate(&[5.0], &mut [], &Tables::default()), [40.0]);
//! ```
//!
//! Code that would mean one thing here and another on a CPU lane is refused ([`Misuse`]): above all a native `let mut` that is carried
//! through a loop or out of a block. Two cases cannot be detected, so tests also compare each stage with its scalar run: a native
//! variable that is assigned, inside a block, a value from before the block without arithmetic; and one that takes two iterations
//! to arrive.

mod error;
mod evaluate;
pub mod ir;
mod passes;
mod record;
mod recorder;
pub mod split;
pub mod wgsl;

pub use error::{MAX_NESTING, Misuse, RecordError};
pub use ir::recording::{Origin, Recording, Statements};
pub use record::record;
pub use recorder::Recorder;
pub use recorder::handles::{
    Recorded, RecordedBlock, RecordedIndex, RecordedList, RecordedLoop, RecordedMask, RecordedRow,
    RecordedVariable,
};
