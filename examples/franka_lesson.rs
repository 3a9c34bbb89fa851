//! The Rust twin of `franka_lesson.py`: the same two demos, in process, without daemon or Python.
//!
//! `cargo run --release --example franka_lesson -- [worlds]`

mod lesson;

use anyhow::Context;
use lesson::{Demo, FRAMES, command, lesson};
use sim_engine::backend::Values;
use sim_engine::simulation::{Options, Simulation};
use sim_physics::arrays::Field;
use std::time::Instant;

fn main() -> anyhow::Result<()> {
    let worlds = match std::env::args().nth(1) {
        Some(text) => text
            .parse()
            .with_context(|| format!("`{text}` is no number of worlds"))?,
        None => 4096,
    };
    for demo in [Demo::Target, Demo::Torque] {
        run(demo, worlds)?;
    }
    Ok(())
}

fn run(demo: Demo, worlds: usize) -> anyhow::Result<()> {
    let model = lesson(demo).compile()?;
    let options = Options {
        worlds,
        fields: vec![Field::JointQ],
        ..Options::default()
    };
    let mut sim = Simulation::new(model.clone(), &options)?;
    let mut arena = vec![0; sim.layout().bytes / 8];
    let mut values = vec![0.0; worlds * model.dofs()];
    let start = Instant::now();
    for frame in 0..FRAMES {
        let (field, row) = command(demo, frame);
        values
            .chunks_exact_mut(model.dofs())
            .for_each(|world| world.copy_from_slice(&row));
        sim.command(field, 0..model.dofs(), Values::F64(&values))?;
        sim.step(&mut arena);
    }
    let steps = (FRAMES * worlds * model.substeps()) as f64 / start.elapsed().as_secs_f64();
    println!(
        "{demo:?}: {worlds} worlds on {}: {:.2} million physics steps/s",
        sim.device(),
        steps * 1e-6
    );
    // the first field of the layout is joint_q, single precision, one world after the other
    let q: Vec<f32> = arena
        .iter()
        .flat_map(|word| [*word as u32, (word >> 32) as u32])
        .map(f32::from_bits)
        .take(model.dofs())
        .collect();
    for (name, q) in model.dof_names().iter().zip(q) {
        println!("  {name:<24} {q:+.6}");
    }
    Ok(())
}
