//! What a model has that the physics does not: each by the name of its element.

use super::actuators::laws;
use super::actuators::motors::Motors;
use super::actuators::muscles::Muscles;
use super::format::ModelFile;
use super::names::names;
use super::options::{OVERRIDE, contact_override, has_flag};
use super::pairs;
use super::plasticity;
use super::reflected::{self, Driven};
use crate::error::ModelError;
use crate::softness::POWER_MAX;

/// Flags of `<option>` that are supported. All others are refused, also those that a newer MuJoCo brings.
const FLAGS: &[&str] = &[
    "mjENBL_ENERGY",
    "mjENBL_FWDINV",
    OVERRIDE,
    "mjDSBL_CONSTRAINT",
    "mjDSBL_EQUALITY",
    "mjDSBL_FRICTIONLOSS",
    "mjDSBL_LIMIT",
    "mjDSBL_CONTACT",
    "mjDSBL_SPRING",
    "mjDSBL_DAMPER",
    "mjDSBL_GRAVITY",
    "mjDSBL_CLAMPCTRL",
    "mjDSBL_WARMSTART",
    "mjDSBL_FILTERPARENT",
    "mjDSBL_ACTUATION",
    "mjDSBL_REFSAFE",
    "mjDSBL_SENSOR",
    "mjDSBL_MIDPHASE",
    "mjDSBL_EULERDAMP",
    "mjDSBL_AUTORESET",
    "mjDSBL_NATIVECCD",
    "mjDSBL_ISLAND",
    "mjDSBL_MULTICCD",
];

/// Most reasons in a message.
const LISTED_MAX: usize = 8;

/// Reasons in one message, the first few of many, and the cure.
pub(super) fn listed(reasons: &[String]) -> String {
    let mut text = reasons[..reasons.len().min(LISTED_MAX)].join("; ");
    if reasons.len() > LISTED_MAX {
        text += &format!("; and {} more", reasons.len() - LISTED_MAX);
    }
    text += "; remove what is named from the model";
    // flexes and plugins cannot be left out
    if reasons.iter().any(|reason| !reason.starts_with("model: ")) {
        text += ", or give its name in `without` of `from_mujoco`";
    }
    text
}

/// Everything that keeps a model from running, a sentence each.
///
/// # Errors
/// A file that lacks arrays.
pub(super) fn refusals(file: &ModelFile) -> Result<Vec<String>, ModelError> {
    let mut refused = Vec::new();
    options(file, &mut refused)?;
    joints(file, &mut refused)?;
    geoms(file, &mut refused)?;
    pairs::refuse(file, &mut refused)?;
    equalities(file, &mut refused)?;
    tendons(file, &mut refused)?;
    actuators(file, &mut refused)?;
    adhesions(file, &mut refused)?;
    sticky(file, "geom", &mut refused)?;
    sticky(file, "pair", &mut refused)?;
    plasticity::refuse(file, &mut refused)?;
    Ok(refused)
}

/// A sentence about an element.
pub(super) fn no(kind: &str, name: &str, feature: &str) -> String {
    format!("{kind} `{name}`: no support for {feature}")
}

fn options(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    for flag in file.texts("opt.flags")? {
        if !FLAGS.contains(&flag.as_str()) {
            refused.push(no("option", "flag", &flag));
        }
    }
    let integrator = file.texts("opt.integrator")?;
    match integrator.first().map(String::as_str) {
        Some("mjINT_EULER" | "mjINT_IMPLICIT" | "mjINT_IMPLICITFAST" | "mjINT_RK4") => {}
        other => refused.push(format!(
            "option `integrator`: no support for {}, use Euler, implicit, implicitfast or RK4",
            other.unwrap_or("none")
        )),
    }
    if let Some(contact) = contact_override(file)? {
        refuse_power(refused, "option", "o_solimp", &contact.softness.solimp);
        if contact.margin < 0.0 {
            refused.push(no("option", "o_margin", "a negative margin"));
        }
    }
    for (counted, what) in [("nflex", "flexes"), ("nplugin", "plugins")] {
        if file.integer(counted)? > 0 {
            refused.push(format!("model: no support for {what}"));
        }
    }
    Ok(())
}

