//! Files of several crates, as they are, over loom's locks and threads: `make loom` runs their models in every order.
//!
//! The models stand at the end of each file. Around a file is as little of its crate as it needs to compile.

#![cfg(loom)]
// a file is one of a crate that uses the rest
#![allow(dead_code, missing_docs)]
// the threads of a model are one of the system's
#![allow(clippy::arc_with_non_send_sync)]

extern crate self as iceoryx2;
extern crate self as sim_protocol;
extern crate self as sim_system;

pub mod doors;
mod surroundings;

use surroundings::{Dtype, FrameHeader, Line, ProtocolError, Row, Table};
pub use surroundings::{Maker, error, sample, signals, status, streams, terminal};

#[path = "../../../sim-daemon/protocol/src/memory/frame.rs"]
mod frame;
#[path = "../../../sim-daemon/client-c/src/handle.rs"]
mod handle;
#[path = "../../../sim-daemon/protocol/src/waiting/hook.rs"]
mod hook;
#[path = "../../../sim-daemon/src/printer.rs"]
mod printer;
#[path = "../../../sim-daemon/protocol/src/waiting/turn.rs"]
mod turn;

mod waiting {
    pub(crate) use crate::hook;

    pub const SLICE: std::time::Duration = std::time::Duration::from_millis(50);
}

mod memory {
    pub use crate::surroundings::{forked, port, service};
}
