//! Writes the kernels of a scene, and states of its run, for benches/gpu/offline. It needs no GPU: the CPU plays the run unless
//! `--on-adapter` is given.

use crate::arguments::Arguments;
use crate::scenes::{Plan, Scene, WorldSet};
use crate::{FIELDS, chosen};
use anyhow::Context;
use serde_json::{Value, json};
use sim_device::Source;
use sim_engine::backend::Values;
use sim_engine::backend::gpu::{Offline, Target};
use sim_engine::options::Adapter;
use sim_engine::simulation::{Device, Options, Simulation};
use sim_record::split::Part;
use std::fs;
use std::path::Path;

/// Writes the scenes of the command line, a folder each.
pub fn dump(arguments: &Arguments, folder: &Path) -> anyhow::Result<()> {
    let worlds = *arguments.worlds.first().context("a number of worlds")?;
    for &scene in &arguments.scenes {
        write_scene(arguments, &folder.join(scene.name()), scene, worlds)?;
    }
    Ok(())
}

fn write_scene(
    arguments: &Arguments,
    folder: &Path,
    scene: Scene,
    worlds: usize,
) -> anyhow::Result<()> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let plan = Plan::new(scene);
    let device = match arguments.on_adapter {
        true => Device::Gpu {
            adapter: Adapter::Index(chosen(arguments.adapter.as_deref())?.index),
            cache: None,
        },
        false => Device::Cpu,
    };
    let options = Options {
        worlds,
        device,
        fields: FIELDS.to_vec(),
        ..Options::default()
    };
    let layout = Simulation::layout_of(&plan.model, &options);
    let target = match arguments.software {
        true => Target::Software,
        false => Target::Hardware,
    };
    let offline = Offline::new(
        &plan.model,
        &layout,
        target,
        arguments.lanes,
        arguments.cuts(),
    )?;
    write_kernels(folder, &plan, &offline, worlds)?;
    let mut sim = Simulation::new(plan.model.clone(), &options)?;
    let mut words = vec![0; sim.layout().bytes / 8];
    let crowd = WorldSet::all(worlds);
    let mut values = Vec::new();
    plan.start(&mut sim, &crowd);
    let last = arguments.frames.iter().max().copied().unwrap_or(0);
    for frame in 0..plan.frames().min(last + 1) {
        plan.fill(frame, &crowd, &mut values);
        sim.command(plan.field, 0..plan.model.dofs(), Values::F32(&values))?;
        let is_kept = arguments.frames.contains(&frame);
        if is_kept {
            write_states(folder, &format!("before-{frame}"), &offline, &sim)?;
        }
        sim.step(&mut words);
        if is_kept {
            write_states(folder, &format!("after-{frame}"), &offline, &sim)?;
        }
    }
    Ok(())
}

fn write_kernels(
    folder: &Path,
    plan: &Plan,
    offline: &Offline,
    worlds: usize,
) -> anyhow::Result<()> {
    let mut kernels = Vec::new();
    for (k, kernel) in offline.kernels.iter().enumerate() {
        let file = format!("{k:02}-{}", kernel.label.replace(' ', "-"));
        fs::write(folder.join(format!("{file}.wgsl")), &kernel.wgsl)?;
        let source = Source {
            label: kernel.label.clone(),
            wgsl: kernel.wgsl.clone(),
            entry: "main".to_owned(),
            constants: vec![
                ("worlds".to_owned(), worlds as f64),
                ("workgroup".to_owned(), f64::from(kernel.workgroup)),
            ],
        };
        let spirv = sim_device::translated(&source, true).map_err(anyhow::Error::msg)?;
        let bytes = bytemuck::cast_slice(&spirv);
        fs::write(folder.join(format!("{file}.spv")), bytes)?;
        kernels.push(json!({
            "label": kernel.label,
            "file": file,
            "workgroup": kernel.workgroup,
        }));
    }
    let first = count(&offline.step);
    let facts = json!({
        "scene": plan.scene.name(),
        "worlds": worlds,
        "dofs": plan.model.dofs(),
        "frames": plan.frames(),
        "substeps": offline.substeps,
        "fields": offline.fields,
        "state": offline.state,
        "moving": offline.moving,
        "scratch": offline.scratch,
        "kernels": kernels,
        "step": order(&offline.step, 0),
        "evaluate": order(&offline.evaluate, first),
    });
    let bytes = bytemuck::cast_slice(&offline.numbers);
    fs::write(folder.join("numbers.bin"), bytes)?;
    let bytes = bytemuck::cast_slice(&offline.indices);
    fs::write(folder.join("indices.bin"), bytes)?;
    fs::write(
        folder.join("scene.json"),
        serde_json::to_string_pretty(&facts)?,
    )?;
    Ok(())
}

/// Kernels of an order.
fn count(order: &[Part]) -> usize {
    let last = order.iter().map(|part| match part {
        Part::Kernel(k) => k + 1,
        Part::Repeat { parts, .. } => count(parts),
    });
    last.max().unwrap_or(0)
}

/// An order: numbers of kernels, and repetitions as `[iterations, order]`.
fn order(parts: &[Part], first: usize) -> Value {
    let part = |part: &Part| match part {
        Part::Kernel(k) => json!(first + k),
        Part::Repeat {
            iterations, parts, ..
        } => json!([iterations, order(parts, first)]),
    };
    parts.iter().map(part).collect()
}

/// The values of all worlds, in the order of device memory.
fn write_states(
    folder: &Path,
    name: &str,
    offline: &Offline,
    sim: &Simulation,
) -> anyhow::Result<()> {
    let states = offline.states(&sim.snapshot(), sim.worlds());
    fs::write(
        folder.join(format!("{name}.bin")),
        bytemuck::cast_slice(&states),
    )?;
    Ok(())
}
