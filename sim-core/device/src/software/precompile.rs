//! Compiles new programs on one device per core, ahead of the device that will run them.
//!
//! Each helper device runs its programs once without workgroups, which makes lavapipe compile them. Their results reach Mesa's disk
//! cache when the helper devices close, and the device that will run the programs finds them there.

use crate::adapter::{AdapterKind, Choice};
use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::program;
use crate::program::workers::within;
use crate::shader::module::Module;
use crate::shader::source::Source;
use crate::software::first_run::empty_batch;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Variables that switch Mesa's disk cache off.
const CACHE_SWITCHES: [&str; 2] = ["MESA_SHADER_CACHE_DISABLE", "MESA_GLSL_CACHE_DISABLE"];

/// Whether the driver compiles a program only when it first runs.
fn compiles_late(device: &Inner) -> bool {
    device.info.kind == AdapterKind::Software && device.vulkan.is_some()
}

/// Whether Mesa keeps what it compiles.
fn has_disk_cache() -> bool {
    CACHE_SWITCHES.iter().all(|name| {
        let value = std::env::var(name).unwrap_or_default();
        !["1", "true", "yes"].contains(&value.to_lowercase().as_str())
    })
}

/// Compiles the programs that the device's cache folder does not know. Returns the SPIR-V of each, in the order of the sources.
///
/// A program that is wrong is skipped here. The error is reported when the program is compiled for the device that runs it.
///
/// Errors: the first program whose driver takes longer than `limit`.
pub(crate) fn precompile(
    device: &Device,
    sources: &[Source],
    limit: Duration,
) -> Result<Vec<Option<Module>>, DeviceError> {
    let mut made = vec![None; sources.len()];
    let cache = device.inner.cache.as_ref();
    let is_new = |place: &usize| cache.is_none_or(|cache| !cache.knows(&sources[*place]));
    let mut places: Vec<usize> = (0..sources.len()).filter(is_new).collect();
    if places.len() < 2 || !compiles_late(&device.inner) || !has_disk_cache() {
        return Ok(made);
    }
    // the longest first, so that the cores finish together
    places.sort_by_key(|place| std::cmp::Reverse(sources[*place].wgsl.len()));
    let new: Vec<Source> = places.iter().map(|place| sources[*place].clone()).collect();
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
                Err(_) => return Ok(None),
            },
        };
        let source = &new[place];
        let module = program::read(&main, source).ok();
        if let Some(module) = &module
            && let Ok(program) = program::build(&other.inner, source, module.clone(), limit)
        {
            let _ = empty_batch(&other, &program).and_then(|batch| other.run(&[&batch]));
        }
        lock().push(other);
        Ok(module)
    };
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let modules = within(&device.inner, labels, cores, limit, work)?;
    for (place, module) in places.into_iter().zip(modules) {
        made[place] = module;
    }
    // lavapipe writes its disk cache when a device closes
    let closed: Vec<Device> = std::mem::take(&mut *idle.lock().unwrap_or_else(|e| e.into_inner()));
    drop(closed);
    Ok(made)
}
