//! Description → Model: sorted, checked, frozen.
//!
//! Links that are fixed to each other become one body; every dof's frame is turned so that its
//! axis is z; constraint parameters that derive from mass are evaluated at the reference pose q = 0.

use super::constants::{Constants, Dof, Equality, Frame, Friction, Impedance, Limit, Newton, Soft};
use super::inverse_weight;
use super::{Description, JointKind, ModelError, Pose, Robot, TargetMode};
use crate::math::factor::Pattern;
use std::ops::Range;
use std::sync::Arc;

/// MuJoCo's default `solimp` (0.9, 0.95, 0.001, 0.5, 2).
const IMPEDANCE: Impedance<f64> = Impedance {
    d_min: 0.9,
    d_max: 0.95,
    inverse_width: 1.0 / 0.001,
    midpoint: 0.5,
};
/// MuJoCo's default `solref`: time constant [s], damping ratio.
const SOLREF: [f64; 2] = [0.02, 1.0];
/// Stiffness and damping of joint limits in force space, Newton's `limit_ke`, `limit_kd`.
const LIMIT_KE: f64 = 1.0e4;
const LIMIT_KD: f64 = 10.0;

/// Where a robot's rows lie in the arrays of the scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RobotRange {
    /// Name of the robot.
    pub name: String,
    /// Its columns of `(worlds, dofs)` arrays.
    pub dofs: Range<usize>,
    /// Its columns of `(worlds, coords)` arrays.
    pub coords: Range<usize>,
    /// Its columns of `(worlds, bodies, …)` arrays.
    pub bodies: Range<usize>,
}

/// A scene that is ready to run: immutable, sorted, hashed.
#[derive(Clone, Debug)]
pub struct Model {
    constants: Constants<f64>,
    dt: f64,
    substeps: usize,
    dof_names: Vec<String>,
    body_names: Vec<String>,
    robots: Vec<RobotRange>,
    start: Start,
    dof_inverse_weight: Vec<f64>,
    hash: u64,
}

/// State and commands after a reset, one entry a dof.
#[derive(Clone, Debug, Default)]
pub struct Start {
    /// [rad or m]
    pub joint_q: Vec<f64>,
    /// [rad or m]
    pub joint_target_q: Vec<f64>,
    /// [rad/s or m/s]
    pub joint_target_qd: Vec<f64>,
}

impl Model {
    /// Constants of the text, in f64.
    pub fn constants(&self) -> &Constants<f64> {
        &self.constants
    }
    /// Duration of one substep [s].
    pub fn dt(&self) -> f64 {
        self.dt
    }
    /// Substeps in a control frame.
    pub fn substeps(&self) -> usize {
        self.substeps
    }
    /// Names of the dofs, `robot/joint`.
    pub fn dof_names(&self) -> &[String] {
        &self.dof_names
    }
    /// Names of the position coordinates, `robot/joint`.
    pub fn coord_names(&self) -> &[String] {
        &self.dof_names
    }
    /// Names of the bodies, `robot/link`.
    pub fn body_names(&self) -> &[String] {
        &self.body_names
    }
    /// Each robot's part of the arrays.
    pub fn robots(&self) -> &[RobotRange] {
        &self.robots
    }
    /// Number of degrees of freedom.
    pub fn dofs(&self) -> usize {
        self.constants.dofs.len()
    }
    /// Number of position coordinates.
    pub fn coords(&self) -> usize {
        self.constants.dofs.len()
    }
    /// Number of bodies: links of all robots, fixed ones included.
    pub fn bodies(&self) -> usize {
        self.constants.frames.len()
    }
    /// Number of constraint rows: equalities, frictions, limits.
    pub fn rows(&self) -> usize {
        self.constants.rows()
    }
    /// State and commands after a reset.
    pub fn start(&self) -> &Start {
        &self.start
    }
    /// Diagonal of M⁻¹ at q = 0, MuJoCo's `dof_invweight0`. `(dofs)` [1/(kg·m²) or 1/kg]
    pub fn dof_inverse_weight(&self) -> &[f64] {
        &self.dof_inverse_weight
    }
    /// A number that differs between models that behave differently.
    pub fn hash(&self) -> u64 {
        self.hash
    }
}

impl Description {
    /// Checks and freezes the scene.
    ///
    /// # Errors
    /// Whatever [`Description::validate`] finds, and a mass matrix that is not positive definite.
    pub fn compile(&self) -> Result<Arc<Model>, ModelError> {
        self.validate()?;
        compile(self).map(Arc::new)
    }
}

