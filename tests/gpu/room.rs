//! Room for contacts that grows: a frame in which a world lacks some is undone and repeated, and no world can tell.

use crate::common::{Run, noise};
use crate::{assert_alive, gpu, options};
use sim_engine::backend::Values;
use sim_engine::backend::gpu::listing;
use sim_engine::options::{adapters, allocate_at_most, lose_after};
use sim_engine::simulation::{Device, Options, Simulation};
use sim_model::{Description, Model, Robot, UrdfOptions};
use sim_physics::arrays::{Field, status};
use sim_physics::constants::params::Param;
use std::fmt::Write;
use std::sync::Arc;

const FIELDS: [Field; 5] = [
    Field::JointQ,
    Field::JointQd,
    Field::ContactCount,
    Field::ContactPos,
    Field::ContactForce,
];
const DOFS: usize = 7;
/// Corners of all boxes of the raft.
const CORNERS: f64 = 36.0;

/// A flat raft of nine boxes with a paddle, above the ground. What drives the paddle is late and noisy.
pub fn raft() -> Arc<Model> {
    let inertial = |mass: f64, inertia: f64| {
        format!(
            "<inertial><mass value=\"{mass}\"/><inertia ixx=\"{inertia}\" iyy=\"{inertia}\" izz=\"{inertia}\" \
             ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>"
        )
    };
    let mut urdf = "<robot name=\"raft\"><link name=\"raft\">".to_owned() + &inertial(2.0, 0.05);
    for k in 0..9 {
        let (x, y) = (0.2 * f64::from(k % 3 - 1), 0.2 * f64::from(k / 3 - 1));
        let place = format!("<origin xyz=\"{x} {y} 0\"/>");
        write!(
            urdf,
            "<collision>{place}<geometry><box size=\"0.16 0.16 0.04\"/></geometry></collision>"
        )
        .unwrap();
    }
    write!(
        urdf,
        "</link><link name=\"paddle\">{}</link>\
         <joint name=\"turns\" type=\"continuous\"><parent link=\"raft\"/><child link=\"paddle\"/>\
         <origin xyz=\"0 0 0.1\"/><axis xyz=\"1 0 0\"/><limit effort=\"9\" velocity=\"99\"/></joint></robot>",
        inertial(0.2, 0.01)
    )
    .unwrap();
    let options = UrdfOptions {
        floating: true,
        ..UrdfOptions::named("raft")
    };
    let mut scene = Description::new(1.0 / 240.0, 2);
    scene.command_delay_max = Some(6);
    scene.params = [Param::CommandDelay, Param::JointFNoise].into();
    scene.add_ground("ground", 0.0);
    let robot = Robot::from_urdf_text(&urdf, "raft.urdf", options).unwrap();
    scene.add_robot(robot).unwrap();
    scene.compile().unwrap()
}

/// Lets rafts fall from these heights [m] and drives their paddles, with noise of this size [N·m]. `each` gets the run after each of
/// the frames. Without a number of threads per world, they have the bits of the CPU.
fn fall(
    model: &Arc<Model>,
    (device, threads): (Device, Option<usize>),
    heights: &[f64],
    (frames, deviation): (usize, f64),
    mut each: impl FnMut(&Run),
) -> Run {
    let worlds = heights.len();
    let options = Options {
        world_threads: threads,
        cpu_bits: threads.is_none(),
        ..options(device, worlds, &FIELDS)
    };
    let mut run = Run::new(model, options);
    let write = |run: &mut Run, param, columns, values: Vec<f64>| {
        let values = Values::F64(&values);
        run.sim
            .write_param(param, 0..columns, values, None)
            .unwrap();
    };
    write(&mut run, Param::CommandDelay, 1, vec![5.0; worlds]);
    let noisy = vec![deviation; worlds * DOFS];
    write(&mut run, Param::JointFNoise, DOFS, noisy);
    let start = heights.iter().flat_map(|height| [0.0, 0.0, *height]);
    let start: Vec<f64> = start.collect();
    let values = Values::F64(&start);
    run.sim.write(Field::JointQ, 0..3, values, None).unwrap();
    for frame in 0..frames {
        // what a raft gets depends on its height, not on its place
        let forces = heights.iter().flat_map(|height| {
            let seed = (1e6 * height) as usize;
            (0..DOFS).map(move |k| match k {
                6 => noise(seed, frame),
                _ => 0.0,
            })
        });
        let forces: Vec<f64> = forces.collect();
        let values = Values::F64(&forces);
        run.sim.command(Field::JointF, 0..DOFS, values).unwrap();
        run.step();
        each(&run);
    }
    assert_alive(&run);
    run
}

