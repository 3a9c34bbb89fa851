//! Programs: what is done to the worlds of a simulation, op by op, and the frames that come of it.

use super::Run;
use sim_engine::backend::Values;
use sim_engine::simulation::{Options, Precision};
use sim_model::Model;
use sim_physics::arrays::Field;
use sim_physics::constants::params::Param;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Numbers of a field or parameter in some of its columns, a row per world; none = the world is left alone.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Columns that are set.
    pub columns: Range<usize>,
    /// One per world.
    pub rows: Vec<Option<Vec<f64>>>,
}

/// What is done.
#[derive(Clone, Debug)]
pub enum Op {
    /// A control frame.
    Step,
    /// An evaluation of all fields.
    Forward,
    /// A command of every world.
    Command(Field, Rows),
    /// State of some worlds.
    Write(Field, Rows),
    /// A parameter of some worlds.
    Param(Param, Rows),
    /// Some worlds go back to the start; seeds are one, or one per world.
    Reset(Vec<bool>, Option<Vec<u64>>),
    /// All worlds as bytes, kept under a number.
    Snapshot(usize),
    /// Some worlds become what a snapshot has of them, or of one world.
    Restore(usize, Vec<bool>, Option<usize>),
}

/// Snapshots by their numbers.
pub type Kept = BTreeMap<usize, Vec<u8>>;

/// What a program left behind.
pub struct Played {
    /// The simulation and its last frame.
    pub run: Run,
    /// The frame after each step and evaluation, and whether it was a step.
    pub frames: Vec<(bool, Vec<u64>)>,
    /// The snapshots that are kept.
    pub kept: Kept,
    /// What each restore was given, by its place in the program.
    pub restored: BTreeMap<usize, Vec<u8>>,
    /// All worlds at the end.
    pub end: Vec<u8>,
}

impl Rows {
    /// Those of some worlds, in their order.
    fn for_worlds(&self, worlds: &[usize]) -> Rows {
        Rows {
            columns: self.columns.clone(),
            rows: worlds
                .iter()
                .map(|&world| self.rows[world].clone())
                .collect(),
        }
    }

    /// World-major numbers, and the mask if some worlds are left alone. Theirs are NaN, which nobody may look at.
    fn flat(&self, precision: Precision) -> (Numbers, Option<Vec<bool>>) {
        let nothing = vec![f64::NAN; self.columns.len()];
        let rows = self.rows.iter().map(|row| row.as_ref().unwrap_or(&nothing));
        let mask: Vec<bool> = self.rows.iter().map(Option::is_some).collect();
        let numbers = rows.flatten().copied();
        // a run of f32 takes both
        let is_single = precision == Precision::F32 && self.columns.len().is_multiple_of(2);
        let numbers = match is_single {
            true => Numbers::F32(numbers.map(|x| x as f32).collect()),
            false => Numbers::F64(numbers.collect()),
        };
        (numbers, mask.contains(&false).then_some(mask))
    }
}

/// Numbers in either precision.
enum Numbers {
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Numbers {
    fn values(&self) -> Values<'_> {
        match self {
            Numbers::F32(numbers) => Values::F32(numbers),
            Numbers::F64(numbers) => Values::F64(numbers),
        }
    }
}

impl Op {
    /// What it does to some worlds of all, in their order.
    pub fn for_worlds(&self, worlds: &[usize]) -> Op {
        let some = |mask: &[bool]| worlds.iter().map(|&world| mask[world]).collect();
        match self {
            Op::Command(field, rows) => Op::Command(*field, rows.for_worlds(worlds)),
            Op::Write(field, rows) => Op::Write(*field, rows.for_worlds(worlds)),
            Op::Param(param, rows) => Op::Param(*param, rows.for_worlds(worlds)),
            Op::Reset(mask, Some(seeds)) if seeds.len() > 1 => {
                let seeds = worlds.iter().map(|&world| seeds[world]).collect();
                Op::Reset(some(mask), Some(seeds))
            }
            Op::Reset(mask, seeds) => Op::Reset(some(mask), seeds.clone()),
            Op::Restore(number, mask, from) => Op::Restore(*number, some(mask), *from),
            other => other.clone(),
        }
    }

