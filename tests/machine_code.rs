//! Models as machine code of their own, or their stages but for contacts: the bits of the stages that were compiled for all models,
//! whatever happens to the worlds.
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
use std::cell::Cell;
use std::sync::Arc;

/// Random scenes where the environment does not say how many.
const CASES: usize = 40;
/// Words of a device.
const WHOLE: &str = ", machine code, ";
const BUT_FOR_CONTACTS: &str = ", machine code but for contacts and solver, ";
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

/// Plays random programs in scenes with and without machine code; returns the share of runs whose device has these words.
fn compare(code: &str, scene: impl Fn(&mut Dice) -> Description) -> f64 {
    let (compiled, all) = (Cell::new(0usize), Cell::new(0usize));
    for_seeds(CASES, |seed| {
        let mut dice = Dice::new(seed);
        let scene = scene(&mut dice);
        let model = scene.compile().map_err(|e| e.to_string())?;
        let ops = program(&mut dice, &model, 8);
        for lanes in widths() {
            let options = |compiles| Options {
                threads: Some(1 + seed % 2),
                ..options(lanes, compiles)
            };
            let sim = Run::new(&model, options(true)).sim;
            compiled.set(compiled.get() + usize::from(sim.device().contains(code)));
            all.set(all.get() + 1);
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
    match all.get() {
        0 => 1.0,
        all => compiled.get() as f64 / all as f64,
    }
}

/// Fails if fewer of the scenes had machine code than so many, where their number is not given.
fn assert_compiled(share: f64, least: f64) {
    let is_given = std::env::var_os("TIGHTLOOP_CASES").is_some();
    assert!(share >= least || is_given, "{share} were compiled");
}

#[test]
fn random_scenes_have_the_bits_of_the_stages() {
    assert_compiled(compare(WHOLE, untouching), 0.75);
}

#[test]
fn random_scenes_whose_shapes_touch_have_the_bits_of_the_stages() {
    let share = compare(BUT_FOR_CONTACTS, |dice| {
        let is_drawn = dice.chance(0.4);
        any_scene(dice, is_drawn)
    });
    // with contacts, only small models are
    assert_compiled(share, 0.4);
}

/// What only models of MuJoCo have: actuators, ties, springs, other integrators.
#[test]
fn models_of_mujoco_have_the_bits_of_the_stages() {
    for name in ["implicit", "runge_kutta"] {
        let folder = common::repo("sim-core/stages/recorded/tests/record_stages");
        let path = folder.join(name).with_extension("safetensors");
        let scene = Description::from_mujoco(path, MujocoOptions::named("every")).unwrap();
        let mut apart = scene.clone();
        keep_apart(&mut apart);
        for (scene, lanes) in [&scene, &apart]
            .into_iter()
            .flat_map(|scene| widths().into_iter().map(move |lanes| (scene, lanes)))
        {
            let model = scene.compile().unwrap();
            let made = Run::new(&model, options(lanes, true)).sim.compiled();
            // four evaluations with contacts are too large
            let is_small = name == "implicit" || scene.filters.len() == apart.filters.len();
            assert_eq!(made.is_some(), is_small, "{name}");
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

/// The arm, which may touch the ground and itself.
fn on_the_ground() -> Arc<Model> {
    let mut scene = lesson(Demo::Torque);
    scene.add_ground("", 0.0);
    scene.robots[0].self_collisions = true;
    scene.compile().unwrap()
}

/// The arm, alone and where it may touch the ground and itself, with every width.
fn arms() -> Vec<(Arc<Model>, Lanes)> {
    let models = [lesson(Demo::Torque).compile().unwrap(), on_the_ground()];
    let with_widths = |model: Arc<Model>| {
        let each = widths()
            .into_iter()
            .map(move |lanes| (model.clone(), lanes));
        each.collect::<Vec<_>>()
    };
    models.into_iter().flat_map(with_widths).collect()
}

#[test]
fn outputs_of_the_last_substep_have_the_bits_of_the_stages() {
    for (model, lanes) in arms() {
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
    for (model, lanes) in arms() {
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

/// The check at launch, of code that is right and of code for another gravity.
#[test]
fn a_launch_finds_machine_code_that_differs_from_the_stages() {
    let model = lesson(Demo::Torque).compile().unwrap();
    let mut lighter = lesson(Demo::Torque);
    lighter.gravity[2] *= 0.9;
    let lighter = lighter.compile().unwrap();
    let device = |lanes, checked_with| {
        let options = Options {
            checked_with: Some(checked_with),
            ..options(lanes, true)
        };
        Run::new(&model, options).sim.device().to_owned()
    };
    for lanes in widths() {
        let right = device(lanes, model.clone());
        assert!(right.contains(", machine code (checked), "), "{right}");
        let wrong = device(lanes, lighter.clone());
        assert!(
            wrong.contains("stages only: in substep 0, stage integrate: JointQ 0 of world "),
            "{wrong}"
        );
        let other = device(lanes, on_the_ground());
        assert!(other.contains("a model that has other arrays"), "{other}");
    }
}

#[test]
fn blocks_of_single_precision_are_compiled_with_contacts_but_for_them() {
    let free = lesson(Demo::Torque).compile().unwrap();
    let touching = on_the_ground();
    let made = |model: &Arc<Model>, options: Options| {
        let sim = Run::new(model, options).sim;
        let words = sim.device().split(", ").find(|part| part.contains("code"));
        (sim.compiled().is_some(), words.map(str::to_owned))
    };
    let words = |text: &str| (true, Some(text.to_owned()));
    for lanes in widths() {
        let touching = made(&touching, options(lanes, true));
        assert_eq!(made(&free, options(lanes, true)), words("machine code"));
        assert_eq!(touching, words("machine code but for contacts and solver"));
        assert_eq!(made(&free, options(lanes, false)), (false, None));
    }
    assert_eq!(made(&free, options(Lanes::Scalar, true)), (false, None));
}
