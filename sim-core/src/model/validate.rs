//! Checks of a description: everything a model relies on, refused by name.

use std::collections::HashSet;

use super::description::{Collision, Description, Joint, JointDof, JointKind, Link, Robot, Shape};
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
            shape_sizes(&what, &shape.shape)?;
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
            let what = collision_name(&what, index, collision);
            pose(&what, &collision.pose)?;
            shape_sizes(&what, &collision.shape)?;
        }
        Ok(())
    }

    fn validate_joint(&self, owner: &str, joint: &Joint) -> Result<(), ModelError> {
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
        self.validate_free(joint)?;
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

    /// A free body is carried by the world, and nothing drives it.
    fn validate_free(&self, joint: &Joint) -> Result<(), ModelError> {
        if joint.kind != JointKind::Free {
            return Ok(());
        }
        let (robot, name) = (self.name.clone(), joint.name.clone());
        let mut above = joint.parent;
        while let Some(link) = above {
            let carrier = self.joints.iter().find(|joint| joint.child == link);
            if let Some(carrier) = carrier.filter(|carrier| carrier.moves()) {
                let carrier = carrier.name.clone();
                return Err(ModelError::FreeBelow {
                    robot,
                    joint: name,
                    carrier,
                });
            }
            above = carrier.and_then(|carrier| carrier.parent);
        }
        let drives = |dof: &JointDof| {
            let targets = [dof.target_q.unwrap_or(0.0), dof.target_qd];
            dof.target_ke > 0.0 || dof.target_kd > 0.0 || targets.iter().any(|x| x.abs() > 0.0)
        };
        if joint.dofs.iter().any(drives) {
            return Err(ModelError::FreeDrive { robot, joint: name });
        }
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
        finite(&format!("{what}: mimic multiplier"), mimic.multiplier)?;
        finite(&format!("{what}: mimic offset"), mimic.offset)
    }
}

/// What resists and drives a dof is finite and not negative.
fn validate_dof(what: &str, dof: &JointDof) -> Result<(), ModelError> {
    let not_negatives = [
        ("effort limit", dof.effort_limit.unwrap_or(0.0)),
        ("damping", dof.damping),
        ("friction", dof.friction),
        ("joint_armature", dof.armature),
        ("joint_target_ke", dof.target_ke),
        ("joint_target_kd", dof.target_kd),
    ];
    for (field, value) in not_negatives {
        not_negative(&format!("{what}: {field}"), value)?;
    }
    let target_q = dof.target_q.unwrap_or(0.0);
    finite(&format!("{what}: joint_target_q"), target_q)?;
    finite(&format!("{what}: joint_target_qd"), dof.target_qd)
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

/// A collision by its name, or by its place in its link.
pub(super) fn collision_name(owner: &str, index: usize, collision: &Collision) -> String {
    match &collision.name {
        Some(name) => format!("{owner}: collision `{name}`"),
        None => format!("{owner}: collision {index}"),
    }
}

/// Refuses sizes that are not positive.
pub(super) fn shape_sizes(what: &str, shape: &Shape) -> Result<(), ModelError> {
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
        // checked when it was read
        Shape::Mesh(_) => Ok(()),
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
