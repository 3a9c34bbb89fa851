//! Mapped files of shared memory, and what happens when another program cuts one.
//!
//! Reading behind the end of a file raises SIGBUS, which ends a process. Here the missing page becomes a page of zeros of this
//! process alone, and the daemon that the file belongs to is noted as damaged: its clients get an error at their next call.
//! A fault at any other address goes to whoever handled the signal before.

use std::ffi::c_void;
use std::os::fd::OwnedFd;
use std::ptr::{NonNull, null_mut};
use std::sync::atomic::{AtomicBool, AtomicPtr, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

/// Mappings that a process can have at once; a client has some tens.
const MAPPINGS_MAX: usize = 8192;
/// Owners of damaged files that are remembered.
const DAMAGED_MAX: usize = 64;
/// Lookups that are remembered, a power of two.
const HINTS: usize = 64;

struct Slot {
    taken: AtomicBool,
    start: AtomicUsize,
    /// 0 while the slot describes nothing.
    end: AtomicUsize,
    owner: AtomicU64,
    /// The file was made here, and not by another process.
    is_made: AtomicBool,
}

static SLOTS: [Slot; MAPPINGS_MAX] = [const {
    Slot {
        taken: AtomicBool::new(false),
        start: AtomicUsize::new(0),
        end: AtomicUsize::new(0),
        owner: AtomicU64::new(0),
        is_made: AtomicBool::new(false),
    }
}; MAPPINGS_MAX];
/// Slots from this on were never taken.
static USED: AtomicUsize = AtomicUsize::new(0);
static DAMAGED: [AtomicU64; DAMAGED_MAX] = [const { AtomicU64::new(0) }; DAMAGED_MAX];
static DAMAGES: AtomicUsize = AtomicUsize::new(0);
static FAULTS: AtomicUsize = AtomicUsize::new(0);
static FOUND: [AtomicUsize; HINTS] = [const { AtomicUsize::new(0) }; HINTS];
/// What handled the signal before us, and whether a fault was handed on to it.
static PREVIOUS: AtomicPtr<libc::sigaction> = AtomicPtr::new(null_mut());
static HANDED_ON: AtomicBool = AtomicBool::new(false);

impl Slot {
    fn holds(&self, first: usize, bytes: usize) -> bool {
        let end = self.end.load(Ordering::Acquire);
        let start = self.start.load(Ordering::Acquire);
        // the same end twice: the slot did not change hands meanwhile
        start <= first
            && first.checked_add(bytes).is_some_and(|last| last <= end)
            && self.end.load(Ordering::Acquire) == end
    }
}

fn used() -> &'static [Slot] {
    &SLOTS[..USED.load(Ordering::Acquire).min(MAPPINGS_MAX)]
}

/// A mapped file.
#[derive(Debug)]
pub(crate) struct Mapping {
    start: NonNull<c_void>,
    bytes: usize,
    slot: usize,
}

impl Mapping {
    /// Maps the first bytes of a file of an owner, made here or not.
    ///
    /// # Errors
    /// Those of the system; `NOMEM` also for more mappings than are known here.
    pub(crate) fn new(
        file: &OwnedFd,
        bytes: usize,
        protection: ProtFlags,
        (owner, is_made): (u64, bool),
    ) -> Result<Mapping, Errno> {
        handle_cut_files();
        // SAFETY: the system chooses the place, so nothing else is there.
        let start = unsafe { mmap(null_mut(), bytes, protection, MapFlags::SHARED, file, 0) }?;
        let start = NonNull::new(start).ok_or(Errno::INVAL)?;
        let Some(slot) = register(start.as_ptr() as usize, bytes, owner, is_made) else {
            // SAFETY: nobody else knows of it.
            let _ = unsafe { munmap(start.as_ptr(), bytes) };
            return Err(Errno::NOMEM);
        };
        Ok(Mapping { start, bytes, slot })
    }

    pub(crate) fn start(&self) -> NonNull<c_void> {
        self.start
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        SLOTS[self.slot].end.store(0, Ordering::Release);
        SLOTS[self.slot].taken.store(false, Ordering::Release);
        // SAFETY: the mapping is ours, and whoever reads through it keeps it. One that cannot be removed stays.
        let _ = unsafe { munmap(self.start.as_ptr(), self.bytes) };
    }
}

fn register(start: usize, bytes: usize, owner: u64, is_made: bool) -> Option<usize> {
    let take = |slot: &Slot| !slot.taken.swap(true, Ordering::AcqRel);
    let index = SLOTS.iter().position(take)?;
    let slot = &SLOTS[index];
    slot.start.store(start, Ordering::Release);
    slot.owner.store(owner, Ordering::Release);
    slot.is_made.store(is_made, Ordering::Release);
    slot.end.store(start + bytes, Ordering::Release);
    USED.fetch_max(index + 1, Ordering::AcqRel);
    Some(index)
}

/// Whether bytes lie in one mapped file, as an offset or a length out of shared memory should make them.
pub(crate) fn holds<T>(values: &[T]) -> bool {
    holds_bytes(values.as_ptr() as usize, size_of_val(values))
}

