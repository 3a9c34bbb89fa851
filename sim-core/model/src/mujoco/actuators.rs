//! Actuators of a model: forces along joints and fixed tendons.

use super::format::ModelFile;
use super::names::names;
use super::options::has_flag;
use super::tendons::{Tendons, moving};
use crate::description::{Actuator, Robot};
use crate::error::ModelError;

/// Adds the actuators; [`super::refusals`] has named those that are not supported.
pub(super) fn add_actuators(file: &ModelFile, robot: &mut Robot) -> Result<(), ModelError> {
    let count = file.rows("actuator_trntype");
    let joints = moving(robot, file.rows("jnt_type"), file)?;
    let names = names(file, "actuator", count)?;
    let kinds = file.kinds("actuator_trntype", count)?;
    let targets = file.vectors_of_integers::<2>("actuator_trnid", count)?;
    let gears = file.vectors::<6>("actuator_gear", count)?;
    let (gain_kinds, gains) = laws(file, "gain", count)?;
    let (bias_kinds, biases) = laws(file, "bias", count)?;
    let clamps = !has_flag(file, "mjDSBL_CLAMPCTRL")?;
    let ctrl_ranges = ranges(file, "ctrl", count)?;
    let force_ranges = ranges(file, "force", count)?;
    let acts = !has_flag(file, "mjDSBL_ACTUATION")?;
    let disabled = file.integer("opt.disableactuator")?;
    let groups = file.integers("actuator_group", count)?;
    let tendons = Tendons::read(file, robot)?;
    let mut actuators = Vec::new();
    for k in 0..count {
        let terms = match kinds[k].as_str() {
            "mjTRN_TENDON" => tendons.of(file, targets[k][0])?.to_vec(),
            _ => {
                let joint = usize::try_from(targets[k][0]).ok();
                let place = joint.and_then(|joint| joints.get(joint)).copied();
                let place = place.filter(|&place| robot.joints[place].dofs.len() == 1);
                let place = place.ok_or_else(|| {
                    let name = &names[k];
                    file.fault(format!("has no joint of one dof for actuator `{name}`"))
                })?;
                vec![(place, 1.0)]
            }
        };
        let terms = terms.into_iter();
        let terms = terms.map(|(joint, coefficient)| (joint, coefficient * gears[k][0]));
        let is_on = acts && !((0..31).contains(&groups[k]) && disabled >> groups[k] & 1 == 1);
        let on = |law: [f64; 3]| if is_on { law } else { [0.0; 3] };
        actuators.push(Actuator {
            name: names[k].clone(),
            terms: terms.collect(),
            ctrl_range: ctrl_ranges[k].filter(|_| clamps),
            force_range: force_ranges[k].filter(|_| is_on),
            gain: on(match gain_kinds[k].as_str() {
                "mjGAIN_AFFINE" => gains[k],
                _ => [gains[k][0], 0.0, 0.0],
            }),
            bias: on(match bias_kinds[k].as_str() {
                "mjBIAS_AFFINE" => biases[k],
                _ => [0.0; 3],
            }),
        });
    }
    if let Some(parts) = &mut robot.mujoco {
        parts.actuators = actuators;
        if !acts {
            for joint in &mut parts.joints {
                joint.actuator_range = None;
            }
        }
    }
    Ok(())
}

type Laws = (Vec<String>, Vec<[f64; 3]>);

/// Kinds of gains or biases, and their first three parameters.
fn laws(file: &ModelFile, which: &str, count: usize) -> Result<Laws, ModelError> {
    let kinds = file.kinds(&format!("actuator_{which}type"), count)?;
    let parameters = file.vectors::<10>(&format!("actuator_{which}prm"), count)?;
    let parameters = parameters.into_iter().map(|[a, b, c, ..]| [a, b, c]);
    Ok((kinds, parameters.collect()))
}

fn ranges(
    file: &ModelFile,
    which: &str,
    count: usize,
) -> Result<Vec<Option<[f64; 2]>>, ModelError> {
    let limited = file.integers(&format!("actuator_{which}limited"), count)?;
    let ranges = file.vectors::<2>(&format!("actuator_{which}range"), count)?;
    let both = limited.into_iter().zip(ranges);
    Ok(both
        .map(|(limited, range)| (limited != 0).then_some(range))
        .collect())
}
