//! Robots and shapes for tests of stages, and states that take every path through them.

use super::shapes::{on_a_field as every_shape_on_a_field, shapes as every_shape};
use sim_model::{
    Body, Collision, Cone, Description, Model, MujocoOptions, Pose, Shape, Site, UrdfOptions,
};
use sim_physics::arrays::Block;
use sim_physics::constants::options::{DryRow, NoSlip};
use sim_physics::constants::params::Param;
use sim_physics::constants::{Constants, Motion};
use sim_physics::lane::Fixed;
use std::path::Path;

/// The repository, whichever of its crates the test is of.
fn repository() -> &'static Path {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let root = folders.find(|folder| folder.join("Cargo.lock").exists());
    root.expect("a crate of the workspace")
}

/// Substeps of a frame.
pub const SUBSTEPS: usize = 8;

/// A world by itself.
pub type Scalar = Block<f32, f32>;

/// A model, and where its random states are.
pub struct Case {
    pub name: &'static str,
    pub m: Constants<f32>,
    near: Option<Near>,
}

/// Random states around one state.
struct Near {
    /// Positions. `(coords)` [rad or m]
    joint_q: Vec<f64>,
    /// Of joints: how far from there, as a share of half their range [–].
    share: f64,
    /// Of free bodies: how far from there along each axis [m].
    apart: f64,
    /// Of free bodies: how much they may be turned, as what is added to each part of a quaternion [–].
    turn: f64,
}

/// All of them.
pub fn cases() -> [Case; 13] {
    [
        fr3(),
        every_joint(),
        limits_only(),
        shapes(Cone::Elliptic, None),
        shapes(Cone::Pyramidal, Some(5)),
        arm_and_cube(),
        swept(),
        every_param(),
        mujoco("implicit"),
        mujoco("runge_kutta"),
        sensors(),
        passive(),
        fields(),
    ]
}

/// What only MuJoCo models have: an implicit step with elliptic cones, or a Runge-Kutta step with pyramidal ones.
pub fn mujoco(name: &'static str) -> Case {
    let case = of_mujoco(name);
    let m = &case.m;
    assert!(m.contacts.classes.iter().any(|class| class.turns.is_some()));
    assert!(m.contacts.impedances.all.len() > 1 && !m.springs.joints.is_empty());
    case
}

/// A sensor of every type.
pub fn sensors() -> Case {
    let case = of_mujoco("sensors");
    assert!(case.m.sensors.all.len() > 40 && case.m.sensors.records > 1);
    case
}

/// Springs and dampers that are no lines, geoms as ellipsoids in a medium, adhesion, a belt and an idle tendon.
pub fn passive() -> Case {
    let case = of_mujoco("passive");
    let m = &case.m;
    assert!(!m.fluid_geoms.is_empty() && !m.solved_bodies.is_empty());
    assert!(m.contacts.adhesion.rows > 0 && m.contacts.surface_velocities.rows > 0);
    assert!(
        !m.actuators.adhesions.is_empty() && m.outputs.tendons.iter().any(|t| t.idle.is_some())
    );
    case
}

fn of_mujoco(name: &'static str) -> Case {
    let path = repository()
        .join("sim-core/stages/recorded/tests/record_stages")
        .join(name)
        .with_extension("safetensors");
    let scene = Description::from_mujoco(path, MujocoOptions::named("every")).unwrap();
    let model = scene.compile().unwrap();
    Case {
        name,
        m: constants(&model),
        near: Some(Near {
            joint_q: model.start().joint_q.clone(),
            share: 1.2,
            apart: 0.1,
            turn: 1.0,
        }),
    }
}

/// The FR3 with drives and armatures of the usual size.
pub fn fr3() -> Case {
    let scene = robot("examples/assets/fr3/fr3_franka_hand.urdf", 0.1, false);
    Case {
        name: "fr3",
        m: constants(&scene.compile().unwrap()),
        near: None,
    }
}

/// Every kind of joint on a floating base, with accelerations refined.
pub fn every_joint() -> Case {
    let mut scene = robot(
        "sim-core/stages/recorded/tests/record_stages/every_joint.urdf",
        0.0,
        true,
    );
    add_sites(&mut scene);
    let m = constants(&scene.compile().unwrap());
    assert!(m.solver.refinements > 0);
    for motion in [
        Motion::Revolute,
        Motion::Prismatic,
        Motion::Ball,
        Motion::Free,
    ] {
        assert!(m.bodies.iter().any(|body| body.motion == motion));
    }
    assert!(!m.equalities.is_empty() && !m.frictions.is_empty() && !m.limits.is_empty());
    Case {
        name: "every joint",
        m,
        near: None,
    }
}

