//! Checks of the tree of links: one root, no loops, and mass on every moving body.

use std::collections::HashSet;

use super::fault::{Culprit, Fault};
use crate::description::{Joint, JointDof, Robot};
use crate::error::ModelError;
use crate::inertia::{Inertial, merge, principal_moments};
use crate::joint_kind::JointKind;
use crate::pose::Pose;

/// Smallest mass [kg] and principal moment [kg·m²] of a moving body, MuJoCo's mjMINVAL.
const INERTIA_MIN: f64 = 1e-15;

impl Robot {
    /// One root, one parent each, no loop.
    pub(super) fn validate_tree(&self) -> Result<(), Fault> {
        let robot = || self.name.clone();
        if self.links.is_empty() {
            return Err(Culprit::Robot.blame(ModelError::NoLinks { robot: robot() }));
        }
        let mut parent_joint: Vec<Option<&Joint>> = vec![None; self.links.len()];
        for (index, joint) in self.joints.iter().enumerate() {
            for (role, link) in [("parent", joint.parent), ("child", Some(joint.child))] {
                if let Some(link) = link.filter(|&link| link >= self.links.len()) {
                    return Err(Culprit::Joint(index).blame(ModelError::UnknownLink {
                        robot: robot(),
                        joint: joint.name.clone(),
                        role,
                        link: format!("#{link}"),
                        known: format!("#0 to #{}", self.links.len() - 1),
                    }));
                }
            }
            let before = parent_joint[joint.child].replace(joint);
            // MuJoCo's links may have several joints, one after another
            let is_next =
                |first: &&Joint| self.precompiled.is_some() && first.parent == joint.parent;
            if let Some(first) = before.filter(|first| !is_next(first)) {
                return Err(Culprit::Joint(index).blame(ModelError::TwoParents {
                    robot: robot(),
                    link: self.links[joint.child].name.clone(),
                    first: first.name.clone(),
                    second: joint.name.clone(),
                }));
            }
        }
        let roots: Vec<usize> = (0..self.links.len())
            .filter(|&link| parent_joint[link].is_none_or(|joint| joint.parent.is_none()))
            .collect();
        if let [_, second, ..] = roots[..] {
            let names = roots.iter().map(|&link| self.links[link].name.clone());
            let (robot, roots) = (robot(), names.collect());
            return Err(Culprit::Link(second).blame(ModelError::SeveralRoots { robot, roots }));
        }
        let reached: HashSet<usize> = self.link_order().into_iter().collect();
        let Some(lost) = (0..self.links.len()).find(|link| !reached.contains(link)) else {
            return Ok(());
        };
        // upwards from a link that hangs from no root, the first one met twice lies on the loop
        let up = |link: usize| {
            parent_joint[link]
                .and_then(|joint| joint.parent)
                .unwrap_or(link)
        };
        let mut met = HashSet::new();
        let mut link = lost;
        while met.insert(link) {
            link = up(link);
        }
        let mut ring = vec![link];
        while up(ring[ring.len() - 1]) != link {
            ring.push(up(ring[ring.len() - 1]));
        }
        ring.reverse();
        let links = ring
            .into_iter()
            .map(|link| self.links[link].name.clone())
            .collect();
        let robot = robot();
        Err(Culprit::Link(link).blame(ModelError::LinkLoop { robot, links }))
    }

    /// Free bodies are carried by the world, and nothing drives them.
    pub(super) fn validate_free(&self) -> Result<(), Fault> {
        let mut above = vec![None; self.links.len()];
        for joint in &self.joints {
            above[joint.child] = Some(joint);
        }
        // the nearest moving joint at or above each link
        let mut carrier: Vec<Option<&Joint>> = vec![None; self.links.len()];
        for link in self.link_order() {
            carrier[link] = above[link].and_then(|joint| match joint.moves() {
                true => Some(joint),
                false => carrier[joint.parent?],
            });
        }
        let drives = |dof: &JointDof| {
            let targets = [dof.target_q.unwrap_or(0.0), dof.target_qd];
            dof.target_ke > 0.0 || dof.target_kd > 0.0 || targets.iter().any(|x| x.abs() > 0.0)
        };
        let free = |joint: &&Joint| joint.kind == JointKind::Free;
        for (index, joint) in self.joints.iter().enumerate().filter(|(_, j)| free(j)) {
            let (robot, name) = (self.name.clone(), joint.name.clone());
            if let Some(carrier) = joint.parent.and_then(|parent| carrier[parent]) {
                return Err(Culprit::Joint(index).blame(ModelError::FreeBelow {
                    robot,
                    joint: name,
                    carrier: carrier.name.clone(),
                }));
            }
            if joint.dofs.iter().any(drives) {
                return Err(
                    Culprit::Joint(index).blame(ModelError::FreeDrive { robot, joint: name })
                );
            }
        }
        Ok(())
    }

    /// Each moving link weighs something, together with the links fixed to it.
    pub(super) fn validate_moving_mass(&self) -> Result<(), Fault> {
        let nothing = Inertial {
            mass: 0.0,
            pos: [0.0; 3],
            inertia: [[0.0; 3]; 3],
        };
        let mut parent_joint: Vec<Option<&Joint>> = vec![None; self.links.len()];
        for joint in &self.joints {
            parent_joint[joint.child] = Some(joint);
        }
        // the link each one moves with, and its frame in that link's
        let mut carrier: Vec<(usize, Pose)> = (0..self.links.len())
            .map(|link| (link, Pose::identity()))
            .collect();
        let mut bodies = vec![nothing; self.links.len()];
        let order = self.link_order();
        for &link in &order {
            let fixed = parent_joint[link].filter(|joint| !joint.moves());
            if let Some((joint, parent)) = fixed.and_then(|joint| Some((joint, joint.parent?))) {
                let (body, frame) = carrier[parent];
                carrier[link] = (body, frame.mul(&joint.origin));
            }
            if let Some(inertial) = &self.links[link].inertial {
                let (body, frame) = carrier[link];
                bodies[body] = merge(&bodies[body], &frame, inertial);
            }
        }
        for link in order {
            let Some(joint) = parent_joint[link].filter(|joint| joint.moves()) else {
                continue;
            };
            let lacks = if bodies[link].mass < INERTIA_MIN {
                "mass"
            } else if principal_moments(bodies[link].inertia)[0] < INERTIA_MIN {
                "inertia"
            } else {
                continue;
            };
            return Err(Culprit::Link(link).blame(ModelError::Massless {
                robot: self.name.clone(),
                link: self.links[link].name.clone(),
                joint: joint.name.clone(),
                lacks,
            }));
        }
        Ok(())
    }
}
