//! What the command reads: a URDF file, a model that MuJoCo compiled, or a mesh.

use std::path::Path;
use std::sync::Arc;

use sim_model::geometry::{DENSITY, Mesh, MeshOptions};
use sim_model::{
    Body, Collision, Description, MujocoContents, MujocoOptions, Pose, Shape, UrdfOptions,
};

use crate::cli::Inspect;
use crate::error::DaemonError;

/// Name of a model without a name.
const UNNAMED: &str = "model";

/// The exported file of a MuJoCo model, if it is one.
pub(super) fn exported(args: &Inspect) -> Option<&Path> {
    let is_exported = args
        .file
        .extension()
        .is_some_and(|ending| ending == "safetensors");
    let exported = is_exported.then_some(args.file.as_path());
    args.exported.as_deref().or(exported)
}

/// Endings of meshes, which are shown as a body of water.
const MESHES: [&str; 5] = ["dae", "glb", "gltf", "obj", "stl"];

/// Endings of files that hold no robot, what they are, and what to do with them.
const OTHERS: [(&str, &str, &str); 6] = [
    (
        "toml",
        "a scene file",
        "inspect the robot files that it names, or run it by `tightloop serve SCENE.toml` and see it by `tightloop view NAME`",
    ),
    (
        "tlrec",
        "a recording",
        "`tightloop view FILE.tlrec` plays it",
    ),
    ("usd", USD.0, USD.1),
    ("usda", USD.0, USD.1),
    ("usdc", USD.0, USD.1),
    ("usdz", USD.0, USD.1),
];
const USD: (&str, &str) = ("USD", "export the robot as URDF or MJCF first");

/// A scene of what a file holds that MuJoCo has not compiled: the only robot of a URDF file, or a mesh.
pub(super) fn other(args: &Inspect) -> Result<Description, DaemonError> {
    let ending = args.file.extension().unwrap_or_default();
    let ending = ending.to_string_lossy().to_lowercase();
    let is_there = args.file.is_file();
    if let Some(&(_, what, cure)) = OTHERS.iter().find(|other| is_there && other.0 == ending) {
        return Err(DaemonError::NoRobot {
            path: args.file.clone(),
            what,
            cure,
        });
    }
    match is_there && MESHES.contains(&ending.as_str()) {
        true => mesh(args),
        false => urdf(args),
    }
}

/// How meshes are read.
pub(super) fn mesh_options(args: &Inspect) -> MeshOptions {
    let meshes = MeshOptions::default();
    MeshOptions {
        max_hull_vertices: args
            .mesh_max_hull_vertices
            .unwrap_or(meshes.max_hull_vertices),
        convex_decomposition: args.convex_decomposition,
        collada_up_axis: args.collada_up_axis,
    }
}

/// A scene of a body whose shape is a mesh.
fn mesh(args: &Inspect) -> Result<Description, DaemonError> {
    let mesh = Mesh::load(&args.file, [1.0; 3], &mesh_options(args))?;
    let shape = Collision::new(None, Shape::Mesh(Arc::new(mesh)), Pose::identity());
    let mut body = Body::new(&plain(&stem(&args.file)), Pose::identity());
    body.fixed = !args.floating;
    body.shapes.push((shape, DENSITY));
    let mut scene = Description::new(1e-3, 1);
    scene.add_body(body)?;
    Ok(scene)
}

/// A scene of the only robot of a URDF file.
fn urdf(args: &Inspect) -> Result<Description, DaemonError> {
    let meshes = mesh_options(args);
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
    match contents.name.is_empty() {
        true => plain(&stem(file)),
        false => plain(&contents.name),
    }
}

/// The name of a file without its ending.
fn stem(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default();
    stem.to_string_lossy().into_owned()
}

/// A name of letters that names may have.
fn plain(name: &str) -> String {
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "_.-".contains(letter);
    if name.is_empty() {
        return UNNAMED.to_owned();
    }
    name.chars()
        .map(|letter| if is_plain(letter) { letter } else { '_' })
        .collect()
}