/// The FR3 with limits as its only constraints: the solver passes over states within them.
pub fn limits_only() -> Case {
    let mut case = fr3();
    case.m.equalities.clear();
    case.m.frictions.clear();
    case.m.solver.refinements = 1;
    Case {
        name: "limits only",
        ..case
    }
}

/// Shapes of every kind, two bodies among some that stand still.
pub fn shapes(cone: Cone, contacts_max: Option<usize>) -> Case {
    let mut scene = every_shape(cone);
    scene.contacts_max = contacts_max;
    let model = scene.compile().unwrap();
    assert!(model.constants().contacts.couples());
    Case {
        name: match cone {
            Cone::Elliptic => "elliptic",
            Cone::Pyramidal => "pyramidal",
        },
        m: constants(&model),
        near: Some(Near {
            joint_q: model.start().joint_q.clone(),
            share: 0.0,
            apart: 0.08,
            turn: 1.0,
        }),
    }
}

/// The same, with the points of MuJoCo where it has a rule of its own.
pub fn shapes_as_mujoco() -> Case {
    let mut case = shapes(Cone::Elliptic, None);
    case.name = "as MuJoCo";
    case.m.contacts.two_point_capsule_boxes = true;
    case
}

/// A body with one shape of every kind on a height field, and a scan of the ground below it.
pub fn fields() -> Case {
    let model = every_shape_on_a_field().compile().unwrap();
    Case {
        name: "fields",
        m: constants(&model),
        near: Some(Near {
            joint_q: model.start().joint_q.clone(),
            share: 0.0,
            apart: 0.08,
            turn: 1.0,
        }),
    }
}

/// The FR3 between a table and a cube, its fingers about the cube.
pub fn arm_and_cube() -> Case {
    arm_at_cube("arm and cube", [])
}

/// The same with sweeps over dry frictions and contacts, whose pairs are visited backwards.
pub fn swept() -> Case {
    let mut case = arm_and_cube();
    let m = &mut case.m;
    let numbers = &mut m.contacts.tables.numbers;
    m.sensors.ranks = Fixed {
        base: numbers.len(),
        stride: 1,
        rows: m.contacts.pairs.len(),
    };
    numbers.extend((0..m.contacts.pairs.len()).rev().map(|rank| rank as f32));
    let first = m.equalities.len();
    let dry_rows = (0..m.frictions.len()).map(|place| DryRow {
        row: first + place,
        tie: None,
        place,
    });
    m.solver.noslip = Some(NoSlip {
        iterations: 3,
        tolerance: 0.0,
        least_gain: 1e-6,
        dry_rows: dry_rows.collect(),
    });
    assert!(!m.frictions.is_empty());
    Case {
        name: "swept",
        ..case
    }
}

/// The same where every parameter varies.
pub fn every_param() -> Case {
    // impedances that vary count as stiff, and a processor then factors in another way than a GPU
    let params = Param::ALL.into_iter();
    arm_at_cube(
        "every parameter",
        params.filter(|&param| param != Param::ShapeSolimp),
    )
}

fn arm_at_cube(name: &'static str, params: impl IntoIterator<Item = Param>) -> Case {
    let mut scene = robot("examples/assets/fr3/fr3_franka_hand.urdf", 0.1, false);
    scene.robots[0].pose = Pose::at([-0.5, -0.5, 0.1]);
    scene.add_box("table", [0.4, 0.4, 0.05], Pose::at([0.0, -0.5, 0.05]));
    scene.robots[0].set_joint_q(&GRASP).unwrap();
    let cube = Shape::Box {
        half_extents: [0.025; 3],
    };
    let mut body = Body::new("cube", Pose::at(HELD));
    body.shapes
        .push((Collision::new(None, cube, Pose::identity()), 400.0));
    scene.add_body(body).unwrap();
    scene.params.extend(params);
    add_sites(&mut scene);
    let model = scene.compile().unwrap();
    Case {
        name,
        m: constants(&model),
        near: Some(Near {
            joint_q: model.start().joint_q.clone(),
            share: 0.02,
            apart: 0.02,
            turn: 0.1,
        }),
    }
}

