//! What a model has, by names and numbers: also of models that cannot run, for reports.

use std::path::Path;

use super::format::ModelFile;
use super::names::names;
use super::pairs;
use super::refusals::refusals;
use super::tendons::spatial_tendons;
use crate::error::ModelError;

/// What a model has, in MuJoCo's words and order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MujocoContents {
    /// Its name; empty where the file has none.
    pub name: String,
    /// Version of MuJoCo that compiled it.
    pub version: String,
    /// What keeps it from running, a sentence each.
    pub refused: Vec<String>,
    /// Integrator, solver, cone, and the flags that are set against their defaults.
    pub options: Vec<String>,
    /// Duration of a step [s].
    pub timestep: f64,
    /// Mass of all bodies [kg].
    pub mass: f64,
    /// Degrees of freedom, and coordinates.
    pub dofs: [usize; 2],
    /// Bodies, the world first.
    pub bodies: Vec<String>,
    /// Bodies that clients place.
    pub mocaps: Vec<String>,
    /// Joints.
    pub joints: Vec<MujocoElement>,
    /// Geoms; active are those that may touch.
    pub geoms: Vec<MujocoElement>,
    /// Sites.
    pub sites: Vec<String>,
    /// Tendons.
    pub tendons: Vec<MujocoElement>,
    /// Equalities; active are those that are at the start.
    pub equalities: Vec<MujocoElement>,
    /// Actuators, with the range of their control.
    pub actuators: Vec<MujocoElement>,
    /// Sensors.
    pub sensors: Vec<MujocoElement>,
    /// Keyframes.
    pub keyframes: Vec<String>,
}

/// A named part of a model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MujocoElement {
    /// Its name; its kind and number if it has none.
    pub name: String,
    /// Its kind, in MJCF's word.
    pub kind: String,
    /// What it acts on or measures, kind and name.
    pub on: Vec<String>,
    /// Its range, if it is limited.
    pub range: Option<[f64; 2]>,
    /// The range of its force, if that is limited [N or N·m].
    pub force_range: Option<[f64; 2]>,
    /// Scalars that it shows.
    pub scalars: usize,
    /// Does it take part?
    pub is_active: bool,
}

impl MujocoContents {
    /// Reads what a model has.
    ///
    /// # Errors
    /// A file that is missing, broken or of another version.
    pub fn read(path: impl AsRef<Path>) -> Result<MujocoContents, ModelError> {
        let file = ModelFile::read(path.as_ref())?;
        let bodies = file.rows("body_parentid");
        let body_names = names(&file, "body", bodies)?;
        let mocaps = file.integers("body_mocapid", bodies)?;
        let mocaps = mocaps.iter().zip(&body_names);
        let mocaps = mocaps.filter(|(place, _)| **place >= 0);
        let first = |array: &str| -> Result<String, ModelError> {
            let texts = if file.has(array) {
                file.texts(array)?
            } else {
                Vec::new()
            };
            Ok(texts.into_iter().next().unwrap_or_default())
        };
        let mut options = Vec::new();
        for option in ["opt.integrator", "opt.solver", "opt.cone"] {
            options.push(word(&first(option)?));
        }
        let flags = file.texts("opt.flags")?;
        let flags = flags.iter().map(|flag| match flag.starts_with("mjDSBL_") {
            true => format!("no {}", word(flag)),
            false => word(flag),
        });
        options.extend(flags);
        Ok(MujocoContents {
            name: first("names.model")?,
            version: first("mujoco_version")?,
            refused: refusals(&file)?,
            options,
            timestep: file.real("opt.timestep")?,
            mass: file.reals("body_mass", bodies)?.iter().sum(),
            dofs: ["dof_armature", "qpos0"].map(|array| file.rows(array)),
            mocaps: mocaps.map(|(_, name)| name.clone()).collect(),
            bodies: body_names,
            joints: joints(&file)?,
            geoms: geoms(&file)?,
            sites: named(&file, "site", "site_bodyid")?,
            tendons: tendons(&file)?,
            equalities: equalities(&file)?,
            actuators: actuators(&file)?,
            sensors: sensors(&file)?,
            keyframes: names(&file, "key", file.rows("key_time"))?,
        })
    }
}

/// Names of all elements of a kind, as many as an array has rows; older files have none for some kinds.
fn named(file: &ModelFile, kind: &str, array: &str) -> Result<Vec<String>, ModelError> {
    let count = file.rows(array);
    match file.has(&format!("names.{kind}")) {
        true => names(file, kind, count),
        false => Ok((0..count).map(|k| format!("{kind}{k}")).collect()),
    }
}

