//! Bodies, dofs and frames of a model, from the links and joints of robots.

use super::actuators;
use super::carrier::{Carrier, exchange, z_to};
use super::constraint_rows::{DofJoint, SoftJoint};
use super::output_frames::{add_frames, add_tendon_lengths};
use super::tendons::{Lengths, add_tendons};
use super::ties::DofConstraint;
use crate::description::{Description, Joint, JointExtras, Precompiled, Robot, TargetMode};
use crate::inertia::{Inertial, merge};
use crate::joint_kind::JointKind;
use crate::model::{RobotRange, SensorInfo, Start};
use crate::pose::Pose;
use sim_physics::constants::actuators::{ActuatorBound, Actuators};
use sim_physics::constants::outputs::OutputFrames;
use sim_physics::constants::params::Param;
use sim_physics::constants::passive::{Drag, FluidGeom, GravityCompensation};
use sim_physics::constants::sensors::Sensors;
use sim_physics::constants::springs::Springs;
use sim_physics::constants::tendons::SpatialTendon;
use sim_physics::constants::{Body, Dof, Frame, MassEntry, Motion, Tree};
use sim_physics::math::factor::Pattern;

#[derive(Default)]
pub(super) struct BodyBuilder {
    /// Length of a step [s].
    pub dt: f64,
    pub bodies: Vec<Body<f64>>,
    pub dofs: Vec<Dof<f64>>,
    pub trees: Vec<Tree<f64>>,
    pub frames: Vec<Frame<f64>>,
    pub joints: Vec<DofJoint>,
    pub robots: Vec<RobotRange>,
    pub dof_names: Vec<String>,
    pub coord_names: Vec<String>,
    pub body_names: Vec<String>,
    pub start: Start,
    pub tendons: Vec<SpatialTendon<f64>>,
    pub springs: Springs<f64>,
    pub free_joints: Vec<usize>,
    pub drags: Vec<Drag<f64>>,
    pub fluid_geoms: Vec<FluidGeom<f64>>,
    pub compensation: GravityCompensation<f64>,
    pub actuators: Actuators<f64>,
    pub switches: usize,
    pub mocaps: usize,
    pub outputs: OutputFrames<f64>,
    pub sensors: Sensors<f64>,
    pub constraints: Vec<DofConstraint>,
    pub actuator_names: Vec<String>,
    pub mocap_names: Vec<String>,
    pub equality_names: Vec<String>,
    pub contact_pair_names: Vec<String>,
    /// Whether any link may be held against gravity, in some world.
    pub any_link_is_held: bool,
    pub sensor_infos: Vec<SensorInfo>,
    pub refused_sensors: Vec<String>,
    /// First moment of what stands still in MuJoCo models [kg·m].
    pub static_moment: [f64; 3],
    couplings: Vec<(usize, usize)>,
    /// How each link of each robot is carried.
    pub carriers: Vec<Vec<Carrier>>,
}

impl BodyBuilder {
    /// All robots of a scene.
    pub fn from_scene(scene: &Description) -> BodyBuilder {
        let mut builder = BodyBuilder {
            dt: scene.dt,
            any_link_is_held: scene.params.contains(&Param::BodyGravcomp),
            ..BodyBuilder::default()
        };
        scene.robots.iter().for_each(|robot| builder.add(robot));
        builder
    }

