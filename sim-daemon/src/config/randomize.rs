//! What a reset draws of the start state and of parameters, by name.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use sim_model::{
    CameraPart, Description, Distribution, Joint, JointDof, JointKind, ModelError, Robot,
};
use sim_physics::constants::params::Param;

use super::error::ConfigError;
use super::number::Number;

/// Distributions by the names of what they are of; of a robot and of one of its joints, the joint's holds.
type Named<T> = BTreeMap<String, T>;

/// Offsets from the start state, and parameters, that a reset draws.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RandomizeTable {
    /// Of joint positions [rad or m]: `robot` for all its joints, `robot/joint`, `robot/joint.part`.
    #[serde(skip_serializing_if = "Named::is_empty")]
    pub joint_q: Named<DistributionTable>,
    /// Of joint velocities [rad/s or m/s], named alike.
    #[serde(skip_serializing_if = "Named::is_empty")]
    pub joint_qd: Named<DistributionTable>,
    /// Of poses of bodies, floating robots and floating joints (`robot/joint`): `x`, `y`, `z` [m], `roll`, `pitch`, `yaw`
    /// [rad], along and about the world's axes.
    #[serde(skip_serializing_if = "Named::is_empty")]
    pub body_q: Named<Named<DistributionTable>>,
    /// Of their velocities: `vx`, `vy`, `vz` [m/s], `wx`, `wy`, `wz` [rad/s], in the world's axes.
    #[serde(skip_serializing_if = "Named::is_empty")]
    pub body_qd: Named<Named<DistributionTable>>,
    /// Of cameras, along and about their own axes: `x`, `y`, `z` [m], `roll`, `pitch`, `yaw` [rad], and `focal`, a part of the
    /// focal lengths [–].
    #[serde(skip_serializing_if = "Named::is_empty")]
    pub cameras: Named<Named<DistributionTable>>,
    /// Of parameters, which are replaced, not offset.
    #[serde(skip_serializing_if = "Named::is_empty")]
    pub params: Named<ParamTable>,
}

/// Distributions of the numbers of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected distributions by name, such as { arm = { uniform = [0, 1] } }, or of uniform or normal one alone where the parameter is one number"
)]
pub enum ParamTable {
    /// Of a parameter that is one number.
    Alone(DistributionTable),
    /// By what they are of: a robot or body for all that it has, `robot/joint`, `robot/link`, a shape; of gravity `x`, `y`, `z`.
    Named(Named<DistributionTable>),
}

/// A distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DistributionTable {
    /// Low and high end.
    Uniform([Number; 2]),
    /// Mean and standard deviation.
    Normal([Number; 2]),
}

/// Parts of a pose, in the order of a free joint's dofs.
const POSE: [&str; 6] = ["x", "y", "z", "roll", "pitch", "yaw"];

/// Sets the distribution of a dof.
type Set = fn(&mut JointDof, Distribution);

impl DistributionTable {
    fn distribution(self) -> Distribution {
        match self {
            DistributionTable::Uniform([low, high]) => Distribution::Uniform {
                low: low.0,
                high: high.0,
            },
            DistributionTable::Normal([mean, std]) => Distribution::Normal {
                mean: mean.0,
                std: std.0,
            },
        }
    }

    fn checked(self, what: &str) -> Result<Distribution, ConfigError> {
        let distribution = self.distribution();
        distribution.validate(what)?;
        Ok(distribution)
    }
}

impl RandomizeTable {
    /// Whether nothing is drawn.
    pub fn is_empty(&self) -> bool {
        *self == RandomizeTable::default()
    }

    /// Gives the dofs of a scene their distributions.
    pub(super) fn write(&self, scene: &mut Description) -> Result<(), ConfigError> {
        let set_q: Set = |dof, offset| dof.offset_q = Some(offset);
        let set_qd: Set = |dof, offset| dof.offset_qd = Some(offset);
        // a robot's name comes before those of its joints, so theirs hold
        for (field, set, named) in [
            ("joint_q", set_q, &self.joint_q),
            ("joint_qd", set_qd, &self.joint_qd),
        ] {
            for (name, table) in named {
                let culprit = Culprit { field, name };
                let distribution = table.checked(&culprit.to_string())?;
                for dof in culprit.dofs_of_joints(scene)? {
                    set(dof, distribution);
                }
            }
        }
        let velocity = JointKind::Free.dof_names();
        for (field, set, named, parts) in [
            ("body_q", set_q, &self.body_q, &POSE[..]),
            ("body_qd", set_qd, &self.body_qd, velocity),
        ] {
            for (name, tables) in named {
                let culprit = Culprit { field, name };
                let joint = culprit.free_joint(scene)?;
                for (part, table) in tables {
                    let Some(dof) = parts.iter().position(|known| known == part) else {
                        let problem = format!("has no part `{part}`; use {}", parts.join(", "));
                        return Err(culprit.error(problem));
                    };
                    let distribution = table.checked(&format!("{culprit}, {part}"))?;
                    set(&mut joint.dofs[dof], distribution);
                }
            }
        }
        for (name, tables) in &self.cameras {
            let field = "cameras";
            let culprit = Culprit { field, name };
            let Some(place) = scene.cameras.iter().position(|camera| camera.name == *name) else {
                let known = some(scene.cameras.iter().map(|camera| &camera.name));
                let problem = format!("there is no such camera; there are: {known}");
                return Err(culprit.error(problem));
            };
            for (part, table) in tables {
                let names = CameraPart::ALL.map(CameraPart::name);
                let Some(index) = names.iter().position(|known| known == part) else {
                    let problem = format!("has no part `{part}`; use {}", names.join(", "));
                    return Err(culprit.error(problem));
                };
                let distribution = table.checked(&format!("{culprit}, {part}"))?;
                scene.cameras[place].draws[index] = Some(distribution);
            }
        }
        for (name, table) in &self.params {
            let ranges = match table {
                ParamTable::Alone(alone) => [(String::new(), alone.distribution())].into(),
                ParamTable::Named(named) => (named.iter())
                    .map(|(name, table)| (name.clone(), table.distribution()))
                    .collect(),
            };
            scene.param_ranges.insert(param(name)?, ranges);
        }
        Ok(())
    }
}