/// The word of an enumerator: `hinge` of `mjJNT_HINGE`.
fn word(member: &str) -> String {
    member
        .split_once('_')
        .map_or(member, |(_, word)| word)
        .to_lowercase()
}

/// Elements by their names and kinds.
fn elements(names: Vec<String>, kinds: impl IntoIterator<Item = String>) -> Vec<MujocoElement> {
    let named = names.into_iter().zip(kinds);
    let all = named.map(|(name, kind)| MujocoElement {
        name,
        kind,
        is_active: true,
        ..MujocoElement::default()
    });
    all.collect()
}

fn read(file: &ModelFile, kind: &str, types: &str) -> Result<Vec<MujocoElement>, ModelError> {
    let count = file.rows(types);
    let kinds = file.kinds(types, count)?;
    Ok(elements(
        names(file, kind, count)?,
        kinds.iter().map(|kind| word(kind)),
    ))
}

/// Ranges of elements that are limited.
fn ranges(
    file: &ModelFile,
    limited: &str,
    range: &str,
    count: usize,
) -> Result<Vec<Option<[f64; 2]>>, ModelError> {
    let limited = file.integers(limited, count)?.into_iter();
    let all = limited.zip(file.vectors::<2>(range, count)?);
    Ok(all
        .map(|(limited, range)| (limited != 0).then_some(range))
        .collect())
}

fn joints(file: &ModelFile) -> Result<Vec<MujocoElement>, ModelError> {
    let mut all = read(file, "joint", "jnt_type")?;
    let ranges = ranges(file, "jnt_limited", "jnt_range", all.len())?;
    for (joint, range) in all.iter_mut().zip(ranges) {
        joint.range = range;
    }
    Ok(all)
}

fn geoms(file: &ModelFile) -> Result<Vec<MujocoElement>, ModelError> {
    let mut all = read(file, "geom", "geom_type")?;
    let count = all.len();
    let bodies = file.rows("body_parentid");
    let body_names = names(file, "body", bodies)?;
    let bodies = file.indices("geom_bodyid", count, bodies)?;
    let contypes = file.integers("geom_contype", count)?;
    let conaffinities = file.integers("geom_conaffinity", count)?;
    let paired = pairs::paired(file, count)?;
    for (place, geom) in all.iter_mut().enumerate() {
        geom.is_active = contypes[place] != 0 || conaffinities[place] != 0 || paired[place];
        let body = bodies[place].map(|body| format!("body {}", body_names[body]));
        geom.on.extend(body);
    }
    Ok(all)
}

fn tendons(file: &ModelFile) -> Result<Vec<MujocoElement>, ModelError> {
    let kinds = spatial_tendons(file)?.into_iter();
    let kinds = kinds.map(|is_spatial| if is_spatial { "spatial" } else { "fixed" }.to_owned());
    let count = file.rows("tendon_num");
    let mut all = elements(names(file, "tendon", count)?, kinds);
    let ranges = ranges(file, "tendon_limited", "tendon_range", count)?;
    for (tendon, range) in all.iter_mut().zip(ranges) {
        tendon.range = range;
    }
    Ok(all)
}

fn equalities(file: &ModelFile) -> Result<Vec<MujocoElement>, ModelError> {
    let mut all = read(file, "equality", "eq_type")?;
    let count = all.len();
    let active = file.integers("eq_active0", count)?;
    let objects = Objects::read(file)?;
    let named = match file.has("eq_objtype") {
        true => file.kinds("eq_objtype", count)?,
        false => vec![String::new(); count],
    };
    let ids = [
        file.integers("eq_obj1id", count)?,
        file.integers("eq_obj2id", count)?,
    ];
    for (place, equality) in all.iter_mut().enumerate() {
        equality.is_active = active[place] != 0;
        let kind = match equality.kind.as_str() {
            "joint" | "tendon" => equality.kind.clone(),
            _ => word(&named[place]),
        };
        let both = ids.iter();
        let both = both.filter_map(|ids| objects.kind_and_name(&kind, ids[place]));
        equality.on = both.collect();
    }
    Ok(all)
}