    pub fn add(&mut self, robot: &Robot) {
        let (first_dof, first_coord) = (self.dofs.len(), self.coord_names.len());
        let (first_frame, first_body) = (self.frames.len(), self.bodies.len());
        let first_actuator = self.actuator_names.len();
        let named = |name: String| format!("{}/{name}", robot.name);
        self.dof_names
            .extend(robot.dof_names().into_iter().map(named));
        self.coord_names
            .extend(robot.coord_names().into_iter().map(named));
        self.trees.push(Tree {
            base: robot.pose.pos,
            free: None,
        });
        // the base stands still: its frame has the world's axes and its origin as reference point
        let base = Carrier {
            body: None,
            tree: self.trees.len() - 1,
            pose: Pose {
                pos: [0.0; 3],
                quat: robot.pose.quat,
            },
        };
        let mut carriers = vec![base; robot.links.len()];
        let mut dof_of = vec![0; robot.joints.len()];
        for link in robot.link_order() {
            let joints = robot.joints.iter().enumerate();
            let mut first = true;
            for (index, joint) in joints.filter(|(_, joint)| joint.child == link) {
                let parent = joint.parent.map_or(base, |parent| carriers[parent]);
                let mut at = match first {
                    true => Carrier {
                        pose: parent.pose.mul(&joint.origin),
                        ..parent
                    },
                    // further joints of a link from MuJoCo begin where the one before ends
                    false => carriers[link],
                };
                first = false;
                if robot.precompiled.is_some() && at.body.is_none() && joint.moves() {
                    at = self.rooted(at);
                }
                dof_of[index] = self.dofs.len();
                let extras = robot.precompiled.as_ref().map(|parts| &parts.joints[index]);
                carriers[link] = self.add_joint(joint, extras, at);
            }
            let mocaps = robot.precompiled.as_ref().map(|parts| &parts.mocaps);
            if mocaps.is_some_and(|mocaps| mocaps.contains(&link)) {
                carriers[link] = self.add_mocap(carriers[link]);
            }
            let carrier = carriers[link];
            self.body_names.push(named(robot.links[link].name.clone()));
            if mocaps.is_some_and(|mocaps| mocaps.contains(&link)) {
                self.mocap_names.push(named(robot.links[link].name.clone()));
            }
            self.frames.push(Frame {
                body: carrier.body,
                tree: carrier.tree,
                position: carrier.pose.pos,
                quat: carrier.pose.quat,
                center: match &robot.links[link].inertial {
                    Some(inertial) => carrier.pose.transform(inertial.pos),
                    None => carrier.pose.pos,
                },
            });
        }
        self.add_masses(robot, &carriers, first_body);
        for joint in robot.moving_joints() {
            self.add_followers(robot, joint, &dof_of);
        }
        if let Some(parts) = &robot.precompiled {
            self.add_mujoco(robot, parts, &dof_of, &carriers);
        }
        self.carriers.push(carriers);
        self.robots.push(RobotRange {
            name: robot.name.clone(),
            dofs: first_dof..self.dofs.len(),
            coords: first_coord..self.coord_names.len(),
            bodies: first_frame..self.frames.len(),
            actuators: first_actuator..self.actuator_names.len(),
        });
    }

    /// The same place, carried by a tree of its own: its bodies are then relative to a point near them.
    fn rooted(&mut self, at: Carrier) -> Carrier {
        let below = self.trees[at.tree].base;
        self.trees.push(Tree {
            base: std::array::from_fn(|i| below[i] + at.pose.pos[i]),
            free: None,
        });
        Carrier {
            body: None,
            tree: self.trees.len() - 1,
            pose: Pose {
                pos: [0.0; 3],
                quat: at.pose.quat,
            },
        }
    }

    /// The bodies of a joint whose frame is `at`; returns where they carry its link. Only MuJoCo joints have `extras`.
    fn add_joint(&mut self, joint: &Joint, extras: Option<&JointExtras>, at: Carrier) -> Carrier {
        let turn = z_to(joint.axis);
        let mut back = turn.inverse();
        let mut at = at;
        let mut axis = Carrier {
            pose: at.pose.mul(&turn),
            ..at
        };
        if let Some(extras) = extras {
            let there = Pose::at(extras.anchor);
            let away = Pose::at(extras.anchor.map(|x| -x));
            // at its reference the joint leaves its link where it is
            let rest = match joint.kind {
                JointKind::Revolute => Pose::about([0.0, 0.0, 1.0], -extras.reference),
                _ => Pose::at([0.0, 0.0, -extras.reference]),
            };
            axis.pose = at.pose.mul(&there).mul(&turn).mul(&rest);
            back = back.mul(&away);
            at.pose = at.pose.mul(&there);
            if joint.kind == JointKind::Ball {
                return self.add_body(joint, 0, Motion::Ball, at, away);
            }
        }
        match joint.kind {
            JointKind::Fixed => at,
            JointKind::Revolute => self.add_body(joint, 0, Motion::Revolute, axis, back),
            JointKind::Prismatic => self.add_body(joint, 0, Motion::Prismatic, axis, back),
            JointKind::Ball => self.add_body(joint, 0, Motion::Ball, at, Pose::identity()),
            JointKind::Planar => {
                // z to x, to y, and back to the normal
                let (x, y) = (z_to([1.0, 0.0, 0.0]), z_to([0.0, 1.0, 0.0]));
                let first = Carrier {
                    pose: axis.pose.mul(&x),
                    ..axis
                };
                let slid = self.add_body(joint, 0, Motion::Prismatic, first, x.inverse().mul(&y));
                let slid = self.add_body(joint, 1, Motion::Prismatic, slid, y.inverse());
                self.add_body(joint, 2, Motion::Revolute, slid, back)
            }
            JointKind::Free => {
                self.trees.push(Tree {
                    base: [0.0; 3],
                    free: Some(self.bodies.len()),
                });
                let world = Carrier {
                    body: None,
                    tree: self.trees.len() - 1,
                    pose: Pose::identity(),
                };
                self.add_body(joint, 0, Motion::Free, world, Pose::identity())
            }
        }
    }

