//! Five scenes and those of files, the commands of their frames, and how worlds differ.

use crate::common::{Demo, FRAMES, command, lesson, lesson_with_table, noise, numbers};
use crate::robots::{self, Case};
use anyhow::{Context, ensure};
use sim_engine::backend::Values;
use sim_engine::simulation::Simulation;
use sim_model::{Description, KeyState, Model};
use sim_physics::arrays::Field;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;

/// Half of the square within which a cube is put [m], about its place in the record: what examples/franka_grasp.py draws from.
const PLACE: f64 = 0.004;
/// Coordinates of the arm, and of the cube behind them.
const ARM: usize = 9;
const CUBE: usize = 7;
/// Hip, thigh and calf of a leg that stands [rad], and the height of the trunk then [m].
const STAND: [f64; 3] = [0.0, 0.8, -1.6];
const HEIGHT: f64 = 0.32;

/// A scene by its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Scene {
    /// The lesson's arm under a torque, nothing to touch.
    TorqueFree,
    /// The same, driven to position targets.
    Target,
    /// The recorded grasp of a cube on a table.
    Grasp,
    /// Twelve driven joints on a floating base.
    Quadruped,
    /// The same robot on the ground, stepping in place.
    Standing,
    /// A scene file.
    File(PathBuf),
}

impl FromStr for Scene {
    type Err = String;

    fn from_str(text: &str) -> Result<Scene, String> {
        if text.ends_with(".toml") {
            return Ok(Scene::File(PathBuf::from(text)));
        }
        let known = [
            Scene::TorqueFree,
            Scene::Target,
            Scene::Grasp,
            Scene::Quadruped,
            Scene::Standing,
        ];
        let names: Vec<&str> = known.iter().map(Scene::name).collect();
        match names.iter().position(|name| *name == text) {
            Some(place) => Ok(known[place].clone()),
            None => Err(format!(
                "unknown; give a scene file that ends in .toml, or {}",
                names.join(", ")
            )),
        }
    }
}

impl Scene {
    /// Its name in results; of the five, on the command line too.
    pub fn name(&self) -> &str {
        match self {
            Scene::File(path) => path
                .file_stem()
                .and_then(|stem| stem.to_str())
                .unwrap_or("scene"),
            Scene::TorqueFree => "torque_free",
            Scene::Target => "target",
            Scene::Grasp => "grasp",
            Scene::Quadruped => "quadruped",
            Scene::Standing => "standing",
        }
    }
}

impl Scene {
    /// As the command line has it.
    pub fn argument(&self) -> &OsStr {
        match self {
            Scene::File(path) => path.as_os_str(),
            other => OsStr::new(other.name()),
        }
    }
}

/// Worlds of a run: world k of it is number `ids[k]` of `of`, and has that one's start and commands.
pub struct WorldSet {
    ids: Vec<usize>,
    of: usize,
}

impl WorldSet {
    /// All of them.
    pub fn all(of: usize) -> WorldSet {
        let ids = (0..of).collect();
        WorldSet { ids, of }
    }

    /// Some of them.
    pub fn some(ids: &[usize], of: usize) -> WorldSet {
        let ids = ids.to_vec();
        WorldSet { ids, of }
    }

    /// How many.
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// From 1 in the first world to -1 in the last.
    fn amplitudes(&self) -> Vec<f32> {
        let share = |id: &usize| 2.0 * *id as f32 / (self.of - 1).max(1) as f32;
        self.ids.iter().map(|id| 1.0 - share(id)).collect()
    }
}

/// The quadruped on its feet on the ground, as its velocity task has it.
fn standing() -> Description {
    let mut description = Case::Quadruped.scene();
    description.add_ground("", -HEIGHT);
    let robot = &mut description.robots[0];
    let joints = robot
        .joints
        .iter_mut()
        .filter(|joint| joint.range.is_some());
    for (k, joint) in joints.enumerate() {
        joint.q[0] = STAND[k % 3];
        let dof = &mut joint.dofs[0];
        [dof.target_ke, dof.target_kd] = [40.0, 1.0];
    }
    description
}

/// Targets of a trot in place: diagonal legs lift their feet in turns.
fn trot(rest: &[f64], frame: usize) -> Vec<f64> {
    let phase = std::f64::consts::TAU * 1.5 * frame as f64 / 50.0;
    let mut row = rest.to_vec();
    for leg in 0..4 {
        let side = if leg == 0 || leg == 3 {
            0.0
        } else {
            std::f64::consts::PI
        };
        let lift = 0.3 * (phase + side).sin().max(0.0);
        row[6 + 3 * leg + 1] += lift;
        row[6 + 3 * leg + 2] -= 2.0 * lift;
    }
    row
}

/// A scene, ready to run.
pub struct Plan {
    pub scene: Scene,
    pub model: Arc<Model>,
    pub field: Field,
    /// A command a frame; world 0 gets it as it is.
    rows: Vec<Vec<f32>>,
    /// About which the worlds' commands differ.
    rest: Vec<f32>,
    /// Where worlds begin, if not at the scene's start.
    begin: Option<KeyState>,
}

