//! Tendons of a model: lengths that are sums of joint positions.

use super::format::ModelFile;
use super::names::names;
use crate::description::Robot;
use crate::error::ModelError;

/// Kinds of tendons, and what they are made of.
pub(super) struct Tendons {
    /// Their names.
    pub names: Vec<String>,
    /// Of each, the robot's joints and their coefficients; none of a spatial tendon.
    pub terms: Vec<Option<Vec<(usize, f64)>>>,
}

impl Tendons {
    /// Reads the tendons of a model. `robot` has its joints.
    pub fn read(file: &ModelFile, robot: &Robot) -> Result<Tendons, ModelError> {
        let (count, wraps) = (file.rows("tendon_num"), file.rows("wrap_type"));
        let firsts = file.integers("tendon_adr", count)?;
        let counts = file.integers("tendon_num", count)?;
        let kinds = file.kinds("wrap_type", wraps)?;
        let joints = file.integers("wrap_objid", wraps)?;
        let coefficients = file.reals("wrap_prm", wraps)?;
        let places = moving(robot, file.rows("jnt_type"), file)?;
        let names = names(file, "tendon", count)?;
        let terms = (0..count).map(|k| {
            let first = firsts[k].max(0) as usize;
            let wraps = first..first.saturating_add(counts[k].max(0) as usize);
            let fault = || file.fault(format!("has no joints for tendon `{}`", names[k]));
            let own_kinds = kinds.get(wraps.clone()).ok_or_else(fault)?;
            if own_kinds.iter().any(|kind| kind != "mjWRAP_JOINT") {
                return Ok(None);
            }
            let mut terms: Vec<(usize, f64)> = Vec::new();
            for wrap in wraps {
                let joint = usize::try_from(joints[wrap]).ok();
                let place = joint.and_then(|joint| places.get(joint)).copied();
                let place = place.filter(|&place| robot.joints[place].dofs.len() == 1);
                let place = place.ok_or_else(fault)?;
                match terms.iter_mut().find(|(known, _)| *known == place) {
                    Some((_, sum)) => *sum += coefficients[wrap],
                    None => terms.push((place, coefficients[wrap])),
                }
            }
            Ok(Some(terms))
        });
        Ok(Tendons {
            terms: terms.collect::<Result<_, _>>()?,
            names,
        })
    }

    /// The terms of a tendon.
    ///
    /// # Errors
    /// No such tendon, or a spatial one.
    pub fn terms(&self, file: &ModelFile, tendon: i64) -> Result<&[(usize, f64)], ModelError> {
        let place = usize::try_from(tendon).ok();
        let terms = place.and_then(|place| self.terms.get(place)?.as_deref());
        terms.ok_or_else(|| file.fault(format!("has no fixed tendon {tendon}")))
    }
}

/// Places of a tendon's actuators, and the range of the sum of their forces [N or N·m].
type Bound = (Vec<usize>, [f64; 2]);

/// Bounds of the sum of actuator forces along a tendon.
pub(super) fn bounds(file: &ModelFile) -> Result<Vec<Bound>, ModelError> {
    let (count, actuators) = (file.rows("tendon_num"), file.rows("actuator_trntype"));
    if file.first_set("tendon_actfrclimited").is_none() {
        return Ok(Vec::new());
    }
    let limited = file.integers("tendon_actfrclimited", count)?;
    let ranges = file.vectors::<2>("tendon_actfrcrange", count)?;
    let kinds = file.kinds("actuator_trntype", actuators)?;
    let targets = file.vectors_of_integers::<2>("actuator_trnid", actuators)?;
    let actuators_of = |tendon: usize| {
        let is_own = |&k: &usize| kinds[k] == "mjTRN_TENDON" && targets[k][0] == tendon as i64;
        (0..actuators).filter(is_own).collect::<Vec<usize>>()
    };
    let limited = (0..count).filter(|&tendon| limited[tendon] != 0);
    let bounds = limited.map(|tendon| (actuators_of(tendon), ranges[tendon]));
    Ok(bounds.filter(|(acting, _)| !acting.is_empty()).collect())
}

/// Where MuJoCo's joints are among the robot's.
pub(super) fn moving(
    robot: &Robot,
    joints: usize,
    file: &ModelFile,
) -> Result<Vec<usize>, ModelError> {
    let moving: Vec<usize> = (0..robot.joints.len())
        .filter(|&joint| robot.joints[joint].moves())
        .collect();
    match moving.len() == joints {
        true => Ok(moving),
        false => Err(file.fault("has joints without bodies".to_owned())),
    }
}