    /// A body that is carried at `at` and moves by the dofs of a joint from `first` on; `pose` is what it carries.
    fn add_body(
        &mut self,
        joint: &Joint,
        first: usize,
        motion: Motion,
        at: Carrier,
        pose: Pose,
    ) -> Carrier {
        let (body, coord) = (self.bodies.len(), self.start.joint_q.len());
        self.bodies.push(Body {
            motion,
            parent: at.body,
            tree: at.tree,
            dof: self.dofs.len(),
            coord,
            rotation: columns(at.pose.rotation()),
            exchange: exchange(columns(at.pose.rotation())),
            quat: at.pose.quat,
            position: at.pose.pos,
            mass: 0.0,
            center: [0.0; 3],
            inertia: [0.0; 6],
            parts: Vec::new(),
        });
        let coords = &joint.q[first..first + motion.coords()];
        self.start.joint_q.extend(coords);
        for (k, dof) in joint.dofs[first..first + motion.dofs()].iter().enumerate() {
            let drives_position = dof.target_mode != TargetMode::Velocity;
            self.dofs.push(Dof {
                body,
                coord,
                entries: (0, 0),
                armature: dof.armature,
                damping: dof.damping,
                damping_curve: [0.0; 2],
                ke: if drives_position { dof.target_ke } else { 0.0 },
                kd: dof.target_kd,
                follows_position: drives_position,
                follows_velocity: dof.target_mode != TargetMode::Position,
                effort_limit: dof.effort_limit.filter(|limit| limit.is_finite()),
            });
            // a target is where the joint starts; a ball's is a rotation vector, a free body has none
            let start = match motion {
                Motion::Revolute | Motion::Prismatic => coords[0],
                Motion::Ball => rotation_vector(coords)[k],
                Motion::Free | Motion::Mocap => 0.0,
            };
            self.start
                .joint_target_q
                .push(dof.target_q.unwrap_or(start));
            self.start.joint_target_qd.push(dof.target_qd);
            self.start.joint_q_offset.push(dof.offset_q);
            self.start.joint_qd_offset.push(dof.offset_qd);
            self.joints.push(DofJoint {
                range: joint.range,
                limit_gains: dof.limit_gains(),
                friction: dof.friction,
                mimic: None,
                soft: None,
            });
        }
        Carrier {
            body: Some(body),
            tree: at.tree,
            pose,
        }
    }

    fn add_followers(&mut self, robot: &Robot, index: usize, dof_of: &[usize]) {
        if let Some(mimic) = &robot.joints[index].mimic {
            let (dof, leader) = (dof_of[index], dof_of[mimic.joint]);
            self.couplings.push((dof, leader));
            self.joints[dof].mimic = Some((leader, mimic.multiplier, mimic.offset));
        }
    }

