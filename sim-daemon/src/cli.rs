//! The command line. Doc comments here are the help.

mod pages;
mod python;

use std::ffi::OsString;
use std::io::Write;
use std::path::PathBuf;

use clap::{Args, CommandFactory, Parser, Subcommand};
use sim_protocol::{AttachOptions, Client, keep_waiting};

use crate::config::MeshOptions;
use crate::error::DaemonError;
use crate::{devices, inspect, recording, session};

/// Batched robot simulation, served over shared memory.
#[derive(Debug, Parser)]
#[command(name = "tightloop", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Keep the worlds of a scene and serve them to clients until stopped.
    ///
    /// Prints one line of JSON when clients may attach: {"ready": {…}}, or {"error": {"kind": …, "message": …}}.
    ///
    /// Example: tightloop serve scene.toml --worlds 4096 --name franka
    Serve(Box<Serve>),
    /// Show what a URDF file means: its tree, dofs, masses, limits, what was ignored or mended, and a picture.
    ///
    /// The picture shows the collision shapes; it is written as ROBOT.png into the working folder.
    ///
    /// Example: tightloop inspect robot.urdf --package-dir ~/robots
    Inspect(Inspect),
    /// Write what a daemon does into a file, from which `replay` does it again: commands, resets, parameters, digests of frames.
    ///
    /// Runs until stopped (Ctrl-C), or until the daemon ends. The daemon never waits for it: what is lost is a gap, and is told.
    ///
    /// Example: tightloop record franka run.tlrec --frames 10000
    Record(Record),
    /// Run a recording again, without a daemon, and compare every frame bit for bit.
    ///
    /// Exit code 0: all frames are equal. 1: the first frame (counted from 0), world and field that differ are named, or a gap, where it stops. 2: the
    /// file cannot be replayed.
    ///
    /// The robot files and meshes of the scene are not in the recording: they must be where they were, and as they were.
    ///
    /// Example: tightloop replay run.tlrec
    Replay(Replay),
    /// List the GPUs of this machine, those that software plays last, and what fits on each.
    ///
    /// Example: tightloop devices
    Devices,
    /// List the daemons that run, one name a line.
    ///
    /// Example: tightloop list
    List,
    /// Stop a daemon, with all of its groups, and wait until it is gone.
    ///
    /// Example: tightloop stop franka
    Stop {
        /// Name of the daemon.
        name: String,
    },
    #[command(flatten)]
    Python(python::Python),
    /// Print what a shell needs to complete command lines.
    ///
    /// Example: tightloop completions bash > ~/.local/share/bash-completion/completions/tightloop
    Completions {
        /// The shell.
        shell: pages::Shell,
    },
    /// Print the manual page, or write the pages of all commands into a folder.
    ///
    /// Example: tightloop man ~/.local/share/man/man1 && man tightloop-serve
    Man {
        /// The folder; it is made if it is not there.
        folder: Option<PathBuf>,
    },
}

/// Arguments of `serve` as given; `session` checks them.
#[derive(Debug, Args)]
pub(crate) struct Serve {
    /// Scene file in TOML; `-` reads it from standard input, with paths relative to the working folder.
    pub(crate) scene: PathBuf,

    /// Number of worlds.
    #[arg(long, default_value_t = 1)]
    pub(crate) worlds: u64,

    /// Groups that the worlds are split into, which step independently; clients attach to NAME.0, NAME.1, ….
    #[arg(long, default_value_t = 1)]
    pub(crate) groups: u64,

    /// Where the physics runs: cpu, gpu, or auto for a GPU if there is one and the worlds are many, else the CPU.
    #[arg(long, default_value = "auto")]
    pub(crate) device: String,

    /// Which GPU: its number or part of its name, as `devices` lists them; the first if left out.
    #[arg(long)]
    pub(crate) adapter: Option<String>,

    /// Name under which clients find the daemon.
    #[arg(long, default_value = "tightloop")]
    pub(crate) name: String,

    /// Threads of a step, shared by all groups; one a core if left out.
    #[arg(long)]
    pub(crate) threads: Option<usize>,

    /// Precision of state, commands and fields: f32 or f64.
    #[arg(long, default_value = "f32")]
    pub(crate) precision: String,

