//! Worlds on a GPU that are asked for the bits of the CPU.

use crate::common::any_program::{Scope, any_program};
use crate::common::any_scene::any_scene;
use crate::common::dice::{Dice, for_seeds};
use crate::common::program::play;
use crate::common::shapes::shapes;
use crate::common::{Demo, Run, lesson_with_table, noise, repo};
use crate::heaps::{BALL, row};
use crate::models::{mujoco, ragdoll};
use crate::{assert_alive, gpu, options};
use sim_device::{Choice, Replay, Source};
use sim_engine::backend::{BackendError, Values};
use sim_engine::simulation::{Device, Options, Simulation};
use sim_model::{Cone, Description, Model, UrdfOptions};
use sim_physics::arrays::Field;
use sim_record::wgsl::Corrections;
use std::sync::Arc;
use std::time::Duration;

const WORLDS: usize = 70;
/// Random scenes where the environment does not say how many, and their worlds.
const CASES: usize = 4;
const FEW: usize = 5;

/// Worlds of random states and efforts, evaluated there.
fn started(model: &Arc<Model>, device: Device, fields: &[Field]) -> Run {
    let options = Options {
        cpu_bits: true,
        ..options(device, WORLDS, fields)
    };
    let mut run = Run::new(model, options);
    let (coords, dofs) = (model.coords(), model.dofs());
    // so little that what stands stays free or touches lightly, and quaternions stay rotations
    let start = &model.start().joint_q;
    let q: Vec<f64> = (0..WORLDS * coords)
        .map(|k| start[k % coords] + 0.02 * noise(k / coords, k % coords))
        .collect();
    let of_dofs = |salt: usize| -> Vec<f64> {
        let all = (0..WORLDS * dofs).map(|k| noise(k / dofs, salt + k % dofs));
        all.collect()
    };
    let (qd, f) = (of_dofs(1000), of_dofs(2000));
    let sim = &mut run.sim;
    sim.write(Field::JointQ, 0..coords, Values::F64(&q), None)
        .unwrap();
    sim.write(Field::JointQd, 0..dofs, Values::F64(&qd), None)
        .unwrap();
    sim.command(Field::JointF, 0..dofs, Values::F64(&f))
        .unwrap();
    run.forward();
    run
}

/// All numbers have the same bits.
#[track_caller]
fn assert_equal(here: &Run, there: &Run, fields: &[Field]) {
    for field in fields {
        for world in 0..WORLDS {
            let (a, b) = (here.get(*field, world), there.get(*field, world));
            assert!(a.iter().all(|a| a.is_finite()), "{field:?}: {a:?}");
            let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert!(
                bits(&a) == bits(&b),
                "{field:?} of world {world}: {a:?}, not {b:?}"
            );
        }
    }
}

/// Compares the start, and what some frames make of it.
#[track_caller]
fn compare(model: &Arc<Model>, fields: &[Field], frames: usize) {
    let [mut here, mut there] = [gpu(), Device::Cpu].map(|on| started(model, on, fields));
    assert_ne!(here.get(Field::JointQ, 0), here.get(Field::JointQ, 1));
    assert_equal(&here, &there, fields);
    for run in [&mut here, &mut there] {
        (0..frames).for_each(|_| run.step());
    }
    assert_alive(&here);
    assert_equal(&here, &there, fields);
}

#[test]
fn all_fields_of_the_grasp_are_those_of_the_cpu() {
    let scene = lesson_with_table(Demo::Target, true);
    compare(&scene.compile().unwrap(), Field::ALL, 3);
}

#[test]
fn all_fields_of_every_joint_are_those_of_the_cpu() {
    let mut scene = Description::new(1.0 / 480.0, 8);
    let options = UrdfOptions {
        floating: true,
        ..UrdfOptions::named("r")
    };
    let path = "sim-core/stages/recorded/tests/record_stages/every_joint.urdf";
    scene.add_urdf(repo(path), options).unwrap();
    compare(&scene.compile().unwrap(), Field::ALL, 3);
}

#[test]
fn all_fields_of_every_shape_are_those_of_the_cpu() {
    let scene = shapes(Cone::Elliptic);
    compare(&scene.compile().unwrap(), Field::ALL, 3);
}

