//! Cores of a thread, which the system alone chooses.

/// The core that this thread runs on; none where the system does not tell.
pub fn current() -> Option<usize> {
    None
}

/// Moves this thread off `core` if it is there and may run elsewhere, and says whether it moved.
pub fn leave(_core: usize) -> bool {
    false
}

/// Moves this thread off `core` until the value is dropped. None where it did not.
pub fn keep_off(_core: usize) -> Option<Away> {
    None
}

/// A core that a thread keeps off.
#[derive(Debug)]
pub struct Away {
    _never: std::convert::Infallible,
}

/// Keeps this thread, and those that it starts, on some cores.
///
/// # Errors
/// Why not, and what to do.
pub fn keep_to(_cores: &[usize]) -> Result<(), String> {
    Err("macOS chooses the cores of all programs; leave the argument out".to_owned())
}
