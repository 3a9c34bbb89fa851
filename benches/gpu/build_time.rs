//! Build time of worlds, measured in separate processes: a driver caches what it compiled in memory and on disk.

use crate::arguments::Arguments;
use crate::scenes::Scene;
use crate::{FIELDS, Place, build, options};
use anyhow::{Context, ensure};
use sim_engine::options::AdapterInfo;
use std::path::Path;
use std::process::Command;

/// Variables that place the disk caches of drivers: Mesa's, NVIDIA's, and those in the user's cache folder.
const CACHE_FOLDERS: [&str; 3] = [
    "MESA_SHADER_CACHE_DIR",
    "__GL_SHADER_DISK_CACHE_PATH",
    "XDG_CACHE_HOME",
];

/// Time to the first frame [s], in a process with empty caches and in a second one with the caches of the first.
pub fn build_twice(info: &AdapterInfo, scene: &Scene, worlds: usize) -> anyhow::Result<[f64; 2]> {
    let folder = std::env::temp_dir().join(format!("gpu-bench-build-{}", std::process::id()));
    std::fs::create_dir_all(&folder).context("a folder for programs")?;
    let both = [(); 2].map(|()| built_in(&folder, info, scene, worlds));
    std::fs::remove_dir_all(&folder).context("the folder of programs")?;
    let [cold, cached] = both;
    Ok([cold?, cached?])
}

fn built_in(
    folder: &Path,
    info: &AdapterInfo,
    scene: &Scene,
    worlds: usize,
) -> anyhow::Result<f64> {
    let mut command = Command::new(std::env::current_exe()?);
    command
        .arg("--build-in")
        .arg(folder.join("programs"))
        .args(["--adapter", &info.index.to_string()])
        .arg("--scenes")
        .arg(scene.argument())
        .args(["--worlds", &worlds.to_string()]);
    for name in CACHE_FOLDERS {
        command.env(name, folder.join("driver"));
    }
    let done = command.output().context("a second process")?;
    let printed = String::from_utf8_lossy(&done.stdout);
    let errors = String::from_utf8_lossy(&done.stderr);
    ensure!(done.status.success(), "{}: {errors}", scene.name());
    printed.trim().parse().with_context(|| printed.to_string())
}

/// Builds the worlds of the first scene and prints the time [s]. Runs in the separate process.
pub fn build_and_print(
    arguments: &Arguments,
    info: &AdapterInfo,
    folder: &Path,
) -> anyhow::Result<()> {
    let place = Place::new(arguments, info, folder);
    let scene = arguments.scenes.first().context("a scene")?;
    let worlds = *arguments.worlds.first().context("a number of worlds")?;
    let (sim, seconds) = build(&arguments.plan(scene)?, &options(&place, worlds, &FIELDS))?;
    if let Some(lost) = sim.lost() {
        anyhow::bail!("{}: {lost}", scene.name());
    }
    println!("{seconds}");
    Ok(())
}
