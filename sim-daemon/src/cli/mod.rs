//! The command line. Its doc comments are the help texts.

mod pages;
mod python;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::{Args, CommandFactory, Parser, Subcommand};

use crate::error::DaemonError;
use crate::terminal::printable;

/// Largest |joint_q| unless another is asked for, that of MuJoCo (`mjMAXVAL`) [rad or m].
const JOINT_Q_MAX: f64 = 1e10;
/// Largest |joint_qd| unless another is asked for: no turbine turns so fast [rad/s or m/s].
const JOINT_QD_MAX: f64 = 1e5;

/// Step many robot worlds at once, and serve them over shared memory.
#[derive(Debug, Parser)]
#[command(name = "tightloop", version, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    command: CliCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum CliCommand {
    /// Run the worlds of a scene and serve them to clients until stopped.
    ///
    /// Prints one line of JSON when clients can attach: {"ready": {…}}, or {"error": {"kind": …, "message": …}}.
    ///
    /// Example: tightloop serve scene.toml --worlds 4096 --name franka
    Serve(Box<Serve>),
    /// Show what a robot file means: tree, dofs, masses, limits, repairs, and a picture.
    ///
    /// Reads URDF and, with the Python package and MuJoCo, MJCF. Also lists what the reader ignored or refused. The picture
    /// shows the collision shapes, and what links without any look like.
    ///
    /// Example: tightloop inspect robot.urdf --png robot.png
    Inspect(Inspect),
    /// Measure how fast a scene runs in this process, and where the time goes.
    ///
    /// Prints steps per second, contacts and constraint rows of a world, iterations of the solver, time by stage, and the
    /// share of SIMD lanes that wait for others. Runs on the CPU. Other programs on the same cores change the result.
    ///
    /// Example: tightloop bench scene.toml --worlds 4096
    Bench(Box<Bench>),
    /// Show the machine code that a scene's model becomes, by stage, or its kernels for a GPU.
    ///
    /// Models without contacts are compiled as a whole. Of small ones with contacts, the stages before contacts are found and
    /// the integrator are. Large models are not compiled. Prints the size of each stage's code; --listing adds the instructions.
    /// With --gpu it prints the kernels that a hardware GPU gets instead, on any computer.
    ///
    /// Example: tightloop compile scene.toml --listing
    Compile(Compile),
    /// Record every command that a daemon executes into a file for `replay`.
    ///
    /// Writes states, commands, resets, parameters and digests of frames until Ctrl-C or until the daemon ends. The
    /// daemon never waits for the recorder. Lost entries become a gap in the file: the recorder reports it, and goes on
    /// from the state behind it.
    ///
    /// Example: tightloop record franka run.tlrec --frames 10000
    Record(Record),
    /// Replay a recording without a daemon, and compare every frame bit for bit.
    ///
    /// Exit code 0: all frames are equal. Exit code 1: a frame differs, or the recording has a gap. The message names
    /// the first frame (counted from 0), world and field, or the steps that are missing; frames behind a gap are compared,
    /// too. Exit code 2: the file cannot be replayed.
    ///
    /// A recording does not contain robot files and meshes. They must be unchanged and at the same place.
    ///
    /// Example: tightloop replay run.tlrec
    Replay(Replay),
    /// List the GPUs of this machine, software drivers last, and how many worlds fit on each.
    ///
    /// Example: tightloop devices
    Devices,
    /// List the running daemons with their worlds, device, process, users, steps per second and age.
    ///
    /// Steps are counted for half a second.
    ///
    /// Example: tightloop list
    List {
        /// Print the names alone, one per line, at once.
        #[arg(long)]
        names: bool,

        /// Print JSON.
        #[arg(long, conflicts_with = "names")]
        json: bool,
    },
    /// Watch a daemon: steps per second, percentiles of frames, clients, faulted worlds, contacts, memory.
    ///
    /// Percentiles are those since the daemon started, or since a client counted anew.
    ///
    /// Example: tightloop top franka
    Top(Top),
    /// Stop a daemon with all its groups, and wait until it has ended.
    ///
    /// Example: tightloop stop franka
    Stop {
        /// Name of the daemon.
        name: String,
    },
    #[command(flatten)]
    Python(python::Python),
    /// Print the completion script of a shell.
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
        /// Folder of the manual pages; created if it is missing.
        folder: Option<PathBuf>,
    },
}

/// Arguments of `serve` as given; `session` checks them.
#[derive(Debug, Args)]
pub(crate) struct Serve {
    /// Scene file in TOML, or with the Python package an MJCF file that ends in .xml; `-` reads standard input, with paths
    /// relative to the working folder.
    pub(crate) scene: PathBuf,

    /// Number of worlds.
    #[arg(long, default_value_t = 1)]
    pub(crate) worlds: u64,

