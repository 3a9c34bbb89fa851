//! `tightloop inspect`: what a URDF file or a MuJoCo model means, as text, as JSON, and as a picture of its collision
//! shapes.

mod json;
mod mujoco;
mod picture;
mod properties;
mod source;
mod table;
mod text;
mod tree;
mod wrap;

use serde_json::json;
use sim_engine::dynamics::Dynamics;
use sim_model::geometry::{MeshOptions, triangles};
use sim_model::{Joint, ModelError, MujocoContents, Pose, Shape};

use crate::cli::Inspect;
use crate::config::hull_sides;
use crate::error::DaemonError;
use crate::output;
use picture::Drawing;
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
        _ => source::urdf(args)?,
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
        let drawing = drawing(&properties, &frames, args);
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

fn say(said: &str) -> Result<(), DaemonError> {
    output::print(said.as_bytes()).map_err(DaemonError::stdout)
}

/// Reports a model that cannot run.
fn refused(args: &Inspect, contents: &MujocoContents, name: &str) -> DaemonError {
    let file = &args.file;
    let said = match args.json {
        true => {
            let (file, own) = (file.to_string_lossy(), mujoco::json(contents));
            let document = json!({ "name": name, "file": file, "mujoco": own });
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

/// What the picture shows. `frames` are position and quaternion of each link, in body order. `(bodies, 7)` [m, –]
fn drawing(properties: &Properties, frames: &[f64], args: &Inspect) -> Drawing {
    let robot = properties.robot;
    let pose = |frame: &[f64]| Pose {
        pos: std::array::from_fn(|axis| frame[axis]),
        quat: std::array::from_fn(|part| frame[3 + part]),
    };
    let poses: Vec<Pose> = frames.chunks_exact(7).map(pose).collect();
    let mut shapes = Vec::new();
    for (place, (&link, pose)) in properties.order.iter().zip(&poses).enumerate() {
        // a plane has no end; the picture has a floor of its own
        let own = &robot.links[link].collisions;
        for collision in own.iter().filter(|own| own.shape != Shape::Plane) {
            let frame = pose.mul(&collision.pose);
            let mut draw = |surface| shapes.push((place as u32, frame, surface));
            match &collision.shape {
                Shape::Mesh(mesh) if args.hulls => mesh.hulls.iter().map(hull_sides).for_each(draw),
                shape => draw(triangles(shape)),
            }
        }
    }
    let outside = properties.outside_range();
    let mut caption = match &args.joint_q {
        Some(joint_q) => format!("joint_q = {}", commas(joint_q)),
        None if robot.mujoco.is_some() => "at the start".to_owned(),
        None if robot.joints.iter().any(starts_elsewhere) => {
            "joint_q = 0, mimic joints with their leaders".to_owned()
        }
        None => "joint_q = 0".to_owned(),
    };
    match outside.as_slice() {
        [] => {}
        [one] => caption += &format!(", outside the range of {one}"),
        [one, rest @ ..] => {
            caption += &format!(", outside the ranges of {one} and {} more", rest.len());
        }
    }
    let meshes = properties
        .robot
        .links
        .iter()
        .flat_map(|link| &link.collisions);
    if meshes
        .into_iter()
        .any(|c| matches!(c.shape, Shape::Mesh(_)))
    {
        caption += match args.hulls {
            true => "; convex hulls of meshes",
            false => "; meshes as their files have them",
        };
    }
    Drawing {
        title: robot.name.clone(),
        summary: properties.in_a_line(),
        caption,
        links: properties.names(),
        frames: poses.into_iter().zip(properties.parent_places()).collect(),
        shapes,
    }
}

fn commas(values: &[f64]) -> String {
    values
        .iter()
        .map(f64::to_string)
        .collect::<Vec<_>>()
        .join(",")
}

/// Whether a mimic joint is not at 0 where its leader is.
fn starts_elsewhere(joint: &Joint) -> bool {
    joint.mimic.is_some_and(|mimic| mimic.position(0.0) != 0.0)
}
