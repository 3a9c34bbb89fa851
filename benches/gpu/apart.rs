//! How long worlds take to be built: in processes of their own, since a driver keeps what it compiled in memory and in folders.

use crate::scenes::{Plan, Scene};
use crate::{Arguments, FIELDS, Place, build, options};
use anyhow::{Context, ensure};
use sim_engine::options::{Adapter, AdapterInfo, Replay};
use std::path::Path;
use std::process::Command;

/// Where drivers keep what they have compiled: Mesa's, NVIDIA's, and others that go by the user's folder.
const KEPT: [&str; 3] = [
    "MESA_SHADER_CACHE_DIR",
    "__GL_SHADER_DISK_CACHE_PATH",
    "XDG_CACHE_HOME",
];

/// Time until the first frame is there [s], in a first process with empty folders, and in a second one with what that has kept.
pub fn build_twice(info: &AdapterInfo, scene: Scene, worlds: usize) -> anyhow::Result<[f64; 2]> {
    let folder = std::env::temp_dir().join(format!("gpu-bench-apart-{}", std::process::id()));
    std::fs::create_dir_all(&folder).context("a folder for programs")?;
    let both = [(); 2].map(|()| built_in(&folder, info, scene, worlds));
    std::fs::remove_dir_all(&folder).context("the folder of programs")?;
    let [cold, cached] = both;
    Ok([cold?, cached?])
}

fn built_in(folder: &Path, info: &AdapterInfo, scene: Scene, worlds: usize) -> anyhow::Result<f64> {
    let mut command = Command::new(std::env::current_exe()?);
    command
        .arg("--build-in")
        .arg(folder.join("programs"))
        .args(["--adapter", &info.index.to_string()])
        .args(["--scenes", scene.name()])
        .args(["--worlds", &worlds.to_string()]);
    for name in KEPT {
        command.env(name, folder.join("driver"));
    }
    let done = command.output().context("a second process")?;
    let said = String::from_utf8_lossy(&done.stdout);
    let trouble = String::from_utf8_lossy(&done.stderr);
    ensure!(done.status.success(), "{}: {trouble}", scene.name());
    said.trim().parse().with_context(|| said.to_string())
}

/// The second process: builds worlds of the first scene and prints how long it took.
pub fn tell(arguments: &Arguments, info: &AdapterInfo, folder: &Path) -> anyhow::Result<()> {
    let place = Place {
        adapter: Adapter::Index(info.index),
        cache: folder.to_owned(),
        replay: Replay::Recorded,
    };
    let scene = *arguments.scenes.first().context("a scene")?;
    let worlds = *arguments.worlds.first().context("a number of worlds")?;
    let (sim, seconds) = build(&Plan::new(scene), &options(&place, worlds, &FIELDS))?;
    if let Some(lost) = sim.lost() {
        anyhow::bail!("{}: {lost}", scene.name());
    }
    println!("{seconds}");
    Ok(())
}
