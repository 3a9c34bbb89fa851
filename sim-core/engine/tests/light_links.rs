//! What `f32` keeps of a light link at the end of a long and heavy arm.

use sim_engine::backend::{Lanes, Precision, Values};
use sim_engine::simulation::{Options, Simulation};
use sim_model::{Description, Inertial, Joint, JointKind, Link, Model, Pose, Robot};
use sim_physics::arrays::Field;
use std::sync::Arc;

const HEAVY: f64 = 10.0;
const LIGHT: f64 = 0.2;

/// A rod along x, or a disc across it, from the joint.
fn link(name: &str, mass: f64, length: f64, moments: [f64; 3]) -> Link {
    let [xx, yy, zz] = moments;
    let inertial = Inertial {
        mass,
        pos: [0.5 * length, 0.0, 0.0],
        inertia: [[xx, 0.0, 0.0], [0.0, yy, 0.0], [0.0, 0.0, zz]],
    };
    Link {
        name: name.into(),
        inertial: Some(inertial),
        collisions: Vec::new(),
    }
}

/// An arm with the proportions of a UR10: two heavy links of 1 m, then three light ones about a wrist.
fn arm(floating: bool) -> Arc<Model> {
    let across = HEAVY / 12.0;
    let heavy = |name: &str| link(name, HEAVY, 1.0, [0.02, across, across]);
    let mut links = vec![
        link("shoulder", HEAVY, 0.1, [0.03, 0.03, 0.02]),
        heavy("upper"),
        heavy("lower"),
        link("wrist_1", 1.0, 0.1, [1e-3, 2e-3, 2e-3]),
        link("wrist_2", 1.0, 0.1, [1e-3, 2e-3, 2e-3]),
        link("wrist_3", LIGHT, 0.02, [1e-4, 1e-4, 1.3e-4]),
    ];
    let axes = [
        [0.0, 0.0, 1.0],
        [0.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [1.0, 0.0, 0.0],
    ];
    let places = [0.2, 0.1, 1.0, 1.0, 0.1, 0.1];
    links.insert(0, link("base", HEAVY, 0.1, [0.1, 0.1, 0.1]));
    let joints = (0..axes.len()).map(|k| Joint {
        axis: axes[k],
        origin: Pose::at([places[k], 0.03, 0.07]),
        ..Joint::new(JointKind::Revolute, &format!("j{k}"), Some(k), k + 1)
    });
    let mut robot = Robot {
        name: "arm".into(),
        pose: Pose::identity(),
        floating: false,
        self_collisions: false,
        joints: joints.collect(),
        links,
        notes: Vec::new(),
        warnings: Vec::new(),
        urdf: None,
        precompiled: None,
    };
    if floating {
        robot.float();
    }
    let mut scene = Description::new(1.0 / 480.0, 8);
    scene.robots.push(robot);
    scene.compile().expect("links with mass compile")
}

/// Coordinates that `f32` holds exactly, so that both precisions are at the same state.
fn state(model: &Model, seed: usize, size: f64) -> Vec<f64> {
    let mut q: Vec<f64> = (0..model.coords())
        .map(|k| f64::from(((1 + seed) as f32 * (1.3 + k as f32)).sin()) * size)
        .map(|x| f64::from(x as f32))
        .collect();
    for first in model.constants().quaternions() {
        q[first..first + 4].copy_from_slice(&[0.5, -0.5, 0.5, 0.5]);
    }
    q
}

/// A field at a state, in a precision.
fn field(
    model: &Arc<Model>,
    precision: Precision,
    which: Field,
    q: &[f64],
    qd: &[f64],
) -> Vec<f64> {
    let options = Options {
        precision,
        lanes: Lanes::Scalar,
        threads: Some(1),
        fields: vec![which],
        ..Options::default()
    };
    let mut sim = Simulation::new(model.clone(), &options).expect("a model of one arm");
    sim.write(Field::JointQ, 0..q.len(), Values::F64(q), None)
        .expect("a state that fits");
    sim.write(Field::JointQd, 0..qd.len(), Values::F64(qd), None)
        .expect("a state that fits");
    let mut arena = vec![0u64; sim.layout().bytes / 8];
    sim.forward(&mut arena);
    let slot = &sim.layout().slots[0];
    let bytes: Vec<u8> = arena.iter().flat_map(|word| word.to_ne_bytes()).collect();
    let count: usize = slot.shape.iter().product();
    let at = |k: usize, size: usize| &bytes[slot.offset + k * size..][..size];
    match precision {
        Precision::F64 => (0..count)
            .map(|k| f64::from_ne_bytes(at(k, 8).try_into().expect("8 bytes")))
            .collect(),
        Precision::F32 => (0..count)
            .map(|k| f64::from(f32::from_ne_bytes(at(k, 4).try_into().expect("4 bytes"))))
            .collect(),
    }
}

/// A field in f32 and in f64.
fn both(model: &Arc<Model>, which: Field, q: &[f64], qd: &[f64]) -> [Vec<f64>; 2] {
    [Precision::F32, Precision::F64].map(|precision| field(model, precision, which, q, qd))
}

#[test]
fn mass_matrix_in_f32_keeps_the_inertia_of_a_light_wrist() {
    for floating in [false, true] {
        let model = arm(floating);
        let n = model.dofs();
        for seed in 0..16 {
            let q = state(&model, seed, 2.0);
            let [single, exact] = both(&model, Field::MassMatrix, &q, &vec![0.0; n]);
            for (k, (x, y)) in single.iter().zip(&exact).enumerate() {
                let (i, j) = (k / n, k % n);
                let share = (x - y).abs() / (exact[i * n + i] * exact[j * n + j]).sqrt();
                assert!(share < 2e-6, "{floating} {seed} ({i}, {j}): {share:e}");
            }
        }
    }
}

#[test]
fn bias_force_in_f32_keeps_the_load_of_a_light_wrist() {
    for floating in [false, true] {
        let model = arm(floating);
        let n = model.dofs();
        for seed in 0..16 {
            let (q, qd) = (state(&model, seed, 2.0), state(&model, seed + 50, 2.0));
            let [single, exact] = both(&model, Field::BiasForce, &q, &qd[..n]);
            let [_, mass] = both(&model, Field::MassMatrix, &q, &qd[..n]);
            // of the last joint alone: what the others carry is heavy
            let last = n - 1;
            let share = (single[last] - exact[last]).abs() / mass[n * n - 1].sqrt();
            assert!(share < 2e-6, "{floating} {seed}: {share:e}");
        }
    }
}
