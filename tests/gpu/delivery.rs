//! Frames that a GPU writes where their readers are.

use crate::common::{Demo, command, lesson};
use crate::{assert_alive, gpu, run};
use rustix::fd::OwnedFd;
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use sim_engine::backend::HostPages;
use sim_physics::arrays::Field;
use std::ptr::{NonNull, null_mut};
use std::sync::Arc;

const FIELDS: [Field; 3] = [Field::JointQ, Field::JointQd, Field::BodyQ];
/// Where the arena begins: frames have a head before it.
const HEAD: usize = 1024 + 64;

/// A mapping of a file of frames.
struct Mapping {
    start: NonNull<u8>,
    bytes: usize,
}

// SAFETY: it is no thread's own.
unsafe impl Send for Mapping {}
// SAFETY: as above.
unsafe impl Sync for Mapping {}

// SAFETY: mapped in `new` until drop; only one that may be written is imported.
unsafe impl HostPages for Mapping {
    fn start(&self) -> NonNull<u8> {
        self.start
    }

    fn bytes(&self) -> usize {
        self.bytes
    }
}

impl Mapping {
    fn new(file: &OwnedFd, bytes: usize, access: ProtFlags) -> Mapping {
        // SAFETY: a new mapping, at no given address.
        let start = unsafe { mmap(null_mut(), bytes, access, MapFlags::SHARED, file, 0) };
        let start = NonNull::new(start.unwrap().cast()).unwrap();
        Mapping { start, bytes }
    }

    /// The arena of so many bytes.
    fn arena(&self, bytes: usize) -> *mut [u64] {
        assert!(HEAD + bytes <= self.bytes);
        let first = self.start.as_ptr().wrapping_add(HEAD);
        std::ptr::slice_from_raw_parts_mut(first.cast(), bytes / 8)
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping is this one's.
        unsafe { munmap(self.start.as_ptr().cast(), self.bytes).unwrap() };
    }
}

/// A file of frames of so many bytes, and its length.
fn file_of(bytes: usize) -> (OwnedFd, usize) {
    let size = (HEAD + bytes).next_multiple_of(4096);
    let file = rustix::fs::memfd_create("frames", rustix::fs::MemfdFlags::CLOEXEC).unwrap();
    rustix::fs::ftruncate(&file, size as u64).unwrap();
    (file, size)
}

const WRITABLE: ProtFlags = ProtFlags::READ.union(ProtFlags::WRITE);

#[test]
fn what_the_device_writes_is_read_through_another_mapping_and_nothing_is_copied() {
    let model = lesson(Demo::Target).compile().unwrap();
    let worlds = 130;
    let mut here = run(&model, gpu(), worlds, &FIELDS);
    let mut staged = run(&model, gpu(), worlds, &FIELDS);
    let bytes = here.sim.layout().bytes;
    let (file, size) = file_of(bytes);
    let writer = Arc::new(Mapping::new(&file, size, WRITABLE));
    let reader = Mapping::new(&file, size, ProtFlags::READ);
    // SAFETY: both mappings live to the end of the test, and are read one after the other.
    let (arena, shown) = unsafe { (&mut *writer.arena(bytes), &*reader.arena(bytes)) };
    assert!(
        here.sim.import(arena, &|| Some(writer.clone())),
        "this driver imports no host memory"
    );
    for frame in 0..5 {
        let (field, row) = command(Demo::Target, frame);
        here.command(field, &row);
        staged.command(field, &row);
        here.sim.step(arena);
        staged.step();
        assert!(shown == &staged.arena[..bytes / 8], "frame {frame}");
    }
    assert_alive(&here);
    assert_eq!(here.sim.copied(), 0);
    assert_eq!(staged.sim.copied(), 5 * bytes as u64);
    // another arena than the one that was imported
    here.step();
    assert_eq!(here.sim.copied(), bytes as u64);
}

#[test]
fn imported_pages_are_mapped_until_they_are_forgotten_or_their_worlds_end() {
    let model = lesson(Demo::Target).compile().unwrap();
    for is_forgotten in [true, false] {
        let mut here = run(&model, gpu(), 3, &FIELDS);
        let mut staged = run(&model, gpu(), 3, &FIELDS);
        let bytes = here.sim.layout().bytes;
        let (file, size) = file_of(bytes);
        let reader = Mapping::new(&file, size, ProtFlags::READ);
        // clients that come and go leave nothing behind
        for round in 0..3 {
            let writer = Arc::new(Mapping::new(&file, size, WRITABLE));
            let owner = Arc::downgrade(&writer);
            // SAFETY: the worlds own the mapping, until they are asked to forget it.
            let arena = unsafe { &mut *writer.arena(bytes) };
            let is_elsewhere = || -> Option<Arc<dyn HostPages>> { None };
            assert!(!here.sim.import(arena, &is_elsewhere), "nobody owns it");
            assert!(here.sim.import(arena, &|| Some(writer.clone())));
            drop(writer);
            // its owner is known
            assert!(here.sim.import(arena, &|| unreachable!()));
            here.sim.step(arena);
            staged.step();
            // SAFETY: no frame is written meanwhile.
            let shown = unsafe { &*reader.arena(bytes) };
            assert!(shown == &staged.arena[..bytes / 8], "round {round}");
            assert_eq!(here.sim.copied(), 0);
            assert_eq!(owner.strong_count(), 1);
            if is_forgotten {
                here.sim.forget();
                assert_eq!(owner.strong_count(), 0);
            } else {
                assert_alive(&here);
                drop(here);
                assert_eq!(owner.strong_count(), 0);
                break;
            }
        }
    }
}

#[test]
fn an_arena_outside_of_the_given_pages_is_copied_to() {
    let model = lesson(Demo::Target).compile().unwrap();
    let mut here = run(&model, gpu(), 3, &FIELDS);
    let bytes = here.sim.layout().bytes;
    let (file, size) = file_of(bytes);
    let pages = Arc::new(Mapping::new(&file, size, WRITABLE));
    let mut arena = vec![0; bytes / 8];
    assert!(!here.sim.import(&arena, &|| Some(pages.clone())));
    here.sim.step(&mut arena);
    assert_eq!(here.sim.copied(), bytes as u64);
    assert_alive(&here);
}
