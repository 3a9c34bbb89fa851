//! A client's end of a lease: commands and their frames, heartbeats, and device memory.

pub(crate) mod answer;
pub(crate) mod controller;
pub mod device_memory;
mod heartbeat;
