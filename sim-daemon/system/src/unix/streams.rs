//! The standard streams.

use std::fs::File;
use std::io;
use std::os::fd::AsFd;

/// Standard output past its lock, which others would wait for.
///
/// # Errors
/// It was closed.
pub fn stdout() -> io::Result<File> {
    own(io::stdout())
}

/// Standard error past its lock, which others would wait for.
///
/// # Errors
/// It was closed.
pub fn stderr() -> io::Result<File> {
    own(io::stderr())
}

fn own(stream: impl AsFd) -> io::Result<File> {
    Ok(File::from(stream.as_fd().try_clone_to_owned()?))
}