impl Plan {
    /// Compiles the scene.
    pub fn new(scene: &Scene) -> anyhow::Result<Plan> {
        let lessons = |demo: Demo| -> Vec<Vec<f64>> {
            let frames = 0..FRAMES;
            frames.map(|f| command(demo, f).1.to_vec()).collect()
        };
        let (description, field, rows, rest) = match scene {
            Scene::File(path) => return Plan::of_file(scene, path),
            Scene::TorqueFree => {
                let rest = vec![0.0; ARM];
                (
                    lesson(Demo::Torque),
                    Field::JointF,
                    lessons(Demo::Torque),
                    rest,
                )
            }
            Scene::Target => {
                let rest = lessons(Demo::Target).swap_remove(0);
                (
                    lesson(Demo::Target),
                    Field::JointTargetQ,
                    lessons(Demo::Target),
                    rest,
                )
            }
            Scene::Grasp => {
                let mut rows = numbers(include_str!("../../tests/data/grasp_targets.csv"));
                // the cube has no drive
                rows.iter_mut().for_each(|row| row.resize(ARM + 6, 0.0));
                let rest = vec![0.0; ARM + 6];
                (
                    lesson_with_table(Demo::Target, true),
                    Field::JointTargetQ,
                    rows,
                    rest,
                )
            }
            Scene::Quadruped => {
                let description = Case::Quadruped.scene();
                let robot = &description.robots[0];
                let rows: Vec<_> = (0..robots::FRAMES)
                    .map(|f| robots::targets(robot, f))
                    .collect();
                let rest = (0..rows[0].len())
                    .map(|dof| rows.iter().map(|row| row[dof]).sum::<f64>() / rows.len() as f64)
                    .collect();
                (description, Field::JointTargetQ, rows, rest)
            }
            Scene::Standing => {
                let description = standing();
                let rest = description.robots[0].moving_joints();
                let rest = rest.into_iter().flat_map(|index| {
                    match description.robots[0].joints[index].range {
                        Some(_) => description.robots[0].joints[index].q.clone(),
                        None => vec![0.0; 6],
                    }
                });
                let rest: Vec<f64> = rest.collect();
                let rows = (0..robots::FRAMES)
                    .map(|frame| trot(&rest, frame))
                    .collect();
                (description, Field::JointTargetQ, rows, rest)
            }
        };
        let single = |row: &Vec<f64>| row.iter().map(|x| *x as f32).collect();
        Ok(Plan {
            scene: scene.clone(),
            model: description.compile()?,
            field,
            rows: rows.iter().map(single).collect(),
            rest: single(&rest),
            begin: None,
        })
    }

    /// The scene of a file; controls of its frames are the rows of the file beside it that ends in .csv. Worlds begin in the first
    /// keyframe, if there is any.
    fn of_file(scene: &Scene, path: &Path) -> anyhow::Result<Plan> {
        let folder = path.parent().unwrap_or(Path::new("."));
        let model = sim_daemon::config::load(path)?
            .describe(folder)?
            .compile()?;
        let controls = path.with_extension("csv");
        let text = std::fs::read_to_string(&controls)
            .with_context(|| format!("{}: a row of controls per frame", controls.display()))?;
        let rows = numbers(&text);
        let columns = model.constants().actuators.all.len();
        ensure!(
            !rows.is_empty() && rows.iter().all(|row| row.len() == columns),
            "{}: give rows of {columns} controls",
            controls.display()
        );
        let mean = |k| rows.iter().map(|row| row[k]).sum::<f64>() / rows.len() as f64;
        Ok(Plan {
            scene: scene.clone(),
            begin: model.keyframes().first().cloned(),
            model,
            field: Field::Ctrl,
            rest: (0..columns).map(|k| mean(k) as f32).collect(),
            rows: (rows.iter())
                .map(|row| row.iter().map(|x| *x as f32).collect())
                .collect(),
        })
    }

    /// Columns of its commands.
    pub fn columns(&self) -> usize {
        self.rows[0].len()
    }

    /// Frames of a run.
    pub fn frames(&self) -> usize {
        self.rows.len()
    }

    /// Puts the worlds where they begin.
    pub fn start(&self, sim: &mut Simulation, crowd: &WorldSet) {
        sim.reset(None, None).expect("a reset without a mask fits");
        if let Some(key) = &self.begin {
            let written = [
                (Field::JointQ, &key.joint_q),
                (Field::JointQd, &key.joint_qd),
                (Field::Act, &key.act),
            ];
            for (field, row) in written.into_iter().filter(|(_, row)| !row.is_empty()) {
                let all = row.repeat(crowd.len());
                sim.write(field, 0..row.len(), Values::F64(&all), None)
                    .expect("a keyframe of its model");
            }
        }
        if self.scene != Scene::Grasp {
            return;
        }
        let start = &self.model.start().joint_q[ARM..ARM + CUBE];
        let cubes: Vec<f32> = (crowd.ids.iter())
            .flat_map(|&id| {
                let moved = move |k: usize| match (id, k) {
                    (1.., 0 | 1) => start[k] + PLACE * noise(id, k),
                    _ => start[k],
                };
                (0..CUBE).map(move |k| moved(k) as f32)
            })
            .collect();
        let columns = ARM..ARM + CUBE;
        sim.write(Field::JointQ, columns, Values::F32(&cubes), None)
            .expect("the cube's coordinates");
    }

    /// The commands of the first frames, `(worlds, columns)` each, made ahead: a GPU that waits for them in each frame lowers its clocks.
    pub fn commands(&self, crowd: &WorldSet, frames: usize) -> Vec<Vec<f32>> {
        let frames = 0..frames.min(self.frames());
        frames.map(|frame| self.row(frame, crowd)).collect()
    }

    /// The commands of a frame: of the grasp the recorded ones, otherwise of an amplitude of each world's own.
    fn row(&self, frame: usize, crowd: &WorldSet) -> Vec<f32> {
        let row = &self.rows[frame];
        if self.scene == Scene::Grasp {
            return row.repeat(crowd.len());
        }
        let mut values = Vec::with_capacity(crowd.len() * row.len());
        for amplitude in crowd.amplitudes() {
            let both = row.iter().zip(&self.rest);
            // world 0 is as recorded, to the bit
            values.extend(both.map(|(x, rest)| match amplitude {
                1.0 => *x,
                _ => rest + amplitude * (x - rest),
            }));
        }
        values
    }
}
