//! Joints of a URDF file: axes, limits, dynamics, and which joint follows which.

use std::collections::HashMap;

use roxmltree::Node;
use urdf_rs::JointType;

use super::reader::Reader;
use super::scan::{children, has};
use crate::description::{Joint, JointKind, Mimic, start_followers};
use crate::error::{ModelError, first_few};

/// A range this wide on both sides means no range, such as 1e16 in SDFormat [rad or m].
const RANGE_FAR: f64 = 1e9;

impl<'a, 'input> Reader<'a, 'input> {
    /// All joints, in file order.
    pub(super) fn joints(&mut self, urdf: &urdf_rs::Robot) -> Result<Vec<Joint>, ModelError> {
        if urdf.links.is_empty() {
            let robot = self.robot.clone();
            let root = self.scan.root();
            return Err(self.scan.place(root, ModelError::NoLinks { robot }));
        }
        let link_names: Vec<&str> = urdf.links.iter().map(|link| link.name.as_str()).collect();
        let link_index: HashMap<&str, usize> = link_names
            .iter()
            .enumerate()
            .map(|(i, &name)| (name, i))
            .collect();
        let mut joints = Vec::with_capacity(urdf.joints.len());
        for (index, joint) in urdf.joints.iter().enumerate() {
            let node = self.scan.joints[index];
            let find = |role, name: &str| {
                link_index.get(name).copied().ok_or_else(|| {
                    let error = ModelError::UnknownLink {
                        robot: self.robot.clone(),
                        joint: joint.name.clone(),
                        role,
                        link: name.to_owned(),
                        known: first_few(&link_names),
                    };
                    self.scan.place(node, error)
                })
            };
            let kind = match joint.joint_type {
                JointType::Revolute | JointType::Continuous => JointKind::Revolute,
                JointType::Prismatic => JointKind::Prismatic,
                JointType::Spherical => JointKind::Ball,
                JointType::Planar => JointKind::Planar,
                JointType::Floating => JointKind::Free,
                JointType::Fixed => JointKind::Fixed,
            };
            let parent = find("parent", &joint.parent.link)?;
            let child = find("child", &joint.child.link)?;
            let mut made = Joint::new(kind, &joint.name, Some(parent), child);
            made.origin = self.pose(node, &joint.origin);
            if made.moves() {
                if !matches!(kind, JointKind::Ball | JointKind::Free) {
                    made.axis = self.axis(joint, node)?;
                }
                if made.dofs.len() == 1 {
                    self.limits(joint, node, &mut made)?;
                } else if let Some(limit) = children(node, "limit").next() {
                    self.scan
                        .ignore(limit, "<limit> of a joint with several dofs".to_owned());
                }
                if let Some(dynamics) = &joint.dynamics {
                    for dof in &mut made.dofs {
                        dof.damping = dynamics.damping;
                        dof.friction = dynamics.friction;
                    }
                }
            } else {
                for name in ["limit", "dynamics", "mimic"] {
                    if let Some(child) = children(node, name).next() {
                        self.scan
                            .ignore(child, format!("<{name}> of a fixed joint"));
                    }
                }
            }
            joints.push(made);
        }
        self.mimics(urdf, &mut joints)?;
        Ok(joints)
    }

    /// urdf-rs names neither the joint nor the line of a kind it does not know.
    pub(super) fn refuse_joint_kinds(&self) -> Result<(), ModelError> {
        for &node in &self.scan.joints {
            match node.attribute("type").unwrap_or_default() {
                "revolute" | "continuous" | "prismatic" | "fixed" | "planar" | "floating"
                | "spherical" => {}
                kind => {
                    let reason = format!(
                        "type `{kind}` is unknown; use revolute, continuous, prismatic, spherical, planar, floating or fixed"
                    );
                    return Err(self.scan.fault(node, reason));
                }
            }
        }
        Ok(())
    }

    fn axis(
        &mut self,
        joint: &urdf_rs::Joint,
        node: Node<'a, 'input>,
    ) -> Result<[f64; 3], ModelError> {
        let axis = *joint.axis.xyz;
        // scaled first, so that neither a tiny nor a huge axis is lost in the squares
        let largest = axis
            .iter()
            .fold(0.0_f64, |largest, part| largest.max(part.abs()));
        if largest == 0.0 {
            let (robot, joint) = (self.robot.clone(), joint.name.clone());
            return Err(self.scan.place(node, ModelError::ZeroAxis { robot, joint }));
        }
        let scaled = axis.map(|part| part / largest);
        let scaled_length = scaled.iter().map(|part| part * part).sum::<f64>().sqrt();
        let length = scaled_length * largest;
        // one that is a unit to the last bits stays as it was written
        if (length - 1.0).abs() <= 4.0 * f64::EPSILON {
            return Ok(axis);
        }
        if (length - 1.0).abs() > 1e-6 {
            self.notes.push(format!(
                "joint `{}`: axis of length {} is scaled to 1",
                joint.name,
                written(length)
            ));
        }
        Ok(scaled.map(|part| part / scaled_length))
    }

