//! Frames and commands in device memory that another instance of Vulkan imports.

use crate::common::{Demo, Run, lesson, noise};
use crate::imported_memory::ImportedMemory;
use crate::room::raft;
use crate::{assert_alive, gpu, options, run};
use sim_engine::backend::sharing::SharedCommand;
use sim_engine::backend::{Input, Values};
use sim_engine::options::open_as_discrete;
use sim_engine::simulation::{Device, Simulation};
use sim_model::{Body, Collision, Description, Model, Pose, Shape};
use sim_physics::arrays::Field;
use sim_physics::constants::params::Param;
use std::sync::Arc;
use std::time::Duration;

/// More than a binding of the software driver holds, and no multiple of a workgroup.
const MANY: usize = 40_003;

/// What another instance of Vulkan sees of a simulation.
struct Peer {
    memory: ImportedMemory,
    stride: usize,
    commands: Vec<SharedCommand>,
}

impl Peer {
    fn new(sim: &mut Simulation, slots: usize) -> Peer {
        let shared = sim.sharing().unwrap().share(slots).unwrap();
        assert_eq!(shared.slots, slots);
        if let Err(reason) = &shared.timelines {
            assert!(
                reason.contains("VK_KHR_external_semaphore_fd")
                    || reason.contains("timeline semaphores"),
                "{reason}"
            );
        }
        Peer {
            memory: ImportedMemory::new(shared.memory, shared.allocated, shared.uuid),
            stride: shared.stride as usize,
            commands: shared.commands,
        }
    }

    /// A slot's frame.
    fn frame(&self, slot: usize, words: usize) -> &[u64] {
        let first = slot * self.stride;
        bytemuck::cast_slice(&self.memory.bytes()[first..first + 8 * words])
    }

    /// Leaves a command; returns its number.
    fn leave(&mut self, field: Field, values: &[f32]) -> usize {
        let mut places = self.commands.iter();
        let number = places.position(|place| place.input == Input::Field(field));
        let number = number.expect("a command that clients may leave");
        let first = self.commands[number].offset as usize;
        let bytes: &[u8] = bytemuck::cast_slice(values);
        self.memory.bytes_mut()[first..first + bytes.len()].copy_from_slice(bytes);
        number
    }
}

fn rows(worlds: usize, columns: usize, salt: usize) -> Vec<f32> {
    let row = |world| (0..columns).map(move |k| noise(world, 100 * salt + k) as f32);
    (0..worlds).flat_map(row).collect()
}

/// The arm, with noise of its encoders, which the host draws.
fn noisy() -> Arc<Model> {
    let mut scene = lesson(Demo::Target);
    scene.params = [Param::JointQNoise].into();
    scene.compile().unwrap()
}

const FIELDS: [Field; 3] = [Field::JointQ, Field::JointQMeasured, Field::BodyQ];

#[test]
fn a_slot_holds_the_frame_of_its_arena_until_that_arena_is_written_again() {
    let model = noisy();
    for discrete in [false, true] {
        open_as_discrete(discrete);
        let mut run = run(&model, gpu(), 70, &FIELDS);
        open_as_discrete(false);
        let deviations = vec![0.01; 70 * 9];
        let (param, values) = (Param::JointQNoise, Values::F64(&deviations));
        run.sim.write_param(param, 0..9, values, None).unwrap();
        let words = run.arena.len();
        let peer = Peer::new(&mut run.sim, 2);
        let mut arenas = [vec![0; words], vec![0; words], vec![0; words]];
        let mut frames = Vec::new();
        for (k, arena) in arenas.iter_mut().enumerate() {
            let sharing = run.sim.sharing().unwrap();
            sharing.assign_slot(arena);
            run.sim.step(arena);
            frames.push(arena.clone());
            // there are two slots, and the third arena gets none
            let shown = run.sim.sharing().unwrap().slot_shown();
            assert_eq!(shown.map(|(slot, _)| slot), (k < 2).then_some(k));
        }
        assert_ne!(frames[0], frames[1]);
        assert!(peer.frame(0, words) == frames[0]);
        assert!(peer.frame(1, words) == frames[1]);
        run.sim.step(&mut arenas[0]);
        assert!(peer.frame(0, words) == arenas[0] && arenas[0] != frames[0]);
        assert!(peer.frame(1, words) == frames[1], "slot 1 is held");
        assert_alive(&run);
    }
}

#[test]
fn commands_of_another_process_move_every_world_as_those_of_the_host_do() {
    let model = lesson(Demo::Target).compile().unwrap();
    for discrete in [false, true] {
        open_as_discrete(discrete);
        let [mut here, mut there] =
            [(); 2].map(|()| run(&model, gpu(), MANY, &[Field::JointQ, Field::JointQd]));
        open_as_discrete(false);
        let mut peer = Peer::new(&mut here.sim, 1);
        for frame in 0..3 {
            let fields = [Field::JointTargetQ, Field::JointF];
            let left = fields.map(|field| {
                let values = rows(MANY, 9, 7 * frame + field as usize);
                let host = Values::F32(&values);
                there.sim.command(field, 0..9, host).unwrap();
                peer.leave(field, &values)
            });
            // what the host staged before is replaced
            let staged = vec![0.5; MANY * 9];
            let staged = Values::F32(&staged);
            here.sim.command(Field::JointF, 0..9, staged).unwrap();
            let sharing = here.sim.sharing().unwrap();
            assert!(sharing.await_client(1, Duration::ZERO).unwrap());
            assert!(sharing.accepts(&left, 1).unwrap());
            sharing.stage_shared(&left);
            here.step();
            there.step();
            assert!(here.arena == there.arena, "frame {frame}");
        }
        assert!(here.sim.snapshot() == there.sim.snapshot());
        assert_alive(&here);
    }
}