/// An entry, for messages.
#[derive(Clone, Copy)]
struct Culprit<'a> {
    field: &'static str,
    name: &'a str,
}

impl std::fmt::Display for Culprit<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "randomize: {} of `{}`", self.field, self.name)
    }
}

impl<'a> Culprit<'a> {
    fn error(self, problem: String) -> ConfigError {
        ConfigError::Randomize {
            culprit: self.to_string(),
            problem,
        }
    }

    /// The robot that the name begins with, and the rest of the name.
    fn robot<'s>(
        self,
        scene: &'s mut Description,
    ) -> Result<(&'s mut Robot, Option<&'a str>), ConfigError> {
        let (robot, rest) = match self.name.split_once('/') {
            Some((robot, rest)) => (robot, Some(rest)),
            None => (self.name, None),
        };
        let place = scene.robots.iter().position(|other| other.name == robot);
        let Some(place) = place else {
            let known = some(scene.robots.iter().map(|robot| &robot.name));
            let problem = format!("there is no robot or body `{robot}`; there are: {known}");
            return Err(self.error(problem));
        };
        Ok((&mut scene.robots[place], rest))
    }

    /// The dofs that a name of `joint_q` or `joint_qd` means.
    fn dofs_of_joints(self, scene: &mut Description) -> Result<Vec<&mut JointDof>, ConfigError> {
        let (robot, rest) = self.robot(scene)?;
        // followers start where their leaders do, free joints are bodies
        let is_drawn = |joint: &Joint| joint.kind != JointKind::Free && joint.mimic.is_none();
        let Some(rest) = rest else {
            let joints = robot.joints.iter_mut().filter(|joint| is_drawn(joint));
            let dofs: Vec<_> = joints.flat_map(|joint| &mut joint.dofs).collect();
            if dofs.is_empty() {
                let problem =
                    "it has no joints but free and following ones; body_q and body_qd move bodies";
                return Err(self.error(problem.to_owned()));
            }
            return Ok(dofs);
        };
        let means = |joint: &Joint| {
            let part = rest.strip_prefix(joint.name.as_str())?;
            let parts = joint.kind.dof_names();
            match part.strip_prefix('.') {
                _ if part.is_empty() => Some(0..parts.len()),
                Some(part) => {
                    let place = parts
                        .iter()
                        .position(|known| *known == part && !part.is_empty())?;
                    Some(place..place + 1)
                }
                None => None,
            }
        };
        let named = robot
            .joints
            .iter()
            .enumerate()
            .find_map(|(index, joint)| Some((index, means(joint)?)));
        let Some((index, dofs)) = named.filter(|(_, dofs)| !dofs.is_empty()) else {
            let names = robot.moving_joints().into_iter();
            let known = some(names.map(|joint| &robot.joints[joint].name));
            let problem = format!("there is no moving joint `{rest}`; there are: {known}");
            return Err(self.error(problem));
        };
        let joint = &robot.joints[index];
        if joint.kind == JointKind::Free {
            let problem = "it is a floating joint; give body_q or body_qd";
            return Err(self.error(problem.to_owned()));
        }
        if let Some(mimic) = joint.mimic {
            let leader = &robot.joints[mimic.joint].name;
            let problem = format!("it follows `{leader}`; give `{leader}` the distribution");
            return Err(self.error(problem));
        }
        Ok(robot.joints[index].dofs[dofs].iter_mut().collect())
    }

    /// The free joint that a name of `body_q` or `body_qd` means.
    fn free_joint(self, scene: &mut Description) -> Result<&mut Joint, ConfigError> {
        let (robot, rest) = self.robot(scene)?;
        let free = |joint: &Joint| joint.kind == JointKind::Free;
        let all: Vec<usize> = (0..robot.joints.len())
            .filter(|&joint| free(&robot.joints[joint]))
            .collect();
        let index = match (rest, &all[..]) {
            (None, [only]) => Some(*only),
            (None, _) => None,
            (Some(rest), all) => all
                .iter()
                .copied()
                .find(|&joint| robot.joints[joint].name == rest),
        };
        let Some(index) = index else {
            let known = all.iter().map(|&joint| &robot.joints[joint].name);
            let problem = match all.len() {
                0 => "it does not move freely; leave it out, or let it float".to_owned(),
                _ => format!("name one of its floating joints: {}", some(known)),
            };
            return Err(self.error(problem));
        };
        Ok(&mut robot.joints[index])
    }
}

/// The first few names of many.
fn some<'a>(names: impl Iterator<Item = &'a String>) -> String {
    const MOST: usize = 20;
    let names: Vec<&str> = names.map(String::as_str).collect();
    match names.len() {
        0 => "none".to_owned(),
        1..=MOST => names.join(", "),
        _ => format!("{}, …", names[..MOST].join(", ")),
    }
}

/// The parameter of a name.
pub(super) fn param(name: &str) -> Result<Param, ModelError> {
    Param::named(name).ok_or_else(|| ModelError::UnknownName {
        owner: "scene".to_owned(),
        what: "parameter",
        name: name.to_owned(),
        known: Param::ALL.map(|param| param.row().name).join(", "),
    })
}
