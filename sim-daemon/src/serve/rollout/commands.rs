//! Commands of a frame: what the policy's action drives, and the sequences of the caller.

use std::collections::BTreeMap;
use std::ops::Range;

use sim_protocol::{Command, Description, Values};

use super::observation::check_clip;
use super::question::{Asked, Drive};

/// Neighbouring columns of a command, of all worlds.
struct Run {
    command: String,
    columns: Range<usize>,
    /// `(worlds, columns)`
    values: Vec<f64>,
}

/// A column of a run.
#[derive(Clone, Copy)]
struct Place {
    run: usize,
    column: usize,
}

/// Commands of all worlds, frame by frame.
pub(super) struct Commands {
    runs: Vec<Run>,
    worlds: usize,
    /// Places of each drive's columns, then of its followers.
    drives: Vec<Vec<Place>>,
    /// Places of each sequence's columns.
    sequences: Vec<Vec<Place>>,
    /// Targets of one world, in the order of a drive's columns.
    targets: Vec<f32>,
}

impl Commands {
    /// Finds the columns.
    ///
    /// # Errors
    /// One sentence about a drive or a sequence that does not fit.
    pub(super) fn find(asked: &Asked, description: &Description) -> Result<Commands, String> {
        let question = &asked.question;
        let outputs = asked.network.outputs();
        if let Some(clip) = &question.clip
            && clip.iter().any(|ends| ends.len() != outputs)
        {
            return Err(format!(
                "the action has {outputs} values, and its bounds others"
            ));
        }
        check_clip(&question.clip)?;
        let mut columns: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        let mut driven: Vec<(&str, usize)> = Vec::new();
        for drive in &question.drives {
            check_drive(drive, outputs)?;
            let all = drive.columns.iter().copied();
            for column in all.chain(drive.followers.iter().map(|follower| follower.0)) {
                if driven.contains(&(&drive.command, column)) {
                    let command = &drive.command;
                    return Err(format!("column {column} of `{command}` is driven twice"));
                }
                driven.push((&drive.command, column));
                columns.entry(&drive.command).or_default().push(column);
            }
        }
        for sequence in &question.commands {
            let end = sequence.first.saturating_add(sequence.values.columns);
            let entry = columns.entry(&sequence.command).or_default();
            entry.extend(sequence.first..check_column(description, &sequence.command, end)?);
        }
        for (command, places) in &mut columns {
            let end = places.iter().max().map_or(0, |last| last.saturating_add(1));
            check_column(description, command, end)?;
            places.sort_unstable();
            places.dedup();
        }
        let worlds = description.worlds;
        let runs = runs(&columns, worlds);
        let place = |command: &str, column: usize| {
            let run = runs
                .iter()
                .position(|run| run.command == command && run.columns.contains(&column));
            let run = run.expect("every column has a run");
            Place {
                run,
                column: column - runs[run].columns.start,
            }
        };
        let drives = question.drives.iter().map(|drive| {
            let followers = drive.followers.iter().map(|follower| follower.0);
            let all = drive.columns.iter().copied().chain(followers);
            all.map(|column| place(&drive.command, column)).collect()
        });
        let drives = drives.collect();
        let sequences = question.commands.iter().map(|sequence| {
            let all = sequence.first..sequence.first + sequence.values.columns;
            all.map(|column| place(&sequence.command, column)).collect()
        });
        let sequences = sequences.collect();
        Ok(Commands {
            runs,
            worlds,
            drives,
            sequences,
            targets: Vec::new(),
        })
    }

