//! What a running simulation is given and is most likely a mistake, and worlds that fault: each is reported once, with the
//! cure, by `tightloop.checks.advice`.

use std::f64::consts::{PI, TAU};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};

use pyo3::prelude::*;
use sim_protocol::{Command, Description, RobotRange};

use crate::followers::Followers;
use crate::frame::PyFrame;
use crate::not_finite::NotFinite;
use crate::rows::{first, number, worlds};

/// Calls whose arrays are looked at: a wrong unit or order is there from the first ones on.
const CALLS: u32 = 256;
/// Bits of `status` of a faulted world: no longer finite, or beyond the bounds.
const FAULTED: u32 = 1 | 8;
/// How far outside of its limits a joint's target looks like degrees [rad]: policies that learn overshoot by less.
const OUTSIDE: f64 = TAU;
/// How far outside of its limits a joint may be written without a warning [rad], as a scene may start.
const SLACK: f64 = 0.2;
/// Standard deviations of angles above this look like degrees [rad].
const NOISE: f64 = PI;
/// No turn, as libraries write it that put w last, or first; each is a half turn in the other order.
const NO_TURN: [[f64; 4]; 2] = [[0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0]];

/// What was reported already; a bit each.
#[derive(Clone, Copy)]
enum Told {
    Targets = 1,
    Degrees = 2,
    Order = 4,
    Torques = 8,
    Faults = 16,
    Gravity = 32,
    Limits = 64,
    Followers = 128,
}

/// What is looked at, and what was reported already.
pub(crate) struct Advice {
    told: AtomicU8,
    calls: AtomicU32,
    /// Targets were sent.
    aims: AtomicBool,
    /// A mocap body got a rotation that is none in either order, so its order is known.
    turned: AtomicBool,
    /// Commands that are not finite are looked for, since they fault their world alone.
    spoils: bool,
    spoiled: NotFinite,
    followers: Followers,
    /// Positions of each dof and of each coordinate that look like degrees are outside of these [rad].
    dofs: Vec<[f64; 2]>,
    coords: Vec<[f64; 2]>,
    /// First coordinates of quaternions.
    quaternions: Vec<usize>,
    /// Dofs whose drive holds the start, whatever clients write; the scene gives it no target.
    holds: Vec<bool>,
}

impl Advice {
    pub(crate) fn new(description: &Description) -> Advice {
        let usual = |range: &Option<[f64; 2]>| match *range {
            Some([lower, upper]) => [lower - OUTSIDE, upper + OUTSIDE],
            None => [f64::NEG_INFINITY, f64::INFINITY],
        };
        let dofs: Vec<_> = description.angle_range.iter().map(usual).collect();
        let names = &description.coord_names;
        let of_coord = |name: &String| {
            let dof = description.dof_names.iter().position(|dof| dof == name);
            dof.and_then(|dof| dofs.get(dof).copied())
                .unwrap_or(usual(&None))
        };
        let mut params = description.params.iter();
        let varies = params
            .any(|param| param.info.name.starts_with("joint_target_k") && param.place.is_some());
        Advice {
            told: AtomicU8::new(0),
            calls: AtomicU32::new(0),
            aims: AtomicBool::new(false),
            turned: AtomicBool::new(false),
            spoils: description.on_nan == "freeze",
            spoiled: NotFinite::default(),
            followers: Followers::new(description),
            coords: names.iter().map(of_coord).collect(),
            quaternions: (0..names.len())
                .filter(|&at| names[at].ends_with(".qx"))
                .collect(),
            holds: description
                .driven
                .iter()
                .map(|follows| !varies && follows & 5 == 1)
                .collect(),
            dofs,
        }
    }