    /// Number of groups of worlds that step independently; clients attach to NAME.0, NAME.1, ….
    #[arg(long, default_value_t = 1)]
    pub(crate) groups: u64,

    /// Where the physics runs: cpu, gpu, or auto for the faster of both, measured at the first launch from 128 worlds on.
    #[arg(long, default_value = "auto")]
    pub(crate) device: String,

    /// Which GPU: its number or part of its name, as `devices` lists them; default: the first.
    #[arg(long)]
    pub(crate) adapter: Option<String>,

    /// Name under which clients find the daemon.
    #[arg(long, default_value = "tightloop")]
    pub(crate) name: String,

    /// Threads of a step, shared by all groups; default: one per core.
    #[arg(long)]
    pub(crate) threads: Option<usize>,

    /// Precision of state, commands and fields: f32 or f64.
    #[arg(long, default_value = "f32")]
    pub(crate) precision: String,

    /// On a GPU, compute the bits that the CPU computes. One thread then has a world, which takes longer where there are contacts.
    #[arg(long)]
    pub(crate) cpu_bits: bool,

    /// Fields in each frame, separated by commas; time, step, status and contacts_left_out are always there.
    #[arg(long, value_delimiter = ',', default_value = "joint_q,joint_qd,body_q")]
    pub(crate) fields: Vec<String>,

    /// Parameters that clients can write for each world, besides those of the scene, separated by commas.
    #[arg(long, value_delimiter = ',')]
    pub(crate) params: Vec<String>,

    /// Largest |joint_q| [rad or m]; a world beyond it is frozen at its state before that frame. inf is no bound.
    #[arg(long, value_name = "Q", default_value_t = JOINT_Q_MAX)]
    pub(crate) joint_q_max: f64,

    /// Largest |joint_qd| [rad/s or m/s]; a world beyond it is frozen at its state before that frame. inf is no bound.
    #[arg(long, value_name = "QD", default_value_t = JOINT_QD_MAX)]
    pub(crate) joint_qd_max: f64,

    /// What happens to a faulted world: freeze keeps it until a reset, reset resets it before its next step.
    #[arg(long, default_value = "freeze")]
    pub(crate) on_fault: String,

    /// What happens to a command that is NaN or infinite: refuse rejects it for all worlds, freeze freezes the worlds
    /// concerned.
    #[arg(long, default_value = "refuse")]
    pub(crate) on_nan: String,

    /// What random draws depend on: world for the index and the seed of a world, seed for the seed alone.
    #[arg(long, default_value = "world")]
    pub(crate) draws: String,

    /// Which state evaluated outputs belong to: frame for the state in the frame, last_substep for the last evaluation of forces, as
    /// after MuJoCo's mj_step.
    #[arg(long, default_value = "frame")]
    pub(crate) outputs_at: String,

    /// Keep to real time: simulated seconds per second; 1 is real time. A frame then leaves when it is due, not sooner.
    #[arg(long, value_name = "FACTOR")]
    pub(crate) realtime: Option<f64>,

    /// With --realtime, what worlds do when no command came until their frame is due: pause stands still, hold continues with the
    /// last commands, stop continues with efforts, controls and velocity targets of zero.
    #[arg(long, default_value = "pause", requires = "realtime")]
    pub(crate) late: String,

    /// With --late hold, stop after this time without a command [s].
    #[arg(long, value_name = "SECONDS", requires = "realtime")]
    pub(crate) command_timeout: Option<f64>,

    /// Processors that the daemon may run on, separated by commas; default: all.
    #[arg(long, value_delimiter = ',')]
    pub(crate) cores: Vec<usize>,

    /// Run with this real-time priority (SCHED_FIFO), 1 to 99, where the system allows it.
    #[arg(long)]
    pub(crate) priority: Option<u8>,

    /// Keep the daemon's memory from being swapped out, where the system allows it.
    #[arg(long)]
    pub(crate) lock_memory: bool,

    /// Most frames that a client can hold at once.
    #[arg(long, default_value_t = 4)]
    pub(crate) frames_held: usize,

    /// Number of worlds that observers see, from the first on.
    #[arg(long, default_value_t = 256)]
    pub(crate) watch_worlds: usize,

    /// End when this parent process ends.
    #[arg(long, value_name = "PID")]
    pub(crate) parent: Option<u32>,

    /// Append log messages to this file instead of stderr.
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

    /// Fields to write as whole arrays, separated by commas; a replay that differs then prints both values.
    #[arg(long, value_delimiter = ',')]
    pub(crate) fields: Vec<String>,

    /// Stop after this many frames.
    #[arg(long)]
    pub(crate) frames: Option<u64>,