    /// What only MuJoCo's robots have, by their dofs.
    fn add_mujoco(
        &mut self,
        robot: &Robot,
        parts: &Precompiled,
        dof_of: &[usize],
        carriers: &[Carrier],
    ) {
        let first_link = self.frames.len() - robot.links.len();
        let first_body = self.outputs.bodies.len();
        let (first_actuator, first_constraint) =
            (self.actuator_names.len(), self.constraints.len());
        add_frames(&mut self.outputs, parts, carriers, first_link);
        for index in robot.moving_joints() {
            let (joint, extras) = (&robot.joints[index], &parts.joints[index]);
            let dofs = dof_of[index]..dof_of[index] + joint.dofs.len();
            for dof in dofs.clone() {
                self.joints[dof].soft = Some(SoftJoint {
                    limit: extras.limit,
                    margin: extras.margin,
                    friction: extras.friction,
                    safe_references: parts.safe_references,
                });
            }
            self.add_passive(joint, extras, dofs.clone());
            if let Some(range) = extras.actuator_range {
                let dof = dofs.start;
                let bounds = &mut self.actuators.dof_bounds;
                bounds.push(ActuatorBound { dof, range });
            }
        }
        self.add_compensations(robot, parts, carriers);
        self.add_drags(parts, carriers);
        self.add_fluid_geoms(parts, carriers);
        let first_equality = self.switches;
        let first_tendon = self.tendons.len();
        let described = &parts.spatial_tendons;
        add_tendons(&mut self.tendons, described, carriers, &self.bodies);
        let lengths = Lengths {
            dof_of,
            tendons: &self.tendons,
            first_tendon,
        };
        add_tendon_lengths(&mut self.outputs, parts, &lengths, carriers, &self.bodies);
        for constraint in &parts.constraints {
            let compiled = DofConstraint::new(
                constraint,
                &lengths,
                carriers,
                &self.bodies,
                first_body,
                first_equality,
                parts.safe_references,
            );
            self.couplings.extend(compiled.couplings());
            self.constraints.push(compiled);
        }
        self.switches += parts.equalities.len();
        let pairs = parts.pairs.iter();
        self.contact_pair_names
            .extend(pairs.map(|pair| format!("{}/{}", robot.name, pair.name)));
        for (name, is_active) in &parts.equalities {
            self.equality_names.push(format!("{}/{name}", robot.name));
            self.start.eq_active.push(f64::from(u8::from(*is_active)));
        }
        for tendon in &parts.tendons {
            let place = self.springs.plastic_rests();
            self.springs.tendons.push(lengths.spring(tendon, place));
        }
        actuators::add_tendon_bounds(&mut self.actuators, parts);
        for actuator in &parts.actuators {
            self.actuator_names
                .push(format!("{}/{}", robot.name, actuator.name));
            let scene = actuators::Scene {
                lengths,
                carriers,
                bodies: &self.bodies,
                first_body,
                dt: self.dt,
            };
            actuators::add(&mut self.actuators, actuator, &scene);
        }
        self.add_sensors(
            robot,
            dof_of,
            carriers,
            [first_body, first_actuator, first_constraint, first_tendon],
        );
    }

    /// Mass, centre and inertia of all links that move with each body of a robot.
    fn add_masses(&mut self, robot: &Robot, carriers: &[Carrier], first_body: usize) {
        let nothing = Inertial {
            mass: 0.0,
            pos: [0.0; 3],
            inertia: [[0.0; 3]; 3],
        };
        for (index, body) in self.bodies.iter_mut().enumerate().skip(first_body) {
            let carried = carriers.iter().zip(&robot.links);
            let whole = carried
                .filter(|(carrier, _)| carrier.body == Some(index))
                .filter_map(|(carrier, link)| Some((&carrier.pose, link.inertial.as_ref()?)))
                .fold(nothing, |whole, (pose, part)| merge(&whole, pose, part));
            let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = whole.inertia;
            (body.mass, body.center) = (whole.mass, whole.pos);
            body.inertia = [xx, yy, zz, xy, xz, yz];
        }
    }

    /// A dof meets all dofs on its path to the root, and those it is coupled with.
    pub fn pattern(&self) -> Pattern {
        let mut entries = self.couplings.clone();
        for k in 0..self.dofs.len() {
            entries.extend(self.path(k).into_iter().map(|i| (k, i)));
        }
        Pattern::new(self.dofs.len(), entries)
    }

    /// The dofs that a dof meets in the mass matrix: those before it on its path to the root, and itself, rising.
    fn path(&self, dof: usize) -> Vec<usize> {
        let mut path = Vec::new();
        let mut body = Some(self.dofs[dof].body);
        while let Some(b) = body {
            path.extend(self.bodies[b].dofs().rev().filter(|&i| i <= dof));
            body = self.bodies[b].parent;
        }
        path.reverse();
        path
    }

    pub fn mass_entries(&mut self, pattern: &Pattern) -> Vec<MassEntry> {
        let mut entries = Vec::new();
        for k in 0..self.dofs.len() {
            let first = entries.len();
            entries.extend(self.path(k).into_iter().map(|other| MassEntry {
                other,
                place: pattern.at(k, other),
            }));
            self.dofs[k].entries = (first, entries.len());
        }
        entries
    }
}

/// Axis times angle of a unit quaternion (x, y, z, w) [rad].
fn rotation_vector(quat: &[f64]) -> [f64; 3] {
    let [x, y, z, w] = [quat[0], quat[1], quat[2], quat[3]];
    let sin = (x * x + y * y + z * z).sqrt();
    let scale = if sin > 0.0 {
        2.0 * libm::atan2(sin, w) / sin
    } else {
        0.0
    };
    [x * scale, y * scale, z * scale]
}

pub(super) fn columns(rows: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c]))
}
