//! What the command reads: a URDF file, or a model that MuJoCo compiled.

use std::path::Path;

use sim_model::geometry::MeshOptions;
use sim_model::{Description, MujocoContents, MujocoOptions, UrdfOptions};

use crate::cli::Inspect;
use crate::error::DaemonError;

/// Name of a model without a name.
const UNNAMED: &str = "model";

/// The exported file of a MuJoCo model, if it is one.
pub(super) fn exported(args: &Inspect) -> Option<&Path> {
    let is_exported = args
        .file
        .extension()
        .is_some_and(|own| own == "safetensors");
    let own = is_exported.then_some(args.file.as_path());
    args.exported.as_deref().or(own)
}

/// A scene of the only robot of a URDF file.
pub(super) fn urdf(args: &Inspect) -> Result<Description, DaemonError> {
    let mut meshes = MeshOptions {
        convex_decomposition: args.convex_decomposition,
        collada_up_axis: args.collada_up_axis,
        ..MeshOptions::default()
    };
    if let Some(vertices) = args.mesh_max_hull_vertices {
        meshes.max_hull_vertices = vertices;
    }
    // nothing moves here: any step does
    let mut scene = Description::new(1e-3, 1);
    scene.add_urdf(
        &args.file,
        UrdfOptions {
            floating: args.floating,
            strict: args.strict,
            meshes,
            package_dirs: args.package_dirs.clone(),
            ..UrdfOptions::default()
        },
    )?;
    Ok(scene)
}

/// A scene of a MuJoCo model.
pub(super) fn mujoco(args: &Inspect, path: &Path, name: &str) -> Result<Description, DaemonError> {
    for (given, argument, cure) in [
        (
            args.floating,
            "--floating",
            "add a <freejoint/> to its body",
        ),
        (args.strict, "--strict", "MuJoCo has checked its inertias"),
        (
            !args.package_dirs.is_empty(),
            "--package-dir",
            "MuJoCo finds its files by `meshdir`",
        ),
        (
            args.convex_decomposition,
            "--convex-decomposition",
            "a mesh touches as its convex hull",
        ),
        (
            args.collada_up_axis,
            "--collada-up-axis",
            "MuJoCo has read its meshes",
        ),
    ] {
        if given {
            return Err(DaemonError::Argument {
                argument,
                value: args.file.display().to_string(),
                problem: format!("the option is for URDF files; leave it out: {cure}"),
            });
        }
    }
    let mut options = MujocoOptions::named(name);
    if let Some(vertices) = args.mesh_max_hull_vertices {
        options.max_hull_vertices = vertices;
    }
    Ok(Description::from_mujoco(path, options)?)
}

/// What a scene calls a model: its name, or that of its file.
pub(super) fn name(contents: &MujocoContents, file: &Path) -> String {
    let stem = || {
        file.file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned()
    };
    let own = match contents.name.is_empty() {
        true => stem(),
        false => contents.name.clone(),
    };
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "_.-".contains(letter);
    let name: String = own
        .chars()
        .map(|letter| if plain(letter) { letter } else { '_' })
        .collect();
    if name.is_empty() {
        UNNAMED.to_owned()
    } else {
        name
    }
}
