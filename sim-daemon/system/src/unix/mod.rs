//! What Linux and macOS share.

pub mod faults;
pub mod files;
pub mod forks;
pub mod open_files;
pub mod signals;
pub mod streams;