fn actuators(file: &ModelFile) -> Result<Vec<MujocoElement>, ModelError> {
    let count = file.rows("actuator_trntype");
    let kinds = laws(file, count)?;
    let mut all = elements(names(file, "actuator", count)?, kinds);
    let objects = Objects::read(file)?;
    let transmissions = file.kinds("actuator_trntype", count)?;
    let targets = file.vectors_of_integers::<2>("actuator_trnid", count)?;
    let control = ranges(file, "actuator_ctrllimited", "actuator_ctrlrange", count)?;
    let force = ranges(file, "actuator_forcelimited", "actuator_forcerange", count)?;
    for (place, actuator) in all.iter_mut().enumerate() {
        let kind = match word(&transmissions[place]).as_str() {
            "jointinparent" => "joint".to_owned(),
            "slidercrank" => "site".to_owned(),
            other => other.to_owned(),
        };
        let named = targets[place].iter();
        actuator.on = named
            .filter_map(|&id| objects.kind_and_name(&kind, id))
            .collect();
        actuator.range = control[place];
        actuator.force_range = force[place];
    }
    Ok(all)
}

/// MJCF's word for what each actuator does with its control; `general` where there is none.
fn laws(file: &ModelFile, count: usize) -> Result<Vec<String>, ModelError> {
    let dynamics = file.kinds("actuator_dyntype", count)?;
    let gains = file.kinds("actuator_gaintype", count)?;
    let biases = file.kinds("actuator_biastype", count)?;
    let gain = file.first_columns::<3>("actuator_gainprm", count)?;
    let bias = file.first_columns::<3>("actuator_biasprm", count)?;
    let all = (0..count).map(|k| {
        let [constant, length, velocity] = bias[k];
        let parts = (dynamics[k].as_str(), gains[k].as_str(), biases[k].as_str());
        let word = match parts {
            ("mjDYN_MUSCLE", ..) | (_, "mjGAIN_MUSCLE", _) => "muscle",
            ("mjDYN_NONE", "mjGAIN_FIXED", "mjBIAS_NONE") => "motor",
            (dynamics, "mjGAIN_FIXED", "mjBIAS_AFFINE") if constant == 0.0 => match dynamics {
                "mjDYN_INTEGRATOR" if length == -gain[k][0] => "intvelocity",
                "mjDYN_INTEGRATOR" => "general",
                _ if length != 0.0 && length == -gain[k][0] => "position",
                _ if length == 0.0 && velocity == -gain[k][0] => "velocity",
                _ => "general",
            },
            _ => "general",
        };
        word.to_owned()
    });
    Ok(all.collect())
}

fn sensors(file: &ModelFile) -> Result<Vec<MujocoElement>, ModelError> {
    // older files have none of their arrays
    if !file.has("sensor_type") {
        return Ok(Vec::new());
    }
    let mut all = read(file, "sensor", "sensor_type")?;
    let count = all.len();
    let objects = Objects::read(file)?;
    let kinds = file.kinds("sensor_objtype", count)?;
    let ids = file.integers("sensor_objid", count)?;
    let scalars = file.integers("sensor_dim", count)?;
    for (place, sensor) in all.iter_mut().enumerate() {
        sensor
            .on
            .extend(objects.kind_and_name(&word(&kinds[place]), ids[place]));
        sensor.scalars = usize::try_from(scalars[place]).unwrap_or(0);
    }
    Ok(all)
}

/// Names of what elements refer to, by their kinds.
struct Objects([(&'static str, Vec<String>); 6]);

impl Objects {
    fn read(file: &ModelFile) -> Result<Objects, ModelError> {
        let names_of_kind = |kind: &'static str, array: &str| -> Result<_, ModelError> {
            Ok((kind, named(file, kind, array)?))
        };
        Ok(Objects([
            names_of_kind("body", "body_parentid")?,
            names_of_kind("joint", "jnt_type")?,
            names_of_kind("geom", "geom_type")?,
            names_of_kind("site", "site_bodyid")?,
            names_of_kind("tendon", "tendon_num")?,
            names_of_kind("actuator", "actuator_trntype")?,
        ]))
    }

    /// Kind and name of one of them, if it has a name.
    fn kind_and_name(&self, kind: &str, id: i64) -> Option<String> {
        let kind = if kind == "xbody" { "body" } else { kind };
        let (kind, names) = self.0.iter().find(|(other, _)| *other == kind)?;
        let name = names.get(usize::try_from(id).ok()?)?;
        Some(format!("{kind} {name}"))
    }
}
