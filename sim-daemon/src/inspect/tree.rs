//! The tree of links, with the joint, the mass and the shapes of each.
//!
//! An only child stands below its parent in the same column, so that a long chain stays narrow; several are indented.

use std::path::Path;

use sim_model::{Collision, Joint, JointKind, Link, Pose, Shape, principal_moments};

use super::properties::{Properties, axis, count, rounded, short, triple, unit};
use super::wrap::{COLUMNS, NO_BREAK, wrapped};
use crate::config::paths::relative_to;

/// Widest column of names; longer ones push what follows to the right.
const NAMES_MAX: usize = 44;
/// Widest branch; below it the drawing grows no more to the right, so that it stays bounded.
const BRANCH_MAX: usize = 120;
/// Digits of a position are tenths of a millimetre [m].
const TENTH: f64 = 1e-4;

/// The tree of a robot.
pub(super) fn tree(properties: &Properties, long: bool) -> String {
    let rows = rows(properties);
    let names = rows.iter().map(|row| row.width(properties));
    let column = names.filter(|&width| width <= NAMES_MAX).max().unwrap_or(0) + 3;
    let mut text = String::new();
    for row in &rows {
        text += &link(properties, row, column, long);
    }
    text
}

/// A link's place in the drawing.
struct Row {
    link: usize,
    /// What stands before its name, and before the lines below it.
    first: String,
    next: String,
}

impl Row {
    /// Letters of the branch and the name.
    fn width(&self, properties: &Properties) -> usize {
        self.first.chars().count() + 2 + properties.robot.links[self.link].name.chars().count()
    }
}

/// Links in body order. Without recursion: a chain may be longer than a stack is deep.
fn rows(properties: &Properties) -> Vec<Row> {
    let mut rows = Vec::new();
    // link, what stands before it, and what stands before what follows its subtree
    let mut stack: Vec<(usize, String, String)> = (properties.order.first())
        .map(|&root| (root, String::new(), String::new()))
        .into_iter()
        .collect();
    while let Some((link, first, below)) = stack.pop() {
        let children = &properties.children[link];
        let next = match children.len() {
            0 => format!("{below} "),
            _ => format!("{below}│"),
        };
        let wide = below.chars().count() > BRANCH_MAX;
        if let [only] = children[..] {
            stack.push((only, below.clone(), below));
        } else {
            for (place, &child) in children.iter().enumerate().rev() {
                let (branch, bar) = if place + 1 < children.len() {
                    ("├─", "│ ")
                } else {
                    ("└─", "  ")
                };
                let bar = if wide { "" } else { bar };
                stack.push((child, format!("{below}{branch}"), format!("{below}{bar}")));
            }
        }
        rows.push(Row { link, first, next });
    }
    rows
}

fn link(properties: &Properties, row: &Row, column: usize, long: bool) -> String {
    let link = &properties.robot.links[row.link];
    let merged = properties.merged_into(row.link);
    let dot = if merged.is_some() { '○' } else { '●' };
    let joints: Vec<String> = properties
        .joints(row.link)
        .map(|joint| above(joint, merged))
        .collect();
    let joint = match joints.len() {
        0 => "fixed to the world".to_owned(),
        _ => joints.join("; "),
    };
    let name = format!("{}{dot} {}", row.first, link.name);
    let mut text = if name.chars().count().max(column) + joint.chars().count() <= COLUMNS {
        let gap = column.saturating_sub(name.chars().count()).max(3);
        format!("{name}{}{joint}\n", " ".repeat(gap))
    } else {
        let next = format!("{}  ", row.next);
        format!("{name}\n") + &wrapped(&format!("{next}  "), &format!("{next}    "), &joint)
    };
    let next = format!("{}   ", row.next);
    for detail in details(properties, link, properties.joint(row.link), long) {
        text += &wrapped(&next, &format!("{next}  "), &detail);
    }
    text
}

/// The joint above a link, in a line.
fn above(joint: &Joint, merged: Option<&str>) -> String {
    let mut text = format!("{}: ", joint.name);
    text += &motion(joint.kind, &axis(joint.axis), joint.range.is_some());
    if joint.kind == JointKind::Free {
        text += " in the world";
    }
    if let Some([low, high]) = joint.range {
        text += &format!(", {} to {} {}", short(low), short(high), unit(joint.kind));
    }
    if joint.kind == JointKind::Prismatic && joint.range.is_none() {
        text += ", no limits";
    }
    if joint.mimic.is_some() {
        text += ", mimic";
    }
    if let Some(merged) = merged {
        text += &format!(", part of {merged}");
    }
    text
}

