//! What is done to some worlds, and no others notice: properties of random programs on random scenes, bit for bit.
//!
//! `make fuzz` tries many seeds. A failure names its seed: `TIGHTLOOP_SEED=… TIGHTLOOP_CASES=1` tries that one alone.

mod common;

use common::Run;
use common::any_program::{Scope, any_program, with_interventions};
use common::any_scene::{any_scene, is_noise};
use common::dice::{Dice, for_seeds};
use common::program::{Kept, Op, Played, play, play_on};
use sim_engine::backend::{Values, cpu};
use sim_engine::simulation::{Draws, Faults, Lanes, Options, Precision};
use sim_model::Model;
use sim_physics::arrays::{Field, status};
use sim_physics::constants::params::Param;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Cases of a property where the environment does not say how many.
const CASES: usize = 15;

/// A scene and how to run it.
struct Case {
    dice: Dice,
    model: Arc<Model>,
    options: Options,
    /// Do starts or noise depend on the number of a world?
    is_drawn: bool,
}

impl Case {
    fn new(seed: usize) -> Result<Case, String> {
        let mut dice = Dice::new(seed);
        let is_drawn = dice.chance(0.4);
        let scene = any_scene(&mut dice, is_drawn);
        let model = scene.compile().map_err(|e| e.to_string())?;
        let precision = dice.pick(&[Precision::F32, Precision::F32, Precision::F64]);
        let bounded = dice.chance(0.4);
        let bound = |size| if bounded { size } else { f64::INFINITY };
        let faults = Faults {
            joint_q_max: bound(dice.order(1.0, 100.0)),
            joint_qd_max: bound(dice.order(1.0, 100.0)),
            resets: dice.chance(0.4),
            freezes_nan: false,
        };
        let options = Options {
            worlds: dice.pick(&[2, 5, 8, 9, 16, 17, 33, 40]),
            precision,
            threads: Some(1 + dice.below(2)),
            lanes: dice.pick(&lanes(precision)),
            fields: Field::ALL.to_vec(),
            faults,
            draws: dice.pick(&[Draws::World, Draws::Seed]),
            ..Options::default()
        };
        let is_noisy = model.constants().varying.params().any(is_noise);
        Ok(Case {
            dice,
            model,
            is_drawn: (is_drawn || is_noisy) && options.draws == Draws::World,
            options,
        })
    }

    /// Everything may happen to these worlds.
    fn scope(&self, worlds: Vec<bool>) -> Scope<'_> {
        Scope {
            model: &self.model,
            sources: (0..worlds.len()).collect(),
            worlds,
            first_kept: 0,
            huge: None,
        }
    }

    fn all(&self) -> Vec<bool> {
        vec![true; self.options.worlds]
    }

    /// A program for all worlds.
    fn program(&mut self, frames: usize) -> Vec<Op> {
        let mut dice = std::mem::replace(&mut self.dice, Dice::new(0));
        let ops = any_program(&mut dice, &self.scope(self.all()), frames);
        self.dice = dice;
        ops
    }

    /// A number that no world survives.
    fn huge(&self) -> f64 {
        match self.options.precision {
            Precision::F32 => 1e38,
            Precision::F64 => 1e307,
        }
    }

    /// A program, and the same with something else done to the worlds that are masked.
    fn with_and_without(&mut self, huge: Option<f64>) -> (Vec<bool>, Vec<Op>, Vec<Op>) {
        let mut dice = std::mem::replace(&mut self.dice, Dice::new(0));
        let mut mask = dice.mask(self.options.worlds);
        mask[dice.below(self.options.worlds)] = false;
        // what comes out of other worlds is not theirs alone
        let untouched = (0..mask.len()).filter(|&world| !mask[world]).collect();
        let scope = Scope {
            sources: untouched,
            ..self.scope(self.all())
        };
        let frames = 4 + dice.below(8);
        let plain = any_program(&mut dice, &scope, frames);
        let scope = Scope {
            first_kept: 1000,
            huge,
            ..self.scope(mask.clone())
        };
        let changed = with_interventions(&mut dice, &plain, &scope);
        self.dice = dice;
        (mask, plain, changed)
    }
}

