//! Parameters that a reset draws: which values of them, and from which distribution.

use super::joint::{Joint, TargetMode};
use super::precompiled::Precompiled;
use super::robot::Robot;
use super::scene::Description;
use crate::distribution::Distribution;
use crate::error::{ModelError, first_few};
use crate::joint_kind::JointKind;
use sim_physics::constants::params::{Param, Per};

/// A number of a parameter that a reset draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParamDraw {
    /// The parameter.
    pub param: Param,
    /// Which of its numbers.
    pub column: usize,
    /// What it is drawn from; a draw below the parameter's least is the least, and a delay above its most the most.
    pub distribution: Distribution,
}

impl Description {
    /// The numbers that a reset draws, parameter by parameter.
    ///
    /// # Errors
    /// A range of a load, a name that nothing has, a distribution that reaches numbers which the parameter cannot have.
    pub(crate) fn param_draws(&self) -> Result<Vec<ParamDraw>, ModelError> {
        let mut draws = Vec::new();
        for (&param, ranges) in &self.param_ranges {
            let names = self.names_of_numbers(param);
            for (name, distribution) in ranges {
                check(param, name, distribution)?;
                self.check_delay(param, distribution)?;
                if !names.iter().flatten().any(|other| other == name) {
                    return Err(refused(param, name, unknown(name, &names)));
                }
            }
            let modes = self
                .dofs()
                .map(|(_, joint, part)| joint.dofs[part].target_mode);
            let modes: Vec<TargetMode> = modes.collect();
            for (column, names) in names.iter().enumerate() {
                let range = |name: &String| Some((name.clone(), *ranges.get(name)?));
                let Some((name, distribution)) = names.iter().rev().find_map(range) else {
                    continue;
                };
                if param == Param::JointTargetKe
                    && modes[column] == TargetMode::Velocity
                    && !distribution.is_always_0()
                {
                    let dof = names.last().unwrap_or(&name);
                    let problem = format!(
                        "the drive of `{dof}` follows velocity targets only; give that joint Uniform(0, 0), or another target mode"
                    );
                    return Err(refused(param, &name, problem));
                }
                draws.push(ParamDraw {
                    param,
                    column,
                    distribution,
                });
            }
        }
        Ok(draws)
    }

    /// Refuses delays of commands for which there is no room.
    fn check_delay(&self, param: Param, distribution: &Distribution) -> Result<(), ModelError> {
        let (part, number) = match *distribution {
            Distribution::Uniform { high, .. } => ("high", high),
            Distribution::Normal { mean, .. } => ("mean", mean),
        };
        let most = self.delay_max();
        if param == Param::CommandDelay && number > most as f64 {
            let problem = format!(
                "{part} is {number}; give at most {most}, or more room with the scene's command_delay_max"
            );
            return Err(refused(param, "", problem));
        }
        Ok(())
    }

    /// Names of each number of a parameter, the most special one last; none of what it does not act on.
    fn names_of_numbers(&self, param: Param) -> Vec<Vec<String>> {
        match param.row().per {
            Per::Entry(1) => vec![vec![String::new()]],
            Per::Entry(n) => ["x", "y", "z"]
                .iter()
                .take(n)
                .map(|axis| vec![axis.to_string()])
                .collect(),
            Per::Dof => {
                let not_of_free = matches!(
                    param,
                    Param::JointTargetKe
                        | Param::JointTargetKd
                        | Param::JointEffortLimit
                        | Param::JointFriction
                        | Param::JointTargetQNoise
                        | Param::JointTargetQdNoise
                );
                let names = |(robot, joint, part): (&Robot, &Joint, usize)| {
                    let not_of_balls = matches!(
                        param,
                        Param::JointRef | Param::JointLimitLower | Param::JointLimitUpper
                    );
                    if (not_of_free || not_of_balls) && joint.kind == JointKind::Free
                        || not_of_balls && joint.kind == JointKind::Ball
                    {
                        return Vec::new();
                    }
                    let mut names =
                        vec![robot.name.clone(), format!("{}/{}", robot.name, joint.name)];
                    let part = joint.kind.dof_names()[part];
                    if !part.is_empty() {
                        names.push(format!("{}.{part}", names[1]));
                    }
                    names
                };
                self.dofs().map(names).collect()
            }
            Per::Body(n) => {
                let links = self.robots.iter().flat_map(|robot| {
                    let links = robot.link_order().into_iter();
                    let name = |link: usize| format!("{}/{}", robot.name, robot.links[link].name);
                    links.map(move |link| vec![robot.name.clone(), name(link)])
                });
                links
                    .flat_map(|names| with_parts(param, names, n))
                    .collect()
            }
            Per::Shape(n) => {
                let names = self.shape_names().into_iter().map(with_owners);
                names
                    .flat_map(|names| with_parts(param, names, n))
                    .collect()
            }
            Per::Site(n) => {
                let parts = |name: &String| match n {
                    1 => vec![vec![name.clone()]],
                    _ => ["linear", "angular"]
                        .map(|part| vec![name.clone(), format!("{name}.{part}")])
                        .to_vec(),
                };
                self.sites
                    .iter()
                    .flat_map(|site| parts(&site.name))
                    .collect()
            }
            Per::Actuator(n) => {
                let names = self.names_in_models(|parts| {
                    let actuators = parts.actuators.iter();
                    actuators.map(|actuator| &actuator.name).collect()
                });
                names
                    .flat_map(|names| with_parts(param, names, n))
                    .collect()
            }
            Per::ContactPair(n) => {
                let names = self
                    .names_in_models(|parts| parts.pairs.iter().map(|pair| &pair.name).collect());
                names
                    .flat_map(|names| with_parts(param, names, n))
                    .collect()
            }
            Per::ContactSensor => {
                let sensors = self.contact_sensors.iter();
                sensors.map(|sensor| vec![sensor.name.clone()]).collect()
            }
        }
    }