/// Bits of a world's fields.
fn bits(run: &Run, world: usize) -> Vec<u64> {
    let numbers = run.numbers(&FIELDS, world);
    numbers.into_iter().map(f64::to_bits).collect()
}

/// Heights of worlds that land in different frames, and of one that does not.
const HEIGHTS: [f64; 6] = [0.0265, 0.0215, 0.0235, 5.0, 0.0225, 0.03];
const FRAMES: usize = 14;

/// Contacts of a kind that worlds have room for at the start.
const AT_START: Option<usize> = Some(16);

#[test]
fn worlds_that_lack_room_are_those_that_have_it_from_the_start() {
    let model = raft();
    for threads in [1, 8] {
        let device = || (gpu(), Some(threads));
        let (mut together, mut rooms) = (Vec::new(), Vec::new());
        let run = fall(&model, device(), &HEIGHTS, (FRAMES, 0.0), |run| {
            let worlds = 0..HEIGHTS.len();
            together.push(worlds.map(|world| bits(run, world)).collect::<Vec<_>>());
            rooms.push(run.sim.contact_room());
        });
        assert_eq!((rooms[0], rooms[FRAMES - 1]), (AT_START, Some(36)));
        for (world, height) in HEIGHTS.iter().enumerate() {
            assert_eq!(run.get(Field::Status, world), [0.0], "world {world}");
            assert_eq!(run.get(Field::ContactsLeftOut, world), [0.0]);
            let contacts = if *height > 1.0 { 0.0 } else { CORNERS };
            assert_eq!(run.get(Field::ContactCount, world), [contacts]);
            // alone it gets room in the frame in which it lands, if at all
            let mut frame = 0;
            let alone = fall(&model, device(), &[*height], (FRAMES, 0.0), |run| {
                assert!(
                    bits(run, 0) == together[frame][world],
                    "{threads} threads, world {world}, frame {frame}"
                );
                frame += 1;
            });
            let is_at_start = alone.sim.contact_room() == AT_START;
            assert_eq!(is_at_start, *height > 1.0);
        }
    }
}

#[test]
fn a_frame_that_is_repeated_has_its_commands_once() {
    let model = raft();
    let [cpu, exact, gpu] = [(Device::Cpu, None), (gpu(), None), (gpu(), Some(8))]
        .map(|device| fall(&model, device, &HEIGHTS, (FRAMES, 0.5), |_| {}));
    assert!(exact.sim.contact_room() > AT_START);
    for world in 0..HEIGHTS.len() {
        for field in FIELDS {
            assert_eq!(exact.get(field, world), cpu.get(field, world), "{field:?}");
        }
        let [a, b] = [&cpu, &gpu].map(|run| run.get(Field::JointQ, world));
        for (k, (a, b)) in a.iter().zip(b).enumerate() {
            // a frame's noise or command too many turns the paddle by 3e-4 rad
            assert!((a - b).abs() < 2e-5, "world {world}, {k}: {a} and {b}");
        }
    }
}

/// Puts rafts where they are at the start of a run.
fn placed(heights: &[f64]) -> Run {
    let wanted = Options {
        world_threads: Some(8),
        ..options(gpu(), heights.len(), &FIELDS)
    };
    let mut run = Run::new(&raft(), wanted);
    let start: Vec<f64> = heights.iter().flat_map(|z| [0.0, 0.0, *z]).collect();
    let values = Values::F64(&start);
    run.sim.write(Field::JointQ, 0..3, values, None).unwrap();
    run
}

