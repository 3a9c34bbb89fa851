//! Where shared memory is.

/// The folder of files that processes map, as it is without links. The user's own temporary folder is too long for the path of a socket, and `/tmp`
/// loses what nobody opened for three days.
pub const fn shared_memory() -> &'static str {
    match cfg!(target_os = "macos") {
        true => "/private/var/tmp",
        false => "/var/tmp",
    }
}

/// What tells names apart that name one file: most disks of this system ignore case.
pub fn folded(name: &str) -> String {
    name.to_lowercase()
}

/// What to do when files cannot be made there.
pub const SHARED_MEMORY_CURE: &str =
    "frames go through /private/var/tmp, which must be writable for this user";
