//! Checks of a joint: its axis, range, drives and leader.

use super::shape::pose;
use crate::description::{Joint, JointDof, Robot};
use crate::error::ModelError;
use crate::joint_kind::JointKind;
use crate::pose::Pose;
use crate::value_checks::{finite, in_range, name, not_negative, within};

/// Largest gain, damping, friction, armature, and entry of a mimic, each in its unit: products of three stay within f32.
const FACTOR_MAX: f64 = 1e12;
/// Largest end of a range [rad or m]: its square stays within f32.
const RANGE_MAX: f64 = 1e18;
/// How far an axis' length may be from 1: roundings only, the reader normalises.
const AXIS_SLACK: f64 = 1e-6;

impl Robot {
    pub(super) fn validate_joint(&self, owner: &str, joint: &Joint) -> Result<(), ModelError> {
        name("joint", &joint.name)?;
        let what = format!("{owner}: joint `{}`", joint.name);
        let (coords, dofs) = (joint.kind.coord_names().len(), joint.kind.dof_names().len());
        if joint.q.len() != coords || joint.dofs.len() != dofs {
            return Err(ModelError::JointParts {
                what,
                kind: joint.kind,
                coords,
                dofs,
            });
        }
        pose(&what, &joint.origin)?;
        if !joint.moves() {
            return Ok(());
        }
        if !matches!(joint.kind, JointKind::Ball | JointKind::Free) {
            self.validate_axis(&what, joint)?;
        }
        if let Some([lower, upper]) = joint.range {
            let rule = "give at most 1e18, or delete both ends where there is no limit";
            within(&format!("{what}: lower limit"), lower, RANGE_MAX, rule)?;
            within(&format!("{what}: upper limit"), upper, RANGE_MAX, rule)?;
            if lower > upper {
                let (robot, joint) = (self.name.clone(), joint.name.clone());
                return Err(ModelError::EmptyRange {
                    robot,
                    joint,
                    lower,
                    upper,
                });
            }
        }
        not_negative(
            &format!("{what}: velocity limit"),
            joint.velocity_limit.unwrap_or(0.0),
        )?;
        for (dof, part) in joint.dofs.iter().zip(joint.kind.dof_names()) {
            let what = match part.is_empty() {
                true => what.clone(),
                false => format!("{what}, {part}"),
            };
            validate_dof(&what, dof)?;
        }
        for &value in &joint.q {
            finite(&format!("{what}: joint_q"), value)?;
        }
        if let (JointKind::Ball | JointKind::Free, Some(quat)) = (joint.kind, joint.q.last_chunk())
        {
            let start = Pose {
                pos: [0.0; 3],
                quat: *quat,
            };
            pose(&format!("{what}: joint_q"), &start)?;
        }
        self.validate_mimic(&what, joint)
    }

    /// A joint's axis is a unit vector.
    fn validate_axis(&self, what: &str, joint: &Joint) -> Result<(), ModelError> {
        for value in joint.axis {
            finite(&format!("{what}: axis"), value)?;
        }
        let length = joint
            .axis
            .iter()
            .map(|part| part * part)
            .sum::<f64>()
            .sqrt();
        if length == 0.0 {
            return Err(ModelError::ZeroAxis {
                robot: self.name.clone(),
                joint: joint.name.clone(),
            });
        }
        let is_unit = (length - 1.0).abs() <= AXIS_SLACK;
        in_range(
            &format!("{what}: length of the axis"),
            length,
            is_unit,
            "it must be 1",
        )?;
        Ok(())
    }

    fn validate_mimic(&self, what: &str, joint: &Joint) -> Result<(), ModelError> {
        let Some(mimic) = joint.mimic else {
            return Ok(());
        };
        let refuse = |leader: String, reason| {
            Err(ModelError::MimicLeader {
                robot: self.name.clone(),
                joint: joint.name.clone(),
                leader,
                reason,
            })
        };
        let Some(leader) = self.joints.get(mimic.joint) else {
            return refuse(format!("#{}", mimic.joint), "does not exist");
        };
        if leader.name == joint.name {
            return refuse(leader.name.clone(), "is itself");
        }
        if !leader.moves() {
            return refuse(leader.name.clone(), "is fixed");
        }
        if joint.kind.dof_names().len() > 1 || leader.kind.dof_names().len() > 1 {
            return refuse(
                leader.name.clone(),
                "cannot be followed, since one of them has several dofs",
            );
        }
        if leader.mimic.is_some() {
            return refuse(leader.name.clone(), "follows another joint itself");
        }
        let offsets = |dof: &JointDof| dof.offset_q.or(dof.offset_qd).is_some();
        if joint.dofs.iter().any(offsets) {
            return Err(ModelError::FollowerOffset {
                robot: self.name.clone(),
                joint: joint.name.clone(),
                leader: leader.name.clone(),
            });
        }
        let rule = "give at most 1e12, followed leaders multiplied in";
        let multiplier = format!("{what}: mimic multiplier");
        within(&multiplier, mimic.multiplier, FACTOR_MAX, rule)?;
        within(
            &format!("{what}: mimic offset"),
            mimic.offset,
            FACTOR_MAX,
            rule,
        )
    }
}

/// What resists and drives a dof is finite and not negative.
fn validate_dof(what: &str, dof: &JointDof) -> Result<(), ModelError> {
    not_negative(
        &format!("{what}: effort limit"),
        dof.effort_limit.unwrap_or(0.0),
    )?;
    let factors = [
        ("damping", dof.damping),
        ("friction", dof.friction),
        ("joint_armature", dof.armature),
        ("joint_limit_ke", dof.limit_gains()[0]),
        ("joint_limit_kd", dof.limit_gains()[1]),
        ("joint_target_ke", dof.target_ke),
        ("joint_target_kd", dof.target_kd),
    ];
    for (field, value) in factors {
        let field = format!("{what}: {field}");
        not_negative(&field, value)?;
        within(&field, value, FACTOR_MAX, "give at most 1e12")?;
    }
    let target_q = dof.target_q.unwrap_or(0.0);
    finite(&format!("{what}: joint_target_q"), target_q)?;
    finite(&format!("{what}: joint_target_qd"), dof.target_qd)?;
    let offsets = [("joint_q", dof.offset_q), ("joint_qd", dof.offset_qd)];
    offsets.iter().try_for_each(|(field, offset)| match offset {
        Some(offset) => offset.validate(&format!("{what}: offset of {field}")),
        None => Ok(()),
    })
}
