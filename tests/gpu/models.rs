//! Models with contacts in many places, as hardware has them: kernels stay short, and several threads find what the CPU finds.

use crate::common::{Run, noise, repo};
use crate::{gpu, options, thrown};
use sim_engine::backend::gpu::{KernelListing, listing};
use sim_engine::simulation::{Device, Options, Simulation};
use sim_model::{Description, Model, MujocoOptions, Robot, UrdfOptions};
use sim_physics::arrays::Field;
use std::fmt::Write;
use std::sync::Arc;

/// Most statements of a kernel here: about what fits the instruction cache of a card.
const STATEMENTS_MAX: usize = 6_500;
const WORLDS: usize = 6;
const FIELDS: [Field; 2] = [Field::JointQ, Field::JointQd];

/// A ball with four arms of three balls each, all of which may touch each other and the ground.
pub fn ragdoll() -> Arc<Model> {
    let mut urdf = "<robot name=\"ragdoll\">".to_owned();
    let mut link = |name: &str, radius: f64| {
        let inertia = "ixx=\"2e-3\" iyy=\"2e-3\" izz=\"2e-3\" ixy=\"0\" ixz=\"0\" iyz=\"0\"";
        write!(
            urdf,
            "<link name=\"{name}\"><inertial><mass value=\"0.5\"/><inertia {inertia}/></inertial>\
             <collision><geometry><sphere radius=\"{radius}\"/></geometry></collision></link>"
        )
        .unwrap();
    };
    link("trunk", 0.1);
    let places = (0..4).flat_map(|arm| (0..3).map(move |part| (arm, part)));
    places
        .clone()
        .for_each(|(arm, part)| link(&format!("{arm}{part}"), 0.05));
    for (arm, part) in places {
        let (parent, place) = match (arm, part) {
            (_, 1..) => (format!("{arm}{}", part - 1), "0 0 -0.11"),
            (0, _) => ("trunk".to_owned(), "0.16 0 0"),
            (1, _) => ("trunk".to_owned(), "-0.16 0 0"),
            (2, _) => ("trunk".to_owned(), "0 0.16 0"),
            _ => ("trunk".to_owned(), "0 -0.16 0"),
        };
        write!(
            urdf,
            "<joint name=\"j{arm}{part}\" type=\"revolute\"><parent link=\"{parent}\"/><child link=\"{arm}{part}\"/>\
             <origin xyz=\"{place}\"/><axis xyz=\"{} {} 0\"/>\
             <limit lower=\"-2\" upper=\"2\" effort=\"9\" velocity=\"9\"/></joint>",
            part % 2,
            (part + 1) % 2
        )
        .unwrap();
    }
    urdf += "</robot>";
    let options = UrdfOptions {
        self_collisions: true,
        floating: true,
        ..UrdfOptions::named("ragdoll")
    };
    let mut scene = Description::new(1.0 / 240.0, 2);
    scene.add_ground("ground", -0.3);
    let robot = Robot::from_urdf_text(&urdf, "ragdoll.urdf", options).unwrap();
    scene.add_robot(robot).unwrap();
    scene.compile().unwrap()
}

/// A MuJoCo model of the tests of stages.
pub fn mujoco(name: &str) -> Arc<Model> {
    let folder = repo("sim-core/stages/recorded/tests/record_stages");
    let path = folder.join(name).with_extension("safetensors");
    let scene = Description::from_mujoco(path, MujocoOptions::named("every")).unwrap();
    scene.compile().unwrap()
}

fn played(model: &Arc<Model>, device: Device, threads: Option<usize>, frames: usize) -> Run {
    let options = Options {
        world_threads: threads,
        ..options(device, WORLDS, &FIELDS)
    };
    let dofs = model.dofs();
    let speeds: Vec<f64> = (0..WORLDS * dofs)
        .map(|k| noise(k / dofs, k % dofs))
        .collect();
    thrown(model, options, &speeds, frames)
}

/// Largest difference of numbers x, as a part of 1 + |x|.
fn apart(a: &Run, b: &Run) -> f64 {
    let mut worst = 0.0_f64;
    for world in 0..WORLDS {
        for field in FIELDS {
            for (a, b) in a.get(field, world).into_iter().zip(b.get(field, world)) {
                assert!(a.is_finite(), "{field:?} of world {world}: {a}");
                worst = worst.max((a - b).abs() / (1.0 + b.abs()));
            }
        }
    }
    worst
}

#[test]
fn kernels_of_a_robot_that_touches_itself_are_short() {
    let model = ragdoll();
    let classes = model.constants().contacts.classes.len();
    assert!(classes > 15, "{classes}");
    let layout = Simulation::layout_of(&model, &Options::default());
    let kernels = listing(&model, &layout, None).unwrap().kernels;
    for kernel in &kernels {
        let (label, statements) = (&kernel.label, kernel.statements);
        assert!(statements < STATEMENTS_MAX, "{label}: {statements}");
    }
    assert!(kernels.iter().any(|kernel| kernel.threads == 8));
}

#[test]
fn models_with_many_kinds_of_contacts_move_as_on_the_cpu() {
    // after a frame: threads add in another order, and the driver's quotients are not the nearest numbers. Stiff contacts of random
    // speeds multiply such a rounding by some thousand
    for (name, model, most) in [
        ("ragdoll", ragdoll(), 2e-5),
        ("implicit", mujoco("implicit"), 2e-4),
        ("runge_kutta", mujoco("runge_kutta"), 2e-4),
    ] {
        let cpu = played(&model, Device::Cpu, None, 1);
        let here = played(&model, gpu(), Some(8), 1);
        let worst = apart(&here, &cpu);
        assert!(worst < most, "{name}: {worst:e}");
    }
}

#[test]
fn sensors_of_contacts_read_the_merged_classes() {
    // a driver takes minutes for all sensors; recording reads every class that they list
    let model = mujoco("sensors");
    let options = Options {
        fields: vec![Field::Sensordata, Field::CfrcExt],
        ..Options::default()
    };
    let layout = Simulation::layout_of(&model, &options);
    let list = |threads| listing(&model, &layout, Some(threads)).unwrap();
    let [alone, shared] = [1, 8].map(list);
    // rows of merged classes take other memory
    assert_ne!(alone.contacts_bytes, shared.contacts_bytes);
    let is_shared = |kernel: &KernelListing| kernel.threads == 8;
    assert!(shared.kernels.iter().any(is_shared));
}
