//! The standard streams.

use std::fs::File;
use std::io;
use std::os::fd::AsFd;

/// Standard output past its lock, which others would wait for.
///
/// # Errors
/// It was closed.
pub fn stdout() -> io::Result<File> {
    to_file(io::stdout())
}

/// Standard error past its lock, which others would wait for.
///
/// # Errors
/// It was closed.
pub fn stderr() -> io::Result<File> {
    to_file(io::stderr())
}

fn to_file(stream: impl AsFd) -> io::Result<File> {
    Ok(File::from(stream.as_fd().try_clone_to_owned()?))
}
