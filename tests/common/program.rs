//! Programs: what is done to the worlds of a simulation, op by op, and the frames that come of it.

use super::Run;
use sim_core::batch::{Field, Group, status};
use sim_core::model::Model;
use sim_core::model::params::Param;
use sim_engine::backend::{COUNTERS, Values};
use sim_engine::simulation::{Options, Precision};
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Numbers of a field or parameter in some of its columns, a row a world; none = the world is left alone.
#[derive(Clone, Debug)]
pub struct Rows {
    /// Columns that are set.
    pub columns: Range<usize>,
    /// One a world.
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
    /// Some worlds go back to the start; seeds are one, or one a world.
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
    fn of(&self, worlds: &[usize]) -> Rows {
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
        let is_single = precision == Precision::F32 && self.columns.len() % 2 == 0;
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
    pub fn of(&self, worlds: &[usize]) -> Op {
        let some = |mask: &[bool]| worlds.iter().map(|&world| mask[world]).collect();
        match self {
            Op::Command(field, rows) => Op::Command(*field, rows.of(worlds)),
            Op::Write(field, rows) => Op::Write(*field, rows.of(worlds)),
            Op::Param(param, rows) => Op::Param(*param, rows.of(worlds)),
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

    /// The state shown is finite; a frozen world stands where it was, and one that is not has made its step.
    fn check_frozen(&self, before: &[u64], is_set: &[bool]) -> Result<(), String> {
        let frame = &self.run.arena;
        for (world, is_set) in is_set.iter().enumerate() {
            let states = self
                .fields(frame, world)
                .into_iter()
                .zip(self.fields(before, world));
            let states = states.filter(|((field, _), _)| field.row().group == Group::State);
            let is_frozen =
                |frame| self.counter(frame, world, Field::Status) as u32 & status::FROZEN != 0;
            let [last, step] = [before, frame].map(|frame| self.counter(frame, world, Field::Step));
            // by itself, after a frame with trouble
            let was_reset = is_frozen(before) && step < 2;
            if !is_set && !was_reset {
                if is_frozen(before) && !is_frozen(frame) {
                    return Err(format!(
                        "world {world} is no longer frozen, though nobody reset it"
                    ));
                }
                if step != last + u64::from(!is_frozen(frame)) {
                    return Err(format!("world {world}: step {step} after {last}"));
                }
            }
            for ((field, now), (_, then)) in states {
                if !self.numbers(now).iter().all(|x| x.is_finite()) {
                    return Err(format!("world {world}: {field:?} is not finite"));
                }
                if is_frozen(frame) && !is_set && !was_reset && now != then {
                    return Err(format!("world {world}: {field:?} moves while frozen"));
                }
            }
        }
        Ok(())
    }

    /// A counter of a world in a frame.
    pub fn counter(&self, frame: &[u64], world: usize, counter: Field) -> u64 {
        let fields = self.fields(frame, world);
        let (_, bytes) = fields
            .iter()
            .find(|(field, _)| *field == counter)
            .expect("every frame has it");
        let digits = bytes.iter().rev();
        digits.fold(0, |number, &byte| number << 8 | u64::from(byte))
    }

    /// A field's bytes as numbers of the run's precision.
    pub fn numbers(&self, bytes: &[u8]) -> Vec<f64> {
        match self.run.sim.precision() {
            Precision::F32 => {
                let words = bytes.as_chunks().0.iter();
                words.map(|&x| f64::from(f32::from_le_bytes(x))).collect()
            }
            Precision::F64 => bytes
                .as_chunks()
                .0
                .iter()
                .map(|&x| f64::from_le_bytes(x))
                .collect(),
        }
    }

    /// Bytes of each field of a world in a frame.
    pub fn fields<'a>(&self, frame: &'a [u64], world: usize) -> Vec<(Field, &'a [u8])> {
        let bytes: &[u8] = bytemuck::cast_slice(frame);
        let slots = self.run.sim.layout().slots.iter();
        slots
            .map(|slot| {
                let size = slot.bytes / slot.shape[0];
                (slot.field, &bytes[slot.offset + world * size..][..size])
            })
            .collect()
    }

    /// Bytes of a world in a snapshot: its counters, then its numbers.
    fn record<'a>(&self, snapshot: &'a [u8], world: usize) -> (&'a [u8], &'a [u8]) {
        const HEAD: usize = 40;
        let size = (snapshot.len() - HEAD) / self.run.sim.worlds();
        snapshot[HEAD + world * size..][..size].split_at(COUNTERS)
    }

    /// What of a world differs from a world of another run, in the frames of both and at the end.
    pub fn differs(&self, world: usize, other: &Played, its: usize) -> Result<(), String> {
        if self.frames.len() != other.frames.len() {
            return Err(format!(
                "{} and {} frames",
                self.frames.len(),
                other.frames.len()
            ));
        }
        for (k, (one, two)) in self.frames.iter().zip(&other.frames).enumerate() {
            let (mine, others) = (self.fields(&one.1, world), other.fields(&two.1, its));
            for (field, bytes) in &mine {
                let Some((_, found)) = others.iter().find(|(of, _)| of == field) else {
                    continue;
                };
                if bytes != found {
                    let at = bytes.iter().zip(*found).position(|(a, b)| a != b);
                    return Err(format!(
                        "world {world}, frame {k}: {field:?} differs from byte {} on: {:?} and {:?}",
                        at.unwrap_or(0),
                        self.numbers(bytes),
                        self.numbers(found),
                    ));
                }
            }
        }
        let ((counters, numbers), (others, found)) =
            (self.record(&self.end, world), other.record(&other.end, its));
        if counters != others {
            return Err(format!(
                "world {world} at the end: counters {counters:?} and {others:?}"
            ));
        }
        if numbers != found {
            let (a, b) = (self.numbers(numbers), self.numbers(found));
            return Err(format!("world {world} at the end: numbers {a:?} and {b:?}"));
        }
        Ok(())
    }
}
