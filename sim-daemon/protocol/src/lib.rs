//! The protocol between a daemon and its clients, on one screen.
//!
//! ```text
//!            wake (event)  ◄───────────────── notify ──────────────────┐
//!            control (request-response, JSON) ◄── describe · acquire · heartbeat · release · journal · timing · shutdown
//!  daemon    act/<epoch>   (pub-sub, 1 : 1)   ◄── command: header, field table, arrays ──   controller
//!            obs/<epoch>   (pub-sub, 1 : 1)   ──► frame:   header, field table, arrays ──►
//!            watch         (pub-sub, 1 : n)   ──► frames of the first worlds and their state, at a limited rate ──► observers
//!            <session>.socket (Unix) ──► descriptors of device memory, where frames and commands of the lease stay on the card
//!            journal/<n>   (pub-sub, 1 : 1)   ──► each command carried out, and digests of its frame ──► recorder
//! ```
//!
//! - A sample is lines of eight words: a field table, then arrays, world-major and 64-byte aligned ([`header`], [`table`]).
//! - Steps are lock-step: the client sends `seq = n`, the daemon answers `ack_seq = n` with a frame or a refusal. One command is
//!   in flight at a time; [`Client::send`] and [`Client::recv`] are the two halves of [`Client::step`].
//! - A lease is one `epoch`, with services of its own; it ends by release, by death, or when another client asks for it
//!   after the heartbeats stopped. Reset, write, forward, snapshot and restore travel as commands too, so that they keep their order.
//! - A recorder has a journal of its own, with the memory of it; the daemon never waits for it, and counts its entries, so that
//!   what a slow recorder loses shows.
//! - A daemon may have its worlds in groups, each with all of this for itself under a name of its own (`NAME.0`, `NAME.1`, …), in
//!   lock-step with its own controller; the daemon's own name then only says how many there are.
//! - A daemon's presence is a lock on `ROOT/NAME.lock` ([`paths`], [`daemon_lock`]); its run is a random `session`.
//! - Clients know no physics: the [`Description`] names what can be sent and what frames carry.
//! - Shared memory lies in files of the daemon's folder, which are complete before they have a name (`memory/storage.rs`); a file
//!   that somebody cuts costs a client or a frame (`memory/mapping.rs`).
//! - Every process here belongs to one user. A hostile process of that user is outside what shared memory can stop; against
//!   mistakes, the daemon copies a command once and checks the copy, and the client checks each table before reading by it.
//!
//! [`Client`] is one end, [`host::Host`] the other. This crate alone uses iceoryx2.

mod client;
mod doors;
mod error;
pub mod host;
pub mod journal;
mod lease;
mod memory;
#[doc(hidden)] // for tests, which give it any bytes
pub mod outside;
mod presence;
mod transport;
mod waiting;
mod wire;

pub use client::Client;
pub use error::ProtocolError;
pub use journal::{Entry as JournalEntry, Journal, digest};
pub use lease::device_memory::{self, Delivery, Descriptor, DeviceCommand, DeviceMemory};
pub use memory::descriptors;
pub use memory::forked::Maker;
pub use memory::frame::{Entry, Frame, View};
pub use presence::daemon_lock::{self, cleanup_after_death, sweep};
pub use presence::discovery::{AttachOptions, find};
pub use presence::paths::{self, Beacon, running};
pub use presence::stop::stop;
pub use waiting::hook::{Hook, keep_waiting};
pub use wire::command::{Command, OnDevice, Values};
pub use wire::description::{
    Description, FieldInfo, Follower, InputInfo, KeyframeInfo, Late, Pace, ParamInfo, RobotRange,
};
pub use wire::hash;
pub use wire::header::{
    self, ALIGNMENT, CommandHeader, Dtype, FrameHeader, Line, Op, PROTOCOL_VERSION, RefusalKind,
    Row,
};
pub use wire::journal_header::JournalHeader;
pub use wire::table::{self, ROWS_MAX, Table};
pub use wire::timing::{Percentiles, Timing};
