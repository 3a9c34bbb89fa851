//! Where shared memory is.

/// The folder of shared memory: a file system in memory.
pub const fn shared_memory() -> &'static str {
    "/dev/shm"
}

/// What tells names apart that name one file.
pub fn folded(name: &str) -> String {
    name.to_owned()
}

/// What to do when files cannot be made there.
pub const SHARED_MEMORY_CURE: &str = "frames go through /dev/shm, which must be writable for this user: mount memory there, by \
                                      `mount -t tmpfs -o mode=1777 tmpfs /dev/shm`";
