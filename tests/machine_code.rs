//! Models as machine code of their own: the bits of the stages that were compiled for all models, whatever happens to the worlds.
//!
//! `make fuzz` tries many seeds. A failure names its seed: `TIGHTLOOP_SEED=… TIGHTLOOP_CASES=1` tries that one alone.

mod common;

use common::any_program::{Scope, any_program};
use common::any_scene::any_scene;
use common::dice::{Dice, for_seeds};
use common::program::{Op, play};
use common::{Demo, Run, lesson, noise};
use sim_engine::backend::{OutputsAt, Values, cpu};
use sim_engine::simulation::{Lanes, Options};
use sim_model::{Description, Model, MujocoOptions};
use sim_physics::arrays::{Field, status};
use std::sync::Arc;

/// Random scenes where the environment does not say how many.
const CASES: usize = 40;
/// As many as fill blocks of every width, and a part of one.
const WORLDS: usize = 37;

/// Fields of the last substep, and others; those of sensors are always of the state.
const LAGGING: [Field; 5] = [
    Field::JointQ,
    Field::BodyQ,
    Field::JointQdd,
    Field::MassMatrix,
    Field::EfcForce,
];

/// The widths for which this processor has machine code.
fn widths() -> Vec<Lanes> {
    let all = match cfg!(target_arch = "x86_64") {
        true => vec![Lanes::Eight, Lanes::Sixteen],
        false => Vec::new(),
    };
    let here = all.into_iter().filter(|lanes| cpu::available(*lanes));
    here.collect()
}

fn options(lanes: Lanes, compiles: bool) -> Options {
    Options {
        worlds: WORLDS,
        threads: Some(1),
        lanes,
        compiles,
        fields: Field::ALL.to_vec(),
        ..Options::default()
    }
}

/// No pair of shapes may touch.
fn keep_apart(scene: &mut Description) {
    let names = scene.shape_names();
    for (k, first) in names.iter().enumerate() {
        let pairs = names[k + 1..].iter();
        scene
            .filters
            .extend(pairs.map(|second| [first.clone(), second.clone()]));
    }
}

/// Whatever happens to all worlds.
fn program(dice: &mut Dice, model: &Model, frames: usize) -> Vec<Op> {
    let scope = Scope {
        model,
        worlds: vec![true; WORLDS],
        sources: (0..WORLDS).collect(),
        first_kept: 0,
        huge: None,
    };
    any_program(dice, &scope, frames)
}

/// A scene as chance has it, of shapes that do not touch.
fn untouching(dice: &mut Dice) -> Description {
    let is_drawn = dice.chance(0.4);
    let mut scene = any_scene(dice, is_drawn);
    keep_apart(&mut scene);
    for robot in &mut scene.robots {
        robot.self_collisions = false;
    }
    scene
}

#[test]
fn random_scenes_have_the_bits_of_the_stages() {
    let compiled = std::cell::Cell::new(0);
    for_seeds(CASES, |seed| {
        let mut dice = Dice::new(seed);
        let scene = untouching(&mut dice);
        let model = scene.compile().map_err(|e| e.to_string())?;
        let ops = program(&mut dice, &model, 8);
        for lanes in widths() {
            let options = |compiles| Options {
                threads: Some(1 + seed % 2),
                ..options(lanes, compiles)
            };
            let made = Run::new(&model, options(true)).sim.compiled();
            compiled.set(compiled.get() + usize::from(made.is_some()));
            let stages = play(&model, &options(false), &ops)?;
            let code = play(&model, &options(true), &ops)?;
            for world in 0..WORLDS {
                (stages.differs(world, &code, world)).map_err(|why| format!("{lanes:?}: {why}"))?;
            }
            if stages.kept != code.kept {
                return Err(format!("{lanes:?}: another snapshot"));
            }
        }
        Ok(())
    });
    let most = CASES * widths().len();
    assert!(
        compiled.get() * 4 >= most * 3 || std::env::var_os("TIGHTLOOP_CASES").is_some(),
        "{} of {most} were compiled",
        compiled.get()
    );
}