    /// Stop after this many seconds.
    #[arg(long)]
    pub(crate) seconds: Option<f64>,

    /// Replace an existing file, once the recording is whole.
    #[arg(long)]
    pub(crate) force: bool,

    /// End when this parent process ends.
    #[arg(long, value_name = "PID", hide = true)]
    pub(crate) parent: Option<u32>,
}

/// Arguments of `replay` as given; `recording` checks them.
#[derive(Debug, Args)]
pub(crate) struct Replay {
    /// File that `record` wrote.
    pub(crate) file: PathBuf,

    /// Threads of a step; default: one per core. Any number gives the same bits.
    #[arg(long)]
    pub(crate) threads: Option<usize>,

    /// Stop after this many frames.
    #[arg(long)]
    pub(crate) frames: Option<u64>,
}

/// Arguments of `bench` as given; `bench` checks them.
#[derive(Debug, Args)]
pub(crate) struct Bench {
    /// Scene file in TOML, or with the Python package an MJCF file that ends in .xml; `-` reads standard input, with paths
    /// relative to the working folder.
    pub(crate) scene: PathBuf,

    /// Number of worlds.
    #[arg(long, default_value_t = 1024)]
    pub(crate) worlds: usize,

    /// Threads of a step. Times by stage are of one thread.
    #[arg(long, default_value_t = 1)]
    pub(crate) threads: usize,

    /// Commands: random gives each world smooth ones of its own, about the middle of the range or the keyframe's; hold keeps
    /// what these are about. A range without bounds counts as ±1.
    #[arg(long, default_value = "random")]
    pub(crate) commands: String,

    /// Largest amplitude of a random command, as a share of half its range.
    #[arg(long, default_value_t = 0.2)]
    pub(crate) swing: f64,

    /// Keyframe of a MuJoCo model in which all worlds begin; its controls are what random ones swing about.
    #[arg(long, value_name = "NAME")]
    pub(crate) keyframe: Option<String>,

    /// Simulated time before the measurement [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0)]
    pub(crate) settle: f64,

    /// Length of the measurement [s].
    #[arg(long, default_value_t = 2.5)]
    pub(crate) seconds: f64,

    /// Worlds per block: 1, 8 (AVX2, NEON) or 16 (AVX-512); default: the most that the processor has.
    #[arg(long)]
    pub(crate) lanes: Option<usize>,

    /// Precision of the state: f32 or f64.
    #[arg(long, default_value = "f32")]
    pub(crate) precision: String,

    /// Measure the stages that were compiled for all models, also where the model is compiled to machine code of its own.
    #[arg(long)]
    pub(crate) stages: bool,

    /// Print JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Arguments of `compile` as given; `compile` checks them.
#[derive(Debug, Args)]
pub(crate) struct Compile {
    /// Scene file in TOML, or with the Python package an MJCF file that ends in .xml; `-` reads standard input, with paths
    /// relative to the working folder.
    pub(crate) scene: PathBuf,

    /// Worlds per block: 8 (AVX2) or 16 (AVX-512); default: the most that the processor has.
    #[arg(long)]
    pub(crate) lanes: Option<usize>,

    /// Print the instructions, each below the line of the physics code that it comes from; of kernels the WGSL.
    #[arg(long)]
    pub(crate) listing: bool,

    /// Show the kernels of a hardware GPU: statements, bytes of SPIR-V, threads per world, dispatches of a frame, memory of a world.
    #[arg(long)]
    pub(crate) gpu: bool,
}

/// Arguments of `top` as given; `top` checks them.
#[derive(Debug, Args)]
pub(crate) struct Top {
    /// Name of the daemon.
    pub(crate) name: String,

    /// Time between two looks [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 1.0)]
    pub(crate) interval: f64,

    /// Stop after this many looks.
    #[arg(long)]
    pub(crate) count: Option<u64>,

    /// Print a line of JSON per look.
    #[arg(long)]
    pub(crate) json: bool,

    /// Instead, serve the numbers to Prometheus at this address of the loopback interface, such as 127.0.0.1:9400.
    #[arg(long, value_name = "ADDRESS", conflicts_with_all = ["json", "count", "interval"])]
    pub(crate) metrics: Option<String>,
}

/// Arguments of `inspect` as given; `inspect` checks them.
#[derive(Debug, Args)]
pub(crate) struct Inspect {
    /// URDF or MJCF file of the robot, a mesh, or a model that a scene with MuJoCo models saved.
    #[arg(value_name = "URDF|MJCF|MODEL.safetensors")]
    pub(crate) file: PathBuf,

    /// The compiled model of an MJCF file, which the Python package adds.
    #[arg(long, hide = true)]
    pub(crate) exported: Option<PathBuf>,

