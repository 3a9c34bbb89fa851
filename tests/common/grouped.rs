//! Worlds in groups against the same worlds together: everything that is drawn, in every frame, bit for bit.

use super::{drawn, noise};
use sim_engine::backend::Values;
use sim_engine::simulation::{Faults, Options, Simulation};
use sim_model::{Description, Distribution, Pose, Site};
use sim_physics::arrays::{Field, status};
use sim_physics::constants::params::Param;
use std::thread;

/// Fields of the frames: state, and all noise that the scene has.
pub const FIELDS: [Field; 7] = [
    Field::JointQ,
    Field::JointQd,
    Field::JointQMeasured,
    Field::JointQdMeasured,
    Field::JointTorque,
    Field::SiteQ,
    Field::Accelerometer,
];

/// Joints of every kind and a body: start, mass, delay and the deviations of all noise are drawn.
pub fn scene() -> Description {
    let mut scene = drawn::scene(1.0);
    scene.sites.push(Site {
        name: "imu".to_owned(),
        body: Some("ball".to_owned()),
        pose: Pose::at([0.1, 0.0, 0.0]),
        relative_to: None,
        damping: Site::DAMPING,
    });
    for (param, name, low, high) in [
        (Param::BodyMassScale, "r", 0.8, 1.2),
        (Param::CommandDelay, "", 0.0, 9.0),
        (Param::JointFNoise, "r", 0.01, 0.1),
        (Param::JointQNoise, "r", 0.01, 0.1),
        (Param::JointQdNoise, "r", 0.01, 0.1),
        (Param::JointTorqueNoise, "r", 0.01, 0.1),
        (Param::SiteQNoise, "imu", 0.01, 0.1),
        (Param::AccelerometerNoise, "imu", 0.01, 0.1),
    ] {
        let ranges = scene.param_ranges.entry(param).or_default();
        ranges.insert(name.to_owned(), Distribution::Uniform { low, high });
    }
    scene
}

/// Asserts that `groups` groups of `options.worlds` worlds, each stepped by a thread of its own, have the bits of all of them
/// together. Some worlds are reset by themselves.
#[track_caller]
pub fn assert_groups_are_the_whole(options: Options, groups: usize) {
    let model = scene().compile().unwrap();
    let each = options.worlds;
    let options = Options {
        faults: Faults {
            joint_qd_max: 50.0,
            resets: true,
            ..Faults::default()
        },
        fields: FIELDS.to_vec(),
        ..options
    };
    let all = Options {
        worlds: groups * each,
        ..options.clone()
    };
    let whole = play(Simulation::new(model.clone(), &all).unwrap(), 0);
    let parts = Simulation::groups(model, &options, groups).unwrap();
    let parts: Vec<_> = thread::scope(|scope| {
        let threads: Vec<_> = (parts.into_iter().enumerate())
            .map(|(group, part)| scope.spawn(move || play(part, group * each)))
            .collect();
        (threads.into_iter())
            .flat_map(|thread| thread.join().unwrap())
            .collect()
    });
    assert_eq!(parts.len(), whole.len());
    for (world, (part, whole)) in parts.iter().zip(&whole).enumerate() {
        assert!(part == whole, "world {world} of {groups} groups");
        // identical worlds would prove nothing
        let next = &parts[(world + 1) % parts.len()];
        assert!(part != next, "world {world} is as the next one");
    }
}

/// Resets of all kinds and steps; the bits of each world in all frames. Its commands depend on the worlds' numbers, which
/// begin with `first`.
fn play(mut simulation: Simulation, first: usize) -> Vec<Vec<u8>> {
    let worlds = simulation.worlds();
    let numbers = first..first + worlds;
    let mask: Vec<bool> = numbers.clone().map(|w| w % 3 == 1).collect();
    let seeds: Vec<u64> = numbers.clone().map(|w| 40 + w as u64 / 2).collect();
    let mut arena = vec![0; simulation.layout().bytes / 8];
    let mut bits = vec![Vec::new(); worlds];
    let mut troubled = false;
    for frame in 0..14 {
        match frame {
            3 => simulation.reset(Some(&mask), None).unwrap(),
            6 => simulation.reset(None, Some(&seeds)).unwrap(),
            8 => simulation.reset(Some(&mask), Some(&[7])).unwrap(),
            11 => simulation.reset(None, Some(&[9])).unwrap(),
            _ => {}
        }
        if [0, 3, 6, 8, 11].contains(&frame) {
            simulation.forward(&mut arena);
        } else {
            let dofs = Field::JointF.elements(&simulation.model().sizes());
            let torque = |world: usize| {
                // beyond the bounds in some worlds
                let scale = if world % 5 == frame % 5 { 1e4 } else { 0.1 };
                (0..dofs).map(move |dof| scale * noise(world + 1, dof + 64 * frame))
            };
            let torques: Vec<f64> = numbers.clone().flat_map(torque).collect();
            let (columns, values) = (0..dofs, Values::F64(&torques));
            let checked = simulation.check_command(Field::JointF, &columns, values);
            checked
                .and_then(|()| simulation.command(Field::JointF, columns, values))
                .unwrap();
            simulation.step(&mut arena);
        }
        let bytes: Vec<u8> = arena.iter().flat_map(|word| word.to_le_bytes()).collect();
        for slot in &simulation.layout().slots {
            let row = slot.bytes / worlds;
            for (world, bits) in bits.iter_mut().enumerate() {
                let row = &bytes[slot.offset + world * row..][..row];
                bits.extend_from_slice(row);
                troubled |=
                    slot.field == Field::Status && row[0] & status::OUT_OF_BOUNDS as u8 != 0;
            }
        }
    }
    assert!(troubled, "no world went beyond the bounds");
    assert!(simulation.lost().is_none(), "{:?}", simulation.lost());
    bits
}