    /// Fields that frames carry, separated by commas; time, step, status and contacts_left_out come with every frame.
    #[arg(long, value_delimiter = ',', default_value = "joint_q,joint_qd,body_q")]
    pub(crate) fields: Vec<String>,

    /// Parameters that vary from world to world and may be written, besides those of the scene, separated by commas.
    #[arg(long, value_delimiter = ',')]
    pub(crate) params: Vec<String>,

    /// Largest |joint_q| of a world [rad or m]; one beyond it is frozen at its state before that frame.
    #[arg(long, value_name = "Q", default_value_t = f64::INFINITY)]
    pub(crate) joint_q_max: f64,

    /// Largest |joint_qd| of a world [rad/s or m/s], likewise.
    #[arg(long, value_name = "QD", default_value_t = f64::INFINITY)]
    pub(crate) joint_qd_max: f64,

    /// What becomes of a frozen world: freeze keeps it until it is reset, reset resets it before its next step.
    #[arg(long, default_value = "freeze")]
    pub(crate) on_fault: String,

    /// What becomes of a command that is NaN or infinite in some world: refuse refuses it for all worlds, freeze freezes that world.
    #[arg(long, default_value = "refuse")]
    pub(crate) on_nan: String,

    /// What is drawn of a world depends on: world for its number and its seed, seed for its seed alone.
    #[arg(long, default_value = "world")]
    pub(crate) draws: String,

    /// Frames that a client may hold at once.
    #[arg(long, default_value_t = 4)]
    pub(crate) frames_held: usize,

    /// Worlds that observers see: the first ones.
    #[arg(long, default_value_t = 256)]
    pub(crate) watch_worlds: usize,

    /// End when this process, our parent, ends.
    #[arg(long, value_name = "PID")]
    pub(crate) parent: Option<u32>,

    /// Append news to this file instead of telling them on stderr.
    #[arg(long, value_name = "FILE")]
    pub(crate) log: Option<PathBuf>,
}

/// Arguments of `record` as given; `recording` checks them.
#[derive(Debug, Args)]
pub(crate) struct Record {
    /// Name of the daemon, or of one of its groups, such as franka.0.
    pub(crate) name: String,

    /// File to write, such as run.tlrec.
    pub(crate) out: PathBuf,

    /// Fields of the daemon's frames to write whole, separated by commas, so that a replay tells both numbers.
    #[arg(long, value_delimiter = ',')]
    pub(crate) fields: Vec<String>,

    /// End after so many frames.
    #[arg(long)]
    pub(crate) frames: Option<u64>,

    /// End after so many seconds.
    #[arg(long)]
    pub(crate) seconds: Option<f64>,

    /// Overwrite the file if it is there.
    #[arg(long)]
    pub(crate) force: bool,
}

/// Arguments of `replay` as given; `recording` checks them.
#[derive(Debug, Args)]
pub(crate) struct Replay {
    /// File that `record` wrote.
    pub(crate) file: PathBuf,

    /// Threads of a step; one a core if left out. The bits are the same with any number.
    #[arg(long)]
    pub(crate) threads: Option<usize>,

    /// End after so many frames.
    #[arg(long)]
    pub(crate) frames: Option<u64>,
}

/// Arguments of `inspect` as given; `inspect` checks them.
#[derive(Debug, Args)]
pub(crate) struct Inspect {
    /// URDF file of the robot.
    pub(crate) urdf: PathBuf,

    /// Let the root link move freely.
    #[arg(long)]
    pub(crate) floating: bool,

    /// Refuse an inertia that no body can have, instead of balancing it.
    #[arg(long)]
    pub(crate) strict: bool,

    /// Folder that holds the packages of package:// paths; may be given several times.
    #[arg(long = "package-dir", value_name = "DIR")]
    pub(crate) package_dirs: Vec<PathBuf>,

    /// Most vertices of the convex hull of a collision mesh.
    #[arg(long, value_name = "COUNT", default_value_t = MeshOptions::default().max_hull_vertices)]
    pub(crate) mesh_max_hull_vertices: usize,

    /// Make several convex hulls of a concave collision mesh.
    #[arg(long)]
    pub(crate) convex_decomposition: bool,

    /// Draw the convex hulls that stand for meshes in contacts, not the meshes.
    #[arg(long)]
    pub(crate) hulls: bool,