    fn limits(
        &mut self,
        joint: &urdf_rs::Joint,
        node: Node<'a, 'input>,
        made: &mut Joint,
    ) -> Result<(), ModelError> {
        let (lower, upper) = (has(node, "limit", "lower"), has(node, "limit", "upper"));
        let limit = &joint.limit;
        let finite = |name: &str, value: f64| {
            (has(node, "limit", name) && value != f64::INFINITY).then_some(value)
        };
        made.dofs[0].effort_limit = finite("effort", limit.effort);
        made.velocity_limit = finite("velocity", limit.velocity);
        if made.dofs[0].effort_limit == Some(0.0) {
            self.notes.push(format!(
                "joint `{}`: effort limit 0 leaves its drive without effect",
                joint.name
            ));
        }
        if joint.joint_type == JointType::Continuous {
            if lower || upper {
                self.scan
                    .ignore(node, "range of a continuous joint".to_owned());
            }
            return Ok(());
        }
        if !lower && !upper {
            self.notes.push(format!(
                "joint `{}`: no range is given, taken as unlimited",
                joint.name
            ));
            return Ok(());
        }
        let mut range = [limit.lower, limit.upper];
        if lower && upper && range[0] <= -RANGE_FAR && range[1] >= RANGE_FAR {
            if range[0].is_finite() || range[1].is_finite() {
                self.notes.push(format!(
                    "joint `{}`: the range from {:e} to {:e} is taken as unlimited",
                    joint.name, range[0], range[1]
                ));
            }
            return Ok(());
        }
        for (given, name, side) in [(lower, "lower", 0), (upper, "upper", 1)] {
            if !given {
                // absent ones are 0, whatever the version of the file makes of them
                range[side] = 0.0;
                self.notes.push(format!(
                    "joint `{}`: no {name} limit is given, taken as 0",
                    joint.name
                ));
            }
        }
        if range[0] == range[1] {
            self.notes.push(format!(
                "joint `{}`: lower and upper limit are both {}, taken as unlimited; make it fixed to hold it",
                joint.name, range[0]
            ));
            return Ok(());
        }
        made.range = Some(range);
        Ok(())
    }

    /// A follower of a follower gets the first leader: q = o₁ + m₁ (o₂ + m₂ q_leader). It starts where that puts it.
    fn mimics(&self, urdf: &urdf_rs::Robot, joints: &mut [Joint]) -> Result<(), ModelError> {
        let index: HashMap<&str, usize> = urdf
            .joints
            .iter()
            .enumerate()
            .map(|(i, joint)| (joint.name.as_str(), i))
            .collect();
        let mut direct: Vec<Option<Mimic>> = vec![None; joints.len()];
        for (i, joint) in joints.iter().enumerate().filter(|(_, joint)| joint.moves()) {
            let Some(mimic) = &urdf.joints[i].mimic else {
                continue;
            };
            let refuse = |reason| {
                let (robot, joint, leader) =
                    (self.robot.clone(), joint.name.clone(), mimic.joint.clone());
                let error = ModelError::MimicLeader {
                    robot,
                    joint,
                    leader,
                    reason,
                };
                Err(self.scan.place(self.scan.joints[i], error))
            };
            let Some(&leader) = index.get(mimic.joint.as_str()) else {
                return refuse("does not exist");
            };
            if leader == i {
                return refuse("is itself");
            }
            if !joints[leader].moves() {
                return refuse("is fixed");
            }
            if joint.dofs.len() > 1 || joints[leader].dofs.len() > 1 {
                return refuse("cannot be followed, since one of them has several dofs");
            }
            let (multiplier, offset) =
                (mimic.multiplier.unwrap_or(1.0), mimic.offset.unwrap_or(0.0));
            direct[i] = Some(Mimic {
                joint: leader,
                multiplier,
                offset,
            });
        }
        let mut on_chain = vec![false; joints.len()];
        for start in 0..joints.len() {
            // down to a joint that follows none, or one with a known leader
            let mut chain: Vec<(usize, Mimic)> = Vec::new();
            let mut joint = start;
            while let Some(mimic) = direct[joint].filter(|_| joints[joint].mimic.is_none()) {
                if std::mem::replace(&mut on_chain[joint], true) {
                    let circle = chain.iter().skip_while(|(member, _)| *member != joint);
                    let joints = circle
                        .map(|&(member, _)| joints[member].name.clone())
                        .collect();
                    let robot = self.robot.clone();
                    let error = ModelError::MimicLoop { robot, joints };
                    return Err(self.scan.place(self.scan.joints[joint], error));
                }
                chain.push((joint, mimic));
                joint = mimic.joint;
            }
            for (follower, mimic) in chain.into_iter().rev() {
                joints[follower].mimic = Some(match joints[mimic.joint].mimic {
                    None => mimic,
                    Some(next) => Mimic {
                        joint: next.joint,
                        multiplier: mimic.multiplier * next.multiplier,
                        offset: mimic.offset + mimic.multiplier * next.offset,
                    },
                });
            }
        }
        start_followers(joints);
        Ok(())
    }
}

/// A number in as few digits as are readable.
fn written(number: f64) -> String {
    match (1e-3..1e6).contains(&number) {
        true => number.to_string(),
        false => format!("{number:e}"),
    }
}
