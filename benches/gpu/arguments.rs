//! The command line of the bench.

use crate::scenes::{Plan, Scene};
use anyhow::Context;
use clap::{Parser, ValueEnum};
use sim_engine::options::Cuts;
use std::path::PathBuf;

/// Which checks run before anything is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Checks {
    /// All; then it measures.
    First,
    /// All; then it ends.
    Only,
    /// None: another call ran them.
    Skip,
}

/// Which side is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Side {
    /// The adapter.
    Gpu,
    /// The processor.
    Cpu,
    /// The adapter, then the processor.
    Both,
}

/// Checks worlds on a GPU, then measures them.
#[derive(Parser)]
pub struct Arguments {
    /// Adapter, by index or by part of its name.
    #[arg(long)]
    pub adapter: Option<String>,
    /// Numbers of worlds.
    #[arg(long, value_delimiter = ',', default_value = "1024,4096,16384,65536")]
    pub worlds: Vec<usize>,
    /// Scenes: torque_free, target, grasp, quadruped, standing, or scene files that end in .toml, with controls beside
    /// them (benches/gpu/card_scenes.py).
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "torque_free,target,grasp,quadruped"
    )]
    pub scenes: Vec<Scene>,
    /// How long each is measured at least [s]; whole runs are.
    #[arg(long, default_value_t = 2.0)]
    pub seconds: f64,
    /// File for the results; a row is there as soon as it is measured.
    #[arg(long)]
    pub csv: Option<PathBuf>,
    /// Adds rows to that file, instead of beginning anew.
    #[arg(long, requires = "csv")]
    pub append: bool,
    /// Frames are copied by the host, even where the device could write them to their readers.
    #[arg(long)]
    pub no_import: bool,
    /// Which side is measured.
    #[arg(long, value_enum, default_value = "both")]
    pub side: Side,
    /// Which checks run.
    #[arg(long, value_enum, default_value = "first")]
    pub checks: Checks,
    /// Numbers of worlds between which a world must have the same bits, besides 1 and 7. 4031 is no whole number of workgroups.
    #[arg(long, value_delimiter = ',', default_value = "4031")]
    pub check_worlds: Vec<usize>,
    /// Leaves out what needs more builds: cold and cached ones, and the comparison of recorded with encoded batches.
    #[arg(long)]
    pub brief: bool,
    /// Measures the power of the card for so long [s], where NVIDIA's driver counts energy.
    #[arg(long)]
    pub power: Option<f64>,
    /// Folder that keeps programs from call to call.
    #[arg(long)]
    pub cache: Option<PathBuf>,
    /// Threads that share a world where contacts can be; else what suits the adapter.
    #[arg(long)]
    pub world_threads: Option<usize>,
    /// Worlds have the bits that they have on the CPU; the checks then compare all numbers with the CPU's.
    #[arg(long)]
    pub cpu_bits: bool,
    /// Largest kernel, in simple statements; else what suits the adapter.
    #[arg(long)]
    pub kernel_size: Option<usize>,
    /// Price of one more dispatch, in simple statements; else what suits the adapter.
    #[arg(long)]
    pub dispatch_price: Option<usize>,
    /// Only prints what each program takes on the device, by its time stamps, in one run of each scene; rows go to this file.
    #[arg(long)]
    pub kernel_times: Option<PathBuf>,
    /// What else the head of the file says, as `name: value`.
    #[arg(long)]
    pub fact: Vec<String>,
    /// Only builds the first scene, with its programs in this folder, and tells how long it took [s]: run by `build_time`.
    #[arg(long, hide = true)]
    pub build_in: Option<PathBuf>,
}

impl Arguments {
    /// A scene, ready to run.
    pub fn plan(&self, scene: &Scene) -> anyhow::Result<Plan> {
        Plan::new(scene).with_context(|| scene.name().to_owned())
    }

    /// Where kernels are cut.
    pub fn cuts(&self) -> Cuts {
        Cuts {
            kernel: self.kernel_size,
            dispatch: self.dispatch_price,
        }
    }
}
