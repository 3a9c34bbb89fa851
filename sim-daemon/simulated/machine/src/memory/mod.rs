//! As the module `memory` of the protocol, where it differs: nothing is mapped here.
//!
//! A scenario says that somebody has cut the files of a run with [`damage`].

pub mod descriptors;
pub mod mapping;
pub mod service;
pub mod storage;

pub use mapping::damage;
