//! Where shared memory is.

/// The folder of files that processes map. The user's own temporary folder is too long for the path of a socket, and `/tmp`
/// loses what nobody opened for three days.
pub const fn shared_memory() -> &'static str {
    "/var/tmp"
}

/// What to do when files cannot be made there.
pub const SHARED_MEMORY_CURE: &str =
    "frames go through /var/tmp, which must be writable for this user";
