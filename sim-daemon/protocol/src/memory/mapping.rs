//! Mapped files of shared memory, and what happens when another program cuts one.
//!
//! Reading behind the end of a file raises a signal on Unix, which ends a process. Here the missing page becomes a page of
//! zeros of this process alone ([`sim_system::faults`]), and the daemon that the file belongs to is noted as damaged: its
//! clients get an error at their next call.

use std::cell::RefCell;
use std::fs::File;
use std::io;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Weak};

use memmap2::{MmapOptions, MmapRaw};
use sim_system::faults;

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

/// The pages of a mapped file: they stay where they are until the last owner goes.
#[derive(Debug)]
pub struct Pages {
    raw: MmapRaw,
    slot: usize,
}

impl Pages {
    /// The first byte, at the begin of a page.
    pub fn start(&self) -> NonNull<u8> {
        NonNull::new(self.raw.as_mut_ptr()).expect("nothing is mapped at zero")
    }

    /// Bytes of the file.
    pub fn bytes(&self) -> usize {
        self.raw.len()
    }

    /// Whether these words lie in them as a whole.
    pub(crate) fn hold(&self, words: &[u64]) -> bool {
        SLOTS[self.slot].holds(words.as_ptr() as usize, size_of_val(words))
    }
}

impl Drop for Pages {
    fn drop(&mut self) {
        // before the pages go
        SLOTS[self.slot].end.store(0, Ordering::Release);
        SLOTS[self.slot].taken.store(false, Ordering::Release);
    }
}

thread_local! {
    static NOTED: RefCell<Option<Vec<Weak<Pages>>>> = const { RefCell::new(None) };
}

/// Also says which files this thread has mapped meanwhile so that it may write to them.
pub(crate) fn noted<T>(make: impl FnOnce() -> T) -> (T, Vec<Weak<Pages>>) {
    NOTED.set(Some(Vec::new()));
    let made = make();
    (made, NOTED.take().unwrap_or_default())
}

/// A mapped file.
#[derive(Debug)]
pub(crate) struct Mapping(Arc<Pages>);

impl Mapping {
    /// Maps the first bytes of a file of an owner, made here or not.
    ///
    /// # Errors
    /// Those of the system; the kind is `OutOfMemory` also for more mappings than are known here.
    pub(crate) fn new(
        file: &File,
        bytes: usize,
        may_write: bool,
        (owner, is_made): (u64, bool),
    ) -> io::Result<Mapping> {
        // SAFETY: it is true for pages of the files that are mapped here, whose readers check what they find.
        unsafe { faults::replace_missing_pages(on_missing_page) };
        let mut options = MmapOptions::new();
        options.len(bytes);
        let raw = match may_write {
            true => options.map_raw(file)?,
            false => options.map_raw_read_only(file)?,
        };
        let slot = register(raw.as_ptr() as usize, bytes, owner, is_made);
        let slot = slot.ok_or(io::ErrorKind::OutOfMemory)?;
        let pages = Arc::new(Pages { raw, slot });
        if may_write {
            NOTED.with_borrow_mut(|noted| {
                noted
                    .iter_mut()
                    .for_each(|n| n.push(Arc::downgrade(&pages)))
            });
        }
        Ok(Mapping(pages))
    }

    pub(crate) fn start(&self) -> NonNull<u8> {
        self.0.start()
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
    let place = used().iter().position(|slot| slot.holds(first, bytes));
    hint.store(place.unwrap_or(0), Ordering::Relaxed);
    place.is_some()
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

/// Whether a page is missing from one of our mappings, which is noted. Runs in a handler of a signal: it allocates nothing
/// and takes no lock.
fn on_missing_page(address: usize) -> bool {
    let Some(slot) = used().iter().find(|slot| slot.holds(address, 1)) else {
        return false;
    };
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

    #[cfg(unix)] // Windows lets nobody cut it
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
        let owner = 0x5ca1_ab1e;
        let mapping = Mapping::new(&file, 4 * page, true, (owner, false)).unwrap();
        let bytes = mapping.start().as_ptr();
        // SAFETY: four pages are mapped.
        let at = |page_number: usize| unsafe { bytes.add(page_number * page) };
        for number in 0..4 {
            // SAFETY: as above.
            unsafe { at(number).write_volatile(7) };
        }
        file.set_len(page as u64).unwrap();
        assert!(!is_damaged(owner));
        // SAFETY: as above; what is missing becomes zeros.
        let read: [u8; 4] = std::array::from_fn(|number| unsafe { at(number).read_volatile() });
        assert_eq!(read, [7, 0, 0, 0]);
        assert!(is_damaged(owner) && !is_damaged(owner + 1) && !is_own_damaged(owner));
    }

    #[test]
    fn bytes_are_held_as_a_whole_or_not_at_all() {
        let file = File::open(std::env::current_exe().unwrap()).unwrap();
        let mapping = Mapping::new(&file, 4096, false, (1, false)).unwrap();
        let start = mapping.start().as_ptr().cast_const();
        // SAFETY: nothing is read through them.
        let slice = |first, bytes| unsafe { std::slice::from_raw_parts(start.add(first), bytes) };
        assert!(holds(slice(0, 4096)) && holds(slice(4000, 96)) && holds(slice(4096, 0)));
        assert!(!holds(&[0_u8; 16]));
        drop(mapping);
    }
}
