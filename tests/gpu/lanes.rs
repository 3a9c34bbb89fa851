//! Several threads per world: they find what one thread finds, and their number of worlds does not matter.
//!
//! The software driver has subgroups as wide as the processor's vectors, of eight threads mostly. Where a world has more, it is a
//! workgroup, and its threads exchange values through memory.

use crate::common::{Run, noise};
use crate::{gpu, options, thrown};
use sim_engine::options::Cuts;
use sim_engine::simulation::{Device, Options};
use sim_model::{Body, Collision, Description, Model, Pose, Robot, Shape, UrdfOptions};
use sim_physics::arrays::Field;
use std::sync::Arc;

const FIELDS: [Field; 2] = [Field::JointQ, Field::JointQd];

/// Two links with dry friction and limits; a ball is at the end.
const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/>
    <inertia ixx="2e-3" iyy="2e-3" izz="5e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 -0.1"/><mass value="0.4"/>
    <inertia ixx="2e-3" iyy="2e-3" izz="5e-4" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 -0.2"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-0.3" upper="0.3" effort="20" velocity="10"/><dynamics friction="0.05" damping="0.05"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 -0.2"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="0.5" effort="20" velocity="10"/><dynamics friction="0.02" damping="0.05"/></joint>
</robot>"#;

/// The arm hangs over a plane and pushes a box that stands on it.
fn scene() -> Arc<Model> {
    let mut scene = Description::new(1.0 / 240.0, 4);
    scene.add_ground("ground", 0.0);
    let mut arm = Robot::from_urdf_text(ARM, "arm.urdf", UrdfOptions::named("arm")).unwrap();
    arm.pose = Pose::at([0.0, 0.0, 0.46]);
    scene.add_robot(arm).unwrap();
    let mut cube = Body::new("cube", Pose::at([0.1, 0.0, 0.05]));
    let half_extents = [0.05; 3];
    let shape = Collision::new(None, Shape::Box { half_extents }, Pose::identity());
    cube.shapes.push((shape, 500.0));
    scene.add_body(cube).unwrap();
    scene.compile().unwrap()
}

/// World k of a run starts as number `ids[k]`.
fn played(device: Device, threads: Option<usize>, ids: &[usize], frames: usize) -> Run {
    played_with(device, threads, Cuts::default(), ids, frames)
}

fn played_with(
    device: Device,
    threads: Option<usize>,
    cuts: Cuts,
    ids: &[usize],
    frames: usize,
) -> Run {
    let model = scene();
    let options = Options {
        world_threads: threads,
        cuts,
        ..options(device, ids.len(), &FIELDS)
    };
    let speed = |id: &usize| (0..2).map(|k| 3.0 * noise(*id, k)).collect::<Vec<_>>();
    let speeds: Vec<f64> = ids.iter().flat_map(speed).collect();
    thrown(&model, options, &speeds, frames)
}

fn state(run: &Run, world: usize) -> Vec<f64> {
    run.numbers(&FIELDS, world)
}

#[test]
fn worlds_of_several_threads_move_as_on_the_cpu() {
    const WORLDS: usize = 40;
    // of positions and velocities [m, rad, and per second]
    const WORST: f64 = 1e-4;
    let ids: Vec<usize> = (0..WORLDS).collect();
    for frames in [1, 40] {
        let cpu = played(Device::Cpu, None, &ids, frames);
        for threads in [4, 8, 16] {
            let here = played(gpu(), Some(threads), &ids, frames);
            let mut worst = 0.0_f64;
            for world in 0..WORLDS {
                let both = state(&here, world).into_iter().zip(state(&cpu, world));
                worst = both.fold(worst, |worst, (a, b)| worst.max((a - b).abs()));
            }
            assert!(
                worst < WORST,
                "{threads} threads, {frames} frames: {worst:e}"
            );
        }
    }
}

#[test]
fn a_world_of_several_threads_has_the_same_bits_among_any_number() {
    let many: Vec<usize> = (0..200).collect();
    let all = played(gpu(), Some(8), &many, 12);
    let few = [199, 3, 77];
    let some = played(gpu(), Some(8), &few, 12);
    for (k, id) in few.iter().enumerate() {
        let bits = |run: &Run, world| -> Vec<u64> {
            state(run, world).into_iter().map(f64::to_bits).collect()
        };
        assert_eq!(bits(&some, k), bits(&all, *id), "world {id}");
    }
    assert_ne!(state(&all, 0), state(&all, 1));
}

#[test]
fn the_last_kernel_of_a_substep_and_the_first_of_the_next_are_one_dispatch() {
    let cuts = Cuts {
        kernel: Some(4000),
        dispatch: Some(0),
    };
    let ids: Vec<usize> = (0..40).collect();
    let joined = played_with(gpu(), Some(8), cuts, &ids, 12);
    let of_steps = joined.sim.programs().iter().filter_map(|p| p.dispatches);
    let dispatches: Vec<usize> = of_steps.collect();
    // of 4 substeps: the first kernel, those between, the last one, and the joined one
    let (middle, ends) = dispatches.split_at(dispatches.len() - 2);
    assert_eq!(ends, [1, 3], "{dispatches:?}");
    assert_eq!(middle[0], 1, "{dispatches:?}");
    assert!(middle[1..].iter().all(|n| *n == 4), "{dispatches:?}");
    let apart = played(gpu(), Some(8), &ids, 12);
    for world in ids {
        let both = state(&joined, world).into_iter().zip(state(&apart, world));
        let worst = both.fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs()));
        assert!(worst < 1e-4, "world {world}: {worst:e}");
    }
}
