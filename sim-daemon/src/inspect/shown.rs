//! What the picture of a robot shows: its collision shapes, what links without any look like, and its surroundings.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use sim_model::geometry::{TriMesh, VisualMesh, triangles};
use sim_model::{Joint, Look, Pose, Robot, Shape, UrdfOptions, Visual, Visuals};

use super::commas;
use super::picture::Drawing;
use super::properties::{Properties, count};
use super::source::mesh_options;
use crate::cli::Inspect;
use crate::config::hull_sides;
use crate::error::DaemonError;

/// A shape that is drawn: place of its link in body order, frame in the world, triangles in that frame.
type Drawn = (u32, Pose, TriMesh);

/// The picture. `frames` are position and quaternion of each link, in body order. `(bodies, 7)` [m, –]
pub(super) fn drawing(
    properties: &Properties,
    frames: &[f64],
    args: &Inspect,
    exported: Option<&Path>,
) -> Result<Drawing, DaemonError> {
    let pose = |frame: &[f64]| Pose {
        pos: std::array::from_fn(|axis| frame[axis]),
        quat: std::array::from_fn(|part| frame[3 + part]),
    };
    let poses: Vec<Pose> = frames.chunks_exact(7).map(pose).collect();
    let [mut shapes, mut surroundings] = collisions(properties, &poses, args);
    let mut caption = configuration(properties, args);
    let solid: HashSet<u32> = shapes.iter().map(|&(place, ..)| place).collect();
    let is_bare = |place: usize| !solid.contains(&(place as u32));
    if (0..poses.len()).any(is_bare) {
        let (looks, note) = looks(properties, &poses, args, exported, is_bare)?;
        if !looks.is_empty() {
            caption += match shapes.is_empty() {
                true => "; visual shapes, since it has no collision shapes",
                false => "; visual shapes of links without collision shapes",
            };
            shapes.extend(looks);
            shapes.sort_by_key(|&(place, ..)| place);
        }
        caption += &note;
    }
    // a world without anything in it is shown itself
    if shapes.is_empty() && poses.len() == 1 {
        std::mem::swap(&mut shapes, &mut surroundings);
    }
    let collisions = properties
        .robot
        .links
        .iter()
        .flat_map(|link| &link.collisions);
    if collisions
        .into_iter()
        .any(|c| matches!(c.shape, Shape::Mesh(_)))
    {
        caption += match args.hulls {
            true => "; convex hulls of meshes",
            false => "; meshes as their files have them",
        };
    }
    Ok(Drawing {
        title: properties.robot.name.clone(),
        summary: properties.in_a_line(),
        caption,
        links: properties.names(),
        frames: poses.into_iter().zip(properties.parent_places()).collect(),
        shapes,
        surroundings,
    })
}

/// Collision shapes of the robot, and those around it: terrain, and what the world of a MuJoCo model has.
fn collisions(properties: &Properties, poses: &[Pose], args: &Inspect) -> [Vec<Drawn>; 2] {
    let robot = properties.robot;
    let [mut of_robot, mut around] = [Vec::new(), Vec::new()];
    for (place, (&link, pose)) in properties.order.iter().zip(poses).enumerate() {
        let is_world = robot.precompiled.is_some() && properties.joint(link).is_none();
        // a plane has no end; the picture has a floor of its own
        let shapes = &robot.links[link].collisions;
        for collision in shapes
            .iter()
            .filter(|collision| collision.shape != Shape::Plane)
        {
            let is_around = is_world || matches!(collision.shape, Shape::HeightField(_));
            let list = if is_around {
                &mut around
            } else {
                &mut of_robot
            };
            let frame = pose.mul(&collision.pose);
            let mut draw = |surface| list.push((place as u32, frame, surface));
            match &collision.shape {
                Shape::Mesh(mesh) if args.hulls => mesh.hulls.iter().map(hull_sides).for_each(draw),
                shape => draw(triangles(shape)),
            }
        }
    }
    [of_robot, around]
}

/// At which joint positions the robot is drawn.
fn configuration(properties: &Properties, args: &Inspect) -> String {
    let mut caption = match &args.joint_q {
        Some(joint_q) => format!("joint_q = {}", commas(joint_q)),
        None if properties.robot.precompiled.is_some() => "at the start".to_owned(),
        None if properties.robot.joints.iter().any(starts_elsewhere) => {
            "joint_q = 0, mimic joints with their leaders".to_owned()
        }
        None => "joint_q = 0".to_owned(),
    };
    match properties.outside_range().as_slice() {
        [] => {}
        [joint] => caption += &format!(", outside the range of {joint}"),
        [joint, rest @ ..] => {
            caption += &format!(", outside the ranges of {joint} and {} more", rest.len());
        }
    }
    caption
}

/// What the links at some places look like, and a note of what cannot be shown.
fn looks(
    properties: &Properties,
    poses: &[Pose],
    args: &Inspect,
    exported: Option<&Path>,
    is_meant: impl Fn(usize) -> bool,
) -> Result<(Vec<Drawn>, String), DaemonError> {
    let robot = properties.robot;
    let Visuals { visuals, .. } = match (exported, &robot.urdf) {
        (Some(path), _) => Robot::mujoco_visuals(path)?,
        (None, Some(path)) => {
            let options = UrdfOptions {
                meshes: mesh_options(args),
                package_dirs: args.package_dirs.clone(),
                ..UrdfOptions::default()
            };
            Robot::visuals(path, &options)?
        }
        (None, None) => return Ok((Vec::new(), String::new())),
    };
    let place_of: HashMap<String, usize> = properties.names().into_iter().zip(0..).collect();
    let mut drawn = Vec::new();
    let mut missing = 0;
    for visual in &visuals {
        let place = place_of.get(&visual.link).copied();
        let place = place.filter(|&place| is_meant(place));
        // the world of a MuJoCo model is around the robot
        let place = place.filter(|&place| {
            robot.precompiled.is_none() || properties.joint(properties.order[place]).is_some()
        });
        let Some(place) = place else {
            continue;
        };
        match surface(visual) {
            Ok(Some(surface)) => {
                drawn.push((place as u32, poses[place].mul(&visual.pose), surface));
            }
            Ok(None) => {}
            Err(_) => missing += 1,
        }
    }
    let note = match missing {
        0 => String::new(),
        _ => format!("; {} cannot be shown", count(missing, "visual")),
    };
    Ok((drawn, note))
}

/// The surface of a visual; none of one without end.
fn surface(visual: &Visual) -> Result<Option<TriMesh>, String> {
    Ok(Some(match &visual.look {
        Look::Shape(shape) => triangles(shape),
        Look::Sheet { .. } => return Ok(None),
        Look::Triangles { surface, .. } => surface.as_ref().clone(),
        Look::File {
            path,
            scale,
            collada_up_axis,
        } => {
            let mesh = VisualMesh::load(path, *collada_up_axis).map_err(|e| e.to_string())?;
            let vertices = mesh
                .vertices
                .iter()
                .map(|vertex| std::array::from_fn(|axis| f64::from(vertex[axis]) * scale[axis]));
            TriMesh {
                vertices: vertices.collect(),
                triangles: mesh.triangles,
            }
        }
        Look::Nothing { problem } => return Err(problem.clone()),
    }))
}

/// Whether a mimic joint is not at 0 where its leader is.
fn starts_elsewhere(joint: &Joint) -> bool {
    joint.mimic.is_some_and(|mimic| mimic.position(0.0) != 0.0)
}
