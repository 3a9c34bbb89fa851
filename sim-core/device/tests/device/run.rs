//! Commands do what they say, in their order, on every route.

use crate::common::{copy, device, fetch, numbers, program, scale_add, staged, ways};
use sim_device::{Batch, Device, Replay, Source};

const COUNT: u32 = 1000;

#[test]
fn a_new_buffer_is_zero() {
    for (device, _) in ways() {
        let buffer = device.buffer("fresh", 4004).unwrap();
        assert_eq!(fetch(&device, &buffer), vec![0.0; 1001]);
        assert!(
            device
                .staging("fresh", 36)
                .unwrap()
                .read()
                .iter()
                .all(|&b| b == 0)
        );
    }
}

#[test]
fn dispatches_and_copies_see_what_those_before_them_wrote() {
    for (device, replay) in ways() {
        let add = program(&device, scale_add(2.0, COUNT));
        assert_eq!(add.bindings(), [0, 3]);
        let input: Vec<f32> = (0..COUNT).map(|i| i as f32).collect();
        let (from, to) = (staged(&device, &input), staged(&device, &vec![0.0; 1000]));
        let [a, b] = ["a", "b"].map(|label| device.buffer(label, 4000).unwrap());
        let mut batch = device.batch(replay);
        batch.copy(&from, 0, &a, 0, 4000);
        // b = 2a, a += 2b = 5a, b += 2a = 12a
        for (x, y) in [(&a, &b), (&b, &a), (&a, &b)] {
            batch.dispatch(
                &add,
                &[(0, x, 0..4000), (3, y, 0..4000)],
                COUNT.div_ceil(32),
            );
        }
        batch.copy(&b, 0, &to, 0, 4000);
        let batch = batch.finish().unwrap();
        let wanted: Vec<f32> = input.iter().map(|x| 12.0 * x).collect();
        device.run(&[&batch]).unwrap();
        assert_eq!(numbers(&to), wanted, "{replay:?}");
        // b keeps its 12a: 2a + 12a; a = a + 2 * 14a; b = 14a + 2 * 29a
        device.run(&[&batch]).unwrap();
        let wanted: Vec<f32> = input.iter().map(|x| 72.0 * x).collect();
        assert_eq!(numbers(&to), wanted, "{replay:?}");
    }
}

#[test]
fn what_a_sum_rounds_away_can_be_kept() {
    // only where words are the driver's own: WGSL lets a compiler take the difference for 0
    let device = device();
    let source = Source {
        label: "rest".to_owned(),
        wgsl: "
            @group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
            @compute @workgroup_size(1) fn main() {
                let sum = numbers[0] + numbers[1];
                numbers[2] = numbers[1] - (sum - numbers[0]);
                numbers[3] = numbers[0] * numbers[1] + numbers[4];
            }"
        .to_owned(),
        entry: "main".to_owned(),
        constants: Vec::new(),
    };
    let program = program(&device, source);
    let (a, b) = (1.0 + f32::EPSILON, 1e-8);
    let given = [a, b, 0.0, 0.0, -b];
    let memory = staged(&device, &given);
    let mut batch = device.batch(Replay::Recorded);
    batch.dispatch(&program, &[(0, &memory, 0..20)], 1);
    device.run(&[&batch.finish().unwrap()]).unwrap();
    let results = numbers(&memory);
    assert_eq!(results[2], b - ((a + b) - a));
    assert_eq!(results[2], b);
    // a product is rounded before it is added to
    assert_eq!(results[3], a * b - b);
}

#[test]
fn batches_of_one_run_see_what_those_before_them_wrote_whatever_their_replay() {
    let replays = [Replay::Recorded, Replay::Encoded];
    for (device, _) in ways() {
        let add = program(&device, scale_add(2.0, COUNT));
        for mask in 0..8 {
            let replay = |i: usize| replays[mask >> i & 1];
            let (from, to) = (staged(&device, &[1.0; 1000]), staged(&device, &[0.0; 1000]));
            let buffer = device.buffer("b", 4000).unwrap();
            let first = copy(&device, replay(0), &from, &buffer);
            let mut middle = device.batch(replay(1));
            middle.dispatch(&add, &[(0, &from, 0..4000), (3, &buffer, 0..4000)], 32);
            let last = copy(&device, replay(2), &buffer, &to);
            let middle = middle.finish().unwrap();
            device.run(&[&first, &middle, &middle, &last]).unwrap();
            assert_eq!(numbers(&to), [5.0; 1000]);
        }
    }
}

