//! Checks of a description: everything a model relies on, refused by name.

use std::collections::HashSet;

use super::description::{Description, Joint, Link, Robot, Shape};
use super::error::ModelError;
use super::inertia::{negative_moment, triangle_excess};
use super::pose::{Pose, QUAT_SLACK};

/// Longest physics step [s]: longer ones are a slip of units.
const DT_MAX: f64 = 1.0;
/// Most physics steps in a control frame.
const SUBSTEPS_MAX: usize = 10_000;
/// Most iterations of the solver or its line search.
const ITERATIONS_MAX: usize = 10_000;
/// How far an axis' length may be from 1: roundings only, the reader normalises.
const AXIS_SLACK: f64 = 1e-6;

impl Description {
    /// Checks everything that `compile` relies on.
    ///
    /// # Errors
    /// The first thing that is wrong, by name, with the cure.
    pub fn validate(&self) -> Result<(), ModelError> {
        let (dt, substeps) = (self.dt, self.substeps);
        in_range(
            "dt",
            dt,
            0.0 < dt && dt <= DT_MAX,
            "it must be above 0 and at most 1 s, such as 1/480",
        )?;
        count(
            "substeps",
            substeps,
            SUBSTEPS_MAX,
            "it must be between 1 and 10000",
        )?;
        for (axis, &value) in ["x", "y", "z"].iter().zip(&self.gravity) {
            finite(&format!("gravity {axis}"), value)?;
        }
        let solver = &self.solver;
        count(
            "solver iterations",
            solver.iterations,
            ITERATIONS_MAX,
            "it must be between 1 and 10000",
        )?;
        count(
            "solver ls_iterations",
            solver.ls_iterations,
            ITERATIONS_MAX,
            "it must be between 1 and 10000",
        )?;
        not_negative("solver tolerance", solver.tolerance)?;
        positive("solver impratio", solver.impratio)?;

        unique(
            "scene",
            "robot",
            self.robots.iter().map(|robot| robot.name.as_str()),
        )?;
        unique(
            "scene",
            "shape",
            self.shapes.iter().map(|shape| shape.name.as_str()),
        )?;
        for shape in &self.shapes {
            name("shape", &shape.name)?;
            let what = format!("shape `{}`", shape.name);
            pose(&what, &shape.pose)?;
            geometry(&what, &shape.shape)?;
        }
        self.robots.iter().try_for_each(Robot::validate)
    }
}

impl Robot {
    /// Checks one robot on its own.
    ///
    /// # Errors
    /// The first thing that is wrong, by name, with the cure.
    pub fn validate(&self) -> Result<(), ModelError> {
        name("robot", &self.name)?;
        if self.name.contains('/') {
            let rule = "a slash separates robot and joint in `robot/joint`; leave it out";
            return Err(ModelError::BadName {
                what: "robot",
                name: self.name.clone(),
                rule,
            });
        }
        let owner = format!("robot `{}`", self.name);
        pose(&owner, &self.pose)?;
        if self.floating {
            return Err(ModelError::NotSupported {
                robot: self.name.clone(),
                argument: "floating=True",
                cure: "leave it False to fix the root link in the world",
            });
        }
        unique(
            &owner,
            "link",
            self.links.iter().map(|link| link.name.as_str()),
        )?;
        unique(
            &owner,
            "joint",
            self.joints.iter().map(|joint| joint.name.as_str()),
        )?;
        self.links
            .iter()
            .try_for_each(|link| self.validate_link(&owner, link))?;
        self.validate_tree()?;
        self.joints
            .iter()
            .try_for_each(|joint| self.validate_joint(&owner, joint))?;
        self.validate_moving_mass()
    }

    fn validate_link(&self, owner: &str, link: &Link) -> Result<(), ModelError> {
        name("link", &link.name)?;
        let what = format!("{owner}: link `{}`", link.name);
        if let Some(inertial) = &link.inertial {
            not_negative(&format!("{what}: mass"), inertial.mass)?;
            for value in inertial.pos {
                finite(&format!("{what}: centre of mass"), value)?;
            }
            for value in inertial.inertia.into_iter().flatten() {
                finite(&format!("{what}: inertia"), value)?;
            }
            let (robot, link) = (self.name.clone(), link.name.clone());
            if let Some(moment) = negative_moment(inertial.inertia) {
                return Err(ModelError::NegativeInertia {
                    robot,
                    link,
                    moment,
                });
            }
            if let Some(ratio) = triangle_excess(inertial.inertia) {
                return Err(ModelError::InertiaTriangle { robot, link, ratio });
            }
        }
        for (index, collision) in link.collisions.iter().enumerate() {
            let what = match &collision.name {
                Some(name) => format!("{what}: collision `{name}`"),
                None => format!("{what}: collision {index}"),
            };
            pose(&what, &collision.pose)?;
            geometry(&what, &collision.shape)?;
        }
        Ok(())
    }

