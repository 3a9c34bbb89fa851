//! Pages of a mapped file that are missing since somebody cut it: reading them raises SIGBUS.

use std::ffi::c_void;
use std::ptr::null_mut;
use std::sync::atomic::{AtomicBool, AtomicPtr, Ordering};
use std::sync::{Mutex, OnceLock, PoisonError};

/// Takes note of a missing page at an address, and says whether zeros may replace it.
pub type OnMissingPage = fn(usize) -> bool;

static ON_MISSING_PAGE: OnceLock<OnMissingPage> = OnceLock::new();
/// What handled the signal before us, and whether a fault was handed on to it.
static PREVIOUS: AtomicPtr<libc::sigaction> = AtomicPtr::new(null_mut());
static HANDED_ON: AtomicBool = AtomicBool::new(false);

/// Puts a page of zeros of this process alone in place of a missing page, where `on_missing_page` says that it may. A fault
/// at any other address goes to the handler before ours.
///
/// Call it again before each mapping: others, such as Python's `faulthandler`, may have put themselves before us. macOS does
/// not tell a fault from a signal that somebody sent.
///
/// # Safety
/// `on_missing_page` is true only for pages of mapped files that may become zeros. It runs in a handler of a signal, so it
/// allocates nothing and takes no lock.
pub unsafe fn replace_missing_pages(on_missing_page: OnMissingPage) {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    // one crate asks for it, always with the same function
    let _ = ON_MISSING_PAGE.set(on_missing_page);
    let handler = on_bus_error as *const () as usize;
    // SAFETY: zero is a value of this plain struct, and the handler does only what a handler may.
    unsafe {
        let mut present: libc::sigaction = std::mem::zeroed();
        libc::sigaction(libc::SIGBUS, std::ptr::null(), &raw mut present);
        if present.sa_sigaction == handler {
            return;
        }
        // never freed: a handler may be reading the one before
        PREVIOUS.store(Box::into_raw(Box::new(present)), Ordering::Release);
        HANDED_ON.store(false, Ordering::Release);
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = handler;
        action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
        libc::sigaction(libc::SIGBUS, &raw const action, null_mut());
    }
}

/// Runs at any instruction of any thread: it allocates nothing and takes no lock.
extern "C" fn on_bus_error(signal: i32, info: *mut libc::siginfo_t, _: *mut c_void) {
    // SAFETY: the system passes what it knows of the signal; of a fault, the address.
    let (code, address) = unsafe { ((*info).si_code, (*info).si_addr() as usize) };
    let is_fault = code > 0;
    if is_fault && replace_page(address) {
        return;
    }
    let previous = PREVIOUS.load(Ordering::Acquire);
    // SAFETY: the action was that of this process. A fault is raised again by itself, a signal that was sent is not.
    unsafe {
        // one that hands it back to us, since it came later and keeps us as its own previous one, gets no second turn
        if previous.is_null() || HANDED_ON.swap(true, Ordering::AcqRel) {
            libc::signal(signal, libc::SIG_DFL);
        } else {
            libc::sigaction(signal, previous, null_mut());
        }
        if !is_fault {
            libc::raise(signal);
        }
    }
}

/// Puts zeros in place of the page at `address`, if it is one of ours.
fn replace_page(address: usize) -> bool {
    if !ON_MISSING_PAGE.get().is_some_and(|noted| noted(address)) {
        return false;
    }
    let protection = libc::PROT_READ | libc::PROT_WRITE;
    let flags = libc::MAP_PRIVATE | libc::MAP_ANON | libc::MAP_FIXED;
    // SAFETY: the page lies in a mapping of a file of ours, and nothing is there any more. errno is the interrupted code's.
    let mapped = unsafe {
        let errno = *errno();
        let bytes = libc::sysconf(libc::_SC_PAGESIZE) as usize;
        let page = (address & !(bytes - 1)) as *mut c_void;
        let mapped = libc::mmap(page, bytes, protection, flags, -1, 0);
        *self::errno() = errno;
        mapped
    };
    mapped != libc::MAP_FAILED
}

#[cfg(target_os = "linux")]
use libc::__errno_location as errno;
#[cfg(target_os = "macos")]
use libc::__error as errno;