/// Lanes that this processor has.
fn lanes(precision: Precision) -> Vec<Lanes> {
    let all = match precision {
        Precision::F32 => vec![Lanes::Auto, Lanes::Scalar, Lanes::Eight, Lanes::Sixteen],
        Precision::F64 => vec![Lanes::Auto, Lanes::Scalar],
    };
    all.into_iter()
        .filter(|&lanes| cpu::available(lanes))
        .collect()
}

/// The frames after steps, those after evaluations left out.
fn steps_only(mut played: Played) -> Played {
    played.frames.retain(|(is_step, _)| *is_step);
    played
}

/// All worlds are as in another run.
fn all_alike(first: &Played, second: &Played, worlds: usize) -> Result<(), String> {
    (0..worlds).try_for_each(|world| first.differs(world, second, world))
}

/// The worlds that are not masked keep their bits.
fn others_notice_nothing(seed: usize, is_poisoned: bool) -> Result<(), String> {
    let mut case = Case::new(seed)?;
    let huge = is_poisoned.then(|| case.huge());
    let (mask, plain, changed) = case.with_and_without(huge);
    let first = steps_only(play(&case.model, &case.options, &plain)?);
    let second = steps_only(play(&case.model, &case.options, &changed)?);
    let untouched = (0..mask.len()).filter(|&world| !mask[world]);
    untouched
        .into_iter()
        .try_for_each(|world| first.differs(world, &second, world))
}

#[test]
fn worlds_that_are_left_alone_keep_their_bits() {
    for_seeds(CASES, |seed| others_notice_nothing(seed, false));
}

#[test]
fn worlds_beside_those_that_explode_keep_their_bits() {
    for_seeds(CASES, |seed| others_notice_nothing(seed, true));
}

#[test]
fn many_worlds_equal_runs_of_one_or_some_of_them_in_any_order() {
    for_seeds(CASES, |seed| {
        let mut case = Case::new(seed)?;
        let ops = case.program(8);
        let all = play(&case.model, &case.options, &ops)?;
        let worlds = case.options.worlds;
        // a world starts where its number says, and so does its noise, so that only the last ones can be left out
        let last = case.dice.below(worlds);
        let mut turned: Vec<usize> = (0..worlds).collect();
        turned.rotate_left(last);
        turned.reverse();
        let runs: Vec<Vec<usize>> = match case.is_drawn {
            true => vec![vec![0], (0..=last).collect()],
            false => vec![vec![0], vec![last], vec![worlds - 1], turned],
        };
        for chosen in runs {
            let options = Options {
                worlds: chosen.len(),
                lanes: case.dice.pick(&lanes(case.options.precision)),
                ..case.options.clone()
            };
            let ops: Vec<Op> = ops.iter().map(|op| op.for_worlds(&chosen)).collect();
            let run = Run::new(&case.model, options);
            let some = play_on(run, &ops, Kept::new(), &all.restored)?;
            for (place, &world) in chosen.iter().enumerate() {
                all.differs(world, &some, place)
                    .map_err(|why| format!("{} worlds: {why}", chosen.len()))?;
            }
        }
        Ok(())
    });
}

#[test]
fn lanes_and_threads_change_no_bit() {
    for_seeds(CASES, |seed| {
        let mut case = Case::new(seed)?;
        let ops = case.program(8);
        let scalar = Options {
            lanes: Lanes::Scalar,
            threads: Some(1),
            ..case.options.clone()
        };
        let scalar = play(&case.model, &scalar, &ops)?;
        for lanes in lanes(case.options.precision) {
            for threads in [1, 2] {
                let options = Options {
                    lanes,
                    threads: Some(threads),
                    ..case.options.clone()
                };
                let other = play(&case.model, &options, &ops)?;
                all_alike(&scalar, &other, case.options.worlds)
                    .map_err(|why| format!("{lanes:?}, {threads} threads: {why}"))?;
                if scalar.kept != other.kept {
                    return Err(format!("{lanes:?}, {threads} threads: another snapshot"));
                }
            }
        }
        Ok(())
    });
}

