//! Sizes: worlds of a tile, memory of a tile, and what an adapter cannot hold.

use super::kernels::places::Places;
use super::kernels::room::Room;
use super::kernels::workgroups::{self, BOOKKEEPING};
use super::recipe::Extent;
use super::software;
use super::uploads;
use crate::backend::{BackendError, available_memory};
use sim_device::{AdapterKind, Device};
use sim_model::SensedShapes;
use sim_physics::constants::Constants;

const MB: u64 = 1 << 20;

/// Worlds of a tile: as many as its largest buffer can bind, at most all. Tiles are equally wide.
pub(super) fn widest(
    device: &Device,
    m: &Constants<f32>,
    places: &Places,
    room: &Room,
    worlds: usize,
    threads: u32,
) -> u32 {
    let info = device.info();
    let numbers = (places.len as u64).max(room.numbers(m) as u64).max(4);
    let fit = info.binding_max.min(u64::from(u32::MAX)) / (4 * numbers);
    // padding included, so that a dispatch has enough workgroups even where each is a single world
    let lanes = BOOKKEEPING.max(workgroups::physics(info));
    let dispatched = match threads {
        1 => u64::from(u32::MAX),
        _ => u64::from(info.workgroups_max.saturating_sub(lanes)),
    };
    let fit = fit.min(dispatched).max(1);
    let tiles = (worlds as u64).div_ceil(fit);
    let width = (worlds as u64).div_ceil(tiles);
    let lanes = BOOKKEEPING.max(workgroups::physics(device.info()));
    width
        .next_multiple_of(u64::from(lanes))
        .min(u64::from(u32::MAX)) as u32
}

/// Memory of a tile, staging buffers included [bytes].
pub(super) fn memory(m: &Constants<f32>, places: &Places, extent: &Extent) -> u64 {
    let state = u64::from(places.state);
    // fields, contacts and counters; state and counters for the host, rows from it with their worlds, commands
    let numbers = u64::from(places.len) + extent.room.numbers(m) as u64 + 4;
    let host = (state + 4)
        + (state + 1)
        + uploads::commands(m)
            .map(|(_, columns)| columns as u64)
            .sum::<u64>();
    4 * (numbers + host) * u64::from(extent.width)
}

/// Shapes and links of each pair, then the flags of each sensor and shape, as `show::contacts` reads them.
pub(super) fn pairs(m: &Constants<f32>, sensors: &[SensedShapes]) -> Vec<[i32; 4]> {
    let link = |link: Option<usize>| link.map_or(-1, |link| link as i32);
    let pairs = m.contacts.pairs.iter().map(|pair| {
        let [a, b] = pair.shapes;
        [a as i32, b as i32, link(pair.links[0]), link(pair.links[1])]
    });
    let sensed = sensors.iter().flat_map(|sensor| {
        let both = sensor.of.iter().zip(&sensor.against);
        both.map(|(of, against)| [i32::from(*of) | i32::from(*against) << 1, 0, 0, 0])
    });
    pairs.chain(sensed).collect()
}

/// Refuses a frame that no program can bind as a whole.
pub(super) fn check_frame(device: &Device, bytes: u64) -> Result<(), BackendError> {
    let most = device.info().binding_max;
    if bytes > most {
        let (bytes, most) = (bytes.div_ceil(MB), most / MB);
        return Err(BackendError::DeviceMemory {
            reason: format!(
                "a frame is {bytes} MB, and this adapter shows a program {most} MB of it; ask for fewer worlds or fields"
            ),
        });
    }
    Ok(())
}

/// Refuses worlds that do not fit into the adapter's memory, before any is allocated. Where the adapter shares the computer's memory,
/// the free part of it counts.
pub(super) fn check_memory(
    device: &Device,
    worlds: usize,
    needed: u64,
) -> Result<(), BackendError> {
    let info = device.info();
    let available = match info.kind {
        _ if software::is_software(info) => software::memory(),
        AdapterKind::Integrated => info.memory.into_iter().chain(available_memory()).min(),
        _ => info.memory,
    };
    let Some(available) = available else {
        return Ok(());
    };
    match needed > available {
        true => Err(BackendError::Memory {
            worlds,
            needed_mb: needed / MB,
            available_mb: available / MB,
        }),
        false => Ok(()),
    }
}
