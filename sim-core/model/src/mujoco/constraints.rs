//! Constraints of a model: equalities, tendons, limits of balls, and dry friction of free joints.

use super::format::ModelFile;
use super::frame;
use super::names::names;
use super::options::has_flag;
use super::plasticity;
use super::reflected::{self, Driven};
use super::tendons::{Tendons, moving};
use super::tree::softness;
use crate::description::{
    Constraint, ConstraintLaw, JointKind, Length, Measure, Precompiled, Robot, Tendon,
};
use crate::error::ModelError;
use crate::pose::Pose;
use crate::softness::Softness;

/// Adds all of them; [`super::refusals`] has named those that are not supported.
pub(super) fn add_constraints(
    file: &ModelFile,
    robot: &Robot,
    parts: &mut Precompiled,
) -> Result<(), ModelError> {
    let tendons = Tendons::read(file, robot)?;
    let none = has_flag(file, "mjDSBL_CONSTRAINT")?;
    let is_on = |flag: &str| Ok::<bool, ModelError>(!none && !has_flag(file, flag)?);
    if is_on("mjDSBL_EQUALITY")? {
        add_equalities(file, robot, &tendons, parts)?;
    }
    if is_on("mjDSBL_FRICTIONLOSS")? {
        add_frictions(file, robot, &tendons, parts)?;
    }
    if is_on("mjDSBL_LIMIT")? {
        add_limits(file, robot, &tendons, parts)?;
    }
    add_springs(file, &tendons, parts)?;
    parts.spatial_tendons = tendons.spatial;
    parts.frames.tendons = tendons.all;
    parts.frames.tendon_names = tendons.names;
    Ok(())
}

/// Names of all equalities, and whether they act at the start.
pub(super) fn equalities(file: &ModelFile) -> Result<Vec<(String, bool)>, ModelError> {
    let count = file.rows("eq_type");
    let active = file.integers("eq_active0", count)?;
    let active = active.into_iter().map(|active| active != 0);
    Ok(names(file, "equality", count)?
        .into_iter()
        .zip(active)
        .collect())
}

/// Inverse weights of lengths alone.
fn along(weight: f64) -> [f64; 2] {
    [weight, weight]
}

fn add_equalities(
    file: &ModelFile,
    robot: &Robot,
    tendons: &Tendons,
    parts: &mut Precompiled,
) -> Result<(), ModelError> {
    let count = file.rows("eq_type");
    if count == 0 {
        return Ok(());
    }
    let equalities = Equalities {
        file,
        robot,
        tendons,
        joints: moving(robot, file.rows("jnt_type"), file)?,
        of_sites: file.kinds("eq_objtype", count)?,
        seconds: file.integers("eq_obj2id", count)?,
        firsts: file.integers("eq_obj1id", count)?,
        data: file.first_columns::<11>("eq_data", count)?,
        softness: softness(file, "eq", count)?,
    };
    let kinds = file.kinds("eq_type", count)?;
    for k in 0..count {
        match kinds[k].as_str() {
            "mjEQ_JOINT" => equalities.add_joint(k, parts)?,
            "mjEQ_TENDON" => equalities.add_tendon(k, parts)?,
            kind => equalities.add_frames(k, kind == "mjEQ_WELD", parts)?,
        }
    }
    Ok(())
}

/// Arrays of equalities.
struct Equalities<'a> {
    file: &'a ModelFile,
    robot: &'a Robot,
    tendons: &'a Tendons,
    joints: Vec<usize>,
    of_sites: Vec<String>,
    firsts: Vec<i64>,
    seconds: Vec<i64>,
    data: Vec<[f64; 11]>,
    softness: Vec<Softness>,
}

