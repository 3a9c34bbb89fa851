//! The table of dofs.

use sim_model::{Joint, JointDof, JointKind, Robot};

use super::properties::{Properties, short, unit};
use super::wrap::wrapped;

/// What stands where a limit is not given.
const NONE: &str = "-";

/// Numbers that a dof may lack: heading, and the value of a joint's dof.
type Column = (&'static str, fn(&Joint, &JointDof) -> Option<f64>);

const COLUMNS: [Column; 5] = [
    ("effort", |_, dof| dof.effort_limit),
    ("velocity", |joint, _| joint.velocity_limit),
    ("damping", |_, dof| some(dof.damping)),
    ("friction", |_, dof| some(dof.friction)),
    ("armature", |_, dof| some(dof.armature)),
];

fn some(value: f64) -> Option<f64> {
    (value != 0.0).then_some(value)
}

/// Dofs in order, with the names that a simulation has for them; below, what follows what.
pub(super) fn dofs(properties: &Properties) -> String {
    let robot = properties.robot;
    let names = robot.dof_names();
    if names.is_empty() {
        return "Dofs\n  none: nothing moves\n".to_owned();
    }
    let dofs: Vec<(&Joint, &JointDof)> = robot
        .moving_joints()
        .into_iter()
        .map(|index| &robot.joints[index])
        .flat_map(|joint| joint.dofs.iter().map(move |dof| (joint, dof)))
        .collect();
    // damping that grows with the speed is shown at rest, also where it is 0 there
    let grows = robot.precompiled.as_ref().is_some_and(|parts| {
        let mut joints = parts.joints.iter();
        joints.any(|joint| joint.damping_curves != [[0.0; 2]; 6])
    });
    let (given, absent): (Vec<Column>, Vec<Column>) =
        COLUMNS.into_iter().partition(|(heading, value)| {
            let is_given = dofs.iter().any(|(joint, dof)| value(joint, dof).is_some());
            is_given || (grows && *heading == "damping")
        });
    let mut rows = vec![heading(&given)];
    for (index, ((joint, dof), name)) in dofs.iter().zip(&names).enumerate() {
        let range = joint.range.map(|range| range.map(short));
        let [low, high] = range.unwrap_or([NONE, NONE].map(str::to_owned));
        let mut row = vec![
            index.to_string(),
            format!("{}/{name}", robot.name),
            low,
            high,
        ];
        row.push(dof_unit(joint, name).to_owned());
        row.extend(given.iter().map(|(heading, value)| {
            // no damping is 0; no limit is none
            let none = if ["effort", "velocity"].contains(heading) {
                NONE
            } else {
                "0"
            };
            value(joint, dof).map_or(none.to_owned(), short)
        }));
        rows.push(row);
    }
    let mut text =
        "Dofs (turns in rad, rad/s, N·m, N·m·s/rad, kg·m²; slides in m, m/s, N, N·s/m, kg)\n"
            .to_owned();
    text += &aligned(&rows, &[1, 4], Some(4));
    if !absent.is_empty() {
        let absent: Vec<&str> = absent.iter().map(|(heading, _)| *heading).collect();
        let (last, rest) = absent.split_last().expect("one at least");
        let all = match rest {
            [] => (*last).to_owned(),
            _ => format!("{} or {last}", rest.join(", ")),
        };
        text += &format!("  No dof has {}.\n", limits(&all));
    }
    text += &followers(robot);
    if robot.coord_names() != names {
        let coords = robot.coord_names().join(" ");
        text += &wrapped("  Coordinates: ", "    ", &coords);
    }
    text
}

/// Efforts and velocities are limits, the others are not.
fn limits(names: &str) -> String {
    names
        .replace("effort", "an effort limit")
        .replace("velocity", "a velocity limit")
}

fn heading(columns: &[Column]) -> Vec<String> {
    let fixed = ["#", "dof", "lower", "upper", ""].into_iter();
    fixed
        .chain(columns.iter().map(|(heading, _)| *heading))
        .map(str::to_owned)
        .collect()
}

/// Unit of a dof's position.
fn dof_unit(joint: &Joint, name: &str) -> &'static str {
    let part = name.strip_prefix(joint.name.as_str()).unwrap_or_default();
    match joint.kind {
        JointKind::Planar if part != ".angle" => "m",
        JointKind::Free if part.starts_with(".v") => "m",
        kind => unit(kind),
    }
}

/// What mimic joints follow, a line each.
fn followers(robot: &Robot) -> String {
    let mut text = String::new();
    for index in robot.moving_joints() {
        let joint = &robot.joints[index];
        if let Some(mimic) = &joint.mimic {
            let leader = &robot.joints[mimic.joint].name;
            let offset = match mimic.offset {
                0.0 => String::new(),
                offset if offset < 0.0 => format!(" - {}", short(-offset)),
                offset => format!(" + {}", short(offset)),
            };
            let factor = short(mimic.multiplier);
            let line = format!("{} = {factor} · {leader}{offset}", joint.name);
            text += &wrapped("  Mimic: ", "    ", &line);
        }
    }
    text
}

/// Rows in columns two spaces apart, the unit nearer: some columns to the left, numbers to the right.
pub(super) fn aligned(rows: &[Vec<String>], left: &[usize], unit: Option<usize>) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..rows[0].len()).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (column, (cell, &width)) in row.iter().zip(&widths).enumerate() {
            // a unit belongs to the number before it
            let gap = if unit == Some(column) { 1 } else { 2 };
            let fill = " ".repeat(width - cell.chars().count());
            line += &" ".repeat(gap);
            if left.contains(&column) {
                line += cell;
                line += &fill;
            } else {
                line += &fill;
                line += cell;
            }
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}
