//! The report as text.

use std::fmt::Write as _;

use sim_model::Shape;

use super::properties::{Properties, count, short};
use super::wrap::wrapped;
use super::{table, tree};
use crate::config::joint_type;

/// All there is to say of a robot.
pub(super) fn document(properties: &Properties, long: bool) -> String {
    let mut text = head(properties);
    text += "\nTree (● moves by itself, ○ is part of the link it is fixed to)\n";
    text += &tree::tree(properties, long);
    text += "\n";
    text += &table::dofs(properties);
    text += "\n";
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
    let kinds = tally(robot.joints.iter().map(joint_type));
    let kinds = kinds.iter().map(|(kind, n)| format!("{n} {kind}"));
    line("Joints", with_kinds(robot.joints.len(), kinds));
    let coords = count(properties.coords(), "coordinate");
    line("Dofs", format!("{}, {coords}", properties.dofs()));
    line("Mass", format!("{} kg", short(properties.mass())));
    let shapes = robot.links.iter().flat_map(|link| &link.collisions);
    let kinds = tally(shapes.map(|collision| Shape::kind(&collision.shape)));
    let all = kinds.iter().map(|(_, count)| count).sum();
    let kinds = kinds.iter().map(|(kind, n)| match (*kind, n) {
        ("box" | "mesh", 2..) => format!("{n} {kind}es"),
        _ => count(*n, kind),
    });
    let mut shapes = with_kinds(all, kinds);
    if all == 0 {
        shapes += ", so the picture shows the frames of the links";
    }
    line("Collisions", shapes);
    text
}

/// How often each word comes, in the order in which they come first.
fn tally<'a>(words: impl Iterator<Item = &'a str>) -> Vec<(&'a str, usize)> {
    let mut found: Vec<(&str, usize)> = Vec::new();
    for word in words {
        match found.iter_mut().find(|(other, _)| *other == word) {
            Some((_, count)) => *count += 1,
            None => found.push((word, 1)),
        }
    }
    found
}

fn with_kinds(all: usize, kinds: impl Iterator<Item = String>) -> String {
    let kinds: Vec<String> = kinds.collect();
    match kinds.len() {
        0 => all.to_string(),
        _ => format!("{all}: {}", kinds.join(", ")),
    }
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