fn joints(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    let joints = file.rows("jnt_type");
    let names = names(file, "joint", joints)?;
    let kinds = file.kinds("jnt_type", joints)?;
    let firsts = file.integers("jnt_dofadr", joints)?;
    let dofs = file.rows("dof_armature");
    let bounded = file.integers("jnt_actfrclimited", joints)?;
    let limits = file.vectors::<5>("jnt_solimp", joints)?;
    let frictions = file.vectors::<5>("dof_solimp", dofs)?;
    for joint in 0..joints {
        let name = &names[joint];
        let (count, kind) = match kinds[joint].as_str() {
            "mjJNT_FREE" => (6, "a free joint"),
            "mjJNT_BALL" => (3, "a ball joint"),
            _ => (1, "a joint"),
        };
        let first = usize::try_from(firsts[joint]).unwrap_or(dofs).min(dofs);
        let joint_dofs = first..(first + count).min(dofs);
        if count > 1 && bounded[joint] != 0 {
            let bounds = format!("bounds of actuator forces of {kind}");
            refused.push(no("joint", name, &bounds));
        }
        let softness = std::iter::once(&limits[joint]).chain(&frictions[joint_dofs]);
        for solimp in softness {
            refuse_power(refused, "joint", name, solimp);
        }
    }
    Ok(())
}

fn geoms(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    let count = file.rows("geom_type");
    let names = names(file, "geom", count)?;
    let kinds = file.kinds("geom_type", count)?;
    let paired = pairs::paired(file, count)?;
    let contypes = file.integers("geom_contype", count)?;
    let conaffinities = file.integers("geom_conaffinity", count)?;
    let condims = file.integers("geom_condim", count)?;
    let solimps = file.vectors::<5>("geom_solimp", count)?;
    let bodies = file.rows("body_weldid");
    let welds = file.integers("body_weldid", bodies)?;
    let bodies = file.indices("geom_bodyid", count, bodies)?;
    for geom in 0..count {
        if contypes[geom] == 0 && conaffinities[geom] == 0 && !paired[geom] {
            continue; // touches nothing
        }
        let name = &names[geom];
        let moves = bodies[geom].is_some_and(|body| welds[body] != 0);
        let shape = match kinds[geom].as_str() {
            "mjGEOM_HFIELD" if moves => Some("height fields on bodies that move"),
            "mjGEOM_SDF" => Some("contacts of signed distance fields"),
            "mjGEOM_PLANE" if moves => Some("planes on bodies that move"),
            _ => None,
        };
        refused.extend(shape.map(|shape| no("geom", name, shape)));
        if !matches!(condims[geom], 1 | 3 | 4 | 6) {
            refused.push(no("geom", name, &format!("condim {}", condims[geom])));
        }
        refuse_power(refused, "geom", name, &solimps[geom]);
    }
    Ok(())
}

pub(super) fn refuse_power(refused: &mut Vec<String>, kind: &str, name: &str, solimp: &[f64; 5]) {
    let power = solimp[4];
    if power > POWER_MAX {
        let most = format!("a solimp with the power {power}, above {POWER_MAX}");
        refused.push(no(kind, name, &most));
    }
}

fn equalities(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    if has_flag(file, "mjDSBL_EQUALITY")? || has_flag(file, "mjDSBL_CONSTRAINT")? {
        return Ok(());
    }
    let count = file.rows("eq_type");
    let names = names(file, "equality", count)?;
    let kinds = file.kinds("eq_type", count)?;
    let solimps = file.vectors::<5>("eq_solimp", count)?;
    for k in 0..count {
        let problem = match kinds[k].as_str() {
            "mjEQ_JOINT" | "mjEQ_TENDON" | "mjEQ_CONNECT" | "mjEQ_WELD" => None,
            "mjEQ_DISTANCE" => Some("distance"),
            _ => Some("equalities of flexes"),
        };
        refused.extend(problem.map(|problem| no("equality", &names[k], problem)));
        refuse_power(refused, "equality", &names[k], &solimps[k]);
    }
    Ok(())
}

