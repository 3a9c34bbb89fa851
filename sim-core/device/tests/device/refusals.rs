//! Invalid requests are refused by name, and a lost device is reported.

use crate::common::{copy, device, fetch, numbers, program, scale_add, staged, ways};
use sim_device::{AdapterKind, BatchBuilder, Choice, Device, DeviceError, Replay, adapters};

#[test]
fn adapters_stand_hardware_first_and_are_found_by_place_and_name() {
    let adapters = adapters();
    assert!(!adapters.is_empty(), "the tests need an adapter");
    assert!(adapters.is_sorted_by_key(|info| info.kind));
    assert!(
        AdapterKind::Discrete < AdapterKind::Integrated
            && AdapterKind::Virtual < AdapterKind::Software
    );
    for (place, info) in adapters.iter().enumerate() {
        assert_eq!(info.index, place);
        assert!(info.binding_max >= 128 << 20 && info.workgroup_max >= 128);
        let device = Device::open(&Choice::Index(place), None).unwrap();
        assert_eq!(device.info().name, info.name);
        let part = info.name[1..].to_uppercase();
        let named = Device::open(&Choice::Name(part), None).unwrap();
        assert!(named.info().index <= place, "the first of that name");
    }
}

#[test]
fn an_adapter_that_is_not_there_is_refused_with_those_that_are() {
    let last = adapters().pop().unwrap();
    for choice in [Choice::Index(99), Choice::Name("Voodoo".to_owned())] {
        let text = Device::open(&choice, None).err().unwrap().to_string();
        let wanted = if choice == Choice::Index(99) {
            "99"
        } else {
            "`Voodoo`"
        };
        assert!(text.contains(wanted) && text.contains(&last.name), "{text}");
    }
}

#[test]
fn commands_that_cannot_be_are_refused_by_name() {
    type Ask =
        fn(&mut BatchBuilder, &sim_device::Program, &sim_device::Buffer, &sim_device::Buffer);
    let cases: [(Ask, &str); 16] = [
        (|c, p, a, _| c.dispatch(p, &[(0, a, 0..64)], 1), "binding 3"),
        (
            |c, p, a, b| c.dispatch(p, &[(0, a, 0..64), (3, b, 0..64), (3, b, 0..64)], 1),
            "twice",
        ),
        (
            |c, p, a, b| c.dispatch(p, &[(0, a, 0..64), (3, b, 0..68)], 1),
            "0..68 of 64",
        ),
        (
            |c, p, a, b| c.dispatch(p, &[(0, a, 0..64), (3, b, 0..u64::MAX)], 1),
            "of 64",
        ),
        (
            |c, p, a, b| c.dispatch(p, &[(0, a, 8..8), (3, b, 0..64)], 1),
            "8..8",
        ),
        (
            |c, p, a, b| c.dispatch(p, &[(0, a, 2..64), (3, b, 0..64)], 1),
            "must start",
        ),
        (
            |c, p, a, b| c.dispatch(p, &[(0, a, 0..64), (3, b, 0..64)], 0),
            "0 workgroups",
        ),
        (
            |c, p, a, b| c.dispatch(p, &[(0, a, 0..64), (3, b, 0..64)], u32::MAX),
            "workgroups",
        ),
        (
            |c, p, a, _| c.dispatch(p, &[(0, a, 0..64), (3, a, 0..64)], 1),
            "read-only",
        ),
        (
            |c, p, a, b| c.dispatch_found(p, &[(0, a, 0..64), (3, b, 0..64)], a, 56),
            "at 56 of 64",
        ),
        (
            |c, p, a, b| c.dispatch_found(p, &[(0, a, 0..64), (3, b, 0..64)], a, 2),
            "at 2 of 64",
        ),
        (
            |c, p, a, b| c.dispatch_found(p, &[(0, a, 0..64), (3, b, 0..64)], b, 0),
            "it writes `b`",
        ),
        (|c, _, a, b| c.copy(a, 0, b, 32, 36), "36 bytes at 32"),
        (|c, _, a, b| c.copy(a, u64::MAX - 3, b, 0, 8), "`a`"),
        (|c, _, a, b| c.copy(a, 2, b, 0, 8), "multiples of 4"),
        (|c, _, a, _| c.copy(a, 0, a, 32, 8), "within one buffer"),
    ];
    for (device, replay) in ways() {
        let add = program(&device, scale_add(1.0, 1));
        let [a, b] = ["a", "b"].map(|label| device.buffer(label, 64).unwrap());
        for (ask, word) in &cases {
            let mut batch = device.batch(replay);
            ask(&mut batch, &add, &a, &b);
            batch.copy(&a, 0, &b, 0, 64);
            let failure = batch.finish().err().expect(word);
            assert!(matches!(failure, DeviceError::Command { .. }), "{failure}");
            assert!(failure.to_string().contains(word), "{word}: {failure}");
        }
        // the same buffers, asked rightly: nothing of the above has reached the driver
        let mut batch = device.batch(replay);
        batch.dispatch(&add, &[(0, &a, 0..64), (3, &b, 0..64), (7, &b, 0..64)], 1);
        device.run(&[&batch.finish().unwrap()]).unwrap();
    }
}

#[test]
fn things_of_another_device_are_refused() {
    let (first, other) = (device(), device());
    let (add, a) = (
        program(&first, scale_add(1.0, 1)),
        first.buffer("a", 16).unwrap(),
    );
    let b = other.buffer("b", 16).unwrap();
    for device in [&first, &other] {
        let mut batch = device.batch(Replay::Recorded);
        batch.dispatch(&add, &[(0, &a, 0..16), (3, &b, 0..16)], 1);
        assert!(
            batch
                .finish()
                .err()
                .unwrap()
                .to_string()
                .contains("another device")
        );
        let mut batch = device.batch(Replay::Recorded);
        batch.copy(&a, 0, &b, 0, 16);
        assert!(
            batch
                .finish()
                .err()
                .unwrap()
                .to_string()
                .contains("another device")
        );
    }
}

#[test]
fn a_lost_device_reports_it_and_others_go_on() {
    for (device, replay) in ways() {
        let other = Device::open(&Choice::First, None).unwrap();
        let (from, to) = (staged(&device, &[1.0; 4]), staged(&device, &[0.0; 4]));
        let batch = copy(&device, replay, &from, &to);
        let add = scale_add(1.0, 1);
        device.lose();
        let failures = [
            device.run(&[&batch]).unwrap_err(),
            device.buffer("more", 16).err().unwrap(),
            device.staging("more", 16).err().unwrap(),
            device.batch(replay).finish().err().unwrap(),
            device
                .programs(&[add], crate::common::PATIENCE)
                .err()
                .unwrap(),
        ];
        for failure in failures {
            assert!(matches!(failure, DeviceError::Lost { .. }), "{failure}");
        }
        assert_eq!(numbers(&to), [0.0; 4]);
        drop((batch, from, to, device));
        assert_eq!(fetch(&other, &other.buffer("b", 16).unwrap()), [0.0; 4]);
    }
}
