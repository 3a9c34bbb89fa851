//! What a model has that the physics does not: each by the name of its element, and why.

use super::format::ModelFile;
use super::names::names;
use crate::error::ModelError;
use crate::softness::POWER_MAX;

/// Arrays in which any entry other than 0 stands for a feature that is not supported: the kind of element, the array, and the
/// feature.
const MUST_BE_ZERO: &[(&str, &str, &str)] = &[
    ("body", "body_gravcomp", "gravity compensation"),
    ("joint", "jnt_stiffnesspoly", "nonlinear stiffness"),
    (
        "joint",
        "jnt_actgravcomp",
        "gravity compensation by actuators",
    ),
    ("geom", "geom_adhesion", "adhesion"),
    ("geom", "geom_surfacevel", "surface velocity"),
    ("geom", "geom_fluid", "the ellipsoid fluid model"),
    ("tendon", "tendon_armature", "armature of a tendon"),
    ("tendon", "tendon_damping", "damping of a tendon"),
    ("tendon", "tendon_dampingpoly", "damping of a tendon"),
    ("tendon", "tendon_stiffness", "stiffness of a tendon"),
    ("tendon", "tendon_stiffnesspoly", "stiffness of a tendon"),
    ("tendon", "tendon_frictionloss", "dry friction of a tendon"),
    ("tendon", "tendon_limited", "limits of a tendon"),
    (
        "tendon",
        "tendon_actfrclimited",
        "bounds of the actuator force on a tendon",
    ),
    ("actuator", "actuator_delay", "delay of an actuator"),
    ("actuator", "actuator_armature", "armature of an actuator"),
    ("actuator", "actuator_damping", "damping of an actuator"),
    ("actuator", "actuator_dampingpoly", "damping of an actuator"),
    ("actuator", "actuator_actlimited", "bounds of an activation"),
];

/// Flags that are not supported.
const FLAGS: &[&str] = &[
    "mjENBL_OVERRIDE",
    "mjENBL_INVDISCRETE",
    "mjENBL_SLEEP",
    "mjENBL_DIAGEXACT",
    "mjENBL_IPC",
];

/// Most reasons in a message.
const LISTED_MAX: usize = 8;

/// Reasons in one message, the first few of many.
pub(super) fn listed(reasons: &[String]) -> String {
    let mut text = reasons[..reasons.len().min(LISTED_MAX)].join("; ");
    if reasons.len() > LISTED_MAX {
        text += &format!("; and {} more", reasons.len() - LISTED_MAX);
    }
    text
}

/// Everything that keeps a model from running, a sentence each.
///
/// # Errors
/// A file that lacks arrays.
pub(super) fn refusals(file: &ModelFile) -> Result<Vec<String>, ModelError> {
    let mut found = Vec::new();
    for (kind, array, feature) in MUST_BE_ZERO {
        if let Some(row) = file.first_set(array) {
            let names = names(file, kind, file.rows(array))?;
            found.push(format!(
                "{kind} `{}`: {feature} is not supported yet",
                names[row]
            ));
        }
    }
    options(file, &mut found)?;
    bodies(file, &mut found)?;
    geoms(file, &mut found)?;
    constraints(file, &mut found)?;
    actuators(file, &mut found)?;
    Ok(found)
}

fn options(file: &ModelFile, found: &mut Vec<String>) -> Result<(), ModelError> {
    for flag in file.texts("opt.flags")? {
        if FLAGS.contains(&flag.as_str()) {
            found.push(format!("option/flag: {flag} is not supported yet"));
        }
    }
    match file.texts("opt.integrator")?.first().map(String::as_str) {
        Some("mjINT_EULER" | "mjINT_IMPLICITFAST" | "mjINT_RK4") => {}
        other => found.push(format!(
            "option: the integrator {} is not supported; use Euler, implicitfast or RK4",
            other.unwrap_or("–")
        )),
    }
    if file.integer("opt.noslip_iterations")? > 0 {
        found.push("option: noslip_iterations is not supported; set it to 0".to_owned());
    }
    for medium in ["opt.density", "opt.viscosity"] {
        if file.real(medium)? != 0.0 {
            found.push(format!("{medium}: fluid forces are not supported yet"));
        }
    }
    for (counted, what) in [
        ("nflex", "flexes are"),
        ("nplugin", "plugins are"),
        ("npair", "contact pairs are"),
        ("nmocap", "mocap bodies are"),
    ] {
        if file.integer(counted)? > 0 {
            found.push(format!("{what} not supported yet"));
        }
    }
    Ok(())
}