#[test]
fn a_run_goes_on_from_a_snapshot_in_any_lanes_and_threads() {
    for_seeds(CASES, |seed| {
        let mut case = Case::new(seed)?;
        let ops = case.program(9);
        let (before, after) = ops.split_at(case.dice.below(ops.len()));
        let first = play(&case.model, &case.options, before)?;
        // beside the snapshots of the program
        let mut rest = vec![Op::Snapshot(usize::MAX), Op::Forward];
        rest.extend(after.iter().cloned());
        let kept = first.kept.clone();
        let went_on = play_on(first.run, &rest, first.kept, &BTreeMap::new())?;
        let snapshot = went_on.kept[&usize::MAX].clone();
        for lanes in lanes(case.options.precision) {
            let threads = Some(1 + case.dice.below(2));
            let options = Options {
                lanes,
                threads,
                ..case.options.clone()
            };
            let mut run = Run::new(&case.model, options);
            run.sim
                .restore(&snapshot, None, None)
                .map_err(|e| e.to_string())?;
            let again = play_on(run, &rest, kept.clone(), &BTreeMap::new())?;
            all_alike(&went_on, &again, case.options.worlds)
                .map_err(|why| format!("{lanes:?}: {why}"))?;
        }
        // the run itself goes back
        let mut run = went_on.run;
        run.sim
            .restore(&snapshot, None, None)
            .map_err(|e| e.to_string())?;
        let again = play_on(run, &rest, kept, &BTreeMap::new())?;
        if again.end != went_on.end {
            return Err("another end after going back".to_owned());
        }
        Ok(())
    });
}

#[test]
fn evaluations_change_nothing() {
    for_seeds(CASES, |seed| {
        let mut case = Case::new(seed)?;
        let mut ops = case.program(8);
        ops.retain(|op| !matches!(op, Op::Forward));
        // the counters of a snapshot count contacts left out in the state that was evaluated last, so all end the same
        ops.push(Op::Forward);
        let between: Vec<Op> = ops
            .iter()
            .flat_map(|op| [Op::Forward, op.clone()])
            .collect();
        let first = steps_only(play(&case.model, &case.options, &ops)?);
        let second = steps_only(play(&case.model, &case.options, &between)?);
        all_alike(&first, &second, case.options.worlds)
    });
}

#[test]
fn a_field_is_the_same_whichever_others_are_asked_for() {
    for_seeds(CASES, |seed| {
        let mut case = Case::new(seed)?;
        let ops = case.program(8);
        let all = play(&case.model, &case.options, &ops)?;
        let mut fields: Vec<Field> = Field::ALL.to_vec();
        let share = case.dice.pick(&[0.05, 0.5]);
        // contacts left out of the state shown are counted where contacts are asked for
        fields.retain(|&field| field == Field::ContactCount || case.dice.chance(share));
        let options = Options {
            fields,
            ..case.options.clone()
        };
        let some = play(&case.model, &options, &ops)?;
        all_alike(&all, &some, case.options.worlds)
    });
}

#[test]
fn a_world_that_exploded_is_as_good_as_new_after_a_reset() {
    for_seeds(CASES, |seed| {
        let mut case = Case::new(seed)?;
        let huge = case.huge();
        let (mask, _, changed) = case.with_and_without(Some(huge));
        let mut run = play(&case.model, &case.options, &changed)?.run;
        let mut fresh = Run::new(&case.model, case.options.clone());
        for run in [&mut run, &mut fresh] {
            let starts = case.model.constants().varying.starts();
            for param in Param::ALL {
                let of_it: Vec<f64> = starts
                    .iter()
                    .filter(|(of, _)| *of == param)
                    .map(|x| x.1)
                    .collect();
                if case.model.constants().varying.first(param).is_some() {
                    let all: Vec<f64> = mask.iter().flat_map(|_| of_it.clone()).collect();
                    let done = run
                        .sim
                        .write_param(param, 0..of_it.len(), Values::F64(&all), None);
                    done.map_err(|e| e.to_string())?;
                }
            }
            run.sim
                .reset(Some(&mask), Some(&[7]))
                .map_err(|e| e.to_string())?;
        }
        let ops = [Op::Forward, Op::Step, Op::Step, Op::Step];
        let [old, new] = [run, fresh].map(|run| play_on(run, &ops, Kept::new(), &BTreeMap::new()));
        let (old, new) = (old?, new?);
        let sick = (0..mask.len()).filter(|&world| mask[world]);
        sick.into_iter()
            .try_for_each(|world| old.differs(world, &new, world))
    });
}