#[test]
fn an_evaluation_makes_room_and_no_step() {
    let mut run = placed(&[5.0, 0.0195]);
    run.forward();
    assert_eq!(run.get(Field::ContactCount, 1), [CORNERS]);
    assert_eq!(run.get(Field::ContactCount, 0), [0.0]);
    assert_eq!(run.get(Field::Step, 1), [0.0]);
    assert_eq!(run.sim.contact_room(), Some(36));
    let kept = run.sim.snapshot();
    let mut again = placed(&[5.0, 5.0]);
    again.sim.restore(&kept, None, None).unwrap();
    again.forward();
    assert!(again.arena == run.arena);
    assert_alive(&again);
}

#[test]
fn contacts_are_left_out_where_no_memory_is_for_more_room() {
    let mut run = placed(&[0.0225, 5.0]);
    run.step();
    assert_eq!(run.sim.contact_room(), AT_START);
    allocate_at_most(3);
    for _ in 0..FRAMES {
        run.step();
    }
    allocate_at_most(u64::MAX);
    assert_alive(&run);
    assert_eq!(run.sim.contact_room(), AT_START);
    assert_eq!(run.get(Field::ContactCount, 0), [16.0]);
    // held by some of its boxes alone, the raft tilts
    assert!(run.get(Field::ContactsLeftOut, 0)[0] > 10.0);
    let bit = f64::from(status::CONTACTS_LEFT_OUT);
    assert_eq!(run.get(Field::Status, 0), [bit]);
    assert_eq!(run.get(Field::Status, 1), [0.0]);
    assert_eq!(run.get(Field::Step, 0), [1.0 + FRAMES as f64]);
}

#[test]
fn a_device_that_is_lost_while_it_makes_room_is_lost() {
    let mut runs = 1;
    loop {
        let mut run = placed(&[0.0195]);
        lose_after(runs);
        run.step();
        lose_after(u64::MAX);
        if run.sim.lost().is_none() {
            assert_eq!(run.sim.contact_room(), Some(36));
            break;
        }
        let bit = f64::from(status::NOT_FINITE);
        assert_eq!(run.get(Field::Status, 0), [bit], "after {runs} runs");
        runs += 1;
    }
    // tables of tiles, copies, and the frame again, twice
    assert!(
        runs > 10,
        "a frame that makes room has more than {runs} runs"
    );
}

/// More worlds than a binding holds with twice the room, and with room as at the start: tiles of worlds that do not land and of one
/// that does.
#[test]
fn tiles_become_narrower_where_a_binding_holds_no_more() {
    let model = raft();
    let layout = Simulation::layout_of(&model, &Options::default());
    let listing = listing(&model, &layout, Some(8)).unwrap();
    let (start, most) = (listing.contacts_bytes, listing.contacts_bytes_max);
    assert!(start > listing.fields_bytes && 2 * start < 3 * most);
    let binding = adapters()[0].binding_max as usize;
    if binding > 256 << 20 {
        return; // so many worlds take gigabytes
    }
    let worlds = binding / start + 1000;
    assert!(2 * (binding / most) < worlds);
    let mut heights = vec![5.0; worlds];
    heights[worlds - 1] = 0.0205;
    let device = || (gpu(), Some(8));
    let many = fall(&model, device(), &heights, (2, 0.0), |_| {});
    assert_eq!(many.get(Field::ContactCount, worlds - 1), [CORNERS]);
    assert_eq!(many.sim.contact_room(), Some(36));
    let ground = fall(&model, device(), &[0.0205], (2, 0.0), |_| {});
    assert!(bits(&many, worlds - 1) == bits(&ground, 0));
    let air = fall(&model, device(), &[5.0], (2, 0.0), |_| {});
    let air = bits(&air, 0);
    let differs = (0..worlds - 1).find(|world| bits(&many, *world) != air);
    assert_eq!(differs, None);
    for world in 0..worlds {
        assert_eq!(many.get(Field::Step, world), [2.0], "world {world}");
    }
}
