//! A controller in Rust: it damps every joint of a running daemon and prints how long a step takes.
//!
//! `cargo run --release -p sim-protocol --example rust_client -- NAME [STEPS] [HZ]`: 1000 steps at 1000 Hz without
//! numbers; 0 Hz is as fast as the daemon answers. The twin of `examples/c_client/client.c`.

use std::error::Error;
use std::thread::sleep;
use std::time::{Duration, Instant};

use sim_protocol::{AttachOptions, Client, Command, Frame, Values, keep_waiting};

fn main() {
    if let Err(error) = run() {
        eprintln!("error: {error}");
        std::process::exit(1);
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().collect();
    let name = args.get(1).ok_or("usage: rust_client NAME [STEPS] [HZ]")?;
    let number = |at: usize| args.get(at).map_or(Ok(1000), |text| text.parse::<usize>());
    let (steps, hz) = (number(2)?.max(1), number(3)?);

    let client = Client::attach(name, &AttachOptions::default(), &mut keep_waiting())?;
    let about = client.description();
    let (worlds, dofs) = (about.worlds, about.dof_names.len());
    let step_ms = about.dt * about.substeps as f64 * 1e3;
    println!("{name}: {worlds} worlds of {dofs} dofs, {step_ms} ms per step");
    let mut force = vec![0.0; worlds * dofs];
    let mut trips_us = Vec::with_capacity(steps);

    let mut frame = client.reset(None, None, &mut keep_waiting())?;
    let start = Instant::now();
    for step in 0..steps {
        // gain of -0.1 [N·m s/rad or N s/m]
        let velocity = floats(&frame, "joint_qd")?.iter();
        force
            .iter_mut()
            .zip(velocity)
            .for_each(|(f, qd)| *f = -0.1 * qd);
        drop(frame);
        while hz > 0 && start.elapsed().as_secs_f64() < step as f64 / hz as f64 {
            sleep(Duration::from_micros(50));
        }
        let sent = Instant::now();
        let damping = Command {
            field: "joint_f",
            columns: 0..dofs,
            values: Values::F32(&force),
        };
        frame = client.step(&[damping], &mut keep_waiting())?;
        trips_us.push(sent.elapsed().as_secs_f64() * 1e6);
    }
    drop(client); // the last frame stays valid
    let q = &floats(&frame, "joint_q")?[..frame.field("joint_q")?.shape[1]];
    println!("joint_q of world 0: {q:+.4?}");
    trips_us.sort_by(f64::total_cmp);
    let [p50, p99, max] = [steps / 2, steps * 99 / 100, steps - 1].map(|at| trips_us[at]);
    println!("round trip: p50 {p50:.2} us, p99 {p99:.2} us, max {max:.2} us");
    Ok(())
}

/// A field of a frame, in place.
fn floats<'a>(frame: &'a Frame, field: &str) -> Result<&'a [f32], Box<dyn Error>> {
    let values = frame.field(field)?.as_slice();
    values.ok_or_else(|| "start the daemon with --precision f32".into())
}
