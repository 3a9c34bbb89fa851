//! Shared memory as files of a daemon's folder: what makes and maps it, and the ports, loans and frames that lie in it.

pub mod descriptors;
pub(crate) mod forked;
pub(crate) mod frame;
pub(crate) mod guard;
pub(crate) mod loaned;
pub(crate) mod mapping;
pub(crate) mod port;
pub(crate) mod problem;
mod reentrant;
pub(crate) mod service;
pub(crate) mod storage;
