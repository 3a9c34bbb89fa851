//! `tightloop inspect`: what a URDF file, a MuJoCo model or a mesh means, as text, as JSON, and as a picture of its
//! collision shapes.

mod json;
mod mujoco;
mod picture;
mod properties;
mod shown;
mod source;
mod table;
mod text;
mod tree;
mod wrap;

use std::path::{Path, PathBuf};

use serde_json::json;
use sim_engine::dynamics::Dynamics;
use sim_model::geometry::MeshOptions;
use sim_model::{ModelError, MujocoContents};

use crate::cli::Inspect;
use crate::error::DaemonError;
use crate::output;
use properties::Properties;

/// Runs the command.
pub(crate) fn run(args: &Inspect) -> Result<(), DaemonError> {
    if let Some(max_hull_vertices) = args.mesh_max_hull_vertices {
        let meshes = MeshOptions {
            max_hull_vertices,
            ..MeshOptions::default()
        };
        meshes.validate().map_err(|error| DaemonError::Argument {
            argument: "--mesh-max-hull-vertices",
            value: max_hull_vertices.to_string(),
            problem: error.to_string(),
        })?;
    }
    check_paths(args)?;
    let exported = source::exported(args);
    let contents = exported.map(MujocoContents::read).transpose()?;
    let mut scene = match (exported, &contents) {
        (Some(path), Some(contents)) => {
            let name = source::name(contents, &args.file);
            if !contents.refused.is_empty() {
                return Err(refused(args, contents, &name));
            }
            source::mujoco(args, path, &name)?
        }
        _ => source::other(args)?,
    };
    if let Some(joint_q) = &args.joint_q {
        let wrong = |error: ModelError| DaemonError::Argument {
            argument: "--joint-q",
            value: commas(joint_q),
            problem: error.to_string(),
        };
        scene.robots[0].set_joint_q(joint_q).map_err(wrong)?;
    }
    // what a simulation would refuse is refused here
    let model = scene.compile()?;
    let start = model.start().joint_q.clone();
    let frames = Dynamics::new(model).forward_kinematics(&start)?;
    let properties = Properties::new(&scene.robots[0]);
    let path = &args.png;
    let drawn = path.as_deref().map_or(Ok(()), |path| {
        let drawing = shown::drawing(&properties, &frames, args, exported)?;
        picture::write(&drawing.render(), path).map_err(|error| DaemonError::Picture {
            path: path.to_owned(),
            problem: format!("{error}; say with --png FILE where to write, or leave it out"),
        })
    });
    let report = || text::document(&properties, contents.as_ref(), &args.file, args.long);
    let said = match (args.json, &drawn, path) {
        (true, Err(_), _) => String::new(),
        (true, Ok(()), _) => {
            let file = &args.file;
            let document = json::document(&properties, contents.as_ref(), file, path.as_deref());
            format!("{document:#}\n")
        }
        (false, Ok(()), Some(path)) => {
            let picture = path.display();
            format!("{}\nPicture    {picture}\n", report())
        }
        (false, _, _) => report(),
    };
    let printed = say(&said);
    drawn.and(printed)
}

/// Endings of pictures that are not PNG.
const OTHER_PICTURES: [&str; 9] = [
    "jpg", "jpeg", "gif", "bmp", "webp", "svg", "pdf", "tif", "tiff",
];

/// Refuses folders that are not there, and a picture under another format's name.
fn check_paths(args: &Inspect) -> Result<(), DaemonError> {
    let wrong = |argument, path: &Path, problem: &str| {
        Err(DaemonError::Argument {
            argument,
            value: path.display().to_string(),
            problem: problem.to_owned(),
        })
    };
    if let Some(folder) = args.package_dirs.iter().find(|folder| !folder.is_dir()) {
        return wrong("--package-dir", folder, "it is no folder; mend the path");
    }
    let is_another = |path: &&PathBuf| {
        let ending = path.extension().unwrap_or_default();
        let mut others = OTHER_PICTURES.iter();
        others.any(|other| ending.eq_ignore_ascii_case(other))
    };
    match args.png.as_ref().filter(is_another) {
        Some(path) => wrong("--png", path, "the picture is PNG; end its name in .png"),
        None => Ok(()),
    }
}

fn say(said: &str) -> Result<(), DaemonError> {
    output::print(said.as_bytes()).map_err(DaemonError::stdout)
}

/// Reports a model that cannot run.
fn refused(args: &Inspect, contents: &MujocoContents, name: &str) -> DaemonError {
    let file = &args.file;
    let said = match args.json {
        true => {
            let (file, mujoco_contents) = (file.to_string_lossy(), mujoco::json(contents));
            let document = json!({ "name": name, "file": file, "mujoco": mujoco_contents });
            format!("{document:#}\n")
        }
        false => {
            let head = mujoco::head(contents, name, file);
            format!("{head}\n{}", mujoco::refused(contents))
        }
    };
    say(&said).err().unwrap_or_else(|| DaemonError::Refused {
        path: file.clone(),
        count: contents.refused.len(),
    })
}

fn commas(values: &[f64]) -> String {
    values
        .iter()
        .map(f64::to_string)
        .collect::<Vec<_>>()
        .join(",")
}