    fn validate_joint(&self, owner: &str, joint: &Joint) -> Result<(), ModelError> {
        name("joint", &joint.name)?;
        let what = format!("{owner}: joint `{}`", joint.name);
        pose(&what, &joint.origin)?;
        if !joint.moves() {
            return Ok(());
        }
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
        if let Some([lower, upper]) = joint.range {
            finite(&format!("{what}: lower limit"), lower)?;
            finite(&format!("{what}: upper limit"), upper)?;
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
        let not_negatives = [
            ("effort limit", joint.effort_limit.unwrap_or(0.0)),
            ("velocity limit", joint.velocity_limit.unwrap_or(0.0)),
            ("damping", joint.damping),
            ("friction", joint.friction),
            ("joint_armature", joint.armature),
            ("joint_target_ke", joint.target_ke),
            ("joint_target_kd", joint.target_kd),
        ];
        for (field, value) in not_negatives {
            not_negative(&format!("{what}: {field}"), value)?;
        }
        finite(&format!("{what}: joint_q"), joint.q)?;
        finite(
            &format!("{what}: joint_target_q"),
            joint.target_q.unwrap_or(0.0),
        )?;
        finite(&format!("{what}: joint_target_qd"), joint.target_qd)?;
        self.validate_mimic(&what, joint)
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
        if leader.mimic.is_some() {
            return refuse(leader.name.clone(), "follows another joint itself");
        }
        finite(&format!("{what}: mimic multiplier"), mimic.multiplier)?;
        finite(&format!("{what}: mimic offset"), mimic.offset)
    }
}

/// Refuses a frame with a number that is not finite, or a quaternion that is no rotation.
fn pose(what: &str, pose: &Pose) -> Result<(), ModelError> {
    for value in pose.pos {
        finite(&format!("{what}: position"), value)?;
    }
    for value in pose.quat {
        finite(&format!("{what}: quaternion"), value)?;
    }
    let length = pose.quat_length();
    if (length - 1.0).abs() > QUAT_SLACK {
        return Err(ModelError::Quaternion {
            what: what.to_owned(),
            length,
        });
    }
    Ok(())
}

/// Refuses sizes that are not positive.
fn geometry(what: &str, shape: &Shape) -> Result<(), ModelError> {
    match *shape {
        Shape::Box { half_extents } => half_extents
            .iter()
            .try_for_each(|&value| positive(&format!("{what}: half extent of the box"), value)),
        Shape::Sphere { radius } => positive(&format!("{what}: radius of the sphere"), radius),
        Shape::Cylinder {
            radius,
            half_height,
        }
        | Shape::Capsule {
            radius,
            half_height,
        } => {
            positive(&format!("{what}: radius of the {}", shape.kind()), radius)?;
            positive(
                &format!("{what}: half height of the {}", shape.kind()),
                half_height,
            )
        }
        Shape::Mesh { scale, .. } => scale.iter().try_for_each(|&value| {
            let what = format!("{what}: scale of the mesh");
            finite(&what, value)?;
            in_range(&what, value, value != 0.0, "it must not be 0")
        }),
    }
}

/// Refuses an empty name, or one with a control character.
fn name(what: &'static str, name: &str) -> Result<(), ModelError> {
    if name.is_empty() || name.chars().any(char::is_control) {
        let rule = "give it one or more printable characters";
        return Err(ModelError::BadName {
            what,
            name: name.to_owned(),
            rule,
        });
    }
    Ok(())
}

/// Refuses a name that comes twice.
fn unique<'a>(
    owner: &str,
    what: &'static str,
    names: impl Iterator<Item = &'a str>,
) -> Result<(), ModelError> {
    let mut seen = HashSet::new();
    for name in names {
        if !seen.insert(name) {
            return Err(ModelError::DuplicateName {
                owner: owner.to_owned(),
                what,
                name: name.to_owned(),
            });
        }
    }
    Ok(())
}

/// Refuses a count outside 1 to `most`.
fn count(what: &str, value: usize, most: usize, rule: &'static str) -> Result<(), ModelError> {
    in_range(what, value as f64, (1..=most).contains(&value), rule)
}

/// Refuses a number that is not finite.
pub(super) fn finite(what: &str, value: f64) -> Result<(), ModelError> {
    if value.is_finite() {
        Ok(())
    } else {
        Err(ModelError::NotFinite {
            what: what.to_owned(),
            value,
        })
    }
}

/// Refuses a number that is negative or not finite.
pub(super) fn not_negative(what: &str, value: f64) -> Result<(), ModelError> {
    in_range(what, value, value >= 0.0, "it must not be negative")
}

/// Refuses a number that is 0, negative or not finite.
fn positive(what: &str, value: f64) -> Result<(), ModelError> {
    in_range(what, value, value > 0.0, "it must be above 0")
}

/// Refuses a number that is not finite, or for which `holds` is false.
fn in_range(what: &str, value: f64, holds: bool, rule: &'static str) -> Result<(), ModelError> {
    finite(what, value)?;
    if holds {
        Ok(())
    } else {
        Err(ModelError::OutOfRange {
            what: what.to_owned(),
            value,
            rule,
        })
    }
}
