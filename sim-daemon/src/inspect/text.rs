//! The report as text.

use std::fmt::Write as _;
use std::path::Path;

use sim_model::geometry::HULL_NOTE;
use sim_model::{MujocoContents, Robot, Shape};

use super::properties::{Properties, count, kinds, short, tally, with_kinds};
use super::wrap::wrapped;
use super::{mujoco, table, tree};
use crate::config::joint_type;

/// Errors of hulls up to this need no line of their own [m]: contacts are as soft.
const SMALL_ERROR: f64 = 5e-3;

/// All there is to say of a robot, or of a model that MuJoCo compiled.
pub(super) fn document(
    properties: &Properties,
    contents: Option<&MujocoContents>,
    file: &Path,
    long: bool,
) -> String {
    let mut text = match contents {
        None => head(properties, file),
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
    text += &notes(properties, long);
    text
}

fn head(properties: &Properties, file: &Path) -> String {
    let robot = properties.robot;
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<10} {value}");
    };
    line("Robot", robot.name.clone());
    let file = robot.urdf.as_deref().unwrap_or(file);
    line("File", file.display().to_string());
    let base = match (robot.floating, properties.base().as_str()) {
        (true, _) => "moves freely".to_owned(),
        (false, "fixed base") => "fixed to the world".to_owned(),
        (false, base) => base.replace("fixed base", "fixed to the world"),
    };
    line("Base", base);
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
    let tallied = tally(robot.joints.iter().map(joint_type));
    let named = tallied.iter().map(|(kind, n)| format!("{n} {kind}"));
    line("Joints", with_kinds(robot.joints.len(), named));
    let coords = count(properties.coords(), "coordinate");
    line("Dofs", format!("{}, {coords}", properties.dofs()));
    line("Mass", format!("{} kg", short(properties.mass())));
    let shapes = robot.links.iter().flat_map(|link| &link.collisions);
    let tallied = tally(shapes.map(|collision| Shape::kind(&collision.shape)));
    let all = tallied.iter().map(|(_, count)| count).sum();
    let named = tallied.iter().map(|(kind, n)| kinds(*n, kind));
    let mut shapes = with_kinds(all, named);
    if all == 0 {
        shapes += ", so the picture shows the frames of the links";
    }
    line("Collisions", shapes);
    text
}

/// What was ignored or mended, warnings first; small errors of hulls in one line, unless it is to be long.
fn notes(properties: &Properties, long: bool) -> String {
    let robot = properties.robot;
    let mut text = "Ignored or mended\n".to_owned();
    let rest = robot
        .notes
        .iter()
        .filter(|note| !robot.warnings.contains(note));
    let small = small_hulls(robot);
    let is_small = |note: &str| small.iter().any(|(end, _)| note.ends_with(end));
    let (grouped, rest): (Vec<_>, Vec<_>) = rest.partition(|note| !long && is_small(note));
    let error = small
        .iter()
        .fold(0.0, |most: f64, (_, error)| most.max(*error));
    let (count, most) = (grouped.len(), format!("{:.1}", 1e3 * error));
    let group = (count > 1).then(|| {
        format!(
            "the convex hulls of {count} meshes leave out up to {most} mm of them; see --mesh-max-hull-vertices, and --long for each"
        )
    });
    let single = grouped.into_iter().filter(|_| count == 1);
    let all: Vec<(char, &String)> = (robot.warnings.iter().map(|warning| ('!', warning)))
        .chain(
            rest.into_iter()
                .chain(single)
                .chain(&group)
                .map(|note| ('-', note)),
        )
        .collect();
    if all.is_empty() {
        text += "  nothing\n";
    }
    for (mark, note) in all {
        text += &wrapped(&format!("  {mark} "), "    ", note);
    }
    text
}

/// How the notes on hulls end whose errors are small, with the errors [m].
fn small_hulls(robot: &Robot) -> Vec<(String, f64)> {
    let shapes = robot.links.iter().flat_map(|link| &link.collisions);
    let meshes = shapes.filter_map(|collision| match &collision.shape {
        Shape::Mesh(mesh) => Some(mesh),
        _ => None,
    });
    let errors = meshes.flat_map(|mesh| {
        let error = mesh
            .hulls
            .iter()
            .fold(0.0, |most: f64, hull| most.max(hull.error));
        let hull_notes = mesh.notes.iter().filter(|note| note.ends_with(HULL_NOTE));
        hull_notes.map(move |note| (format!("{} {note}", mesh.path.display()), error))
    });
    errors.filter(|(_, error)| *error <= SMALL_ERROR).collect()
}
