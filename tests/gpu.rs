//! Worlds on a GPU: a software Vulkan does, and is required.

mod common;

use common::{Demo, Run, command, lesson, lesson_with_table};
use sim_core::batch::Field;
use sim_core::model::Model;
use sim_engine::options::Adapter;
use sim_engine::simulation::{Device, Options};
use std::sync::Arc;

const FIELDS: [Field; 6] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQdd,
    Field::BodyQ,
    Field::MassMatrix,
    Field::BodyJacobian,
];

fn on(model: &Arc<Model>, device: Device, worlds: usize) -> Run {
    let options = Options {
        worlds,
        device,
        fields: FIELDS.to_vec(),
        ..Options::default()
    };
    Run::new(model, options)
}

fn gpu() -> Device {
    Device::Gpu {
        adapter: Adapter::First,
        cache: None,
    }
}

fn compare(model: &Arc<Model>, demo: Demo, worlds: usize, frames: usize) {
    let start = std::time::Instant::now();
    let mut here = on(model, gpu(), worlds);
    println!("built {:?}: {}", start.elapsed(), here.sim.device());
    let mut there = on(model, Device::Cpu, worlds);
    here.forward();
    there.forward();
    for frame in 0..frames {
        for run in [&mut here, &mut there] {
            let (field, row) = command(demo, frame);
            run.command(field, &row);
        }
        let start = std::time::Instant::now();
        here.step();
        if frame < 3 {
            println!("step {:?}", start.elapsed());
        }
        there.step();
        for field in FIELDS
            .into_iter()
            .chain([Field::Time, Field::Status, Field::Step])
        {
            for world in [0, worlds - 1] {
                let (a, b) = (here.get(field, world), there.get(field, world));
                let worst = a
                    .iter()
                    .zip(&b)
                    .map(|(a, b)| (a - b).abs())
                    .fold(0.0, f64::max);
                assert!(
                    worst < 1e-3 || frame > 20,
                    "{frame} {field:?} {world}: {worst} {a:?} {b:?}"
                );
                if frame + 1 == frames {
                    println!("{field:?}: {worst:e}");
                }
            }
        }
    }
    assert!(here.sim.lost().is_none(), "{:?}", here.sim.lost());
}

#[test]
fn lesson_without_contacts() {
    compare(
        &lesson(Demo::Target).compile().unwrap(),
        Demo::Target,
        70,
        30,
    );
}

#[test]
fn lesson_with_contacts() {
    compare(
        &lesson_with_table(Demo::Target, true).compile().unwrap(),
        Demo::Target,
        70,
        10,
    );
}
