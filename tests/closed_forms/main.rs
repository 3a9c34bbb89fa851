//! Motions that are known without any simulator.

#[path = "../common/mod.rs"]
mod common;

mod free_body;
mod pivot;
mod planar;

use common::Run;
use sim_engine::simulation::{Lanes, Options, Precision};
use sim_model::{Description, Inertial, Joint, JointKind, Link, Pose, Robot};
use sim_physics::arrays::Field;

const GRAVITY: f64 = 9.81;
/// Steps of a control frame in [`one_body`].
const SUBSTEPS: usize = 10;

type Vec3 = [f64; 3];
type Quat = [f64; 4];

/// A body on one joint.
#[derive(Clone, Copy)]
struct Top {
    /// [kg]
    mass: f64,
    /// Centre of mass from the joint, in the body's axes [m].
    center: Vec3,
    /// Moments about the centre of mass, along the body's axes [kg·m²].
    moments: Vec3,
}

/// A scene of one body on a joint at the world's origin.
fn one_body(dt: f64, kind: JointKind, top: Top) -> Description {
    let mut scene = Description::new(dt, SUBSTEPS);
    scene.gravity = [0.0, 0.0, -GRAVITY];
    let link = |name: &str, inertial| Link {
        name: name.into(),
        inertial,
        collisions: Vec::new(),
    };
    let [xx, yy, zz] = top.moments;
    let inertial = Inertial {
        mass: top.mass,
        pos: top.center,
        inertia: [[xx, 0.0, 0.0], [0.0, yy, 0.0], [0.0, 0.0, zz]],
    };
    scene.robots.push(Robot {
        name: "one".into(),
        pose: Pose::identity(),
        floating: false,
        self_collisions: false,
        links: vec![link("base", None), link("top", Some(inertial))],
        joints: vec![Joint::new(kind, "joint", Some(0), 1)],
        notes: Vec::new(),
        warnings: Vec::new(),
        urdf: None,
        precompiled: None,
    });
    scene
}

/// Position and velocity after some seconds from a start, and how many steps that took.
fn after(
    scene: &Description,
    precision: Precision,
    q: &[f64],
    qd: &[f64],
    seconds: f64,
) -> (Vec<f64>, Vec<f64>, f64) {
    let states = motion(scene, precision, q, qd, seconds);
    let steps = (states.len() * SUBSTEPS) as f64;
    let (q, qd) = states.into_iter().next_back().unwrap();
    (q, qd, steps)
}

/// Position and velocity after each control frame of some seconds from a start.
fn motion(
    scene: &Description,
    precision: Precision,
    q: &[f64],
    qd: &[f64],
    seconds: f64,
) -> Vec<(Vec<f64>, Vec<f64>)> {
    let fields = vec![Field::JointQ, Field::JointQd];
    // in f32 the last lane but one of a second block, so that whole registers are at work
    let (worlds, world, lanes) = match precision {
        Precision::F64 => (1, 0, Lanes::Scalar),
        Precision::F32 => (31, 29, Lanes::Auto),
    };
    let options = Options {
        worlds,
        precision,
        threads: Some(1),
        lanes,
        fields,
        ..Options::default()
    };
    let mut run = Run::new(&scene.compile().unwrap(), options);
    run.write(Field::JointQ, q);
    run.write(Field::JointQd, qd);
    let frames = (seconds / (scene.dt * SUBSTEPS as f64)).round() as usize;
    let step = |_| {
        run.step();
        (
            run.get(Field::JointQ, world),
            run.get(Field::JointQd, world),
        )
    };
    (0..frames).map(step).collect()
}

/// Largest difference that `f32` may make after some steps: four roundings of numbers of this size in each, all to
/// one side.
fn rounding(steps: f64, size: f64) -> f64 {
    4.0 * steps * size * f64::from(f32::EPSILON) / 2.0
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Turns a vector by a quaternion (x, y, z, w).
fn turned(q: Quat, a: Vec3) -> Vec3 {
    let axis = [q[0], q[1], q[2]];
    let t = cross(axis, a).map(|x| 2.0 * x);
    let u = cross(axis, t);
    std::array::from_fn(|i| a[i] + q[3] * t[i] + u[i])
}

fn conjugate(q: Quat) -> Quat {
    [-q[0], -q[1], -q[2], q[3]]
}

fn quat(q: &[f64]) -> Quat {
    q.try_into().unwrap()
}

fn vec3(x: &[f64]) -> Vec3 {
    x.try_into().unwrap()
}

fn distance(a: Vec3, b: Vec3) -> f64 {
    common::distance(&a, &b)
}

/// Asserts that halving the step halves the error, as a method of first order does.
#[track_caller]
fn assert_first_order(what: &str, coarse: f64, fine: f64) {
    assert!(
        (fine / coarse - 0.5).abs() < 0.05,
        "{what}: {coarse:e}, at half the step {fine:e}"
    );
}
