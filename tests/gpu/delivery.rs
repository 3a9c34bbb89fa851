//! Frames that a GPU writes where their readers are.

use crate::common::{Demo, command, lesson};
use crate::{assert_alive, gpu, run};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use sim_physics::arrays::Field;
use std::ptr::null_mut;

const FIELDS: [Field; 3] = [Field::JointQ, Field::JointQd, Field::BodyQ];
/// Where the arena begins: frames have a head before it.
const HEAD: usize = 1024 + 64;

#[test]
fn what_the_device_writes_is_read_through_another_mapping_and_nothing_is_copied() {
    let model = lesson(Demo::Target).compile().unwrap();
    let worlds = 130;
    let mut here = run(&model, gpu(), worlds, &FIELDS);
    let mut staged = run(&model, gpu(), worlds, &FIELDS);
    let bytes = here.sim.layout().bytes;
    let size = (HEAD + bytes).next_multiple_of(4096);
    let file = rustix::fs::memfd_create("frames", rustix::fs::MemfdFlags::CLOEXEC).unwrap();
    rustix::fs::ftruncate(&file, size as u64).unwrap();
    let map = |protection| {
        // SAFETY: a new mapping, at no given address.
        unsafe { mmap(null_mut(), size, protection, MapFlags::SHARED, &file, 0) }.unwrap()
    };
    let (writer, reader) = (
        map(ProtFlags::READ | ProtFlags::WRITE),
        map(ProtFlags::READ),
    );
    // SAFETY: both mappings live to the end of the test, and are read one after the other.
    let arena: &mut [u64] =
        unsafe { std::slice::from_raw_parts_mut(writer.cast::<u8>().add(HEAD).cast(), bytes / 8) };
    // SAFETY: as above.
    let shown: &[u64] =
        unsafe { std::slice::from_raw_parts(reader.cast::<u8>().add(HEAD).cast(), bytes / 8) };
    // SAFETY: the mapping lives longer than the simulation, and nobody else writes to it.
    assert!(
        unsafe { here.sim.import(arena) },
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
    drop(here);
    // SAFETY: nothing looks at them any more.
    unsafe {
        munmap(writer, size).unwrap();
        munmap(reader, size).unwrap();
    }
}
