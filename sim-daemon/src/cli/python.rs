//! Commands that the Python package runs before this command line sees them. They are here for help, completions and
//! manual pages. Without the Python package they end with an error. tests/python/command_line/test_shells.py compares both.

use std::net::IpAddr;
use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::error::DaemonError;

/// A command of the Python package.
#[derive(Debug, Subcommand)]
pub(crate) enum Python {
    /// Show the worlds of a daemon or a recording in the browser.
    ///
    /// Example: tightloop view franka --worlds 64
    View(View),
    /// Make a picture, a film or a web page of a daemon or a recording, without a display.
    ///
    /// Example: tightloop film run.tlrec run.mp4 --worlds 16
    Film(Film),
    /// Turn a recording into a dataset of episodes: HDF5, LeRobot, MCAP or Rerun.
    ///
    /// Example: tightloop export run.tlrec demos.hdf5 --to hdf5 --worlds 0-7
    Export(Export),
    /// Tour the features: torques, targets, a grasp, many worlds, a trained policy.
    ///
    /// Example: tightloop demo --view
    Demo(Demo),
}

#[derive(Debug, Args)]
pub(crate) struct View {
    /// Name of a daemon, or a recording.
    #[arg(value_name = "NAME|FILE.tlrec")]
    target: PathBuf,

    /// Port of the page; the next free port if it is taken.
    #[arg(long, default_value_t = 8080)]
    port: u16,

    /// Address to listen on; 0.0.0.0 is for other machines too, without encryption.
    #[arg(long, default_value = "127.0.0.1")]
    host: IpAddr,

    /// Also answer to this host name, such as that of a proxy; can be repeated.
    #[arg(long, value_name = "NAME")]
    allow_host: Vec<String>,

    /// Most worlds to show, up to 1024.
    #[arg(long, default_value_t = 256)]
    worlds: usize,

    /// Open the page in this machine's browser.
    #[arg(long)]
    open: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Film {
    /// Name of a daemon, or a recording.
    #[arg(value_name = "NAME|FILE.tlrec")]
    source: PathBuf,

    /// Output: a .png, .gif, .mp4 or .html file, which replaces an existing one once it is complete, or a new folder
    /// of .png files.
    out: PathBuf,

    /// Start of the film, or time of a .png [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    at: f64,

    /// Length of the film [s]; default: 5 s of real time of a daemon, or the whole recording.
    #[arg(long)]
    seconds: Option<f64>,

    /// Pictures per second.
    #[arg(long, default_value_t = 30.0)]
    fps: f64,

    /// Simulated seconds per second of film.
    #[arg(long, default_value_t = 1.0)]
    speed: f64,

    /// Size of the pictures.
    #[arg(long, value_name = "WxH", default_value = "640x480")]
    size: String,

    /// Number of worlds to show, on a grid.
    #[arg(long, default_value_t = 1)]
    worlds: usize,

    /// World to show alone, or to follow.
    #[arg(long, default_value_t = 0)]
    world: usize,

    /// Camera position; follow moves with the world. Default: follow for a single world whose robot floats, else
    /// three-quarter.
    #[arg(long, value_parser = ["three-quarter", "front", "side", "top", "follow"])]
    camera: Option<String>,

    /// Show collision shapes instead of visuals.
    #[arg(long)]
    collision: bool,

    /// Hide contact points and forces; above 4 worlds they are hidden.
    #[arg(long)]
    no_contacts: bool,
}

#[derive(Debug, Args)]
pub(crate) struct Export {
    /// Recording, as `tightloop record` or `sim.record` writes it.
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,

    /// New file, or new folder of a LeRobot dataset.
    out: PathBuf,

    /// Format of the dataset.
    #[arg(long, value_parser = ["hdf5", "lerobot", "mcap", "rerun"])]
    to: String,

    /// Fields of the observations, separated by commas.
    #[arg(long, value_name = "NAMES", default_value = "joint_q,joint_qd")]
    fields: String,

    /// Commands that are the action, separated by commas; default: those that the recorded client sent first.
    #[arg(long, value_name = "NAMES")]
    action: Option<String>,

    /// Joints or actuators whose commands are the action, as names or patterns such as arm/*, separated by commas;
    /// default: all but the dofs of free bodies.
    #[arg(long, value_name = "NAMES")]
    joints: Option<String>,

    /// Worlds, such as 0-7,12; default: all.
    #[arg(long)]
    worlds: Option<String>,

    /// Frames per second, of which the control rate is a multiple; default: the control rate.
    #[arg(long)]
    fps: Option<f64>,

    /// Fewest steps of an episode; shorter ones are left out.
    #[arg(long, value_name = "STEPS", default_value_t = 1)]
    min_steps: usize,

    /// Scene file whose cameras see the replay, besides those of the recorded scene.
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,

    /// What the robot does, in words, for LeRobot; default: the name of the recording.
    #[arg(long, value_name = "TEXT")]
    task: Option<String>,
}

#[derive(Debug, Args)]
pub(crate) struct Demo {
    /// Show this URDF, MJCF or scene file instead of the tour.
    file: Option<PathBuf>,

    /// Show only this stop, such as grasp; can be repeated.
    #[arg(long = "stop", value_name = "NAME")]
    stops: Vec<String>,

    /// Seconds at each stop; default: one round.
    #[arg(long)]
    seconds: Option<f64>,

    /// Number of worlds of every stop.
    #[arg(long)]
    worlds: Option<usize>,

    /// Show the tour in the browser, in real time.
    #[arg(long)]
    view: bool,

    /// Port of the page; the next free port if it is taken.
    #[arg(long, default_value_t = 8080)]
    port: u16,

    /// Folder for the pictures.
    #[arg(long, default_value = "demo")]
    out: PathBuf,

    /// Where the physics runs: cpu, gpu or auto.
    #[arg(long, default_value = "auto")]
    device: String,

    /// Most threads of a step; default: all cores.
    #[arg(long)]
    threads: Option<usize>,
}

impl Python {
    /// Says what is missing.
    pub(crate) fn run(&self) -> Result<(), DaemonError> {
        let command = match self {
            Python::View(_) => "view",
            Python::Film(_) => "film",
            Python::Export(_) => "export",
            Python::Demo(_) => "demo",
        };
        Err(DaemonError::NeedsPython { command })
    }
}