fn details(properties: &Properties, link: &Link, joint: Option<&Joint>, long: bool) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(joint) = joint.filter(|joint| long && joint.parent.is_some()) {
        lines.push(format!("joint frame {}", place(&joint.origin)));
    }
    match &link.inertial {
        None => lines.push("no mass".to_owned()),
        Some(inertial) => {
            let mass = short(inertial.mass);
            lines.push(format!("{mass} kg at {} m", triple(inertial.pos, TENTH)));
            if long {
                let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = inertial.inertia;
                let entries = [
                    ("xx", xx),
                    ("yy", yy),
                    ("zz", zz),
                    ("xy", xy),
                    ("xz", xz),
                    ("yz", yz),
                ]
                .map(|(name, value)| format!("{name} {}", rounded(value, 5)));
                lines.push(format!("inertia {} kg·m²", entries.join(", ")));
                let moments = principal_moments(inertial.inertia).map(|m| rounded(m, 5));
                lines.push(format!("principal moments {} kg·m²", moments.join(", ")));
            }
        }
    }
    for collision in &link.collisions {
        let mut line = shape(properties, collision);
        if long {
            line += &format!(", {}", place(&collision.pose));
        }
        lines.push(line);
    }
    lines
}

/// A frame in the frame above it.
fn place(pose: &Pose) -> String {
    let mut text = format!("at {} m", triple(pose.pos, TENTH));
    if pose.quat != Pose::identity().quat {
        let quat = pose.quat.map(|part| short((part * 1e5).round() * 1e-5));
        text += &format!(", quaternion ({})", quat.join(", "));
    }
    text
}

/// A collision shape and its sizes.
fn shape(properties: &Properties, collision: &Collision) -> String {
    // a size stays in one line
    let edges = |edges: [f64; 3]| {
        let edges = edges.map(|edge| rounded(edge, 4));
        format!("{} m", edges.join(" × ")).replace(' ', NO_BREAK)
    };
    let mut text = match &collision.shape {
        Shape::Plane => "plane".to_owned(),
        Shape::Box { half_extents } => {
            format!("box {}", edges(half_extents.map(|half| 2.0 * half)))
        }
        Shape::Sphere { radius } => format!("sphere of radius {} m", short(*radius)),
        Shape::Cylinder {
            radius,
            half_height,
        } => format!(
            "cylinder of radius {} m, height {} m",
            short(*radius),
            short(2.0 * half_height)
        ),
        Shape::Capsule {
            radius,
            half_height,
        } => format!(
            "capsule of radius {} m, height {} m between its half spheres",
            short(*radius),
            short(2.0 * half_height)
        ),
        Shape::Ellipsoid { radii } => format!("ellipsoid of radii {}", edges(*radii)),
        Shape::HeightField(field) => {
            let [low, high] = field.range();
            let [x, y] = field.half.map(|half| short(2.0 * half));
            format!(
                "height field of {} × {} samples over {x} × {y} m, {} to {} m high",
                field.rows,
                field.columns,
                short(low),
                short(high)
            )
        }
        Shape::Mesh(mesh) => {
            // meshes of a MuJoCo model have names instead of files
            let file = match &properties.robot.urdf {
                None => mesh.path.clone(),
                Some(urdf) => relative_to(urdf.parent().unwrap_or(Path::new("")), &mesh.path),
            };
            let [low, high] = mesh.triangles.extent();
            let size = edges([0, 1, 2].map(|axis| high[axis] - low[axis]));
            let facets = count(mesh.triangles.triangles.len(), "triangle");
            let closed = if mesh.closed { "closed" } else { "open" };
            let corners = || mesh.hulls.iter().map(|hull| hull.vertices.len());
            let (least, most) = (corners().min().unwrap_or(0), corners().max().unwrap_or(0));
            let hulls = match mesh.hulls.len() {
                1 => format!("hull of {most} vertices"),
                several => format!("{several} hulls of {least} to {most} vertices"),
            };
            let file = file.display();
            let mut text = format!("mesh {file}: {size}, {facets}, {closed}, {hulls}");
            if mesh.scale != [1.0; 3] {
                text += &format!(", scale {}", mesh.scale.map(short).join(" "));
            }
            text
        }
    };
    if let Some(name) = collision.name.as_deref().filter(|name| !name.is_empty()) {
        text += &format!(", `{name}`");
    }
    text
}

/// What a joint lets its link do.
fn motion(kind: JointKind, axis: &str, limited: bool) -> String {
    match kind {
        JointKind::Fixed => "fixed".to_owned(),
        JointKind::Revolute if limited => format!("revolute about {axis}"),
        JointKind::Revolute => format!("continuous about {axis}"),
        JointKind::Prismatic => format!("prismatic along {axis}"),
        JointKind::Ball => "spherical".to_owned(),
        JointKind::Planar => format!("planar across {axis}"),
        JointKind::Free => "floating".to_owned(),
    }
}