    /// The worlds whose state it sets.
    fn sets(&self, world: usize) -> bool {
        match self {
            Op::Write(_, rows) => rows.rows[world].is_some(),
            Op::Reset(mask, _) | Op::Restore(_, mask, _) => mask[world],
            _ => false,
        }
    }
}

/// Plays a program in a new simulation.
pub fn play(model: &Arc<Model>, options: &Options, ops: &[Op]) -> Result<Played, String> {
    play_on(
        Run::new(model, options.clone()),
        ops,
        Kept::new(),
        &BTreeMap::new(),
    )
}

/// Plays a program. Where a world of a snapshot is put into others, it is one of `foreign`, if there is one for that place of
/// the program.
pub fn play_on(
    run: Run,
    ops: &[Op],
    kept: Kept,
    foreign: &BTreeMap<usize, Vec<u8>>,
) -> Result<Played, String> {
    let (frames, restored, end) = (Vec::new(), BTreeMap::new(), Vec::new());
    let mut played = Played {
        run,
        frames,
        kept,
        restored,
        end,
    };
    // worlds whose state was set since the last frame that they stepped in
    let mut is_set = vec![true; played.run.sim.worlds()];
    let mut before = played.run.arena.clone();
    for (place, op) in ops.iter().enumerate() {
        for (world, is_set) in is_set.iter_mut().enumerate() {
            *is_set |= op.sets(world);
        }
        played
            .apply(place, op, foreign)
            .map_err(|why| format!("op {place}: {why}"))?;
        if let Op::Step | Op::Forward = op {
            let is_step = matches!(op, Op::Step);
            played.frames.push((is_step, played.run.arena.clone()));
            if is_step {
                played
                    .check_frozen(&before, &is_set)
                    .map_err(|why| format!("op {place}: {why}"))?;
                is_set.fill(false);
                before.clone_from(&played.run.arena);
            }
        }
    }
    played.end = played.run.sim.snapshot();
    Ok(played)
}

impl Played {
    fn apply(
        &mut self,
        place: usize,
        op: &Op,
        foreign: &BTreeMap<usize, Vec<u8>>,
    ) -> Result<(), String> {
        let run = &mut self.run;
        let precision = run.sim.precision();
        let done = match op {
            Op::Step => {
                run.step();
                Ok(())
            }
            Op::Forward => {
                run.forward();
                Ok(())
            }
            Op::Command(field, rows) => {
                let (numbers, _) = rows.flat(precision);
                run.sim
                    .command(*field, rows.columns.clone(), numbers.values())
            }
            Op::Write(field, rows) => {
                let (numbers, mask) = rows.flat(precision);
                run.sim.write(
                    *field,
                    rows.columns.clone(),
                    numbers.values(),
                    mask.as_deref(),
                )
            }
            Op::Param(param, rows) => {
                let (numbers, mask) = rows.flat(precision);
                run.sim.write_param(
                    *param,
                    rows.columns.clone(),
                    numbers.values(),
                    mask.as_deref(),
                )
            }
            Op::Reset(mask, seeds) => run.sim.reset(Some(mask), seeds.as_deref()),
            Op::Snapshot(number) => {
                self.kept.insert(*number, run.sim.snapshot());
                Ok(())
            }
            Op::Restore(number, mask, from) => {
                let other = foreign.get(&place).filter(|_| from.is_some());
                let Some(bytes) = other.or(self.kept.get(number)) else {
                    return Err(format!("there is no snapshot {number}"));
                };
                self.restored.insert(place, bytes.clone());
                return run
                    .sim
                    .restore(bytes, Some(mask), *from)
                    .map_err(|e| e.to_string());
            }
        };
        done.map_err(|e| e.to_string())
    }
}