fn compile(scene: &Description) -> Result<Model, ModelError> {
    let mut builder = Builder::default();
    for robot in &scene.robots {
        builder.add(robot);
    }
    let Builder {
        dofs,
        frames,
        joints,
        robots,
        dof_names,
        body_names,
        start,
        couplings,
    } = builder;

    let mut entries = couplings.clone();
    for (k, dof) in dofs.iter().enumerate() {
        let mut carrier = dof.parent;
        while let Some(i) = carrier {
            entries.push((k, i));
            carrier = dofs[i].parent;
        }
    }
    let mut constants = Constants {
        dt: scene.dt,
        gravity: scene.gravity,
        pattern: Pattern::new(dofs.len(), entries),
        dofs,
        frames,
        equalities: Vec::new(),
        frictions: Vec::new(),
        limits: Vec::new(),
        solver: Newton {
            iterations: scene.solver.iterations,
            ls_iterations: scene.solver.ls_iterations,
            tolerance: 0.0,
        },
    };
    let reference = inverse_weight::at_reference(&constants, &dof_names)?;
    // MuJoCo scales costs by 1 / (mean inertia × dofs)
    constants.solver.tolerance =
        scene.solver.tolerance * reference.mean_inertia * constants.dofs.len() as f64;
    add_rows(&mut constants, &joints, &reference.dof_inverse_weight);

    let mut model = Model {
        constants,
        dt: scene.dt,
        substeps: scene.substeps,
        dof_names,
        body_names,
        robots,
        start,
        dof_inverse_weight: reference.dof_inverse_weight,
        hash: 0,
    };
    model.hash = hash(&model);
    Ok(model)
}

/// What the rows need of a dof's joint; mimic leaders already as dof numbers.
struct DofJoint {
    range: Option<[f64; 2]>,
    friction: f64,
    mimic: Option<(usize, f64, f64)>,
}

/// Constraint rows in MuJoCo's order.
fn add_rows(constants: &mut Constants<f64>, joints: &[DofJoint], inverse_weight: &[f64]) {
    let dt = constants.dt;
    for (dof, joint) in joints.iter().enumerate() {
        let weight = inverse_weight[dof];
        if let Some((leader, multiplier, offset)) = joint.mimic {
            let soft = soft(SOLREF, weight + inverse_weight[leader], dt);
            constants.equalities.push(Equality {
                follower: dof,
                leader,
                multiplier,
                offset,
                soft,
            });
        }
        if joint.friction > 0.0 {
            let soft = soft(SOLREF, weight, dt);
            // a friction row has no position: its impedance is d_min, its reference -b v
            let regularizer = (1.0 - IMPEDANCE.d_min) / IMPEDANCE.d_min * weight;
            constants.frictions.push(Friction {
                dof,
                loss: joint.friction,
                damping: soft.damping,
                weight: 1.0 / regularizer,
                zone: regularizer * joint.friction,
            });
        }
        if let Some([lower, upper]) = joint.range {
            let f = weight * (1.0 - IMPEDANCE.d_max);
            let solref = [
                2.0 / (LIMIT_KD * f),
                0.5 * LIMIT_KD * f * (1.0 / (LIMIT_KE * f)).sqrt(),
            ];
            constants.limits.push(Limit {
                dof,
                lower,
                upper,
                soft: soft(solref, weight, dt),
            });
        }
    }
}

/// MuJoCo's stiffness and damping from (time constant, damping ratio), `refsafe` on.
fn soft(solref: [f64; 2], inverse_weight: f64, dt: f64) -> Soft<f64> {
    let d_max = IMPEDANCE.d_max;
    let time_constant = solref[0].max(2.0 * dt);
    let natural = time_constant * solref[1] * d_max;
    Soft {
        stiffness: 1.0 / (natural * natural),
        damping: 2.0 / (d_max * time_constant),
        inverse_weight,
        impedance: IMPEDANCE,
    }
}

/// Where a link is carried: by which dof, and how it lies in that dof's frame.
#[derive(Clone, Copy)]
struct Carrier {
    dof: Option<usize>,
    pose: Pose,
}

#[derive(Default)]
struct Builder {
    dofs: Vec<Dof<f64>>,
    frames: Vec<Frame<f64>>,
    joints: Vec<DofJoint>,
    robots: Vec<RobotRange>,
    dof_names: Vec<String>,
    body_names: Vec<String>,
    start: Start,
    couplings: Vec<(usize, usize)>,
}

