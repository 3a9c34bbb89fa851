//! A box that slides and turns on four corners: the solver's model holds contacts in single precision (elliptic cones).

mod common;

use common::{Run, noise};
use sim_engine::backend::{Profile, Values};
use sim_engine::simulation::{Options, Precision};
use sim_model::{Body, Collision, Cone, Description, Model, Pose, Shape};
use sim_physics::arrays::Field;
use std::sync::Arc;

const WORLDS: usize = 512;

/// The box on the ground, with at most so many iterations of the solver.
fn model(iterations: usize) -> Arc<Model> {
    let mut scene = Description::new(1.0 / 480.0, 1);
    scene.solver.cone = Cone::Elliptic;
    scene.solver.iterations = iterations;
    scene.add_ground("ground", 0.0);
    let mut body = Body::new("body", Pose::at([0.0, 0.0, 0.0245]));
    let shape = Shape::Box {
        half_extents: [0.1, 0.07, 0.025],
    };
    let shape = Collision::new(None, shape, Pose::identity());
    body.shapes.push((shape, 1000.0));
    scene.add_body(body).unwrap();
    scene.compile().unwrap()
}

/// Worlds that slide and turn, each at speeds of its own.
fn sliding(model: &Arc<Model>, precision: Precision) -> Run {
    let options = Options {
        worlds: WORLDS,
        precision,
        threads: Some(1),
        fields: vec![Field::JointQdd, Field::ContactCount],
        ..Options::default()
    };
    let mut run = Run::new(model, options);
    let speed = |k: usize| match k {
        0 | 1 => 0.05,
        5 => 0.5,
        _ => 0.0,
    };
    let row = |world: usize| (0..6).map(move |k| speed(k) * noise(world, k));
    let rows: Vec<f64> = (0..WORLDS).flat_map(row).collect();
    run.sim
        .write(Field::JointQd, 0..6, Values::F64(&rows), None)
        .unwrap();
    run
}

fn accelerations(run: &Run) -> Vec<Vec<f64>> {
    (0..WORLDS)
        .map(|world| run.get(Field::JointQdd, world))
        .collect()
}

#[test]
fn accelerations_where_contacts_are_held_are_those_of_double_precision() {
    let model = model(100);
    let [single, double] = [Precision::F32, Precision::F64].map(|precision| {
        let mut run = sliding(&model, precision);
        run.step();
        assert_eq!(run.get(Field::ContactCount, 0), [4.0]);
        accelerations(&run)
    });
    for (world, (single, double)) in single.iter().zip(&double).enumerate() {
        // of contacts, up to g; angular ones are an arm of 0.1 m away
        for (k, (x, y)) in single.iter().zip(double).enumerate() {
            let most = if k < 3 { 0.01 } else { 0.1 };
            assert!((x - y).abs() < most, "world {world}: {k}: {x} for {y}");
        }
    }
}

#[test]
fn held_contacts_take_few_iterations_and_evaluations() {
    let mut run = sliding(&model(100), Precision::F32);
    let mut arena = vec![0; run.sim.layout().bytes / 8];
    let mut profile = Profile::new();
    for _ in 0..40 {
        assert!(run.sim.step_profiled(&mut arena, &mut profile));
    }
    let (iterations, evaluations) = (&profile.iterations, &profile.evaluations);
    let told = format!(
        "{} iterations, {} at most; {} evaluations, {} at most",
        iterations.mean(),
        iterations.quantile(0.999),
        evaluations.mean(),
        evaluations.quantile(0.999)
    );
    println!("{told}");
    assert!(
        iterations.mean() < 3.0 && iterations.quantile(0.999) <= 10,
        "{told}"
    );
}

#[test]
fn a_single_iteration_is_newtons_and_moves_every_world() {
    let mut run = sliding(&model(1), Precision::F32);
    run.step();
    for (world, acceleration) in accelerations(&run).iter().enumerate() {
        let largest = acceleration.iter().map(|x| x.abs()).fold(0.0, f64::max);
        assert!(largest > 0.05, "world {world}: {acceleration:?}");
    }
}
