//! Memory: what is shared with the host, what does not fit, what a view of it forbids.

use crate::common::{copy, device, fetch, numbers, program, scale_add, staged, ways};
use rustix::fs::{MemfdFlags, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use sim_device::{AdapterKind, Device, DeviceError, HostPages, Replay};
use std::ops::Range;
use std::ptr::NonNull;
use std::sync::Arc;

/// Size of the shared pages [bytes].
const PAGES: usize = 1 << 20;

/// A mapping of shared pages.
struct Mapping(NonNull<u8>);

// SAFETY: it is no thread's own, and what batches write is read after them.
unsafe impl Send for Mapping {}
// SAFETY: as above.
unsafe impl Sync for Mapping {}

// SAFETY: mapped in `new` until drop; only one that may be written is imported.
unsafe impl HostPages for Mapping {
    fn start(&self) -> NonNull<u8> {
        self.0
    }

    fn bytes(&self) -> usize {
        PAGES
    }
}

impl Mapping {
    fn new(file: &impl rustix::fd::AsFd, access: ProtFlags) -> Mapping {
        // SAFETY: a new mapping at a place of the kernel's choice.
        let at = unsafe {
            mmap(
                std::ptr::null_mut(),
                PAGES,
                access,
                MapFlags::SHARED,
                file,
                0,
            )
        };
        Mapping(NonNull::new(at.unwrap().cast()).unwrap())
    }

    fn numbers(&self) -> &[f32] {
        // SAFETY: mapped until drop, and no batch runs while it is viewed.
        unsafe { std::slice::from_raw_parts(self.0.as_ptr().cast(), PAGES / 4) }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: the mapping is this one's.
        unsafe { munmap(self.0.as_ptr().cast(), PAGES).unwrap() };
    }
}

/// A file of shared pages.
fn shared_pages() -> rustix::fd::OwnedFd {
    let file = memfd_create("tightloop-import", MemfdFlags::CLOEXEC).unwrap();
    ftruncate(&file, PAGES as u64).unwrap();
    file
}

const WRITABLE: ProtFlags = ProtFlags::READ.union(ProtFlags::WRITE);

/// Whether the driver refuses such pages, as the software driver does not.
fn refuses_pages(device: &Device) -> bool {
    if !device.info().imports {
        let name = &device.info().name;
        let software = device.info().kind == AdapterKind::Software;
        assert!(!software, "lavapipe takes pages of shared memory");
        eprintln!("skipped: the driver of {name} refuses pages of shared memory");
    }
    !device.info().imports
}

#[test]
fn what_a_program_writes_into_imported_pages_is_read_through_another_mapping() {
    let device = device();
    if refuses_pages(&device) {
        return;
    }
    let file = shared_pages();
    let written = Arc::new(Mapping::new(&file, WRITABLE));
    let other = Mapping::new(&file, ProtFlags::READ);
    // SAFETY: what batches write is read after them.
    let pages = unsafe { device.import(written, 0..PAGES) }.unwrap();
    let input: Vec<f32> = (0..PAGES / 4).map(|i| i as f32).collect();
    let from = staged(&device, &input);
    let whole = 0..PAGES as u64;
    let add = program(&device, scale_add(2.0, PAGES as u32 / 4));
    for (replay, times) in [(Replay::Recorded, 2.0), (Replay::Encoded, 4.0)] {
        let mut batch = device.batch(replay);
        let groups = (PAGES / 4 / 32) as u32;
        batch.dispatch(
            &add,
            &[(0, &from, whole.clone()), (3, &pages, whole.clone())],
            groups,
        );
        let batch = batch.finish().unwrap();
        device.run(&[&batch]).unwrap();
        let wanted: Vec<f32> = input.iter().map(|x| times * x).collect();
        assert!(other.numbers() == wanted, "{replay:?}");
    }
    // and a copy out of them
    assert_eq!(fetch(&device, &pages), other.numbers());
}

#[test]
fn imported_pages_are_mapped_until_the_last_batch_over_them_is_gone() {
    if refuses_pages(&device()) {
        return;
    }
    let file = shared_pages();
    let other = Mapping::new(&file, ProtFlags::READ);
    for (replay, is_lost, value) in [
        (Replay::Recorded, false, 3.0),
        (Replay::Encoded, false, 4.0),
        (Replay::Recorded, true, 5.0),
    ] {
        let device = device();
        let written = Arc::new(Mapping::new(&file, WRITABLE));
        let owner = Arc::downgrade(&written);
        // SAFETY: what batches write is read after them.
        let pages = unsafe { device.import(written, 4096..8192) }.unwrap();
        let from = staged(&device, &[value; 8]);
        let mut batch = device.batch(replay);
        batch.copy(&from, 0, &pages, 32, 32);
        let batch = batch.finish().unwrap();
        drop(pages);
        assert!(owner.strong_count() > 0, "{replay:?}");
        device.run(&[&batch]).unwrap();
        assert_eq!(other.numbers()[1024 + 8..][..8], [value; 8]);
        if is_lost {
            device.lose();
            device.run(&[&batch]).unwrap_err();
        }
        drop(batch);
        // a lost device may still write
        assert_eq!(owner.strong_count(), usize::from(is_lost), "{replay:?}");
        drop((device, from));
        assert_eq!(owner.strong_count(), 0, "{replay:?}");
    }
}

#[test]
fn pages_that_cannot_be_imported_are_refused_and_the_device_goes_on() {
    for (device, replay) in ways() {
        let pages = Arc::new(Mapping::new(&shared_pages(), WRITABLE));
        let owner = Arc::downgrade(&pages);
        let backwards = Range {
            start: 8192,
            end: 4096,
        };
        for range in [
            1..65537,
            0..0,
            0..PAGES + 4096,
            PAGES..usize::MAX,
            backwards,
        ] {
            // SAFETY: nothing is imported.
            let failure = unsafe { device.import(pages.clone(), range) }
                .err()
                .unwrap();
            assert!(matches!(failure, DeviceError::Import { .. }), "{failure}");
        }
        drop(pages);
        assert_eq!(owner.strong_count(), 0);
        let from = staged(&device, &[3.0; 8]);
        let to = device.buffer("to", 32).unwrap();
        device.run(&[&copy(&device, replay, &from, &to)]).unwrap();
        assert_eq!(fetch(&device, &to), [3.0; 8]);
    }
}

#[test]
fn a_buffer_that_does_not_fit_is_refused_by_name() {
    for (device, _) in ways() {
        for bytes in [1 << 44, u64::MAX - 3, u64::MAX] {
            for failure in [
                device.buffer("state", bytes).err().unwrap(),
                device.staging("state", bytes).err().unwrap(),
            ] {
                let text = failure.to_string();
                assert!(matches!(failure, DeviceError::OutOfMemory { .. }), "{text}");
                assert!(
                    text.contains("`state`") && text.contains("fewer worlds"),
                    "{text}"
                );
            }
        }
        assert_eq!(
            fetch(&device, &device.buffer("small", 8).unwrap()),
            [0.0; 2]
        );
    }
}

#[test]
fn a_staging_buffer_that_is_looked_at_is_not_run_over() {
    for (device, replay) in ways() {
        let (from, to) = (staged(&device, &[1.0; 4]), staged(&device, &[0.0; 4]));
        let batch = copy(&device, replay, &from, &to);
        let view = to.read();
        let failure = device.run(&[&batch]).unwrap_err();
        assert!(matches!(failure, DeviceError::Busy { .. }), "{failure}");
        assert!(view.iter().all(|&byte| byte == 0));
        drop(view);
        device.run(&[&batch]).unwrap();
        assert_eq!(numbers(&to), [1.0; 4]);
    }
}

#[test]
fn what_was_written_after_a_run_is_seen_by_the_next() {
    for (device, replay) in ways() {
        let (from, to) = (staged(&device, &[1.0; 64]), staged(&device, &[0.0; 64]));
        let batch = copy(&device, replay, &from, &to);
        for i in 0..50 {
            let input = [i as f32; 64];
            from.write().copy_from_slice(bytemuck::cast_slice(&input));
            device.run(&[&batch]).unwrap();
            assert_eq!(numbers(&to), input);
        }
    }
}

#[test]
fn ranges_of_a_buffer_are_bound_as_they_are_given() {
    for (device, replay) in ways() {
        let align = device.info().binding_align.max(32);
        let count = (align / 4 * 3) as usize;
        let input: Vec<f32> = (0..count).map(|i| i as f32).collect();
        let (from, to) = (staged(&device, &input), staged(&device, &vec![0.0; count]));
        let add = program(&device, scale_add(1.0, 8));
        let mut batch = device.batch(replay);
        let ranges = [
            (0, &*from, align..align + 32),
            (3, &*to, 2 * align..3 * align),
        ];
        batch.dispatch(&add, &ranges, 1);
        device.run(&[&batch.finish().unwrap()]).unwrap();
        let mut wanted = vec![0.0; count];
        for i in 0..8 {
            wanted[2 * count / 3 + i] = input[count / 3 + i];
        }
        assert_eq!(numbers(&to), wanted);
    }
}