#[test]
fn commands_that_wait_are_kept_when_their_memory_goes() {
    let model = lesson(Demo::Target).compile().unwrap();
    let [mut here, mut there] = [(); 2].map(|()| run(&model, gpu(), 33, &[Field::JointQ]));
    let mut peer = Peer::new(&mut here.sim, 1);
    let values = rows(33, 9, 1);
    let left = peer.leave(Field::JointTargetQ, &values);
    here.sim.sharing().unwrap().stage_shared(&[left]);
    here.sim.forget();
    peer.leave(Field::JointTargetQ, &rows(33, 9, 2));
    let host = Values::F32(&values);
    there.sim.command(Field::JointTargetQ, 0..9, host).unwrap();
    here.step();
    there.step();
    assert!(here.sim.snapshot() == there.sim.snapshot());
    assert_alive(&here);
}

#[test]
fn slots_and_commands_outlast_more_room_for_contacts() {
    let model = raft();
    for discrete in [false, true] {
        open_as_discrete(discrete);
        let fields = [Field::JointQ, Field::ContactCount, Field::ContactForce];
        let [mut here, mut there] = [(); 2].map(|()| run(&model, gpu(), 5, &fields));
        open_as_discrete(false);
        let mut peer = Peer::new(&mut here.sim, 1);
        let words = here.arena.len();
        let start: Vec<f64> = (0..5)
            .flat_map(|world| [0.0, 0.0, 0.0205 + 0.002 * f64::from(world)])
            .collect();
        let values = Values::F64(&start);
        for run in [&mut here, &mut there] {
            run.sim.write(Field::JointQ, 0..3, values, None).unwrap();
        }
        for frame in 0..6 {
            let mut forces = vec![0.0; 5 * 7];
            forces
                .iter_mut()
                .skip(6)
                .step_by(7)
                .for_each(|force| *force = frame as f32);
            let host = Values::F32(&forces);
            there.sim.command(Field::JointF, 0..7, host).unwrap();
            let left = peer.leave(Field::JointF, &forces);
            let sharing = here.sim.sharing().unwrap();
            assert!(sharing.accepts(&[left], 1).unwrap());
            sharing.stage_shared(&[left]);
            sharing.assign_slot(&here.arena);
            here.step();
            there.step();
            assert!(here.arena == there.arena, "frame {frame}");
            assert!(peer.frame(0, words) == here.arena, "frame {frame}");
        }
        assert_eq!(here.get(Field::ContactCount, 0), [36.0]);
        assert_alive(&here);
    }
}

/// A cube alone, which has no drives.
fn cube() -> Arc<Model> {
    let mut scene = Description::new(1.0 / 480.0, 8);
    let half_extents = [0.025; 3];
    let shape = Collision::new(None, Shape::Box { half_extents }, Pose::identity());
    let mut body = Body::new("cube", Pose::identity());
    body.shapes.push((shape, 400.0));
    scene.add_body(body).unwrap();
    scene.compile().unwrap()
}

#[test]
fn values_that_the_host_must_see_are_found_wherever_they_are() {
    let worlds = 300;
    let mut run = Run::new(&cube(), options(gpu(), worlds, &[Field::JointQ]));
    let mut peer = Peer::new(&mut run.sim, 1);
    let mut accepts = |field, place: usize, value: f32| {
        let mut values = vec![0.0; worlds * 6];
        values[place] = value;
        let left = peer.leave(field, &values);
        let sharing = run.sim.sharing().unwrap();
        let read = sharing.read_shared(left).unwrap();
        assert!(
            read.iter()
                .zip(&values)
                .all(|(a, b)| a.to_bits() == b.to_bits())
        );
        sharing.accepts(&[left], 1).unwrap()
    };
    for place in [0, worlds * 6 - 1] {
        assert!(accepts(Field::JointF, place, f32::MAX));
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(!accepts(Field::JointF, place, value));
            assert!(!accepts(Field::JointTargetQ, place, value));
        }
        // the cube may be pushed, but has no targets
        assert!(!accepts(Field::JointTargetQ, place, 1e-40));
        assert!(accepts(Field::JointTargetQ, place, -0.0));
    }
    assert_alive(&run);
}

#[test]
fn worlds_on_the_cpu_have_no_memory_that_a_client_maps() {
    let model = lesson(Demo::Target).compile().unwrap();
    let mut run = run(&model, Device::Cpu, 2, &[Field::JointQ]);
    assert!(run.sim.sharing().is_none());
}
