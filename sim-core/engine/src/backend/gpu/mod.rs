//! The GPU backend: worlds live in device memory, and a control frame is one recorded batch.
//!
//! # Programs
//! The physics code is recorded for the model (`kernels::programs`). Where nothing touches, all substeps are one recording; otherwise one
//! substep is, and it is dispatched once per substep. `sim_record::split` partitions a recording into kernels that a driver compiles in
//! good time. It cuts where few values cross; values that cross go through spare fields. The evaluation of output fields is a second
//! recording. A few more kernels, each dispatched once a frame, do the rest:
//!
//! - `kernels::bookkeeping`: one for each command that waits, two around the substeps (what was before, faults and delays), and one after
//!   substeps and evaluation where worlds can get more room for contacts;
//! - `kernels::show`: one for the frame, and one for fields of contacts.
//!
//! # Threads per world
//! Where contacts can be, hardware has eight threads per world (`kernels::workgroups`). They share the rows of contacts, and each keeps columns of
//! the solver's system (`sim_physics::step::solver`, `spread`). Classes of contacts of the same trees are merged for that (`kernels::merged`).
//! Pairs of shapes are tested by blocks, whose loads a thread waits for together (`kernels::blocks`).
//! Kernels without such work have one thread per world. Sums over threads have a fixed order. Models of more than 48 dofs have 16 or
//! 32 threads per world, so that the solver's system stays in registers. Where it still does not, loops solve it in memory
//! (`kernels::rolled`).
//!
//! # Memory
//! Programs read and write *fields* (`kernels::places`): value i of world w is component i % 4 of `fields[(i / 4) * worlds + w]`. State and
//! commands come first, then what stages leave for each other. Contacts lie likewise in a buffer of their own. A *tile* is as many
//! worlds as a binding can hold (`tile`). Contacts have room for few of each class at first (`kernels::room`). A frame in which a world
//! needs more is undone, all tiles are made anew with twice the room, and the frame is repeated (`growth`).
//!
//! # A frame
//! A frame of a tile is recorded once: waiting commands, substeps, fault checks, evaluation, then a batch that writes the output. Where
//! the driver imports host memory, the output goes into the memory of its readers (`imported`), which its batches own until the lease ends.
//! Otherwise the processor copies it once from a staging buffer, and counts the bytes. Programs write to host memory at once; a frame with contacts is drawn in device memory first.
//!
//! # The host's part
//! The host mirrors seeds, episodes, parameters and counters (`mirror`). It draws starts and noise by the functions of the CPU backend
//! and sends them as rows. So a reset, a write or a snapshot has the CPU's bits, and a snapshot of one backend runs on the other.
//! Steps agree within rounding: threads of a world add in another order, and a driver's `fma`, quotients and roots need not be the nearest
//! numbers. `cpu_bits` asks for the CPU's bits: one thread per world, classes of contacts as the CPU has them, and what `rounding` finds
//! the driver to round otherwise as functions of `sim_record::wgsl::Corrections`.
//!
//! # A lost device
//! Its last frame reports every world as not finite, and the daemon refuses all later commands by name. `auto` leaves the worlds to the
//! CPU where a GPU does not start, and the daemon's notes say why.
//!
//! # What is measured
//! On an H100 (`benches/results`, `gpu_cuts.csv`), with 4096 worlds: eight threads per world take 3 % less of a frame than four in the
//! grasp and 11 % less for a quadruped on the ground. Kernels of 12,000 statements instead of 6,000 take 3 % less in the grasp and 5 %
//! more in the other. Other cards were not measured.

mod backend;
mod compiled;
mod create;
mod frame;
mod growth;
mod imported;
mod kernels;
mod lacks;
mod listing;
mod mirror;
mod recipe;
mod rounding;
mod shared;
mod sharing;
mod sizing;
mod software;
mod tile;
mod uploads;
mod words;
mod worlds;

pub use create::{Cuts, Wanted, create};
pub use listing::{KernelListing, Listing, listing};
