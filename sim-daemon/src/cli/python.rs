//! Commands that the Python package carries out, before this command line sees them. They stand here for its help, its
//! completions and its manual; who calls them here has no Python package. tests/python/test_shells.py compares both.

use std::net::IpAddr;
use std::path::PathBuf;

use clap::{Args, Subcommand};

use crate::error::DaemonError;

/// A command of the Python package.
#[derive(Debug, Subcommand)]
pub(super) enum Python {
    /// Show a daemon's worlds, or a recording, in the browser.
    ///
    /// Example: tightloop view franka --worlds 64
    View(View),
    /// Make a picture, a film or a web page of a daemon's worlds or of a recording, without a display.
    ///
    /// Example: tightloop film run.tlrec run.mp4 --worlds 16
    Film(Film),
    /// Tour what there is: torques, targets, a grasp, many worlds, a trained policy.
    ///
    /// Example: tightloop demo --view
    Demo(Demo),
}

#[derive(Debug, Args)]
pub(super) struct View {
    /// Name of a daemon, or a file that `record` wrote.
    #[arg(value_name = "NAME|FILE.tlrec")]
    target: PathBuf,

    /// Port of the page; the next free one if it is taken.
    #[arg(long, default_value_t = 8080)]
    port: u16,

    /// Address to listen on; 0.0.0.0 lets other machines drive, too.
    #[arg(long, default_value = "127.0.0.1")]
    host: IpAddr,

    /// Most worlds to show, up to 1024.
    #[arg(long, default_value_t = 256)]
    worlds: usize,

    /// Open the page in this machine's browser.
    #[arg(long)]
    open: bool,
}

#[derive(Debug, Args)]
pub(super) struct Film {
    /// Name of a daemon, or a file that `record` wrote.
    #[arg(value_name = "NAME|FILE.tlrec")]
    source: PathBuf,

    /// What to write: a .png, .gif, .mp4 or .html file, or a folder of .png files.
    out: PathBuf,

    /// When to begin; of a .png, when it is taken [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    at: f64,

    /// How long: of a daemon as time passes, 5 if left out; of a recording simulated time, all if left out.
    #[arg(long)]
    seconds: Option<f64>,

    /// Pictures a second.
    #[arg(long, default_value_t = 30.0)]
    fps: f64,

    /// Seconds of the run a second of film.
    #[arg(long, default_value_t = 1.0)]
    speed: f64,

    /// Size of the pictures.
    #[arg(long, value_name = "WxH", default_value = "640x480")]
    size: String,

    /// How many worlds, on a grid.
    #[arg(long, default_value_t = 1)]
    worlds: usize,

    /// The one that is seen alone, or followed.
    #[arg(long, default_value_t = 0)]
    world: usize,

    /// Where it is seen from; follow goes with the world.
    #[arg(long, default_value = "three-quarter", value_parser = ["three-quarter", "front", "side", "top", "follow"])]
    camera: String,

    /// Show the shapes that touch, not what robots look like.
    #[arg(long)]
    collision: bool,

    /// Leave contact points and forces out.
    #[arg(long)]
    no_contacts: bool,
}

#[derive(Debug, Args)]
pub(super) struct Demo {
    /// Only this stop, such as grasp; may be given several times.
    #[arg(long = "stop", value_name = "NAME")]
    stops: Vec<String>,

    /// How long to stay at each stop; one round if left out.
    #[arg(long)]
    seconds: Option<f64>,

    /// Worlds of every stop.
    #[arg(long)]
    worlds: Option<usize>,

    /// Show it in the browser, in real time.
    #[arg(long)]
    view: bool,

    /// Port of the page; the next free one if it is taken.
    #[arg(long, default_value_t = 8080)]
    port: u16,

    /// Folder of the pictures.
    #[arg(long, default_value = "demo")]
    out: PathBuf,

    /// Where the physics runs: cpu, gpu, or auto.
    #[arg(long, default_value = "auto")]
    device: String,

    /// Most threads a step may use; all cores if left out.
    #[arg(long)]
    threads: Option<usize>,
}

impl Python {
    /// Says what is missing.
    pub(super) fn run(&self) -> Result<(), DaemonError> {
        let command = match self {
            Python::View(_) => "view",
            Python::Film(_) => "film",
            Python::Demo(_) => "demo",
        };
        Err(DaemonError::NeedsPython { command })
    }
}