#[test]
fn a_batch_replayed_a_thousand_times_equals_one_that_is_encoded() {
    // x ← x/3 + y, y ← y/3 + x: rounds at every step, so that a step too many, too few or too early shows in the bits
    let run = |device: &Device, replay| {
        let add = program(device, scale_add(1.0 / 3.0, COUNT));
        let input: Vec<f32> = (0..COUNT).map(|i| 1.0 / (i + 1) as f32).collect();
        let zero = staged(device, &[0.0; 1000]);
        let [x, y] = ["x", "y"].map(|label| device.buffer(label, 4000).unwrap());
        let from = staged(device, &input);
        device
            .run(&[
                &copy(device, replay, &from, &x),
                &copy(device, replay, &zero, &y),
            ])
            .unwrap();
        let mut batch = device.batch(replay);
        for _ in 0..5 {
            batch.dispatch(&add, &[(0, &x, 0..4000), (3, &y, 0..4000)], 32);
            batch.copy(&y, 0, &x, 400, 2000);
        }
        let batch = batch.finish().unwrap();
        for _ in 0..1000 {
            device.run(&[&batch]).unwrap();
        }
        let bits =
            |buffer| -> Vec<u32> { fetch(device, buffer).iter().map(|x| x.to_bits()).collect() };
        (bits(&x), bits(&y))
    };
    let all: Vec<_> = ways()
        .into_iter()
        .map(|(device, replay)| run(&device, replay))
        .collect();
    assert_eq!(all[0], all[1]);
    assert_eq!(all[0], all[2]);
    assert_ne!(all[0].0, all[0].1);
}

#[test]
fn many_batches_live_side_by_side_and_keep_what_they_name() {
    for (device, replay) in ways() {
        let out = device.buffer("out", 16).unwrap();
        let batches: Vec<Batch> = (0..500)
            .map(|i| {
                // program and buffers are dropped here: the batch alone holds them
                let add = program(&device, scale_add(f64::from(i % 7), 4));
                let one = staged(&device, &[1.0; 4]);
                let mut batch = device.batch(replay);
                batch.dispatch(&add, &[(0, &one, 0..16), (3, &out, 0..16)], 1);
                batch.finish().unwrap()
            })
            .collect();
        let backwards: Vec<&Batch> = batches.iter().rev().collect();
        device.run(&backwards).unwrap();
        let sum: u32 = (0..500).map(|i| i % 7).sum();
        assert_eq!(fetch(&device, &out), [sum as f32; 4]);
    }
}

#[test]
fn an_empty_run_and_an_empty_batch_do_nothing() {
    for (device, replay) in ways() {
        let nothing = device.batch(replay).finish().unwrap();
        device.run(&[]).unwrap();
        device.run(&[&nothing, &nothing]).unwrap();
    }
}

#[test]
fn threads_run_batches_of_one_device_at_the_same_time() {
    for (device, replay) in ways() {
        std::thread::scope(|scope| {
            for thread in 0..4 {
                let device = device.clone();
                scope.spawn(move || {
                    let add = program(&device, scale_add(f64::from(thread), 100));
                    let (one, sum) = (staged(&device, &[1.0; 100]), staged(&device, &[0.0; 100]));
                    let mut batch = device.batch(replay);
                    batch.dispatch(&add, &[(0, &one, 0..400), (3, &sum, 0..400)], 4);
                    let batch = batch.finish().unwrap();
                    for _ in 0..100 {
                        device.run(&[&batch]).unwrap();
                    }
                    assert_eq!(numbers(&sum), [100.0 * thread as f32; 100]);
                });
            }
        });
    }
}

#[test]
fn as_many_workgroups_run_as_a_program_has_found() {
    let find = Source {
        label: "find".to_owned(),
        wgsl: "
            @group(0) @binding(0) var<storage, read_write> groups: array<u32>;
            @compute @workgroup_size(1) fn main() {
                groups[1] = groups[4];
                groups[2] = 1u;
                groups[3] = 1u;
            }"
        .to_owned(),
        entry: "main".to_owned(),
        constants: Vec::new(),
    };
    for (device, replay) in ways() {
        let (find, add) = (
            program(&device, find.clone()),
            program(&device, scale_add(1.0, 96)),
        );
        let wish = device.staging("groups", 20).unwrap();
        let (one, sum) = (staged(&device, &[1.0; 96]), staged(&device, &[0.0; 96]));
        let groups = device.buffer("found", 20).unwrap();
        let mut batch = device.batch(replay);
        batch.copy(&wish, 0, &groups, 0, 20);
        batch.dispatch(&find, &[(0, &groups, 0..20)], 1);
        batch.dispatch_found(&add, &[(0, &one, 0..384), (3, &sum, 0..384)], &groups, 4);
        let batch = batch.finish().unwrap();
        let mut wanted = [0.0; 96];
        for count in [2u32, 0, 1, 3] {
            wish.write()[16..20].copy_from_slice(&count.to_le_bytes());
            device.run(&[&batch]).unwrap();
            wanted[..32 * count as usize]
                .iter_mut()
                .for_each(|x| *x += 1.0);
            assert_eq!(numbers(&sum), wanted, "{replay:?}");
        }
    }
}