fn tendons(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    let count = file.rows("tendon_num");
    let names = names(file, "tendon", count)?;
    for which in ["lim", "fri"] {
        let solimps = file.vectors::<5>(&format!("tendon_solimp_{which}"), count)?;
        for (name, solimp) in names.iter().zip(&solimps) {
            refuse_power(refused, "tendon", name, solimp);
        }
    }
    // MuJoCo counts the first coordinate and the first dof of a joint, which is no length of a ball's turn
    let wraps = file.rows("wrap_type");
    let (kinds, objects) = (
        file.kinds("wrap_type", wraps)?,
        file.integers("wrap_objid", wraps)?,
    );
    let joint_kinds = file.kinds("jnt_type", file.rows("jnt_type"))?;
    let is_wide = |row: usize| {
        let joint = usize::try_from(objects[row])
            .ok()
            .and_then(|joint| joint_kinds.get(joint));
        kinds[row] == "mjWRAP_JOINT"
            && joint.is_some_and(|kind| !matches!(kind.as_str(), "mjJNT_SLIDE" | "mjJNT_HINGE"))
    };
    let firsts = file.integers("tendon_adr", count)?;
    let lengths = file.integers("tendon_num", count)?;
    let armatures = match file.has("tendon_armature") {
        true => file.reals("tendon_armature", count)?,
        false => vec![0.0; count],
    };
    let shares = reflected::shares(file, Driven::Tendon, count)?;
    for (k, name) in names.iter().enumerate() {
        let first = firsts[k].max(0);
        let rows =
            (first..first.saturating_add(lengths[k]).min(wraps as i64)).map(|row| row as usize);
        let rows: Vec<usize> = rows.collect();
        if rows.iter().copied().any(is_wide) {
            refused.push(no("tendon", name, "joints that are not of one dof"));
        }
        // as MuJoCo's compiler refuses it
        let bends =
            |&row: &usize| matches!(kinds[row].as_str(), "mjWRAP_SPHERE" | "mjWRAP_CYLINDER");
        let is_heavy = armatures[k] != 0.0 || shares[k].armature != 0.0;
        if is_heavy && rows.iter().any(bends) {
            refused.push(no("tendon", name, "armature where it bends around a geom"));
        }
    }
    Ok(())
}

/// Laws of actuators that are supported.
const DYNAMICS: &[&str] = &[
    "mjDYN_NONE",
    "mjDYN_INTEGRATOR",
    "mjDYN_FILTER",
    "mjDYN_FILTEREXACT",
    "mjDYN_MUSCLE",
    "mjDYN_DCMOTOR",
];
const GAINS: &[&str] = &[
    "mjGAIN_FIXED",
    "mjGAIN_AFFINE",
    "mjGAIN_MUSCLE",
    "mjGAIN_DCMOTOR",
];
const BIASES: &[&str] = &[
    "mjBIAS_NONE",
    "mjBIAS_AFFINE",
    "mjBIAS_MUSCLE",
    "mjBIAS_DCMOTOR",
];

