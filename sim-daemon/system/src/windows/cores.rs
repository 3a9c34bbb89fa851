//! Cores of a thread: of the first 64, which are one group of processors.

use std::io;

use windows_sys::Win32::System::Threading::{
    GetCurrentProcess, GetCurrentProcessorNumber, GetCurrentThread, GetProcessAffinityMask,
    SetProcessAffinityMask, SetThreadAffinityMask,
};

/// The core that this thread runs on; none where the system does not tell.
pub fn current() -> Option<usize> {
    // SAFETY: the call has no preconditions.
    Some(unsafe { GetCurrentProcessorNumber() } as usize)
}

/// Moves this thread off `core` if it is there and may run elsewhere, and says whether it moved. It may come back at once if
/// the system thinks so; where it may run stays the user's choice.
pub fn leave(core: usize) -> bool {
    keep_off(core).is_some_and(|away| {
        drop(away);
        current() != Some(core)
    })
}

/// Moves this thread off `core` if it is there and may run elsewhere, until the value is dropped, on the same thread. None
/// where it did not.
pub fn keep_off(core: usize) -> Option<Away> {
    let (mut allowed, mut all) = (0, 0);
    // SAFETY: both places are ours; the handle of this process needs no closing.
    let others = unsafe {
        if GetProcessAffinityMask(GetCurrentProcess(), &raw mut allowed, &raw mut all) == 0 {
            return None;
        }
        allowed & !mask(core)
    };
    if current() != Some(core) || others == 0 {
        return None;
    }
    // SAFETY: the handle of this thread needs no closing.
    let before = unsafe { SetThreadAffinityMask(GetCurrentThread(), others) };
    (before != 0).then_some(Away { before, others })
}

/// A core that a thread keeps off.
#[derive(Debug)]
pub struct Away {
    before: usize,
    others: usize,
}

impl Drop for Away {
    fn drop(&mut self) {
        // SAFETY: the handle of this thread needs no closing.
        unsafe {
            let meanwhile = SetThreadAffinityMask(GetCurrentThread(), self.before);
            // another choice that was made meanwhile stays
            if meanwhile != self.others && meanwhile != 0 {
                SetThreadAffinityMask(GetCurrentThread(), meanwhile);
            }
        }
    }
}

/// Keeps this process on some cores.
///
/// # Errors
/// Why not, and what to do.
pub fn keep_to(cores: &[usize]) -> Result<(), String> {
    if let Some(core) = cores.iter().find(|core| **core >= usize::BITS as usize) {
        return Err(format!("core {core}: numbers end at {}", usize::BITS - 1));
    }
    let cores = cores.iter().fold(0, |all, &core| all | mask(core));
    // SAFETY: the handle of this process needs no closing.
    if unsafe { SetProcessAffinityMask(GetCurrentProcess(), cores) } == 0 {
        let error = io::Error::last_os_error();
        return Err(format!("{error}; the task manager lists the processors"));
    }
    Ok(())
}

fn mask(core: usize) -> usize {
    u32::try_from(core).map_or(0, |core| 1_usize.checked_shl(core).unwrap_or(0))
}
