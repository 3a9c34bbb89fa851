//! Random starts of worlds: state offsets around the scene's start, and parameters.

use crate::random::{Draw, Stream};
use sim_model::{Distribution, Model, Pose};
use sim_physics::arrays::Field;
use sim_physics::constants::Motion;
use sim_physics::constants::params::Param;

/// The random part of a start.
#[derive(Clone, Debug)]
pub struct StartDraw {
    joints: Vec<DrawnJoint>,
    params: Vec<DrawnParam>,
}

/// A parameter with drawn columns.
#[derive(Clone, Debug)]
struct DrawnParam {
    param: Param,
    /// Its first column among all parameters that vary.
    first: usize,
    /// Least and largest allowed value.
    bounds: [f64; 2],
    /// Its drawn columns.
    columns: Vec<(usize, Distribution)>,
}

/// A joint with a drawn start.
#[derive(Clone, Debug)]
struct DrawnJoint {
    motion: Motion,
    dof: usize,
    coord: usize,
    /// The scene's start, per coordinate [rad or m].
    q: Vec<f64>,
    /// Per dof.
    q_offset: Vec<Option<Distribution>>,
    /// Per dof.
    qd_offset: Vec<Option<Distribution>>,
    /// [rad or m]
    range: [f64; 2],
    followers: Vec<Follower>,
}

/// A joint that mimics a drawn one.
#[derive(Clone, Debug)]
struct Follower {
    dof: usize,
    coord: usize,
    multiplier: f64,
    /// The scene's start [rad or m].
    q: f64,
}

impl StartDraw {
    /// The random part of a model's start.
    pub fn new(model: &Model) -> StartDraw {
        let (m, start) = (model.constants(), model.start());
        let drawn = m.bodies.iter().filter(|body| {
            let mut offsets = body
                .dofs()
                .map(|dof| start.joint_q_offset[dof].or(start.joint_qd_offset[dof]));
            offsets.any(|offset| offset.is_some())
        });
        let joints = drawn.map(|body| {
            let limit = m.limits.iter().find(|limit| limit.dof == body.dof);
            let followers = m.equalities.iter().filter(|e| e.leader == body.dof);
            DrawnJoint {
                motion: body.motion,
                dof: body.dof,
                coord: body.coord,
                q: start.joint_q[body.coord..][..body.motion.coords()].to_vec(),
                q_offset: start.joint_q_offset[body.dofs()].to_vec(),
                qd_offset: start.joint_qd_offset[body.dofs()].to_vec(),
                range: limit.map_or([f64::NEG_INFINITY, f64::INFINITY], |limit| {
                    [limit.lower, limit.upper]
                }),
                followers: followers
                    .map(|e| {
                        let coord = m.dofs[e.follower].coord;
                        Follower {
                            dof: e.follower,
                            coord,
                            multiplier: e.multiplier,
                            q: start.joint_q[coord],
                        }
                    })
                    .collect(),
            }
        });
        let params = start.params.chunk_by(|a, b| a.param == b.param);
        let params = params.map(|draws| DrawnParam {
            param: draws[0].param,
            first: m
                .varying
                .first(draws[0].param)
                .expect("what is drawn varies"),
            bounds: [
                (draws[0].param.row().least).unwrap_or(f64::NEG_INFINITY),
                match draws[0].param {
                    Param::CommandDelay => model.command_delay_max() as f64,
                    _ => f64::INFINITY,
                },
            ],
            columns: draws
                .iter()
                .map(|draw| (draw.column, draw.distribution))
                .collect(),
        });
        StartDraw {
            joints: joints.collect(),
            params: params.collect(),
        }
    }

    /// Draws the start of a world's episode. Calls `put` with each drawn value of `joint_q` and `joint_qd` and its column.
    pub fn draw(
        &self,
        seed: u64,
        world: u32,
        episode: u32,
        mut put: impl FnMut(Field, usize, f64),
    ) {
        let positions = Draw::new(seed, world, episode, Stream::StartPosition);
        let velocities = Draw::new(seed, world, episode, Stream::StartVelocity);
        for joint in &self.joints {
            joint.draw_position(&positions, &mut put);
            joint.draw_velocity(&velocities, &mut put);
        }
    }

    /// Draws the parameters of a world's episode. Calls `put` with each value and its column among all parameters that vary.
    pub fn draw_params(
        &self,
        seed: u64,
        world: u32,
        episode: u32,
        mut put: impl FnMut(usize, f64),
    ) {
        for drawn in &self.params {
            let draw = Draw::new(seed, world, episode, Stream::Param(drawn.param));
            for &(column, distribution) in &drawn.columns {
                let [least, most] = drawn.bounds;
                let value = draw.sample(column as u32, distribution);
                put(drawn.first + column, value.max(least).min(most));
            }
        }
    }
}

impl DrawnJoint {
    fn draw_position(&self, draw: &Draw, put: &mut impl FnMut(Field, usize, f64)) {
        let offset = |k: usize| {
            let drawn = |of| draw.sample((self.dof + k) as u32, of);
            self.q_offset[k].map_or(0.0, drawn)
        };
        let varies = |first: usize| self.q_offset[first..].iter().any(Option::is_some);
        if !varies(0) {
            return;
        }
        let mut set = |k: usize, value: f64| put(Field::JointQ, self.coord + k, value);
        match self.motion {
            Motion::Revolute | Motion::Prismatic => {
                let q = (self.q[0] + offset(0)).clamp(self.range[0], self.range[1]);
                set(0, q);
                for follower in &self.followers {
                    let q = follower.q + follower.multiplier * (q - self.q[0]);
                    put(Field::JointQ, follower.coord, q);
                }
            }
            Motion::Ball => {
                let turned = rotation(&self.q).mul(&turn(std::array::from_fn(offset)));
                (0..4).for_each(|k| set(k, turned.quat[k]));
            }
            Motion::Mocap => {}
            Motion::Free => {
                (0..3).for_each(|k| set(k, self.q[k] + offset(k)));
                if varies(3) {
                    let turn = Pose::from_rpy([0.0; 3], std::array::from_fn(|k| offset(3 + k)));
                    let turned = turn.mul(&rotation(&self.q[3..]));
                    (0..4).for_each(|k| set(3 + k, turned.quat[k]));
                }
            }
        }
    }

    fn draw_velocity(&self, draw: &Draw, put: &mut impl FnMut(Field, usize, f64)) {
        for (k, offset) in self.qd_offset.iter().enumerate() {
            let Some(offset) = *offset else { continue };
            let qd = draw.sample((self.dof + k) as u32, offset);
            put(Field::JointQd, self.dof + k, qd);
            for follower in &self.followers {
                put(Field::JointQd, follower.dof, follower.multiplier * qd);
            }
        }
    }
}

/// A quaternion (x, y, z, w) as a rotation.
fn rotation(quat: &[f64]) -> Pose {
    Pose {
        pos: [0.0; 3],
        quat: [quat[0], quat[1], quat[2], quat[3]],
    }
}

/// The rotation of a rotation vector [rad].
fn turn(vector: [f64; 3]) -> Pose {
    let angle = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    if angle == 0.0 {
        return Pose::identity();
    }
    Pose::about(vector.map(|x| x / angle), angle)
}
