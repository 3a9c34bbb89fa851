//! Worlds on a GPU. An adapter is required; the software driver of Debian's mesa-vulkan-drivers will do.

mod agreement;
mod auto;
mod blocks;
mod bookkeeping;
#[path = "../common/mod.rs"]
mod common;
mod cpu_bits;
mod delivery;
mod heaps;
#[path = "../common/imported_memory.rs"]
mod imported_memory;
mod lanes;
#[path = "../../sim-core/device/tests/device/layer.rs"]
mod layer;
mod lost;
mod models;
mod programs;
mod room;
mod same_bits;
mod sharing;
mod stages;
mod uploads;

use sim_engine::backend::Values;
use sim_engine::options::Adapter;
use sim_engine::simulation::{Device, Options};
use sim_model::Model;
use sim_physics::arrays::Field;
use std::sync::Arc;

/// The first adapter; nothing is kept on disk.
fn gpu() -> Device {
    Device::Gpu {
        adapter: Adapter::First,
        cache: None,
    }
}

/// Worlds of a model with these fields.
fn options(device: Device, worlds: usize, fields: &[Field]) -> Options {
    Options {
        worlds,
        device,
        fields: fields.to_vec(),
        ..Options::default()
    }
}

/// Worlds that start with these speeds, of their first dofs, after some frames.
fn thrown(model: &Arc<Model>, options: Options, speeds: &[f64], frames: usize) -> common::Run {
    let columns = speeds.len() / options.worlds;
    let mut run = common::Run::new(model, options);
    let values = Values::F64(speeds);
    run.sim
        .write(Field::JointQd, 0..columns, values, None)
        .unwrap();
    for _ in 0..frames {
        run.step();
    }
    assert_alive(&run);
    run
}

fn run(model: &Arc<Model>, device: Device, worlds: usize, fields: &[Field]) -> common::Run {
    common::Run::new(model, options(device, worlds, fields))
}

/// Fails if the device was lost, or if Vulkan's validation layer is not watching.
#[track_caller]
fn assert_alive(run: &common::Run) {
    if run.sim.device().starts_with("gpu") {
        layer::assert_watched();
    }
    assert!(run.sim.lost().is_none(), "{:?}", run.sim.lost());
}
