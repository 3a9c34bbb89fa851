//! `tightloop serve`: a daemon from start to end, its loop, and the threads beside it.

mod device_memory;
mod exchange;
mod fault_log;
mod groups;
mod ik;
mod janitor;
mod least_memory;
mod log;
mod pace;
mod rollout;
mod server;
mod session;
mod shown;
mod watchdog;

pub(crate) use exchange::Exchange;
pub(crate) use ik::Ik;
pub(crate) use rollout::{Rollouts, Steps};
pub(crate) use session::{read_scene, run};