    /// Free the base: let the root link move.
    #[arg(long)]
    pub(crate) floating: bool,

    /// Refuse an inertia that no rigid body can have, instead of balancing it.
    #[arg(long)]
    pub(crate) strict: bool,

    /// Folder that holds the packages of package:// paths; can be repeated.
    #[arg(long = "package-dir", value_name = "DIR")]
    pub(crate) package_dirs: Vec<PathBuf>,

    /// Most vertices of a collision mesh's convex hull; default: 64, or 1024 for a MuJoCo model.
    #[arg(long, value_name = "COUNT")]
    pub(crate) mesh_max_hull_vertices: Option<usize>,

    /// Split a concave collision mesh into several convex hulls.
    #[arg(long)]
    pub(crate) convex_decomposition: bool,

    /// Turn COLLADA meshes from their <up_axis> to z up, which RViz does not.
    #[arg(long)]
    pub(crate) collada_up_axis: bool,

    /// Draw the convex hulls that collide, instead of the meshes.
    #[arg(long, requires = "png")]
    pub(crate) hulls: bool,

    /// Joint positions of the picture [rad or m], one per coordinate, separated by commas; default: 0, or the start of a
    /// MuJoCo model.
    #[arg(
        long,
        value_name = "Q",
        value_delimiter = ',',
        allow_hyphen_values = true,
        requires = "png"
    )]
    pub(crate) joint_q: Option<Vec<f64>>,

    /// Also print frames, inertias and positions of shapes, and each note on a hull.
    #[arg(long)]
    pub(crate) long: bool,

    /// Print JSON.
    #[arg(long, conflicts_with = "long")]
    pub(crate) json: bool,

    /// Draw a picture into this file; one that is there is replaced.
    #[arg(long, value_name = "FILE")]
    pub(crate) png: Option<PathBuf>,
}

/// Parses a command line; where there is nothing to run, prints help or the mistake and returns the exit code.
pub(crate) fn parse(args: impl IntoIterator<Item = OsString>) -> Result<CliCommand, i32> {
    match Cli::try_parse_from(args) {
        Ok(cli) => Ok(cli.command),
        Err(error) => {
            // help and version go to stdout with code 0, mistakes to stderr with code 2: clap knows
            if error.kind() == ErrorKind::ValueValidation {
                eprint!("{}", printable(&in_our_words(&error.to_string())));
            } else {
                let _ = error.print();
            }
            Err(error.exit_code())
        }
    }
}

/// A message of clap with what to give, where it repeats the words of Rust's parsers.
fn in_our_words(message: &str) -> String {
    message
        .replace("invalid digit found in string", "give a whole number")
        .replace(
            "number too large to fit in target type",
            "give a smaller number",
        )
        .replace("invalid float literal", "give a number")
        .replace(
            "cannot parse integer from empty string",
            "give a whole number",
        )
        .replace("cannot parse float from empty string", "give a number")
}

/// Prints the completions of a shell.
pub(crate) fn completions(shell: pages::Shell) -> Result<(), DaemonError> {
    pages::completions(Cli::command(), shell)
}

/// Prints the manual page, or writes the pages of all commands into a folder.
pub(crate) fn man(folder: Option<&Path>) -> Result<(), DaemonError> {
    pages::man(Cli::command(), folder)
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
        let Ok(CliCommand::Python(python)) = parse(line.map(OsString::from)) else {
            panic!("film is a command of Python");
        };
        let error = python.run().unwrap_err();
        let said = error.to_string();
        assert!(
            said.contains("`film`") && said.contains("pip install"),
            "{said}"
        );
        assert_eq!(error.exit_code(), 1);
    }

    #[test]
    fn help_says_what_it_said() {
        let help = Cli::command().term_width(100).render_help().to_string();
        let lines: Vec<_> = help.lines().map(str::trim_end).collect();
        let said: Vec<_> = include_str!("help/tightloop.txt").lines().collect();
        assert_eq!(lines, said, "wanted? change help/tightloop.txt");
        for (name, said) in [
            ("serve", include_str!("help/serve.txt")),
            ("record", include_str!("help/record.txt")),
            ("replay", include_str!("help/replay.txt")),
            ("inspect", include_str!("help/inspect.txt")),
            ("bench", include_str!("help/bench.txt")),
            ("compile", include_str!("help/compile.txt")),
        ] {
            let mut command = Cli::command().term_width(100);
            command.build(); // so that usage lines begin with `tightloop`
            let command = command.find_subcommand_mut(name).expect("it is a command");
            let help = command.render_long_help().to_string();
            // where help has spaces at the end of a line, the snapshot has none
            let lines = help.lines().map(str::trim_end);
            assert!(lines.eq(said.lines()), "wanted? change help/{name}.txt");
        }
    }
}
