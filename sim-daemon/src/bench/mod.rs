//! `tightloop bench`: how fast a scene runs in process, and where the time goes.

mod commands;
mod report;

use std::io::Write;
use std::time::{Duration, Instant};

use sim_engine::backend::{Values, cpu};
use sim_engine::options::machine_code_check;
use sim_engine::simulation::{Lanes, MachineCode, Options, Precision, Profile, Simulation};
use sim_model::{KeyState, Model};
use sim_physics::arrays::Field;

use crate::cli::Bench;
use crate::error::DaemonError;
use crate::perf_map;
use crate::serve::read_scene;
use crate::terminal::printable;
use commands::Commands;

/// Rates are medians of so many turns.
const TURNS: usize = 5;

/// What was measured.
struct Measured {
    device: String,
    worlds: usize,
    threads: usize,
    /// What was commanded, if anything can be.
    command: Option<&'static str>,
    /// Steps of a world per second, of each turn, least first.
    rates: Vec<f64>,
    profile: Profile,
    /// Machine code of a substep, without rare cases and with them, if that ran.
    compiled: Option<[MachineCode; 2]>,
    /// Worlds that have faulted, and whose solver used up its iterations in the last frame.
    faulted: usize,
    unconverged: usize,
}

/// Measures a scene, and prints what was found.
pub(crate) fn run(args: &Bench) -> Result<(), DaemonError> {
    let mut options = check(args)?;
    let (scene, folder) = read_scene(&args.scene)?;
    let model = scene.describe(&folder)?.compile()?;
    options.checked_with = machine_code_check(&model);
    let start = keyframe(&model, args.keyframe.as_deref())?;
    let swing = if args.commands == "hold" {
        0.0
    } else {
        args.swing
    };
    let mut commands = Commands::new(&model, start.as_ref(), options.worlds, swing);
    let mut simulation = Simulation::new(model.clone(), &options)?;
    if let Some(note) = perf_map::write(&simulation) {
        let _ = writeln!(std::io::stderr(), "{}", printable(&note));
    }
    if let Some(key) = &start {
        place(&mut simulation, key)?;
    }
    let mut arena = vec![0; simulation.layout().bytes / 8];
    let frame = model.dt() * model.substeps() as f64;
    let settling = (args.settle / frame).ceil() as usize;
    let mut step = |simulation: &mut Simulation, profile: Option<&mut Profile>| {
        if let Some(commands) = &mut commands {
            commands.send(simulation)?;
        }
        match profile {
            None => simulation.step(&mut arena),
            Some(profile) => assert!(
                simulation.step_profiled(&mut arena, profile),
                "the CPU has profiles"
            ),
        }
        Ok::<(), DaemonError>(())
    };
    for _ in 0..settling {
        step(&mut simulation, None)?;
    }
    let steps = (options.worlds * model.substeps()) as f64;
    let turn = Duration::from_secs_f64(args.seconds / TURNS as f64);
    let mut rates = Vec::new();
    for _ in 0..TURNS {
        let (begin, mut frames) = (Instant::now(), 0.0);
        while begin.elapsed() < turn || frames == 0.0 {
            step(&mut simulation, None)?;
            frames += 1.0;
        }
        rates.push(frames * steps / begin.elapsed().as_secs_f64());
    }
    rates.sort_by(f64::total_cmp);
    let mut profile = Profile::new();
    let begin = Instant::now();
    while begin.elapsed() < turn || profile.world_steps == 0 {
        step(&mut simulation, Some(&mut profile))?;
    }
    let mut slots = simulation.layout().slots.iter();
    let status = slots.find(|slot| slot.field == Field::Status);
    let first = status.expect("status is in every frame").offset / 4;
    let words: &[u32] = bytemuck::cast_slice(&arena);
    let having = |bits: u32| {
        let statuses = &words[first..first + options.worlds];
        statuses
            .iter()
            .filter(|&&status| status & bits != 0)
            .count()
    };
    let measured = Measured {
        device: simulation.device().to_owned(),
        worlds: options.worlds,
        threads: simulation.threads(),
        compiled: simulation.compiled(),
        command: commands
            .as_ref()
            .filter(|_| swing > 0.0)
            .map(Commands::field),
        rates,
        profile,
        faulted: having(sim_physics::arrays::status::FROZEN),
        unconverged: having(sim_physics::arrays::status::NOT_CONVERGED),
    };
    report::print(&measured, args.json)
}