/// What runs of other models compare.
const STATE: [Field; 2] = [Field::JointQ, Field::JointQd];

#[test]
fn a_robot_that_touches_itself_is_that_of_the_cpu() {
    compare(&ragdoll(), &STATE, 5);
}

#[test]
fn implicit_steps_are_those_of_the_cpu() {
    compare(&mujoco("implicit"), &STATE, 5);
}

#[test]
fn whatever_happens_to_worlds_of_any_scene_has_the_bits_of_the_cpu() {
    for_seeds(CASES, |seed| {
        let mut dice = Dice::new(seed);
        // the software driver takes minutes for all fields of many bodies and shapes
        let model = loop {
            let is_drawn = dice.chance(0.4);
            let scene = any_scene(&mut dice, is_drawn).compile();
            let model = scene.map_err(|e| e.to_string())?;
            let classes = model.constants().contacts.classes.len();
            if (1..=3).contains(&classes) && model.dofs() <= 10 {
                break model;
            }
        };
        let scope = Scope {
            model: &model,
            worlds: vec![true; FEW],
            sources: (0..FEW).collect(),
            first_kept: 0,
            huge: None,
        };
        let ops = any_program(&mut dice, &scope, 6);
        let fields = [Field::JointQ, Field::JointQd, Field::BodyQ, Field::EfcForce];
        let wanted = |device| Options {
            cpu_bits: true,
            ..options(device, FEW, &fields)
        };
        let here = play(&model, &wanted(gpu()), &ops)?;
        let there = play(&model, &wanted(Device::Cpu), &ops)?;
        (0..FEW).try_for_each(|world| here.differs(world, &there, world))
    });
}

#[test]
fn stiff_contacts_are_added_to_factors_as_on_the_cpu() {
    let model = row(3, &BALL, 1e5);
    assert!(model.constants().contacts.are_stiff);
    compare(&model, &STATE, 10);
}

#[test]
fn stiff_contacts_of_many_dofs_are_refused() {
    let wanted = Options {
        cpu_bits: true,
        ..options(gpu(), 2, &[Field::JointQ])
    };
    let refused = Simulation::new(row(9, &BALL, 1e5), &wanted).err().unwrap();
    assert!(
        matches!(&refused, BackendError::OtherBits { reason } if reason.contains("are stiff")),
        "{refused}"
    );
}

#[test]
fn threads_that_share_a_world_are_refused() {
    let model = lesson_with_table(Demo::Target, true).compile().unwrap();
    let wanted = Options {
        cpu_bits: true,
        world_threads: Some(8),
        ..options(gpu(), 2, &[Field::JointQ])
    };
    let refused = Simulation::new(model, &wanted).err().unwrap();
    assert!(
        matches!(&refused, BackendError::OtherBits { reason } if reason.contains("world_threads is 8")),
        "{refused}"
    );
}

/// Random bits, and numbers that are easily lost.
fn samples() -> Vec<[f32; 3]> {
    let halfway = [
        1.0 + f32::EPSILON,
        1.0 - f32::EPSILON,
        (1 << 24) as f32 + 2.0,
    ];
    let special = [
        0.0,
        -0.0,
        1.0,
        f32::MIN_POSITIVE,
        f32::MAX,
        -f32::MAX,
        f32::INFINITY,
        1e-30,
        -1e30,
    ];
    let mut samples = vec![halfway];
    // numbers near powers of 2 and 4, and those with all ones
    let near = [1.0_f32, 2.0, 4.0, 16_777_216.0].map(f32::to_bits);
    let near = near.map(|bits| (bits - 5..bits + 6).map(f32::from_bits));
    let near: Vec<f32> = near.into_iter().flatten().collect();
    for a in &near {
        samples.extend(near.iter().map(|b| [*a, *b, *a]));
    }
    for a in special {
        samples.extend(special.iter().flat_map(|b| [[a, *b, 1.0], [*b, 3.0, a]]));
    }
    let random = |seed: usize| {
        // neighbouring exponents, where sums cancel, in every second one
        let spread = if seed.is_multiple_of(2) { 4 } else { 250 };
        [0, 1, 2].map(|k| {
            let bits = (1e9 * (1.0 + noise(seed, k))) as u32;
            let exponent = 127 - spread / 2 + (1e9 * (1.0 + noise(seed, 3 + k))) as u32 % spread;
            f32::from_bits(bits << 2 & 0x807f_ffff | exponent << 23)
        })
    };
    samples.extend((0..60_000).map(random));
    samples
}

