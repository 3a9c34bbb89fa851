//! Windows.
//!
//! Folders of a user are closed to others by what the user's profile grants, so there are no modes. Locks bind all readers of
//! the bytes that they cover: ours cover bytes behind the end of a file.

pub mod clock;
pub mod cores;
pub mod faults;
pub mod files;
pub mod forks;
pub mod memory;
pub mod open_files;
pub mod process;
pub mod signals;
pub mod storage;
pub mod streams;