/// The arguments, checked.
fn check(args: &Bench) -> Result<Options, DaemonError> {
    let wrong = |argument, value: &dyn ToString, problem: &str| DaemonError::Argument {
        argument,
        value: value.to_string(),
        problem: problem.to_owned(),
    };
    if !(1..=1 << 24).contains(&args.worlds) {
        return Err(wrong("worlds", &args.worlds, "ask for 1 to 16777216"));
    }
    if !(1..=1024).contains(&args.threads) {
        return Err(wrong("threads", &args.threads, "ask for 1 to 1024"));
    }
    if !matches!(args.commands.as_str(), "random" | "hold") {
        return Err(wrong(
            "commands",
            &args.commands,
            "unknown; use random or hold",
        ));
    }
    for (argument, value, most) in [
        ("swing", args.swing, 1.0),
        ("settle", args.settle, 1e6),
        ("seconds", args.seconds, 1e6),
    ] {
        // NaN is in no range
        if !(0.0..=most).contains(&value) {
            let problem = format!("give a number from 0 to {most}");
            return Err(wrong(argument, &value, &problem));
        }
    }
    let lanes = match args.lanes {
        None => Lanes::Auto,
        Some(1) => Lanes::Scalar,
        Some(8) => Lanes::Eight,
        Some(16) => Lanes::Sixteen,
        Some(other) => return Err(wrong("lanes", &other, "unknown; use 1, 8 or 16")),
    };
    if !cpu::available(lanes) {
        let problem = "this processor lacks the instructions; leave it out";
        return Err(wrong("lanes", &args.lanes.unwrap_or(0), problem));
    }
    let precision = match args.precision.as_str() {
        "f32" => Precision::F32,
        "f64" => Precision::F64,
        other => return Err(wrong("precision", &other, "unknown; use f32 or f64")),
    };
    if precision == Precision::F64 && !matches!(args.lanes, None | Some(1)) {
        let problem = "f64 has one world a block; leave it out";
        return Err(wrong("lanes", &args.lanes.unwrap_or(0), problem));
    }
    Ok(Options {
        worlds: args.worlds,
        threads: Some(args.threads),
        lanes,
        compiles: !args.stages,
        precision,
        fields: vec![Field::JointQ, Field::JointQd],
        ..Options::default()
    })
}

/// The keyframe of a name, with or without its model's.
fn keyframe(model: &Model, name: Option<&str>) -> Result<Option<KeyState>, DaemonError> {
    let Some(name) = name else {
        return Ok(None);
    };
    let is_it = |key: &&KeyState| key.name == name || key.name.ends_with(&format!("/{name}"));
    if let Some(key) = model.keyframes().iter().find(is_it) {
        return Ok(Some(key.clone()));
    }
    let known: Vec<_> = model.keyframes().iter().map(|key| &*key.name).collect();
    let problem = match known.is_empty() {
        true => "the scene has no keyframes; leave it out".to_owned(),
        false => format!("unknown; the scene has {}", known.join(", ")),
    };
    Err(DaemonError::Argument {
        argument: "keyframe",
        value: name.to_owned(),
        problem,
    })
}

/// Puts every world into a keyframe.
fn place(simulation: &mut Simulation, key: &KeyState) -> Result<(), DaemonError> {
    let worlds = simulation.worlds();
    for (field, row) in [
        (Field::JointQ, &key.joint_q),
        (Field::JointQd, &key.joint_qd),
        (Field::Act, &key.act),
        (Field::MocapPos, &key.mocap_pos),
        (Field::MocapQuat, &key.mocap_quat),
    ] {
        if !row.is_empty() {
            let all = row.repeat(worlds);
            simulation.write(field, 0..row.len(), Values::F64(&all), None)?;
        }
    }
    Ok(())
}