/// Equal, both no number, or both so small that a device may flush them to 0.
fn agree(a: f32, b: f32) -> bool {
    a == b || a.is_nan() && b.is_nan() || a.abs().max(b.abs()) <= f32::MIN_POSITIVE
}

#[test]
fn corrected_operations_are_the_nearest_numbers() {
    let device = sim_device::Device::open(&Choice::First, None).unwrap();
    let corrections = Corrections {
        fma: true,
        quotient: true,
        root: true,
    };
    for off in [-3, -2, -1, 0, 1, 2, 3] {
        // a reciprocal and a root that are as far off as Vulkan lets them be
        let moved = |x: &str| format!("= bitcast<f32>(bitcast<u32>({x}) + {}u);", off as u32);
        let functions = corrections
            .functions()
            .replace("= 1.0f / b;", &moved("1.0f / b"))
            .replace("= sqrt(a);", &moved("sqrt(a)"));
        assert_eq!(functions.matches("bitcast<f32>(bitcast<u32>").count(), 3);
        assert_nearest(&device, &functions, off);
    }
}

/// Compares these functions with the processor's operations.
fn assert_nearest(device: &sim_device::Device, functions: &str, off: i32) {
    let samples = samples();
    let count = samples.len();
    let source = Source {
        label: "corrections".to_owned(),
        wgsl: format!(
            "@group(0) @binding(0) var<storage, read> samples: array<f32>;
            @group(0) @binding(1) var<storage, read_write> results: array<vec4<f32>>;
            {functions}
            @compute @workgroup_size(32) fn main(@builtin(global_invocation_id) thread: vec3<u32>) {{
                let k = thread.x;
                if (k >= {count}u) {{ return; }}
                let a = samples[3u * k]; let b = samples[3u * k + 1u]; let c = samples[3u * k + 2u];
                results[k] = vec4<f32>(fused(a, b, c), quotient(a, b), root(abs(c)), root(c));
            }}"
        ),
        entry: "main".to_owned(),
        constants: Vec::new(),
    };
    let programs = device.programs(&[source], Duration::from_secs(60));
    let program = programs.unwrap().remove(0);
    let bytes = [12, 16].map(|size| (size * count) as u64);
    let given = device.staging("samples", bytes[0]).unwrap();
    given
        .write()
        .copy_from_slice(bytemuck::cast_slice(&samples));
    let results = device.staging("results", bytes[1]).unwrap();
    let mut batch = device.batch(Replay::Recorded);
    let bindings = [(0, &*given, 0..bytes[0]), (1, &*results, 0..bytes[1])];
    batch.dispatch(&program, &bindings, count.div_ceil(32) as u32);
    device.run(&[&batch.finish().unwrap()]).unwrap();
    let results = results.read();
    let results: &[[f32; 4]] = bytemuck::cast_slice(&results);
    for ([a, b, c], [fma, quotient, root, other]) in samples.iter().zip(results) {
        let wanted = a.mul_add(*b, *c);
        assert!(agree(*fma, wanted), "fma({a:e}, {b:e}, {c:e}): {fma:e}");
        // 0, infinity and what is no number have no neighbours: a driver has them exactly, or is refused
        if off == 0 || [*a, *b, a / b].iter().all(|x| x.is_normal()) {
            assert!(
                agree(*quotient, a / b),
                "{off}: {a:e} / {b:e}: {quotient:e}"
            );
        }
        if off == 0 || c.is_normal() {
            assert!(
                agree(*root, c.abs().sqrt()),
                "{off}: root of |{c:e}|: {root:e}"
            );
            assert!(agree(*other, c.sqrt()), "{off}: root of {c:e}: {other:e}");
        }
    }
}
