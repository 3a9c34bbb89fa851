//! Memory of the machine.

use sysinfo::System;

/// Memory that can be taken without swapping [bytes]; the largest number where that is not known.
pub fn available() -> u64 {
    let Ok(mut system) = System::new() else {
        return u64::MAX;
    };
    system.refresh_memory();
    system.available_memory()
}