fn bodies(file: &ModelFile, found: &mut Vec<String>) -> Result<(), ModelError> {
    let joints = file.rows("jnt_type");
    let joint_names = names(file, "joint", joints)?;
    let kinds = file.kinds("jnt_type", joints)?;
    let firsts = file.integers("jnt_dofadr", joints)?;
    let dofs = file.rows("dof_armature");
    let armatures = file.reals("dof_armature", dofs)?;
    let dampings = file.reals("dof_damping", dofs)?;
    let losses = file.reals("dof_frictionloss", dofs)?;
    let stiffness = file.reals("jnt_stiffness", joints)?;
    let limited = file.integers("jnt_limited", joints)?;
    let bounded = file.integers("jnt_actfrclimited", joints)?;
    if let Some(dof) = file.first_set("dof_dampingpoly") {
        found.push(format!("dof {dof}: nonlinear damping is not supported yet"));
    }
    for joint in 0..joints {
        let kind = kinds[joint].as_str();
        let count = match kind {
            "mjJNT_FREE" => 6,
            "mjJNT_BALL" => 3,
            _ => continue,
        };
        let name = &joint_names[joint];
        let mut refuse = |what: &str| {
            found.push(format!(
                "joint `{name}`: {what} of a ball or free joint is not supported yet"
            ));
        };
        let first = usize::try_from(firsts[joint]).unwrap_or(dofs).min(dofs);
        let own = first..(first + count).min(dofs);
        if stiffness[joint] != 0.0 {
            refuse("stiffness");
        }
        if limited[joint] != 0 {
            refuse("a limit");
        }
        if bounded[joint] != 0 {
            refuse("a bound of actuator forces");
        }
        let is_free = kind == "mjJNT_FREE";
        if is_free && armatures[own.clone()].iter().any(|&x| x != 0.0) {
            refuse("armature");
        }
        if is_free && dampings[own.clone()].iter().any(|&x| x != 0.0) {
            refuse("damping");
        }
        if losses[own].iter().any(|&x| x != 0.0) {
            refuse("dry friction");
        }
    }
    let softness = [("jnt_solimp", joints, "joint"), ("dof_solimp", dofs, "dof")];
    for (array, count, kind) in softness {
        for (row, solimp) in file.vectors::<5>(array, count)?.iter().enumerate() {
            refuse_power(found, &format!("{kind} {row}"), solimp[4]);
        }
    }
    Ok(())
}

fn geoms(file: &ModelFile, found: &mut Vec<String>) -> Result<(), ModelError> {
    let count = file.rows("geom_type");
    let geom_names = names(file, "geom", count)?;
    let kinds = file.kinds("geom_type", count)?;
    let contypes = file.integers("geom_contype", count)?;
    let conaffinities = file.integers("geom_conaffinity", count)?;
    let solimps = file.vectors::<5>("geom_solimp", count)?;
    for geom in 0..count {
        if contypes[geom] == 0 && conaffinities[geom] == 0 {
            continue; // touches nothing
        }
        let name = &geom_names[geom];
        let shape = match kinds[geom].as_str() {
            "mjGEOM_ELLIPSOID" => Some("ellipsoids"),
            "mjGEOM_HFIELD" => Some("height fields"),
            "mjGEOM_SDF" => Some("signed distance fields"),
            _ => None,
        };
        if let Some(shape) = shape {
            found.push(format!(
                "geom `{name}`: contacts of {shape} are not supported yet"
            ));
        }
        refuse_power(found, &format!("geom `{name}`"), solimps[geom][4]);
    }
    Ok(())
}

fn refuse_power(found: &mut Vec<String>, owner: &str, power: f64) {
    if power > POWER_MAX {
        found.push(format!(
            "{owner}: a solimp with the power {power} is not supported; use at most {POWER_MAX}"
        ));
    }
}