/// The same for bytes that may not be there at all.
pub(crate) fn holds_bytes(first: usize, bytes: usize) -> bool {
    let hint = &FOUND[(first >> 16) % HINTS];
    if SLOTS[hint.load(Ordering::Relaxed)].holds(first, bytes) {
        return true;
    }
    let found = used().iter().position(|slot| slot.holds(first, bytes));
    hint.store(found.unwrap_or(0), Ordering::Relaxed);
    found.is_some()
}

/// Whether any mapped file was cut.
pub(crate) fn any_damaged() -> bool {
    DAMAGES.load(Ordering::Acquire) > 0
}

/// Pages that were missing so far.
pub(crate) fn faults() -> usize {
    FAULTS.load(Ordering::Acquire)
}

/// Whether a file of `owner` that was made here was cut while it was mapped.
pub(crate) fn is_own_damaged(owner: u64) -> bool {
    is_damaged(!owner)
}

/// Whether a file of `owner` was cut while it was mapped.
pub(crate) fn is_damaged(owner: u64) -> bool {
    let count = DAMAGES.load(Ordering::Acquire).min(DAMAGED_MAX);
    DAMAGED[..count]
        .iter()
        .any(|damaged| damaged.load(Ordering::Acquire) == owner)
}

/// Sees to it that the signal comes to us first; others, such as Python's `faulthandler`, may have put themselves before.
fn handle_cut_files() {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _turn = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let ours = on_bus_error as *const () as usize;
    // SAFETY: zero is a value of this plain struct, and the handler does only what a handler may.
    unsafe {
        let mut present: libc::sigaction = std::mem::zeroed();
        libc::sigaction(libc::SIGBUS, std::ptr::null(), &raw mut present);
        if present.sa_sigaction == ours {
            return;
        }
        // never freed: a handler may be reading the one before
        PREVIOUS.store(Box::into_raw(Box::new(present)), Ordering::Release);
        HANDED_ON.store(false, Ordering::Release);
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = ours;
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
    let Some(slot) = used().iter().find(|slot| slot.holds(address, 1)) else {
        return false;
    };
    let protection = libc::PROT_READ | libc::PROT_WRITE;
    let flags = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_FIXED;
    // SAFETY: the page lies in a mapping of a file of ours, and nothing is there any more. errno is the interrupted code's.
    let mapped = unsafe {
        let errno = *libc::__errno_location();
        let bytes = libc::sysconf(libc::_SC_PAGESIZE) as usize;
        let page = (address & !(bytes - 1)) as *mut c_void;
        let mapped = libc::mmap(page, bytes, protection, flags, -1, 0);
        *libc::__errno_location() = errno;
        mapped
    };
    if mapped == libc::MAP_FAILED {
        return false;
    }
    FAULTS.fetch_add(1, Ordering::AcqRel);
    let owner = slot.owner.load(Ordering::Acquire);
    note_damage(owner);
    if slot.is_made.load(Ordering::Acquire) {
        note_damage(!owner);
    }
    true
}

fn note_damage(owner: u64) {
    if !is_damaged(owner) {
        // several threads may be here; of more owners than are remembered, the newest count
        let index = DAMAGES.fetch_add(1, Ordering::AcqRel) % DAMAGED_MAX;
        DAMAGED[index].store(owner, Ordering::Release);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::File;

    #[test]
    fn a_cut_file_reads_as_zeros_and_its_owner_is_noted() {
        let path = std::env::temp_dir().join(format!("tightloop-cut-{}", std::process::id()));
        let file = File::options()
            .create_new(true)
            .read(true)
            .write(true)
            .open(&path)
            .unwrap();
        std::fs::remove_file(&path).unwrap();
        let page = 1 << 16; // a multiple of every page
        file.set_len(4 * page as u64).unwrap();
        let (file, owner) = (OwnedFd::from(file), 0x5ca1_ab1e);
        let protection = ProtFlags::READ | ProtFlags::WRITE;
        let mapping = Mapping::new(&file, 4 * page, protection, (owner, false)).unwrap();
        let bytes: *mut u8 = mapping.start().as_ptr().cast();
        // SAFETY: four pages are mapped.
        let at = |page_number: usize| unsafe { bytes.add(page_number * page) };
        for number in 0..4 {
            // SAFETY: as above.
            unsafe { at(number).write_volatile(7) };
        }
        rustix::fs::ftruncate(&file, page as u64).unwrap();
        assert!(!is_damaged(owner));
        // SAFETY: as above; what is missing becomes zeros.
        let read: [u8; 4] = std::array::from_fn(|number| unsafe { at(number).read_volatile() });
        assert_eq!(read, [7, 0, 0, 0]);
        assert!(is_damaged(owner) && !is_damaged(owner + 1) && !is_own_damaged(owner));
    }

    #[test]
    fn bytes_are_held_as_a_whole_or_not_at_all() {
        let file = OwnedFd::from(File::open("/proc/self/exe").unwrap());
        let mapping = Mapping::new(&file, 4096, ProtFlags::READ, (1, false)).unwrap();
        let start: *const u8 = mapping.start().as_ptr().cast();
        // SAFETY: nothing is read through them.
        let slice = |first, bytes| unsafe { std::slice::from_raw_parts(start.add(first), bytes) };
        assert!(holds(slice(0, 4096)) && holds(slice(4000, 96)) && holds(slice(4096, 0)));
        assert!(!holds(&[0_u8; 16]));
        drop(mapping);
    }
}
