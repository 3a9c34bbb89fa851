//! Memory for another process: what it holds, what refuses it, and in which order both work. `tests/gpu` imports it.

use crate::common::{copy, device, fetch, numbers, staged};
use sim_device::{Choice, Device, DeviceError, Replay};
use std::time::Duration;

#[test]
fn shared_memory_begins_as_zeros_and_is_a_buffer_like_any_other() {
    let device = device();
    let shared = device.shared_buffer("shared", 4000).unwrap();
    assert!(shared.allocated >= 4000);
    assert_ne!(device.uuid(), Some([0; 16]));
    assert_eq!(fetch(&device, &shared.buffer), [0.0; 1000]);
    let values: Vec<f32> = (0..1000).map(|k| k as f32).collect();
    let sent = staged(&device, &values);
    for replay in [Replay::Recorded, Replay::Encoded] {
        let batch = copy(&device, replay, &sent, &shared.buffer);
        device.run(&[&batch]).unwrap();
        assert_eq!(fetch(&device, &shared.buffer), values);
    }
    assert_eq!(numbers(&sent), values);
}

#[test]
fn what_cannot_be_shared_is_refused_with_the_reason() {
    let portable = Device::open_portable(&Choice::First, None).unwrap();
    let refused = [
        portable.shared_buffer("shared", 64).err(),
        portable.timeline().err(),
        device().shared_buffer("shared", u64::MAX >> 2).err(),
    ];
    let told = ["only Vulkan", "only Vulkan", "largest buffer"];
    for (refused, told) in refused.into_iter().zip(told) {
        let sentence = refused.unwrap().to_string();
        assert!(
            sentence.contains("another process") && sentence.contains(told),
            "{sentence}"
        );
    }
}

#[test]
fn a_timeline_moves_with_the_work_or_its_extension_is_named() {
    let device = device();
    let made = device.timeline();
    let (timeline, _theirs) = match made {
        Ok(made) => made,
        Err(DeviceError::Export { reason }) => {
            let known = ["VK_KHR_external_semaphore_fd", "timeline semaphores"];
            assert!(known.iter().any(|known| reason.contains(known)), "{reason}");
            return;
        }
        Err(other) => panic!("{other}"),
    };
    let reached = |value| timeline.wait(value, Duration::ZERO).unwrap();
    assert!(reached(0) && !reached(1));
    let batch = copy(
        &device,
        Replay::Recorded,
        &staged(&device, &[1.0; 4]),
        &device.buffer("copy", 16).unwrap(),
    );
    device
        .run_between(&[&batch], None, Some((&timeline, 3)))
        .unwrap();
    assert!(reached(3) && !reached(4));
    device
        .run_between(&[&batch], Some((&timeline, 3)), Some((&timeline, 4)))
        .unwrap();
    assert!(reached(4));
}