impl Builder {
    fn add(&mut self, robot: &Robot) {
        let (first_dof, first_body) = (self.dofs.len(), self.frames.len());
        let order = robot.dofs();
        // the base stands still: its frame has the world's axes and its origin as reference point
        let mut carriers = vec![
            Carrier {
                dof: None,
                pose: Pose {
                    pos: [0.0; 3],
                    quat: robot.pose.quat
                }
            };
            robot.links.len()
        ];
        for link in robot.link_order() {
            if let Some((index, joint)) = robot
                .joints
                .iter()
                .enumerate()
                .find(|(_, joint)| joint.child == link)
            {
                let parent = carriers[joint.parent];
                let mut pose = parent.pose.mul(&joint.origin);
                let mut dof = parent.dof;
                if joint.kind != JointKind::Fixed {
                    let turn = z_to(joint.axis);
                    dof = Some(self.dofs.len());
                    debug_assert_eq!(order[self.dofs.len() - first_dof], index);
                    self.push_dof(robot, index, parent.dof, pose.mul(&turn));
                    pose = turn.inverse();
                }
                carriers[link] = Carrier { dof, pose };
            }
            let carrier = carriers[link];
            self.body_names
                .push(format!("{}/{}", robot.name, robot.links[link].name));
            self.frames.push(Frame {
                dof: carrier.dof,
                position: carrier.pose.pos,
                quat: carrier.pose.quat,
                base: robot.pose.pos,
            });
        }
        for (k, &index) in order.iter().enumerate() {
            let dof = first_dof + k;
            self.set_mass(robot, &carriers, dof);
            let joint = &robot.joints[index];
            let mimic = joint.mimic.map(|mimic| {
                let leader = order.iter().position(|&j| j == mimic.joint);
                let leader = first_dof + leader.expect("validated: the leader moves");
                self.couplings.push((dof, leader));
                (leader, mimic.multiplier, mimic.offset)
            });
            self.joints.push(DofJoint {
                range: joint.range,
                friction: joint.friction,
                mimic,
            });
        }
        self.robots.push(RobotRange {
            name: robot.name.clone(),
            dofs: first_dof..self.dofs.len(),
            coords: first_dof..self.dofs.len(),
            bodies: first_body..self.frames.len(),
        });
    }

    fn push_dof(&mut self, robot: &Robot, index: usize, parent: Option<usize>, pose: Pose) {
        let joint = &robot.joints[index];
        let drives_position = joint.target_mode != TargetMode::Velocity;
        self.dofs.push(Dof {
            revolute: joint.kind == JointKind::Revolute,
            parent,
            rotation: columns(pose.rotation()),
            quat: pose.quat,
            position: pose.pos,
            mass: 0.0,
            center: [0.0; 3],
            inertia: [0.0; 6],
            armature: joint.armature,
            damping: joint.damping,
            ke: if drives_position {
                joint.target_ke
            } else {
                0.0
            },
            kd: joint.target_kd,
            follows_velocity: joint.target_mode != TargetMode::Position,
            effort_limit: joint.effort_limit.filter(|limit| limit.is_finite()),
        });
        self.dof_names
            .push(format!("{}/{}", robot.name, joint.name));
        self.start.joint_q.push(joint.q);
        self.start
            .joint_target_q
            .push(joint.target_q.unwrap_or(joint.q));
        self.start.joint_target_qd.push(joint.target_qd);
    }

    /// Mass, centre and inertia of all links that move with a dof.
    fn set_mass(&mut self, robot: &Robot, carriers: &[Carrier], dof: usize) {
        let parts = || {
            carriers
                .iter()
                .zip(&robot.links)
                .filter(|(c, _)| c.dof == Some(dof))
                .filter_map(|(carrier, link)| {
                    let inertial = link.inertial.as_ref()?;
                    let center = carrier.pose.transform(inertial.pos);
                    Some((
                        inertial.mass,
                        center,
                        carrier.pose.rotate_tensor(inertial.inertia),
                    ))
                })
        };
        let mass: f64 = parts().map(|(mass, _, _)| mass).sum();
        let mut center = [0.0; 3];
        if mass > 0.0 {
            for (part, at, _) in parts() {
                for i in 0..3 {
                    center[i] += part / mass * at[i];
                }
            }
        }
        let mut inertia = [0.0; 6];
        for (part, at, tensor) in parts() {
            let d = [at[0] - center[0], at[1] - center[1], at[2] - center[2]];
            let square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
            let pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];
            for (entry, (i, j)) in inertia.iter_mut().zip(pairs) {
                let parallel = if i == j { square } else { 0.0 } - d[i] * d[j];
                *entry += tensor[i][j] + part * parallel;
            }
        }
        let body = &mut self.dofs[dof];
        (body.mass, body.center, body.inertia) = (mass, center, inertia);
    }
}

fn columns(rows: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c]))
}

/// A rotation that takes z to the given unit vector; none where the axis is z already.
fn z_to(axis: [f64; 3]) -> Pose {
    if axis == [0.0, 0.0, 1.0] {
        return Pose::identity();
    }
    if axis[2] < -0.5 {
        // half a turn about x, then the short way from -z
        return z_to([axis[0], -axis[1], -axis[2]]).flipped();
    }
    let quat = [-axis[1], axis[0], 0.0, 1.0 + axis[2]];
    let norm = quat.iter().map(|x| x * x).sum::<f64>().sqrt();
    Pose {
        pos: [0.0; 3],
        quat: quat.map(|x| x / norm),
    }
}

impl Pose {
    /// Half a turn about the parent's x axis, applied after this rotation.
    fn flipped(&self) -> Pose {
        Pose {
            pos: [0.0; 3],
            quat: [1.0, 0.0, 0.0, 0.0],
        }
        .mul(self)
    }
}

/// FNV-1a over everything that a run depends on.
fn hash(model: &Model) -> u64 {
    let text = format!(
        "{:?} {} {} {:?} {:?} {:?}",
        model.constants, model.dt, model.substeps, model.dof_names, model.body_names, model.start
    );
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| {
        (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    })
}
