//! What MuJoCo models have beyond trees of links: actuators, sensors, tendons, equalities, keyframes, and what is refused.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};
use sim_model::{MujocoContents, MujocoElement};

use super::properties::{count, kinds, short, tally, with_kinds};
use super::table::aligned;
use super::wrap::wrapped;

/// What stands where there is nothing to say.
const NONE: &str = "-";

/// Numbers of what a model has.
pub(super) fn head(contents: &MujocoContents, name: &str, file: &Path) -> String {
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<10} {value}");
    };
    line("Model", name.to_owned());
    line("File", file.display().to_string());
    line("Compiler", format!("MuJoCo {}", contents.version));
    let options = contents.options.join(", ");
    line(
        "Options",
        format!("step of {} s, {options}", short(contents.timestep)),
    );
    line(
        "Bodies",
        format!("{}, the world included", contents.bodies.len()),
    );
    line("Joints", listed(&contents.joints));
    let [dofs, coords] = contents.dofs;
    line("Dofs", format!("{dofs}, {}", count(coords, "coordinate")));
    line("Mass", format!("{} kg", short(contents.mass)));
    let tallied = tally(contents.geoms.iter().map(|geom| geom.kind.as_str()));
    let named = tallied.iter().map(|(kind, n)| kinds(*n, kind));
    let touching = contents.geoms.iter().filter(|geom| geom.is_active).count();
    let geoms = with_kinds(contents.geoms.len(), named);
    line("Geoms", format!("{geoms}; {touching} may touch"));
    line("Actuators", listed(&contents.actuators));
    line("Sensors", contents.sensors.len().to_string());
    for (kind, elements) in [
        ("Tendons", &contents.tendons),
        ("Equalities", &contents.equalities),
    ] {
        if !elements.is_empty() {
            line(kind, listed(elements));
        }
    }
    for (kind, names) in [
        ("Mocap", &contents.mocaps),
        ("Keyframes", &contents.keyframes),
    ] {
        if !names.is_empty() {
            line(kind, with_kinds(names.len(), names.iter().cloned()));
        }
    }
    text
}

/// How many there are, of which kinds.
fn listed(elements: &[MujocoElement]) -> String {
    let tallied = tally(elements.iter().map(|element| element.kind.as_str()));
    let named = tallied.iter().map(|(kind, n)| format!("{n} {kind}"));
    with_kinds(elements.len(), named)
}

/// Tables of what a model has beyond its tree, each followed by an empty line; `name` is the model's.
pub(super) fn tables(contents: &MujocoContents, name: &str) -> String {
    let full_name = |element: &MujocoElement| format!("{name}/{}", element.name);
    let on = |element: &MujocoElement| match element.on.is_empty() {
        true => NONE.to_owned(),
        false => element.on.join(", "),
    };
    let mut text = String::new();
    let actuators = contents.actuators.iter().map(|actuator| {
        let ranges = [actuator.range, actuator.force_range].map(range);
        [full_name(actuator), actuator.kind.clone(), on(actuator)]
            .into_iter()
            .chain(ranges)
            .collect()
    });
    let heading = ["actuator", "kind", "on", "control", "force"];
    text += &table("Actuators (forces in N or N·m)", &heading, actuators);
    let mut first = 0;
    let sensors = contents.sensors.iter().map(|sensor| {
        let last = first + sensor.scalars;
        let columns = match sensor.scalars {
            0 => NONE.to_owned(),
            1 => first.to_string(),
            _ => format!("{first} to {}", last - 1),
        };
        first = last;
        vec![full_name(sensor), sensor.kind.clone(), on(sensor), columns]
    });
    let heading = ["sensor", "kind", "of", "columns"];
    text += &table("Sensors (columns of `sensordata`)", &heading, sensors);
    let tendons = contents.tendons.iter().map(|tendon| {
        let kind = tendon.kind.clone();
        vec![full_name(tendon), kind, range(tendon.range)]
    });
    text += &table("Tendons", &["tendon", "kind", "range"], tendons);
    let equalities = contents.equalities.iter().map(|equality| {
        let active = if equality.is_active { "yes" } else { "no" };
        let kind = equality.kind.clone();
        vec![full_name(equality), kind, on(equality), active.to_owned()]
    });
    let heading = ["equality", "kind", "of", "active"];
    text += &table("Equalities", &heading, equalities);
    text
}

/// Rows under a title and a heading, and an empty line; nothing where there is no row.
fn table(title: &str, heading: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let head = ["#"].iter().chain(heading).map(|&word| word.to_owned());
    let mut all = vec![head.collect()];
    all.extend(rows.enumerate().map(|(place, row)| {
        let place = std::iter::once(place.to_string());
        place.chain(row).collect::<Vec<_>>()
    }));
    if all.len() == 1 {
        return String::new();
    }
    let left: Vec<usize> = (1..all[0].len()).collect();
    format!("{title}\n{}\n", aligned(&all, &left, None))
}

fn range(range: Option<[f64; 2]>) -> String {
    range.map_or(NONE.to_owned(), |range| {
        let [low, high] = range.map(short);
        format!("{low} to {high}")
    })
}

/// What keeps a model from running.
pub(super) fn refused(contents: &MujocoContents) -> String {
    let mut text = "Refused\n".to_owned();
    for reason in &contents.refused {
        text += &wrapped("  ! ", "    ", reason);
    }
    text
}

/// A model as it was compiled: `version`, `refused`, `options`, `timestep`, `mass`, `bodies`, `mocaps`, `joints`, `geoms`,
/// `sites`, `tendons`, `equalities`, `actuators`, `sensors`, `keyframes`.
///
/// An element has `name`, `kind`, `on` (what it acts on or measures), `range`, `force_range`, `scalars` (columns of a sensor)
/// and `active` (whether a geom may touch, an equality holds at the start).
pub(super) fn json(contents: &MujocoContents) -> Value {
    let all = |elements: &[MujocoElement]| elements.iter().map(element).collect::<Value>();
    json!({
        "version": contents.version,
        "refused": contents.refused,
        "options": contents.options,
        "timestep": contents.timestep,
        "mass": contents.mass,
        "bodies": contents.bodies,
        "mocaps": contents.mocaps,
        "joints": all(&contents.joints),
        "geoms": all(&contents.geoms),
        "sites": contents.sites,
        "tendons": all(&contents.tendons),
        "equalities": all(&contents.equalities),
        "actuators": all(&contents.actuators),
        "sensors": all(&contents.sensors),
        "keyframes": contents.keyframes,
    })
}

fn element(element: &MujocoElement) -> Value {
    json!({
        "name": element.name,
        "kind": element.kind,
        "on": element.on,
        "range": element.range,
        "force_range": element.force_range,
        "scalars": element.scalars,
        "active": element.is_active,
    })
}
