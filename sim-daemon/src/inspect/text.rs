//! The report as text.

use std::fmt::Write as _;
use std::path::Path;

use sim_model::{MujocoContents, Shape};

use super::properties::{Properties, count, kinds, short, tally, with_kinds};
use super::wrap::wrapped;
use super::{mujoco, table, tree};
use crate::config::joint_type;

/// All there is to say of a robot, or of a model that MuJoCo compiled.
pub(super) fn document(
    properties: &Properties,
    contents: Option<&MujocoContents>,
    file: &Path,
    long: bool,
) -> String {
    let mut text = match contents {
        None => head(properties),
        Some(contents) => mujoco::head(contents, &properties.robot.name, file),
    };
    text += "\nTree (● moves by itself, ○ is part of the link it is fixed to)\n";
    text += &tree::tree(properties, long);
    text += "\n";
    text += &table::dofs(properties);
    text += "\n";
    if let Some(contents) = contents {
        text += &mujoco::tables(contents, &properties.robot.name);
    }
    text += &notes(properties);
    text
}

fn head(properties: &Properties) -> String {
    let robot = properties.robot;
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<10} {value}");
    };
    line("Robot", robot.name.clone());
    if let Some(file) = &robot.urdf {
        line("File", file.display().to_string());
    }
    let base = if robot.floating {
        "moves freely"
    } else {
        "fixed to the world"
    };
    line("Base", base.to_owned());
    let merged = (0..robot.links.len())
        .filter(|&link| properties.merged_into(link).is_some())
        .count();
    let mut links = robot.links.len().to_string();
    links += &match merged {
        0 => String::new(),
        1 => ", of which 1 is merged into the link it is fixed to".to_owned(),
        _ => format!(", of which {merged} are merged into the link they are fixed to"),
    };
    line("Links", links);
    let found = tally(robot.joints.iter().map(joint_type));
    let named = found.iter().map(|(kind, n)| format!("{n} {kind}"));
    line("Joints", with_kinds(robot.joints.len(), named));
    let coords = count(properties.coords(), "coordinate");
    line("Dofs", format!("{}, {coords}", properties.dofs()));
    line("Mass", format!("{} kg", short(properties.mass())));
    let shapes = robot.links.iter().flat_map(|link| &link.collisions);
    let found = tally(shapes.map(|collision| Shape::kind(&collision.shape)));
    let all = found.iter().map(|(_, count)| count).sum();
    let named = found.iter().map(|(kind, n)| kinds(*n, kind));
    let mut shapes = with_kinds(all, named);
    if all == 0 {
        shapes += ", so the picture shows the frames of the links";
    }
    line("Collisions", shapes);
    text
}

/// What was ignored or mended, warnings first.
fn notes(properties: &Properties) -> String {
    let robot = properties.robot;
    let mut text = "Ignored or mended\n".to_owned();
    let rest = robot
        .notes
        .iter()
        .filter(|note| !robot.warnings.contains(note));
    let all: Vec<(char, &String)> = (robot.warnings.iter().map(|warning| ('!', warning)))
        .chain(rest.map(|note| ('-', note)))
        .collect();
    if all.is_empty() {
        text += "  nothing\n";
    }
    for (mark, note) in all {
        text += &wrapped(&format!("  {mark} "), "    ", note);
    }
    text
}