fn actuators(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    let count = file.rows("actuator_trntype");
    let names = names(file, "actuator", count)?;
    let transmissions = file.kinds("actuator_trntype", count)?;
    let dynamics = file.kinds("actuator_dyntype", count)?;
    let gains = file.kinds("actuator_gaintype", count)?;
    let biases = file.kinds("actuator_biastype", count)?;
    let states = file.integers("actuator_actnum", count)?;
    let controls = file.integers_or("actuator_ctrlnum", count, 1)?;
    let outputs = file.integers_or("actuator_outnum", count, 1)?;
    let muscles = Muscles::read(file, count)?;
    let motors = Motors::read(file, count)?;
    for k in 0..count {
        let transmission = match transmissions[k].as_str() {
            "mjTRN_JOINT"
            | "mjTRN_JOINTINPARENT"
            | "mjTRN_TENDON"
            | "mjTRN_SITE"
            | "mjTRN_SLIDERCRANK"
            | "mjTRN_BODY" => None,
            other => Some(other),
        };
        let law = match (dynamics[k].as_str(), gains[k].as_str(), biases[k].as_str()) {
            (dynamics, ..) if !DYNAMICS.contains(&dynamics) => Some(dynamics),
            (_, gain, _) if !GAINS.contains(&gain) => Some(gain),
            (.., bias) => (!BIASES.contains(&bias)).then_some(bias),
        };
        let name = &names[k];
        refused
            .extend(transmission.map(|to| no("actuator", name, &format!("transmission to {to}"))));
        refused.extend(law.map(|law| no("actuator", name, law)));
        let is_muscle = gains[k] == "mjGAIN_MUSCLE" || biases[k] == "mjBIAS_MUSCLE";
        if is_muscle && !muscles.is_whole(k) {
            refused.push(no("actuator", name, "a muscle without a range of lengths"));
        }
        let motor = motors.refused(k).into_iter();
        refused.extend(motor.map(|what| no("actuator", name, what)));
        if controls[k] != 1 || outputs[k] != 1 || states[k] > 1 {
            let several = "another number of controls, outputs or activations than one";
            refused.push(no("actuator", name, several));
        }
    }
    Ok(())
}

/// What actuators that pull a body to its contacts cannot do.
fn adhesions(file: &ModelFile, refused: &mut Vec<String>) -> Result<(), ModelError> {
    let count = file.rows("actuator_trntype");
    let names = names(file, "actuator", count)?;
    let transmissions = file.kinds("actuator_trntype", count)?;
    let targets = file.vectors_of_integers::<2>("actuator_trnid", count)?;
    let laws = [laws(file, "gain", count)?, laws(file, "bias", count)?];
    for k in (0..count).filter(|&k| transmissions[k] == "mjTRN_BODY") {
        // how fast contacts part is known after the forces
        let follows = laws
            .iter()
            .any(|(kinds, factors)| kinds[k].ends_with("_AFFINE") && factors[k][2] != 0.0);
        let is = |law: &str| laws.iter().any(|(kinds, _)| kinds[k].ends_with(law));
        let wrong = [
            (targets[k][0] == 0, "adhesion of the world"),
            (follows, "adhesion by a force that depends on velocity"),
            (is("_MUSCLE"), "adhesion by a muscle"),
            (is("_DCMOTOR"), "adhesion by a DC motor"),
        ];
        let wrong = wrong.iter().filter(|(is_wrong, _)| *is_wrong);
        refused.extend(wrong.map(|(_, what)| no("actuator", &names[k], what)));
    }
    Ok(())
}

/// What contacts that pull cannot do.
fn sticky(file: &ModelFile, kind: &str, refused: &mut Vec<String>) -> Result<(), ModelError> {
    let array = format!("{kind}_adhesion");
    let count = file.rows(&array);
    let names = names(file, kind, count)?;
    // MuJoCo then drops the pull and keeps what balances it
    let is_off = has_flag(file, "mjDSBL_SPRING")? && has_flag(file, "mjDSBL_DAMPER")?;
    // and it drops both of an adhesion that was set after it compiled the model, but not its contacts in the gap
    let is_late = file.has("flg_adhesion") && file.integer("flg_adhesion")? == 0;
    for (name, force) in names.iter().zip(file.reals_or(&array, count, 0.0)?) {
        let wrong = [
            (force < 0.0, "a negative adhesion"),
            (
                force > 0.0 && is_off,
                "adhesion where springs and dampers are disabled",
            ),
            (
                force > 0.0 && is_late,
                "adhesion while the model's flg_adhesion is off",
            ),
        ];
        let wrong = wrong.iter().filter(|(is_wrong, _)| *is_wrong);
        refused.extend(wrong.map(|(_, what)| no(kind, name, what)));
    }
    Ok(())
}
