//! Heaps of bodies, whose contacts can join all dofs to one system: loops solve it, and one class has the contacts of all bodies.

use crate::common::{Run, noise};
use crate::{assert_alive, gpu, options, thrown};
use sim_engine::backend::BackendError;
use sim_engine::backend::gpu::listing;
use sim_engine::simulation::{Device, Options, Simulation};
use sim_model::{Body, Collision, Description, Model, Pose, Shape};
use sim_physics::arrays::Field;
use std::sync::Arc;

const WORLDS: usize = 6;
/// Largest difference of positions and velocities [m, rad, and per second]: threads add in another order, and stiff contacts multiply such
/// a rounding by some thousand.
const WORST: f64 = 2e-4;
/// Fastest spin at the start [rad/s]: forces of centres of mass beside their frames' origins count.
const SPIN: f64 = 10.0;
const FIELDS: [Field; 4] = [
    Field::JointQ,
    Field::JointQd,
    Field::ContactsLeftOut,
    Field::Status,
];

/// Bodies in a row on the ground, each of which touches its neighbours; every third one has its centre of mass beside its frame's origin.
/// Friction is so many times as stiff as normals are.
pub fn row(bodies: usize, shape: &Shape, impratio: f64) -> Arc<Model> {
    let mut scene = Description::new(1.0 / 240.0, 2);
    scene.solver.iterations = 100;
    scene.solver.impratio = impratio;
    scene.add_ground("ground", 0.0);
    for k in 0..bodies {
        let place = Pose::at([0.098 * k as f64, 0.0, 0.049]);
        let mut body = Body::new(&format!("body{k}"), place);
        let aside = if k % 3 == 0 { 0.01 } else { 0.0 };
        let shape = Collision::new(None, shape.clone(), Pose::at([0.0, aside, 0.0]));
        body.shapes.push((shape, 500.0));
        scene.add_body(body).unwrap();
    }
    scene.compile().unwrap()
}

pub const BALL: Shape = Shape::Sphere { radius: 0.05 };

/// World k of a run starts as number `ids[k]`. One thread per world computes the bits of the CPU.
fn played(model: &Arc<Model>, device: Device, threads: usize, ids: &[usize], frames: usize) -> Run {
    let options = Options {
        world_threads: Some(threads),
        cpu_bits: threads == 1,
        ..options(device, ids.len(), &FIELDS)
    };
    let dofs = model.dofs();
    // of a free body, at most 0.3 m/s and SPIN
    let speed = |id: &usize| {
        let of_dof = |k| noise(*id, k) * if k % 6 < 3 { 0.3 } else { SPIN };
        (0..dofs).map(of_dof).collect::<Vec<f64>>()
    };
    let speeds: Vec<f64> = ids.iter().flat_map(speed).collect();
    thrown(model, options, &speeds, frames)
}

fn state(run: &Run, world: usize) -> Vec<f64> {
    run.numbers(&FIELDS, world)
}

#[test]
fn heaps_have_the_bits_of_the_cpu() {
    let model = row(9, &BALL, 1.0);
    let ids: Vec<usize> = (0..WORLDS).collect();
    let [cpu, here] = [Device::Cpu, gpu()].map(|on| played(&model, on, 1, &ids, 20));
    for world in ids {
        assert_eq!(state(&here, world), state(&cpu, world), "world {world}");
    }
}

#[test]
fn heaps_of_several_threads_move_as_on_the_cpu() {
    let model = row(9, &BALL, 1.0);
    let ids: Vec<usize> = (0..WORLDS).collect();
    for frames in [1, 20] {
        let cpu = played(&model, Device::Cpu, 1, &ids, frames);
        let here = played(&model, gpu(), 8, &ids, frames);
        let mut worst = 0.0_f64;
        for world in ids.iter().copied() {
            let both = state(&here, world).into_iter().zip(state(&cpu, world));
            worst = both.fold(worst, |worst, (a, b)| worst.max((a - b).abs()));
        }
        assert!(worst < WORST, "{frames} frames: {worst:e}");
    }
}

#[test]
fn a_heap_has_the_same_bits_among_any_number_of_worlds() {
    let model = row(9, &BALL, 1.0);
    let many: Vec<usize> = (0..70).collect();
    let all = played(&model, gpu(), 8, &many, 6);
    let few = [69, 3];
    let some = played(&model, gpu(), 8, &few, 6);
    for (k, id) in few.iter().enumerate() {
        let bits = |run: &Run, world| -> Vec<u64> {
            state(run, world).into_iter().map(f64::to_bits).collect()
        };
        assert_eq!(bits(&some, k), bits(&all, *id), "world {id}");
    }
    assert_ne!(state(&all, 0), state(&all, 1));
}

#[test]
fn what_a_heap_shows_is_what_the_cpu_shows() {
    // one thread evaluates what is shown, with loops over the system; stiff contacts make forces of differences
    let model = row(9, &BALL, 1.0);
    let fields = [Field::JointQdd, Field::BodyContactForce];
    let shown = |device| {
        let options = Options {
            world_threads: Some(1),
            ..options(device, 2, &fields)
        };
        let mut run = Run::new(&model, options);
        run.step();
        run
    };
    let (cpu, here) = (shown(Device::Cpu), shown(gpu()));
    assert_alive(&here);
    for field in fields {
        let [a, b] = [&here, &cpu].map(|run| run.get(field, 1));
        let largest = b.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let both = a.into_iter().zip(b);
        let worst = both.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        assert!(
            largest > 1.0 && worst < 2e-3 * largest,
            "{field:?}: {worst:e}"
        );
    }
}

#[test]
fn a_system_that_the_software_driver_would_leave_unsolved_is_refused() {
    let model = row(25, &BALL, 1.0);
    let refused = Simulation::new(model, &options(gpu(), 1, &FIELDS)).err();
    let text = refused.expect("its loops end early").to_string();
    assert!(
        text.contains("150 dofs") && text.contains("use device = cpu"),
        "{text}"
    );
}

#[test]
fn a_model_whose_kernels_would_be_too_long_is_refused_at_once() {
    // each touches the ground, and no other one
    let mut scene = Description::new(1.0 / 240.0, 2);
    scene.add_ground("ground", 0.0);
    for k in 0..130 {
        let mut body = Body::new(&format!("body{k}"), Pose::at([k as f64, 0.0, 0.05]));
        let mut shape = Collision::new(None, BALL, Pose::identity());
        shape.surface.group = -1;
        body.shapes.push((shape, 500.0));
        scene.add_body(body).unwrap();
    }
    let model = scene.compile().unwrap();
    let layout = Simulation::layout_of(&model, &Options::default());
    let refused = listing(&model, &layout, None).unwrap_err();
    assert!(matches!(refused, BackendError::Program { .. }));
    let text = refused.to_string();
    assert!(text.contains("instructions"), "{text}");
    assert!(text.contains("use device = cpu"), "{text}");
}

#[test]
fn kernels_of_a_heap_are_short() {
    // each may touch every other one: 465 kinds of contacts, and a system of 180 dofs
    let half_extents = [0.05; 3];
    let model = row(30, &Shape::Box { half_extents }, 1.0);
    assert_eq!(model.constants().contacts.classes.len(), 465);
    let layout = Simulation::layout_of(&model, &Options::default());
    let kernels = listing(&model, &layout, None).unwrap().kernels;
    for kernel in &kernels {
        let (label, statements) = (&kernel.label, kernel.statements);
        assert!(statements < 12_000, "{label}: {statements}");
    }
    assert!(kernels.iter().any(|kernel| kernel.threads == 32));
}