    /// The commands of a frame, for actions within their bounds, `(worlds, actions)`.
    pub(super) fn set(&mut self, asked: &Asked, actions: &[f32], frame: usize) {
        for run in &mut self.runs {
            run.values.fill(0.0);
        }
        let outputs = asked.network.outputs();
        for world in 0..self.worlds {
            let sequences = asked.question.commands.iter().zip(&asked.commands);
            for ((sequence, values), places) in sequences.zip(&self.sequences) {
                let row = sequence.values.row(values, frame, world);
                for (&place, &value) in places.iter().zip(row) {
                    *at(&mut self.runs, place, world) += value;
                }
            }
            let action = &actions[world * outputs..][..outputs];
            for (drive, places) in asked.question.drives.iter().zip(&self.drives) {
                self.targets.clear();
                for (k, &place) in places[..drive.columns.len()].iter().enumerate() {
                    let value = at(&mut self.runs, place, world);
                    let low = drive.low[k].unwrap_or(f32::NEG_INFINITY);
                    let high = drive.high[k].unwrap_or(f32::INFINITY);
                    let target = drive.offset[k] + drive.scale[k] * action[drive.values[k]];
                    let sum = f64::from(target) + *value;
                    *value = sum.clamp(f64::from(low), f64::from(high));
                    self.targets.push(*value as f32);
                }
                let followers = places[drive.columns.len()..].iter().zip(&drive.followers);
                for (&place, &(_, leader, multiplier, offset)) in followers {
                    let target = multiplier * self.targets[leader] + offset;
                    // they keep to their leaders, whatever the caller adds
                    *at(&mut self.runs, place, world) = f64::from(target);
                }
            }
        }
    }

    /// The commands that were set.
    pub(super) fn all(&self) -> Vec<Command<'_>> {
        let runs = self.runs.iter();
        runs.map(|run| Command {
            field: &run.command,
            columns: run.columns.clone(),
            values: Values::F64(&run.values),
        })
        .collect()
    }
}

/// The value of a column in a world.
fn at(runs: &mut [Run], place: Place, world: usize) -> &mut f64 {
    let run = &mut runs[place.run];
    &mut run.values[world * run.columns.len() + place.column]
}

/// Joins neighbouring columns.
fn runs(columns: &BTreeMap<&str, Vec<usize>>, worlds: usize) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    for (&command, places) in columns {
        for &column in places {
            match runs.last_mut() {
                Some(run) if run.command == command && run.columns.end == column => {
                    run.columns.end += 1;
                }
                _ => runs.push(Run {
                    command: command.to_owned(),
                    columns: column..column + 1,
                    values: Vec::new(),
                }),
            }
        }
    }
    for run in &mut runs {
        run.values = vec![0.0; worlds * run.columns.len()];
    }
    runs
}

/// Refuses columns that a command does not have; returns `end`.
fn check_column(description: &Description, command: &str, end: usize) -> Result<usize, String> {
    let known = description
        .commands
        .iter()
        .find(|known| known.name == command);
    let known = known.ok_or_else(|| format!("there is no command `{command}`"))?;
    match end <= known.columns {
        true => Ok(end),
        false => Err(format!(
            "`{command}` has {} columns, and no column {}",
            known.columns,
            end - 1
        )),
    }
}

fn check_drive(drive: &Drive, outputs: usize) -> Result<(), String> {
    let size = drive.columns.len();
    let lengths = [
        drive.values.len(),
        drive.scale.len(),
        drive.offset.len(),
        drive.low.len(),
        drive.high.len(),
    ];
    if lengths != [size; 5] {
        return Err(format!(
            "`{}`: numbers for other than {size} columns",
            drive.command
        ));
    }
    if let Some(value) = drive.values.iter().find(|&&value| value >= outputs) {
        return Err(format!(
            "`{}` is driven by value {value} of the action, which has {outputs}",
            drive.command
        ));
    }
    let ends = drive.low.iter().zip(&drive.high);
    let is_wrong = |(low, high): (&Option<f32>, &Option<f32>)| {
        let (low, high) = (low.unwrap_or(f32::MIN), high.unwrap_or(f32::MAX));
        low.is_nan() || high.is_nan() || low > high
    };
    if ends.into_iter().any(is_wrong)
        || drive
            .followers
            .iter()
            .any(|&(_, leader, _, _)| leader >= size)
    {
        return Err(format!(
            "`{}`: bounds or followers do not fit",
            drive.command
        ));
    }
    Ok(())
}
