//! Shared memory as files of a daemon's folder: what makes and maps it, and the ports, loans and frames that lie in it.

#[cfg(not(simulated))]
pub mod descriptors;
pub(crate) mod forked;
pub(crate) mod frame;
pub(crate) mod guard;
pub(crate) mod loaned;
#[cfg(not(simulated))]
pub(crate) mod mapping;
pub(crate) mod port;
pub(crate) mod problem;
#[cfg(not(simulated))]
mod reentrant;
#[cfg(not(simulated))]
pub(crate) mod service;
#[cfg(not(simulated))]
pub(crate) mod storage;

#[cfg(simulated)]
pub use sim_machine::memory::{descriptors, mapping, service, storage};