    /// Of elements of models from MuJoCo, the name of their robot, then their own.
    fn names_in_models(
        &self,
        elements: fn(&Precompiled) -> Vec<&String>,
    ) -> impl Iterator<Item = Vec<String>> + '_ {
        let models = self.robots.iter();
        let models = models.filter_map(|robot| Some((robot, robot.precompiled.as_ref()?)));
        models.flat_map(move |(robot, parts)| {
            let names = elements(parts).into_iter();
            names.map(|name| vec![robot.name.clone(), format!("{}/{name}", robot.name)])
        })
    }

    /// All dofs in order: robot, joint, and which one of the joint.
    fn dofs(&self) -> impl Iterator<Item = (&Robot, &Joint, usize)> {
        self.robots.iter().flat_map(|robot| {
            let joints = robot.moving_joints().into_iter();
            joints.flat_map(move |joint| {
                let joint = &robot.joints[joint];
                (0..joint.dofs.len()).map(move |part| (robot, joint, part))
            })
        })
    }
}

/// Names of each of the `n` numbers that something of these names has: at last its own, where the parameter's parts have names.
fn with_parts(param: Param, names: Vec<String>, n: usize) -> Vec<Vec<String>> {
    let parts: &[&str] = match param {
        Param::BodyCom => &["x", "y", "z"],
        Param::ActuatorForcerange => &["lower", "upper"],
        Param::ShapeSolref => &["timeconst", "dampratio"],
        Param::ShapeSolimp => &["dmin", "dmax", "width", "midpoint"],
        Param::PairFriction => &["slide", "torsion", "roll"],
        _ => &[],
    };
    let of_number = |k: usize| {
        let part = parts.get(k).zip(names.last());
        let part = part.map(|(part, name)| format!("{name}.{part}"));
        names.iter().cloned().chain(part).collect()
    };
    (0..n).map(of_number).collect()
}

/// The name of a shape after those of its robot or body and its link.
fn with_owners(shape: String) -> Vec<String> {
    let ends = shape.match_indices('/').map(|(end, _)| end);
    let mut names: Vec<String> = ends.map(|end| shape[..end].to_owned()).collect();
    names.push(shape);
    names
}

/// Why a name is that of no number, and which there are: of the robot that it begins with, or else of robots.
fn unknown(name: &str, names: &[Vec<String>]) -> String {
    if names == [[""]] {
        return "it is one number; give the distribution without a name".to_owned();
    }
    let robot = |name: &str| name.split('/').next().map(str::to_owned);
    let special = names.iter().filter_map(|all| all.last());
    let mut known: Vec<&String> = special
        .filter(|other| robot(other) == robot(name))
        .collect();
    if known.is_empty() {
        known = names.iter().filter_map(|all| all.first()).collect();
        known.dedup();
    }
    let problem = match name {
        "" => "give distributions by name",
        _ => "nothing that it varies has this name",
    };
    format!("{problem}; there are: {}", first_few(&known))
}

/// Refuses what no number of the parameter can be drawn from.
fn check(param: Param, name: &str, distribution: &Distribution) -> Result<(), ModelError> {
    if param.is_load() {
        let problem = "it is a load, which a reset clears; write it with the steps that it acts in";
        return Err(refused(param, name, problem.to_owned()));
    }
    distribution.validate(&culprit(param, name))?;
    let (part, number) = match *distribution {
        Distribution::Uniform { low, .. } => ("low", low),
        Distribution::Normal { mean, .. } => ("mean", mean),
    };
    match param.row().least {
        Some(least) if number < least => {
            let problem = format!("{part} is {number}; give at least {least}");
            Err(refused(param, name, problem))
        }
        _ => Ok(()),
    }
}

fn refused(param: Param, name: &str, problem: String) -> ModelError {
    ModelError::ParamRange {
        culprit: culprit(param, name),
        problem,
    }
}

/// An entry, for messages.
fn culprit(param: Param, name: &str) -> String {
    let param = param.row().name;
    match name.is_empty() {
        true => format!("randomize: {param}"),
        false => format!("randomize: {param} of `{name}`"),
    }
}
