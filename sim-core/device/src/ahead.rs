//! Software drivers compile a program when it first runs, one program after the other (llvmpipe of Mesa). Here they do it at once:
//! on devices of their own, side by side, which leave what they made in the driver's folder; then on the device that is meant, which finds it there.

use crate::adapter::{AdapterKind, Choice};
use crate::batch::{Replay, Slot};
use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::memory::Buffer;
use crate::program::{self, Program, Source};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Variables that tell Mesa to keep nothing.
const KEEPS_NOTHING: [&str; 2] = ["MESA_SHADER_CACHE_DISABLE", "MESA_GLSL_CACHE_DISABLE"];

/// Does the driver compile when a program runs, and not before?
pub(crate) fn is_late(device: &Inner) -> bool {
    device.info.kind == AdapterKind::Software && device.vulkan.is_some()
}

fn keeps() -> bool {
    KEEPS_NOTHING.iter().all(|name| {
        let value = std::env::var(name).unwrap_or_default();
        !["1", "true", "yes"].contains(&value.to_lowercase().as_str())
    })
}

/// Lets the driver compile programs that the folder of the device does not know, each on one of several devices. What is wrong with a program is
/// found again, and told, when it is compiled for the device that is meant.
///
/// Errors: the driver takes longer than `limit` over one of them.
pub(crate) fn compile(
    device: &Device,
    sources: &[Source],
    limit: Duration,
) -> Result<(), DeviceError> {
    let cache = device.inner.cache.as_ref();
    let is_new = |source: &&Source| cache.is_none_or(|cache| !cache.knows(source));
    let mut new: Vec<Source> = sources.iter().filter(is_new).cloned().collect();
    if new.len() < 2 || !is_late(&device.inner) || !keeps() {
        return Ok(());
    }
    // the longest first, so that none is left alone at the end
    new.sort_by_key(|source| std::cmp::Reverse(source.wgsl.len()));
    let labels = new.iter().map(|source| source.label.clone()).collect();
    let idle = Arc::new(Mutex::new(Vec::new()));
    let (shared, main) = (idle.clone(), device.inner.clone());
    let work = move |place: usize| {
        let lock = || shared.lock().unwrap_or_else(|e| e.into_inner());
        let waiting = lock().pop();
        let other = match waiting {
            Some(other) => other,
            None => match Device::open(&Choice::Index(main.info.index), None) {
                Ok(other) => other,
                Err(_) => return Ok(()),
            },
        };
        let source = &new[place];
        let _ = program::read(&main, source)
            .and_then(|module| program::build(&other.inner, source, module, limit))
            .map(|program| run_empty(&other, &program));
        lock().push(other);
        Ok(())
    };
    program::within(&device.inner, labels, limit, work)?;
    // a driver has written its folder when its devices are closed
    let closed: Vec<Device> = std::mem::take(&mut *idle.lock().unwrap_or_else(|e| e.into_inner()));
    drop(closed);
    Ok(())
}

/// Runs no workgroup of a program: the driver compiles it, or reads what it kept.
pub(crate) fn run_empty(device: &Device, program: &Program) -> Result<(), DeviceError> {
    let Buffer(memory) = device.buffer("nothing", 1)?;
    let slots = program.0.bindings.iter().map(|binding| Slot {
        binding: binding.number,
        read_only: binding.read_only,
        buffer: memory.clone(),
        range: 0..memory.bytes,
    });
    let mut batch = device.batch(Replay::Recorded);
    batch.empty(program, slots.collect());
    device.run(&[&batch.finish()?])
}