/// Numbers that no run takes, or none of `f32`.
fn bad(precision: Precision) -> Vec<f64> {
    let mut bad = vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
    if precision == Precision::F32 {
        bad.extend([1e39, -1e300]);
    }
    bad
}

#[test]
fn numbers_that_are_not_finite_are_refused_everywhere_and_change_nothing() {
    for_seeds(CASES, |seed| {
        let mut case = Case::new(seed)?;
        let ops = case.program(3);
        let mut run = play(&case.model, &case.options, &ops)?.run;
        let before = run.sim.snapshot();
        let worlds = case.options.worlds;
        let inputs = [
            Field::JointF,
            Field::JointTargetQ,
            Field::JointTargetQd,
            Field::JointQ,
            Field::JointQd,
        ];
        let varying: Vec<Param> = case.model.constants().varying.params().collect();
        for bad in bad(case.options.precision) {
            let world = case.dice.below(worlds);
            let mut mask = vec![false; worlds];
            mask[world] = true;
            let mut good = mask.clone();
            good.fill(true);
            good[world] = worlds == 1;
            let mut check =
                |name: &str, columns: usize, set: &mut dyn FnMut(&[f64]) -> Result<(), String>| {
                    if columns == 0 {
                        return Ok(());
                    }
                    // drives that follow velocities have no position gain
                    let fill = if name == "joint_target_ke" { 0.0 } else { 0.5 };
                    let mut numbers = vec![fill; worlds * columns];
                    numbers[world * columns + case.dice.below(columns)] = bad;
                    match set(&numbers) {
                        Err(why)
                            if why.contains(name) && why.contains(&format!("world {world} ")) =>
                        {
                            Ok(())
                        }
                        Err(why) => Err(format!("{name} of {bad}: {why}")),
                        Ok(()) => Err(format!("{name} of {bad} in world {world} was taken")),
                    }
                };
            for field in inputs {
                let columns = field.elements(&case.model.sizes());
                check(field.row().name, columns, &mut |numbers| {
                    let values = Values::F64(numbers);
                    let done = match field {
                        Field::JointQ | Field::JointQd => {
                            run.sim.write(field, 0..columns, values, Some(&mask))
                        }
                        _ => run.sim.command(field, 0..columns, values),
                    };
                    done.map_err(|e| e.to_string())
                })?;
            }
            for &param in &varying {
                let columns = param.columns(&case.model.sizes());
                check(param.row().name, columns, &mut |numbers| {
                    let done =
                        run.sim
                            .write_param(param, 0..columns, Values::F64(numbers), Some(&mask));
                    done.map_err(|e| e.to_string())
                })?;
            }
            if run.sim.snapshot() != before {
                return Err(format!("{bad} changed something"));
            }
        }
        Ok(())
    });
}

#[test]
fn worlds_of_these_programs_touch_overflow_explode_and_live_on() {
    let (mut shown, mut touching, mut full, mut frozen, mut lost) = (0, 0, 0, 0, 0);
    for seed in 1..=40 {
        let mut case = Case::new(seed).unwrap();
        let huge = case.huge();
        let (_, _, ops) = case.with_and_without(Some(huge));
        let played = play(&case.model, &case.options, &ops).unwrap();
        for (_, frame) in &played.frames {
            for world in 0..case.options.worlds {
                let counter = |field| played.counter(frame, world, field);
                let status = counter(Field::Status) as u32;
                shown += 1;
                touching += usize::from(counter(Field::ContactCount) > 0);
                full += usize::from(status & status::CONTACTS_LEFT_OUT != 0);
                frozen += usize::from(status & status::FROZEN != 0);
                lost += usize::from(status & status::NOT_FINITE != 0);
            }
        }
    }
    let counts = [touching, full, frozen, lost, shown - frozen];
    assert!(
        counts.iter().all(|&count| count > 100),
        "{counts:?} of {shown}"
    );
}