/// What only models of MuJoCo have: actuators, ties, springs, other integrators.
#[test]
fn models_of_mujoco_have_the_bits_of_the_stages() {
    for name in ["implicit", "runge_kutta"] {
        let folder = common::repo("sim-core/stages/recorded/tests/record_stages");
        let path = folder.join(name).with_extension("safetensors");
        let mut scene = Description::from_mujoco(path, MujocoOptions::named("every")).unwrap();
        keep_apart(&mut scene);
        let model = scene.compile().unwrap();
        for lanes in widths() {
            let made = Run::new(&model, options(lanes, true)).sim.compiled();
            assert!(
                made.is_some(),
                "{name}: the model has contacts, or is too large"
            );
            for seed in 0..10 {
                let mut dice = Dice::new(seed);
                let ops = program(&mut dice, &model, 6);
                let [stages, code] = [false, true]
                    .map(|compiles| play(&model, &options(lanes, compiles), &ops).unwrap());
                for world in 0..WORLDS {
                    let same = stages.differs(world, &code, world);
                    same.unwrap_or_else(|why| panic!("{name}, {lanes:?}, seed {seed}: {why}"));
                }
            }
        }
    }
}

/// Bits of all fields of all worlds, frame by frame, of an arm that falls into its limits and is pushed about.
fn frames(model: &Arc<Model>, options: Options) -> Vec<Vec<u64>> {
    let mut run = Run::new(model, options);
    let rows = |scale: f64, salt: usize| -> Vec<f64> {
        let row = |world| (0..9).map(move |k| scale * noise(world, salt + k));
        (0..WORLDS).flat_map(row).collect()
    };
    let speeds = rows(2.0, 0);
    (run.sim
        .write(Field::JointQd, 0..9, Values::F64(&speeds), None))
    .unwrap();
    let frame = |frame: usize| {
        let torques = rows(20.0, 100 + frame / 4);
        (run.sim.command(Field::JointF, 0..9, Values::F64(&torques))).unwrap();
        run.step();
        run.arena.clone()
    };
    (0..40).map(frame).collect()
}

#[test]
fn an_arm_at_its_limits_has_the_bits_of_the_stages_and_of_one_world_a_block() {
    let model = lesson(Demo::Torque).compile().unwrap();
    let scalar = frames(&model, options(Lanes::Scalar, true));
    for lanes in widths() {
        for compiles in [false, true] {
            assert!(
                frames(&model, options(lanes, compiles)) == scalar,
                "{lanes:?}, {compiles}"
            );
        }
    }
    // some world was at a limit, and some was not: both programs ran
    let mut run = Run::new(&model, options(Lanes::Scalar, true));
    run.arena.clone_from(&scalar[39]);
    let forces = |world| run.get(Field::EfcForce, world);
    let limits = model.rows() - model.constants().limits.len()..model.rows();
    let at_limit = |world: &usize| forces(*world)[limits.clone()].iter().any(|x| *x != 0.0);
    let count = (0..WORLDS).filter(at_limit).count();
    assert!(0 < count && count < WORLDS, "{count} worlds at a limit");
}

#[test]
fn outputs_of_the_last_substep_have_the_bits_of_the_stages() {
    let model = lesson(Demo::Torque).compile().unwrap();
    for lanes in widths() {
        let [stages, code] = [false, true].map(|compiles| {
            let options = Options {
                outputs_at: OutputsAt::LastSubstep,
                fields: LAGGING.to_vec(),
                ..options(lanes, compiles)
            };
            frames(&model, options)
        });
        assert!(stages == code, "{lanes:?}");
    }
}

#[test]
fn a_world_that_is_not_finite_is_frozen_alone() {
    let model = lesson(Demo::Torque).compile().unwrap();
    for lanes in widths() {
        let mut run = Run::new(&model, options(lanes, true));
        let mut torques = vec![0.0; WORLDS * 9];
        torques[5 * 9 + 3] = 1e38;
        (run.sim.command(Field::JointF, 0..9, Values::F64(&torques))).unwrap();
        for _ in 0..3 {
            run.step();
        }
        for world in 0..WORLDS {
            let is_frozen = run.get(Field::Status, world)[0] as u32 & status::FROZEN != 0;
            assert_eq!(is_frozen, world == 5, "{lanes:?}, world {world}");
        }
    }
}

#[test]
fn only_models_without_contacts_in_blocks_of_single_precision_are_compiled() {
    let free = lesson(Demo::Torque).compile().unwrap();
    let mut ground = lesson(Demo::Torque);
    ground.add_ground("", 0.0);
    ground.robots[0].self_collisions = true;
    let touching = ground.compile().unwrap();
    let made = |model: &Arc<Model>, options: Options| {
        let sim = Run::new(model, options).sim;
        (
            sim.compiled().is_some(),
            sim.device().contains(", machine code"),
        )
    };
    for lanes in widths() {
        assert_eq!(made(&free, options(lanes, true)), (true, true));
        assert_eq!(made(&free, options(lanes, false)), (false, false));
        assert_eq!(made(&touching, options(lanes, true)), (false, false));
    }
    assert_eq!(made(&free, options(Lanes::Scalar, true)), (false, false));
}
