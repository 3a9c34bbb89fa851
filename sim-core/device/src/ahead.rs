//! Software drivers compile a program when it first runs, one program after the other (llvmpipe of Mesa). Here they do it at once:
//! on devices of their own, side by side, which leave what they made in the driver's folder; then on the device that is meant, which finds it there.

use crate::adapter::{AdapterKind, Choice};
use crate::device::{Device, Inner};
use crate::error::DeviceError;
use crate::module::Module;
use crate::program::{self, Source};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Variables that tell Mesa to keep nothing.
const KEEPS_NOTHING: [&str; 2] = ["MESA_SHADER_CACHE_DISABLE", "MESA_GLSL_CACHE_DISABLE"];

/// Does the driver compile when a program runs, and not before?
fn is_late(device: &Inner) -> bool {
    device.info.kind == AdapterKind::Software && device.vulkan.is_some()
}

fn keeps() -> bool {
    KEEPS_NOTHING.iter().all(|name| {
        let value = std::env::var(name).unwrap_or_default();
        !["1", "true", "yes"].contains(&value.to_lowercase().as_str())
    })
}

/// Lets the driver compile programs that the folder of the device does not know, each on one of several devices; returns their words, by the
/// places of the sources. What is wrong with a program is found again, and told, when it is compiled for the device that is meant.
///
/// Errors: the driver takes longer than `limit` over one of them.
pub(crate) fn compile(
    device: &Device,
    sources: &[Source],
    limit: Duration,
) -> Result<Vec<Option<Module>>, DeviceError> {
    let mut made = vec![None; sources.len()];
    let cache = device.inner.cache.as_ref();
    let is_new = |place: &usize| cache.is_none_or(|cache| !cache.knows(&sources[*place]));
    let mut places: Vec<usize> = (0..sources.len()).filter(is_new).collect();
    if places.len() < 2 || !is_late(&device.inner) || !keeps() {
        return Ok(made);
    }
    // the longest first, so that none is left alone at the end
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
            let _ = other
                .over_nothing(&program)
                .and_then(|batch| other.run(&[&batch]));
        }
        lock().push(other);
        Ok(module)
    };
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let modules = program::within(&device.inner, labels, cores, limit, work)?;
    for (place, module) in places.into_iter().zip(modules) {
        made[place] = module;
    }
    // a driver has written its folder when its devices are closed
    let closed: Vec<Device> = std::mem::take(&mut *idle.lock().unwrap_or_else(|e| e.into_inner()));
    drop(closed);
    Ok(made)
}