    /// Looks at the arrays of a step.
    pub(crate) fn step(
        &self,
        py: Python<'_>,
        description: &Description,
        commands: &[Command<'_>],
    ) -> PyResult<()> {
        if commands.is_empty() {
            return Ok(());
        }
        if let Some((field, columns)) = aimless(description, commands)
            && !columns.clone().all(|dof| self.followers.has(dof))
            && self.is_new(Told::Targets)
        {
            warn(py, &of_targets(description, field, &columns))?;
        }
        if self.spoils && !self.has_told(Told::Faults) {
            self.spoiled.look(description, commands);
        }
        if !self.looks() {
            return Ok(());
        }
        if commands
            .iter()
            .any(|of| of.field.starts_with("joint_target"))
        {
            self.aims.store(true, Ordering::Relaxed);
        }
        for of in commands {
            match of.field {
                "joint_target_q" => {
                    self.degrees(py, of, &self.dofs, &description.dof_names, None)?;
                    self.followers(py, of, None, description)?;
                }
                "mocap_quat" => self.mocaps(py, of, description, None)?,
                "joint_f" if !self.aims.load(Ordering::Relaxed) => {
                    self.torques(py, of, &description.dof_names)?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Looks at the arrays of a write into the worlds of a mask.
    pub(crate) fn write(
        &self,
        py: Python<'_>,
        description: &Description,
        commands: &[Command<'_>],
        mask: Option<&[bool]>,
    ) -> PyResult<()> {
        if !self.looks() {
            return Ok(());
        }
        for of in commands {
            match of.field {
                "joint_q" => {
                    let names = &description.coord_names;
                    self.degrees(py, of, &self.coords, names, mask)?;
                    self.limits(py, of, names, mask)?;
                    self.followers(py, of, mask, description)?;
                    let first = of.columns.start;
                    let is_whole = |at: &&usize| **at >= first && **at + 4 <= of.columns.end;
                    for at in self
                        .quaternions
                        .iter()
                        .filter(is_whole)
                        .map(|at| at - first)
                    {
                        let told = |world| {
                            let name = names[first + at].trim_end_matches(".qx");
                            of_order(&format!("joint_q of `{name}`"), world, "(x, y, z, w)", 0)
                        };
                        self.order(py, of, at, mask, 1, told)?;
                    }
                }
                "mocap_quat" => self.mocaps(py, of, description, mask)?,
                "gravity" => self.gravity(py, of, mask)?,
                "joint_q_noise" | "joint_target_q_noise" => {
                    let is_angle =
                        |at: usize| self.dofs.get(at).is_some_and(|of| of[0].is_finite());
                    let is_wrong = |at: usize, value: f64| value > NOISE && is_angle(at);
                    if let Some((_, at, value)) = first(of, mask, is_wrong)
                        && self.is_new(Told::Degrees)
                    {
                        let (field, name) = (of.field, &description.dof_names[at]);
                        warn(
                            py,
                            &format!(
                                "params.{field} of `{name}` is {value}, which looks like degrees: angles are in radians, and \
                                 np.radians converts degrees"
                            ),
                        )?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Looks at the worlds of a frame.
    pub(crate) fn frame(
        &self,
        py: Python<'_>,
        description: &Description,
        frame: sim_protocol::Frame,
    ) -> PyResult<PyFrame> {
        let bits = match frame.field("status") {
            Ok(view) if !self.has_told(Told::Faults) => view.as_slice::<u32>().unwrap_or(&[]),
            _ => &[],
        };
        let has_faults = bits.iter().fold(0, |all, bits| all | bits) & FAULTED != 0;
        let frame = PyFrame::new(py, frame)?;
        if !has_faults || !self.is_new(Told::Faults) {
            return Ok(frame);
        }
        let frame = Bound::new(py, frame)?;
        let bounds = (description.joint_q_max, description.joint_qd_max);
        let names = description.dof_names.clone();
        py.import("tightloop.checks.advice")?
            .getattr("tell_of_faults")?
            .call1((
                &frame,
                bounds,
                &description.on_nan,
                &description.on_fault,
                names,
                self.spoiled.take(),
            ))?;
        Ok(PyFrame::again(&frame))
    }

    /// Whether this call is among those whose arrays are looked at.
    fn looks(&self) -> bool {
        self.calls.load(Ordering::Relaxed) < CALLS
            && self.calls.fetch_add(1, Ordering::Relaxed) < CALLS
    }

    fn has_told(&self, what: Told) -> bool {
        self.told.load(Ordering::Relaxed) & what as u8 != 0
    }

    /// Whether something was not reported before; then it is now.
    fn is_new(&self, what: Told) -> bool {
        self.told.fetch_or(what as u8, Ordering::Relaxed) & what as u8 == 0
    }

    /// Warns of mimic joints that are elsewhere than their leaders put them.
    fn followers(
        &self,
        py: Python<'_>,
        of: &Command<'_>,
        mask: Option<&[bool]>,
        description: &Description,
    ) -> PyResult<()> {
        match self.followers.problem(of, mask, description) {
            Some(problem) if self.is_new(Told::Followers) => warn(py, &problem),
            _ => Ok(()),
        }
    }

    /// Warns of positions that look like degrees.
    fn degrees(
        &self,
        py: Python<'_>,
        of: &Command<'_>,
        usual: &[[f64; 2]],
        names: &[String],
        mask: Option<&[bool]>,
    ) -> PyResult<()> {
        let Some(usual) = usual.get(of.columns.clone()) else {
            return Ok(()); // of a daemon that does not tell
        };
        // the daemon refuses what is not finite
        let is_wrong = |at: usize, value: f64| {
            value.is_finite() && (value < usual[at][0] || value > usual[at][1])
        };
        if let Some((world, at, value)) = first(of, mask, is_wrong)
            && self.is_new(Told::Degrees)
        {
            let (field, name) = (of.field, &names[of.columns.start + at]);
            let [lower, upper] = [usual[at][0] + OUTSIDE, usual[at][1] - OUTSIDE];
            let problem = format!(
                "{field} of `{name}` is {value} rad in world {world}, and its limits are {lower:.4} to {upper:.4}: angles are in \
                 radians, and np.radians converts degrees"
            );
            warn(py, &problem)?;
        }
        Ok(())
    }

    /// Warns of positions far outside of limits.
    fn limits(
        &self,
        py: Python<'_>,
        of: &Command<'_>,
        names: &[String],
        mask: Option<&[bool]>,
    ) -> PyResult<()> {
        let Some(usual) = self.coords.get(of.columns.clone()) else {
            return Ok(());
        };
        let inner = OUTSIDE - SLACK;
        let is_wrong = |at: usize, value: f64| {
            value.is_finite() && (value < usual[at][0] + inner || value > usual[at][1] - inner)
        };
        if let Some((world, at, value)) = first(of, mask, is_wrong)
            && !self.has_told(Told::Degrees)
            && self.is_new(Told::Limits)
        {
            let name = &names[of.columns.start + at];
            let [lower, upper] = [usual[at][0] + OUTSIDE, usual[at][1] - OUTSIDE];
            let problem = format!(
                "joint_q of `{name}` is {value:.4} rad in world {world}, far outside of its limits, {lower:.4} to {upper:.4}, which \
                 will push it back: write a position within them"
            );
            warn(py, &problem)?;
        }
        Ok(())
    }

    /// Warns of quaternions of mocap bodies with w last: MuJoCo has it first. One that starts so, or follows others that
    /// turn in either order, is meant.
    fn mocaps(
        &self,
        py: Python<'_>,
        of: &Command<'_>,
        description: &Description,
        mask: Option<&[bool]>,
    ) -> PyResult<()> {
        let [last, first] = NO_TURN;
        for (mocap, name) in description.mocap_names.iter().enumerate() {
            let place = 4 * mocap..4 * mocap + 4;
            if description.mocap_quat.get(place.clone()) == Some(&last[..]) {
                continue;
            }
            let what = format!("mocap_quat of `{name}`");
            let told = |world| of_order(&what, world, "(w, x, y, z), as in MuJoCo", 1);
            if !self.turned.load(Ordering::Relaxed) {
                self.order(py, of, place.start, mask, 0, told)?;
            }
            let width = of.columns.len();
            let turns = worlds(of, mask).any(|world| {
                let part = |at: usize| number(&of.values, world * width + place.start + at);
                let quat: [f64; 4] = std::array::from_fn(part);
                quat != last && quat != first
            });
            if turns {
                self.turned.store(true, Ordering::Relaxed);
            }
        }
        Ok(())
    }

    /// Warns of a quaternion that is no turn in the other order.
    fn order(
        &self,
        py: Python<'_>,
        of: &Command<'_>,
        at: usize,
        mask: Option<&[bool]>,
        other: usize,
        told: impl Fn(usize) -> String,
    ) -> PyResult<()> {
        let width = of.columns.len();
        let is_no_turn = |world: &usize| {
            let place = world * width + at;
            (0..4).all(|part| number(&of.values, place + part) == NO_TURN[other][part])
        };
        if let Some(world) = worlds(of, mask).find(is_no_turn)
            && self.is_new(Told::Order)
        {
            warn(py, &told(world))?;
        }
        Ok(())
    }

    /// Warns of gravity along all axes alike, which is one number that was written to each of them.
    fn gravity(&self, py: Python<'_>, of: &Command<'_>, mask: Option<&[bool]>) -> PyResult<()> {
        let part = |world: usize, axis: usize| number(&of.values, 3 * world + axis);
        let is_one = |&world: &usize| {
            let x = part(world, 0);
            x != 0.0 && part(world, 1) == x && part(world, 2) == x
        };
        if let Some(world) = worlds(of, mask).find(is_one)
            && self.is_new(Told::Gravity)
        {
            let x = part(world, 0);
            let problem = format!(
                "params.gravity is ({x}, {x}, {x}) in world {world}: one number counts for all axes. Give three, such as \
                 (0, 0, -9.81)"
            );
            warn(py, &problem)?;
        }
        Ok(())
    }

    /// Warns of torques on joints whose drive holds a position.
    fn torques(&self, py: Python<'_>, of: &Command<'_>, names: &[String]) -> PyResult<()> {
        let Some(holds) = self.holds.get(of.columns.clone()) else {
            return Ok(());
        };
        let is_wrong = |at: usize, value: f64| holds[at] && value != 0.0;
        if let Some((_, at, _)) = first(of, None, is_wrong)
            && self.is_new(Told::Torques)
        {
            let name = &names[of.columns.start + at];
            let problem = format!(
                "joint_f acts on `{name}` beside its drive, which holds its target. For torques alone, \
                 set joint_target_ke and joint_target_kd of the robot to 0 before launch. To add torques to the drive, send \
                 joint_target_q too"
            );
            warn(py, &problem)?;
        }
        Ok(())
    }
}

/// Targets among the arrays that no drive follows, as far as older daemons say, and whose they are.
fn aimless<'a>(
    description: &Description,
    commands: &[Command<'a>],
) -> Option<(&'a str, Range<usize>)> {
    commands.iter().find_map(|of| {
        let bit = match of.field {
            "joint_target_q" => 1,
            "joint_target_qd" => 2,
            _ => return None,
        };
        let driven = description.driven.get(of.columns.clone())?;
        let is_in_vain = !driven.is_empty() && driven.iter().all(|follows| follows & bit == 0);
        is_in_vain.then(|| (of.field, of.columns.clone()))
    })
}

/// The warning of targets that nothing follows.
#[cold]
fn of_targets(description: &Description, field: &str, dofs: &Range<usize>) -> String {
    let robots = description.robots.iter();
    let owners = robots.filter(|robot| robot.dofs[0] < dofs.end && dofs.start < robot.dofs[1]);
    let (models, others): (Vec<&RobotRange>, Vec<&RobotRange>) =
        owners.partition(|robot| robot.is_mujoco);
    let gains = match field {
        "joint_target_q" => "joint_target_ke and joint_target_kd",
        _ => "joint_target_kd, and joint_target_mode \"velocity\" or \"both\",",
    };
    let is_still = |model: &&RobotRange| model.actuators[0] == model.actuators[1];
    let still = models.iter().copied().find(is_still);
    let mut cures = Vec::new();
    if !others.is_empty() {
        cures.push(format!(
            "set {gains} of the robot before launch, or send joint_f"
        ));
    } else if !models.iter().all(is_still) {
        cures.push("actuators of a MuJoCo model follow ctrl".to_owned());
    }
    if let Some(model) = still {
        cures.push(format!(
            "model `{0}` from MuJoCo has no actuators: call scene.models[\"{0}\"].add_position_actuators(stiffness=…, damping=…) \
             before launch and send ctrl, or send joint_f",
            model.name
        ));
    }
    let names: Vec<_> = others
        .iter()
        .chain(&models)
        .map(|robot| format!("`{}`", robot.name))
        .collect();
    format!(
        "{field} has no effect, since no drive of {} follows it: {}",
        names.join(", "),
        cures.join("; ")
    )
}

/// The warning of a quaternion in the other order; `place` is that of the order in [`NO_TURN`].
#[cold]
fn of_order(what: &str, world: usize, order: &str, place: usize) -> String {
    let text = |quaternion: [f64; 4]| {
        let [a, b, c, d] = quaternion;
        format!("({a}, {b}, {c}, {d})")
    };
    let (given, meant) = (NO_TURN[1 - place], NO_TURN[place]);
    // the same half turn, which nobody writes by mistake
    let half = text(given.map(|part| if part == 0.0 { 0.0 } else { -part }));
    format!(
        "{what} turns by 180° in world {world}: its quaternion is {}, and the order is {order}. Give {} for no turn, or {half} if \
         the half turn is meant",
        text(given),
        text(meant)
    )
}

#[cold]
fn warn(py: Python<'_>, problem: &str) -> PyResult<()> {
    // the numbers differ from simulation to simulation, and the mistake is the same
    py.import("tightloop.checks.advice")?
        .call_method1("warn_of_values", (problem,))
        .map(drop)
}