impl Equalities<'_> {
    /// q₁ - r₁ = p(q₂ - r₂), with the references r.
    fn add_joint(&self, k: usize, parts: &mut Precompiled) -> Result<(), ModelError> {
        let joint = |joint: i64| {
            let place = usize::try_from(joint).ok();
            let place = place.and_then(|joint| self.joints.get(joint)).copied();
            let place = place.filter(|&place| self.robot.joints[place].dofs.len() == 1);
            place.ok_or_else(|| {
                let fault = "has an equality without joints of one dof".to_owned();
                self.file.fault(fault)
            })
        };
        let reference = |parts: &Precompiled, joint: usize| parts.joints[joint].reference;
        let weight = |parts: &Precompiled, joint: usize| {
            let before = &self.robot.joints[..joint];
            let dof: usize = before.iter().map(|joint| joint.dofs.len()).sum();
            parts.dof_inverse_weight[dof]
        };
        let [constant, multiplier, c2, c3, c4, ..] = self.data[k];
        let follower = joint(self.firsts[k])?;
        let offset = reference(parts, follower);
        let mut inverse_weight = weight(parts, follower);
        let mut leader = None;
        let (mut second, mut other, mut polynomial) = (Vec::new(), 0.0, [0.0; 5]);
        polynomial[0] = constant;
        if self.seconds[k] >= 0 {
            let second_joint = joint(self.seconds[k])?;
            leader = Some(second_joint);
            second.push((second_joint, 1.0));
            other = reference(parts, second_joint);
            inverse_weight += weight(parts, second_joint);
            polynomial = [constant, multiplier, c2, c3, c4];
        }
        parts.constraints.push(Constraint {
            measure: Measure::Lengths {
                first: Length::Joints(vec![(follower, 1.0)]),
                second: Length::Joints(second),
                offsets: [offset, other],
                polynomial,
                referred: [Some(follower), leader],
            },
            law: ConstraintLaw::Equality(k),
            softness: self.softness[k],
            inverse_weight: along(inverse_weight),
        });
        Ok(())
    }

    /// The same of the lengths of tendons.
    fn add_tendon(&self, k: usize, parts: &mut Precompiled) -> Result<(), ModelError> {
        let count = self.tendons.names.len();
        let lengths = self.file.reals("tendon_length0", count)?;
        let weights = self.file.reals("tendon_invweight0", count)?;
        let first = self.tendons.length(self.file, self.firsts[k])?.clone();
        let first_tendon = self.firsts[k] as usize;
        let [constant, rest @ ..] = self.data[k];
        let mut polynomial = [constant, 0.0, 0.0, 0.0, 0.0];
        let mut inverse_weight = weights[first_tendon];
        let (mut second, mut other) = (Length::Joints(Vec::new()), 0.0);
        if self.seconds[k] >= 0 {
            second = self.tendons.length(self.file, self.seconds[k])?.clone();
            other = lengths[self.seconds[k] as usize];
            inverse_weight += weights[self.seconds[k] as usize];
            polynomial[1..].copy_from_slice(&rest[..4]);
        }
        parts.constraints.push(Constraint {
            measure: Measure::Lengths {
                first,
                second,
                offsets: [lengths[first_tendon], other],
                polynomial,
                referred: [None; 2],
            },
            law: ConstraintLaw::Equality(k),
            softness: self.softness[k],
            inverse_weight: along(inverse_weight),
        });
        Ok(())
    }

    /// Points that are connected, or frames that are welded.
    fn add_frames(
        &self,
        k: usize,
        is_weld: bool,
        parts: &mut Precompiled,
    ) -> Result<(), ModelError> {
        let file = self.file;
        let [x, y, z, a, b, c, qw, qx, qy, qz, torque_scale] = self.data[k];
        let mut links = [0; 2];
        let mut poses = match is_weld {
            true => [frame([a, b, c], [qw, qx, qy, qz]), Pose::at([x, y, z])],
            false => [Pose::at([x, y, z]), Pose::at([a, b, c])],
        };
        let sites = file.rows("site_bodyid");
        let bodies = file.indices("site_bodyid", sites, self.robot.links.len())?;
        for (side, object) in [self.firsts[k], self.seconds[k]].into_iter().enumerate() {
            let fault = || file.fault("has an equality without its bodies".to_owned());
            let object = usize::try_from(object).map_err(|_| fault())?;
            links[side] = object;
            if self.of_sites[k] == "mjOBJ_SITE" {
                links[side] = bodies.get(object).copied().flatten().ok_or_else(fault)?;
                let places = file.vectors::<3>("site_pos", sites)?;
                let turns = file.vectors::<4>("site_quat", sites)?;
                poses[side] = frame(places[object], turns[object]);
            }
            if links[side] >= self.robot.links.len() {
                return Err(fault());
            }
        }
        let weights = file.vectors::<2>("body_invweight0", self.robot.links.len())?;
        let [first, second] = links.map(|link| weights[link]);
        parts.constraints.push(Constraint {
            measure: Measure::Frames {
                links,
                poses,
                torque_scale: is_weld.then_some(torque_scale),
            },
            law: ConstraintLaw::Equality(k),
            softness: self.softness[k],
            inverse_weight: [first[0] + second[0], first[1] + second[1]],
        });
        Ok(())
    }
}

/// Dry friction of free joints and of tendons; that of other joints is in their dofs.
fn add_frictions(
    file: &ModelFile,
    robot: &Robot,
    tendons: &Tendons,
    parts: &mut Precompiled,
) -> Result<(), ModelError> {
    let mut dof = 0;
    for (place, joint) in robot.joints.iter().enumerate() {
        let loss = joint.dofs.first().map_or(0.0, |first| first.friction);
        if joint.kind == JointKind::Free && loss > 0.0 {
            let weights = &parts.dof_inverse_weight;
            parts.constraints.push(Constraint {
                measure: Measure::Free { joint: place },
                law: ConstraintLaw::Friction(loss),
                softness: parts.joints[place].friction,
                inverse_weight: [weights[dof], weights[dof + 3]],
            });
        }
        dof += joint.dofs.len();
    }
    let count = tendons.names.len();
    let losses = file.reals("tendon_frictionloss", count)?;
    let softness = of_tendons(file, "fri", count)?;
    let weights = file.reals("tendon_invweight0", count)?;
    for k in (0..count).filter(|&k| losses[k] > 0.0) {
        parts.constraints.push(Constraint {
            measure: length(tendons.length(file, k as i64)?),
            law: ConstraintLaw::Friction(losses[k]),
            softness: softness[k],
            inverse_weight: along(weights[k]),
        });
    }
    Ok(())
}