    /// Joint positions of the picture, one a coordinate [rad or m], separated by commas; 0 if left out.
    #[arg(
        long,
        value_name = "Q",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    pub(crate) joint_q: Option<Vec<f64>>,

    /// Print frames, inertias and the places of shapes, too.
    #[arg(long)]
    pub(crate) long: bool,

    /// Print JSON, and write no picture unless --png says where.
    #[arg(long, conflicts_with = "long")]
    pub(crate) json: bool,

    /// Write the picture to this file.
    #[arg(long, value_name = "FILE")]
    pub(crate) png: Option<PathBuf>,

    /// Write no picture.
    #[arg(long, conflicts_with = "png")]
    pub(crate) no_png: bool,
}

/// Runs a command line; the exit code is 0 done, 1 failed, 2 misused.
pub(crate) fn run(args: impl IntoIterator<Item = OsString>) -> i32 {
    let cli = match Cli::try_parse_from(args) {
        Ok(cli) => cli,
        Err(error) => {
            // help and version go to stdout with code 0, mistakes to stderr with code 2: clap knows
            let _ = error.print();
            return error.exit_code();
        }
    };
    let result = match &cli.command {
        Command::Serve(serve) => session::run(serve),
        Command::Inspect(args) => inspect::run(args),
        Command::Record(args) => recording::record(args),
        Command::Replay(args) => recording::replay(args),
        Command::Devices => devices::run(),
        Command::List => list(),
        Command::Stop { name } => stop(name),
        Command::Python(command) => command.run(),
        Command::Completions { shell } => pages::completions(Cli::command(), *shell),
        Command::Man { folder } => pages::man(Cli::command(), folder.as_deref()),
    };
    match result {
        Ok(()) => 0,
        Err(error) => {
            // whoever launched us reads it from our line on stdout
            if !matches!(&cli.command, Command::Serve(serve) if serve.parent.is_some()) {
                let _ = writeln!(std::io::stderr(), "tightloop: {error}");
            }
            error.exit_code()
        }
    }
}

fn list() -> Result<(), DaemonError> {
    for name in sim_protocol::running(None)? {
        // whoever reads our list may stop reading
        if writeln!(std::io::stdout(), "{name}").is_err() {
            break;
        }
    }
    Ok(())
}

fn stop(name: &str) -> Result<(), DaemonError> {
    let options = AttachOptions::default();
    // any of its groups ends a daemon
    let name = match sim_protocol::find(name, &options, &mut keep_waiting())?.groups {
        1 => name.to_owned(),
        _ => format!("{name}.0"),
    };
    let client = Client::attach(&name, &options, &mut keep_waiting())?;
    client.shutdown(&mut keep_waiting())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn without_python_its_commands_say_what_is_missing() {
        let line = ["tightloop", "film", "run.tlrec", "run.mp4"];
        let Ok(Cli {
            command: Command::Python(python),
        }) = Cli::try_parse_from(line)
        else {
            panic!("film is a command of Python");
        };
        let said = python.run().unwrap_err().to_string();
        assert!(
            said.contains("`film`") && said.contains("pip install"),
            "{said}"
        );
        assert_eq!(run(line.map(OsString::from)), 1);
    }

    #[test]
    fn help_says_what_it_said() {
        let help = Cli::command().term_width(100).render_help().to_string();
        let lines: Vec<_> = help.lines().map(str::trim_end).collect();
        let said: Vec<_> = include_str!("help.txt").lines().collect();
        assert_eq!(lines, said, "if the change is wanted, change help.txt");
        for (name, file, said) in [
            ("serve", "serve_help.txt", include_str!("serve_help.txt")),
            ("record", "record_help.txt", include_str!("record_help.txt")),
            ("replay", "replay_help.txt", include_str!("replay_help.txt")),
            (
                "inspect",
                "inspect_help.txt",
                include_str!("inspect_help.txt"),
            ),
        ] {
            let mut command = Cli::command().term_width(100);
            command.build(); // so that usage lines begin with `tightloop`
            let command = command.find_subcommand_mut(name).expect("it is a command");
            let help = command.render_long_help().to_string();
            // where help has spaces at the end of a line, the snapshot has none
            let lines: Vec<_> = help.lines().map(str::trim_end).collect();
            let said: Vec<_> = said.lines().collect();
            assert_eq!(lines, said, "if the change is wanted, change {file}");
        }
    }
}
