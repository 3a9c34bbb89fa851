//! Process exit while a driver compiles.

use crate::program::workers::compiling;
use std::io::Write;

// SAFETY: as C declares it: it takes any integer and never returns.
unsafe extern "C" {
    safe fn _exit(code: i32) -> !;
}

/// Exits with this code now, whatever other threads do, and without exit handlers.
pub fn leave_at_once(code: i32) -> ! {
    _exit(code)
}

/// Exits with this code if an abandoned driver thread still compiles; otherwise returns.
///
/// Exit handlers unload the driver's libraries, and a thread inside them would crash. `_exit` runs no exit handlers.
pub fn leave(code: i32) {
    if compiling() > 0 {
        let _ = std::io::stdout().flush();
        _exit(code);
    }
}