/// Limits of balls and of tendons; those of other joints are their ranges.
fn add_limits(
    file: &ModelFile,
    robot: &Robot,
    tendons: &Tendons,
    parts: &mut Precompiled,
) -> Result<(), ModelError> {
    let joints = file.rows("jnt_type");
    let limited = file.integers("jnt_limited", joints)?;
    let ranges = file.vectors::<2>("jnt_range", joints)?;
    let mut dof = 0;
    let places = moving(robot, joints, file)?;
    for (k, &place) in places.iter().enumerate() {
        let joint = &robot.joints[place];
        if joint.kind == JointKind::Ball && limited[k] != 0 {
            let extras = &parts.joints[place];
            parts.constraints.push(Constraint {
                measure: Measure::Angle { joint: place },
                law: ConstraintLaw::Range {
                    bounds: [f64::NEG_INFINITY, ranges[k][0].max(ranges[k][1])],
                    margin: extras.margin,
                },
                softness: extras.limit,
                inverse_weight: along(parts.dof_inverse_weight[dof]),
            });
        }
        dof += joint.dofs.len();
    }
    let count = tendons.names.len();
    let limited = file.integers("tendon_limited", count)?;
    let ranges = file.vectors::<2>("tendon_range", count)?;
    let margins = file.reals("tendon_margin", count)?;
    let softness = of_tendons(file, "lim", count)?;
    let weights = file.reals("tendon_invweight0", count)?;
    for k in (0..count).filter(|&k| limited[k] != 0) {
        parts.constraints.push(Constraint {
            measure: length(tendons.length(file, k as i64)?),
            law: ConstraintLaw::Range {
                bounds: ranges[k],
                margin: margins[k],
            },
            softness: softness[k],
            inverse_weight: along(weights[k]),
        });
    }
    Ok(())
}

/// Springs and dampers of tendons.
fn add_springs(
    file: &ModelFile,
    tendons: &Tendons,
    parts: &mut Precompiled,
) -> Result<(), ModelError> {
    let count = tendons.names.len();
    let kept = |name: &str, flag: &str| -> Result<Vec<f64>, ModelError> {
        match has_flag(file, flag)? {
            true => Ok(vec![0.0; count]),
            false => file.reals(name, count),
        }
    };
    let stiffness = kept("tendon_stiffness", "mjDSBL_SPRING")?;
    let mut damping = kept("tendon_damping", "mjDSBL_DAMPER")?;
    let stiffness_curves = file.curves(
        "tendon_stiffnesspoly",
        count,
        has_flag(file, "mjDSBL_SPRING")?,
    )?;
    let mut damping_curves = file.curves(
        "tendon_dampingpoly",
        count,
        has_flag(file, "mjDSBL_DAMPER")?,
    )?;
    let mut armature = match file.has("tendon_armature") {
        true => file.reals("tendon_armature", count)?,
        false => vec![0.0; count],
    };
    let rests = file.vectors::<2>("tendon_lengthspring", count)?;
    let yields = plasticity::yields(file, "tendon", count)?;
    for (k, share) in reflected::shares(file, Driven::Tendon, count)?
        .iter()
        .enumerate()
    {
        armature[k] += share.armature;
        damping[k] += share.damping;
        damping_curves[k] = share.damped(damping_curves[k]);
    }
    let acts = |&k: &usize| {
        [stiffness[k], damping[k], armature[k]] != [0.0; 3]
            || [stiffness_curves[k], damping_curves[k]] != [[0.0; 2]; 2]
    };
    for k in (0..count).filter(acts) {
        parts.tendons.push(Tendon {
            length: tendons.length(file, k as i64)?.clone(),
            stiffness: stiffness[k],
            rest: rests[k],
            damping: damping[k],
            armature: armature[k],
            stiffness_curve: stiffness_curves[k],
            damping_curve: damping_curves[k],
            // what has no spring keeps no rest
            spring_yield: yields[k]
                .filter(|_| stiffness[k] != 0.0 || stiffness_curves[k] != [0.0; 2]),
        });
    }
    Ok(())
}

/// The length of a tendon.
fn length(length: &Length) -> Measure {
    Measure::Lengths {
        first: length.clone(),
        second: Length::Joints(Vec::new()),
        offsets: [0.0; 2],
        polynomial: [0.0; 5],
        referred: [None; 2],
    }
}

/// Softness of limits (`lim`) or frictions (`fri`) of tendons.
fn of_tendons(file: &ModelFile, which: &str, count: usize) -> Result<Vec<Softness>, ModelError> {
    let solref = file.vectors::<2>(&format!("tendon_solref_{which}"), count)?;
    let solimp = file.vectors::<5>(&format!("tendon_solimp_{which}"), count)?;
    let pairs = solref.into_iter().zip(solimp);
    Ok(pairs
        .map(|(solref, solimp)| Softness { solref, solimp })
        .collect())
}
