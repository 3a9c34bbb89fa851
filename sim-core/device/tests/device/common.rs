//! What the tests share: both routes, a program or two, numbers in and out.

use sim_device::{Batch, Buffer, Choice, Device, Program, Replay, Source, Staging};
use std::time::Duration;

/// Long enough for any program here on a busy computer.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// The ways that a batch may go, of each route and replay: each with a device of its own.
pub fn ways() -> Vec<(Device, Replay)> {
    let portable = Device::open_portable(&Choice::First, None).expect("the tests need an adapter");
    vec![
        (device(), Replay::Recorded),
        (device(), Replay::Encoded),
        (portable, Replay::Encoded),
    ]
}

/// A device on the first route.
pub fn device() -> Device {
    Device::open(&Choice::First, None).expect("the tests need an adapter")
}

/// `b[i] = a[i] * factor + b[i]` for `count` numbers.
pub fn scale_add(factor: f64, count: u32) -> Source {
    Source {
        label: "scale_add".to_owned(),
        wgsl: "
            override count: u32;
            override factor: f32 = 1.0;
            override workgroup: u32 = 32;
            @group(0) @binding(0) var<storage, read> a: array<f32>;
            @group(0) @binding(3) var<storage, read_write> b: array<f32>;
            @compute @workgroup_size(workgroup) fn step(@builtin(global_invocation_id) id: vec3<u32>) {
                if id.x < count { b[id.x] = a[id.x] * factor + b[id.x]; }
            }"
        .to_owned(),
        entry: "step".to_owned(),
        constants: vec![("count".to_owned(), f64::from(count)), ("factor".to_owned(), factor)],
    }
}

/// One program of one source.
pub fn program(device: &Device, source: Source) -> Program {
    device
        .programs(&[source], PATIENCE)
        .expect("it compiles")
        .remove(0)
}

/// A staging buffer with numbers.
pub fn staged(device: &Device, numbers: &[f32]) -> Staging {
    let staging = device.staging("numbers", numbers.len() as u64 * 4).unwrap();
    staging
        .write()
        .copy_from_slice(bytemuck::cast_slice(numbers));
    staging
}

/// Numbers of a staging buffer.
pub fn numbers(staging: &Staging) -> Vec<f32> {
    bytemuck::cast_slice(&staging.read()).to_vec()
}

/// A batch that copies all of a buffer.
pub fn copy(device: &Device, replay: Replay, from: &Buffer, to: &Buffer) -> Batch {
    let mut builder = device.batch(replay);
    builder.copy(from, 0, to, 0, from.bytes());
    builder.finish().unwrap()
}

/// What a buffer of the device holds.
pub fn fetch(device: &Device, buffer: &Buffer) -> Vec<f32> {
    let staging = device.staging("fetched", buffer.bytes()).unwrap();
    device
        .run(&[&copy(device, Replay::Encoded, buffer, &staging)])
        .unwrap();
    numbers(&staging)
}
