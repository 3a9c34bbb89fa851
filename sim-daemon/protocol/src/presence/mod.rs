//! Where a daemon is and whether it runs: its paths, lock and description, and how a client finds, reaches and stops it.

pub(crate) mod connection;
pub mod daemon_lock;
pub(crate) mod described;
pub(crate) mod discovery;
pub(crate) mod liveness;
pub mod paths;
pub(crate) mod stop;