/// A site in the world and one on each link, each measured from the one before it but for the first of three.
fn add_sites(scene: &mut Description) {
    let robot = &scene.robots[0];
    let links = robot
        .links
        .iter()
        .map(|link| format!("{}/{}", robot.name, link.name));
    let bodies: Vec<_> = std::iter::once(None).chain(links.map(Some)).collect();
    for (k, body) in bodies.into_iter().enumerate() {
        scene.sites.push(Site {
            name: format!("site {k}"),
            body,
            pose: Pose::from_rpy([0.1, -0.2, 0.3], [0.4, 0.5, -0.6]),
            relative_to: (k % 3 > 0).then(|| format!("site {}", k - 1)),
            damping: Site::DAMPING,
        });
    }
}

/// The arm of the lesson with its fingers at the cube's sides [rad, m].
const GRASP: [f64; 9] = [
    0.187, 0.519, 0.087, -2.289, -0.125, 2.790, 1.167, 0.026, 0.026,
];
/// The cube between them, on the table [m].
const HELD: [f64; 3] = [0.0, -0.35, 0.126];

fn constants(model: &Model) -> Constants<f32> {
    model.constants().cast()
}

fn robot(file: &str, armature: f64, floating: bool) -> Description {
    let path = repository().join(file);
    let mut scene = Description::new(1.0 / 480.0, SUBSTEPS);
    let options = UrdfOptions {
        floating,
        ..UrdfOptions::named("robot")
    };
    let robot = scene
        .add_urdf(path, options)
        .unwrap_or_else(|e| panic!("{file}: {e}"));
    for joint in robot
        .joints
        .iter_mut()
        .filter(|joint| joint.parent.is_some())
    {
        for dof in &mut joint.dofs {
            (dof.target_ke, dof.target_kd, dof.armature) = (400.0, 40.0, armature);
        }
    }
    scene
}

impl Case {
    /// A random state: without a place to be near, a tenth beyond the joints' ranges at either end, so that rows become
    /// active. `unit` is uniform in [-1, 1).
    pub fn random_state(&self, mut unit: impl FnMut() -> f64) -> Scalar {
        let m = &self.m;
        let mut block = Block::new(m, 0.0);
        let mut number = |size: f64| (unit() * size) as f32;
        for (j, dof) in m.dofs.iter().enumerate() {
            let (lower, upper) = m
                .limits
                .iter()
                .find(|l| l.dof == j)
                .map_or((-1.0, 1.0), |l| (l.lower, l.upper));
            let half = 0.5 * (upper - lower);
            let (middle, share) = match &self.near {
                Some(near) => (near.joint_q[dof.coord] as f32, near.share as f32),
                None => (0.5 * (lower + upper), 1.2),
            };
            let position = middle + share * half * number(1.0);
            if matches!(
                m.bodies[dof.body].motion,
                Motion::Revolute | Motion::Prismatic
            ) {
                block.joint_q[dof.coord] = position;
            }
            block.joint_target_q[j] = middle + half * number(1.0);
            block.joint_qd[j] = number(2.0);
            block.joint_qdd[j] = number(20.0);
            block.joint_f[j] = number(30.0);
            block.joint_target_qd[j] = number(1.0);
        }
        let rests = m.springs.starting_rests();
        block.plastic_rest.copy_from_slice(&rests);
        for x in block.ctrl.iter_mut().chain(&mut block.control_history) {
            *x = number(2.0);
        }
        for (x, (param, start)) in block.params.iter_mut().zip(m.varying.starts()) {
            *x = match param {
                Param::BodyF => number(5.0),
                Param::CommandDelay => number(40.0).abs(),
                Param::JointFriction => number(3.0).abs(),
                _ => *start as f32 * (1.0 + number(0.3)),
            };
        }
        for x in block
            .command_history
            .iter_mut()
            .chain(&mut block.command_noise)
        {
            *x = number(1.0);
        }
        let apart = self.near.as_ref().map_or(5.0, |near| near.apart);
        for body in m.bodies.iter().filter(|body| body.motion == Motion::Free) {
            for i in body.coord..body.coord + 3 {
                let place = self
                    .near
                    .as_ref()
                    .map_or(0.0, |near| near.joint_q[i] as f32);
                block.joint_q[i] = place + number(apart);
            }
        }
        let size = self.near.as_ref().map_or(1.0, |near| near.turn);
        for first in m.quaternions() {
            let turn = [number(size), number(size), number(size), 1.0 + number(0.5)];
            let norm = turn.iter().map(|x| x * x).sum::<f32>().sqrt();
            for (to, x) in block.joint_q[first..first + 4].iter_mut().zip(turn) {
                *to = x / norm;
            }
        }
        block
    }
}