fn constraints(file: &ModelFile, found: &mut Vec<String>) -> Result<(), ModelError> {
    let count = file.rows("eq_type");
    let equality_names = names(file, "equality", count)?;
    let kinds = file.kinds("eq_type", count)?;
    let width = file.width("eq_data");
    let data = file.reals("eq_data", count * width)?;
    let seconds = file.integers("eq_obj2id", count)?;
    let active = file.integers("eq_active0", count)?;
    let solimps = file.vectors::<5>("eq_solimp", count)?;
    for equality in 0..count {
        let name = &equality_names[equality];
        let own = &data[equality * width..(equality + 1) * width];
        let problem = match kinds[equality].as_str() {
            "mjEQ_JOINT" if seconds[equality] < 0 => Some("one joint alone"),
            "mjEQ_JOINT"
                if own
                    .get(2..5)
                    .is_some_and(|rest| rest.iter().any(|&x| x != 0.0)) =>
            {
                Some("a polynomial beyond a line")
            }
            "mjEQ_JOINT" if active[equality] == 0 => Some("a start without it"),
            "mjEQ_JOINT" => None,
            "mjEQ_CONNECT" => Some("connect"),
            "mjEQ_WELD" => Some("weld"),
            "mjEQ_TENDON" => Some("a tendon"),
            _ => Some("this kind"),
        };
        if let Some(problem) = problem {
            found.push(format!("equality `{name}`: {problem} is not supported yet"));
        }
        refuse_power(found, &format!("equality `{name}`"), solimps[equality][4]);
    }
    let tendons = file.rows("tendon_num");
    let tendon_names = names(file, "tendon", tendons)?;
    let firsts = file.integers("tendon_adr", tendons)?;
    let counts = file.integers("tendon_num", tendons)?;
    let wraps = file.rows("wrap_type");
    let kinds = file.kinds("wrap_type", wraps)?;
    for tendon in 0..tendons {
        let own = firsts[tendon].max(0) as usize..(firsts[tendon] + counts[tendon]).max(0) as usize;
        let own = kinds.get(own).unwrap_or_default();
        if own.iter().any(|kind| kind != "mjWRAP_JOINT") {
            let name = &tendon_names[tendon];
            found.push(format!(
                "tendon `{name}`: spatial tendons are not supported yet"
            ));
        }
    }
    Ok(())
}

fn actuators(file: &ModelFile, found: &mut Vec<String>) -> Result<(), ModelError> {
    let count = file.rows("actuator_trntype");
    let actuator_names = names(file, "actuator", count)?;
    let transmissions = file.kinds("actuator_trntype", count)?;
    let dynamics = file.kinds("actuator_dyntype", count)?;
    let gains = file.kinds("actuator_gaintype", count)?;
    let biases = file.kinds("actuator_biastype", count)?;
    let targets = file.vectors_of_integers::<2>("actuator_trnid", count)?;
    let joints = file.rows("jnt_type");
    let joint_kinds = file.kinds("jnt_type", joints)?;
    for k in 0..count {
        let name = &actuator_names[k];
        let mut refuse = |what: &str| {
            found.push(format!("actuator `{name}`: {what} is not supported yet"));
        };
        match transmissions[k].as_str() {
            "mjTRN_JOINT" | "mjTRN_JOINTINPARENT" => {
                let joint = usize::try_from(targets[k][0]).ok();
                let kind = joint.and_then(|joint| joint_kinds.get(joint));
                if kind.is_none_or(|kind| kind == "mjJNT_BALL" || kind == "mjJNT_FREE") {
                    refuse("transmission to a ball or free joint");
                }
            }
            "mjTRN_TENDON" => {}
            other => refuse(other),
        }
        if dynamics[k] != "mjDYN_NONE" {
            refuse(&dynamics[k]);
        }
        if !matches!(gains[k].as_str(), "mjGAIN_FIXED" | "mjGAIN_AFFINE") {
            refuse(&gains[k]);
        }
        if !matches!(biases[k].as_str(), "mjBIAS_NONE" | "mjBIAS_AFFINE") {
            refuse(&biases[k]);
        }
    }
    for (array, what) in [
        ("actuator_ctrlnum", "control"),
        ("actuator_outnum", "output"),
    ] {
        for (k, &own) in file.integers_or(array, count, 1)?.iter().enumerate() {
            if own != 1 {
                let name = &actuator_names[k];
                found.push(format!(
                    "actuator `{name}`: {own} {what}s are not supported yet"
                ));
            }
        }
    }
    Ok(())
}
