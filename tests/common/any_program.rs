//! Programs as chance has them, and programs with something else done to some worlds.

use super::dice::Dice;
use super::program::{Op, Rows};
use sim_model::Model;
use sim_physics::arrays::Field;
use sim_physics::constants::Motion;
use sim_physics::constants::params::{NO_LIMIT, Param};
use std::ops::Range;

/// Whom an op may touch, and how hard.
#[derive(Clone)]
pub struct Scope<'a> {
    /// The model.
    pub model: &'a Model,
    /// Worlds that it may set; the others are left alone.
    pub worlds: Vec<bool>,
    /// Worlds of a snapshot that may be put into others.
    pub sources: Vec<usize>,
    /// The number under which the first of its snapshots is kept.
    pub first_kept: usize,
    /// Numbers that no world survives, if there are to be any.
    pub huge: Option<f64>,
}

/// A program of this many frames or so.
pub fn any_program(dice: &mut Dice, scope: &Scope<'_>, frames: usize) -> Vec<Op> {
    let mut ops = Vec::new();
    let mut kept = 0;
    for _ in 0..frames {
        for _ in 0..dice.below(3) {
            ops.extend(any_op(dice, scope, &mut kept));
        }
        ops.push(Op::Step);
    }
    ops
}

/// The program, and between its ops others that touch only the worlds of the scope.
pub fn with_interventions(dice: &mut Dice, ops: &[Op], scope: &Scope<'_>) -> Vec<Op> {
    let mut changed = Vec::new();
    let mut kept = 0;
    for op in ops {
        let count = dice.pick(&[0, 0, 1, 2]);
        for _ in 0..count {
            // commands are of all worlds, so that those of the program are changed instead
            let other = any_op(dice, scope, &mut kept);
            changed.extend(other.filter(|op| !matches!(op, Op::Command(..))));
        }
        changed.push(match op {
            Op::Command(field, rows) => {
                let mut rows = rows.clone();
                for (world, row) in rows.rows.iter_mut().enumerate() {
                    if scope.worlds[world] {
                        *row = Some(any_command(dice, scope, *field, &rows.columns));
                    }
                }
                Op::Command(*field, rows)
            }
            other => other.clone(),
        });
    }
    changed
}

/// Something other than a step; none where the model has nothing of the kind.
fn any_op(dice: &mut Dice, scope: &Scope<'_>, kept: &mut usize) -> Option<Op> {
    let model = scope.model;
    let worlds = scope.worlds.len();
    let mut mask = dice.mask(worlds);
    for (is_set, is_in_scope) in mask.iter_mut().zip(&scope.worlds) {
        *is_set &= is_in_scope;
    }
    let rows =
        |dice: &mut Dice, columns: &Range<usize>, row: &dyn Fn(&mut Dice) -> Vec<f64>| Rows {
            columns: columns.clone(),
            rows: mask
                .iter()
                .map(|&is_set| is_set.then(|| row(dice)))
                .collect(),
        };
    Some(match dice.below(9) {
        0..3 => {
            let field = dice.pick(&[
                Field::JointF,
                Field::JointF,
                Field::JointTargetQ,
                Field::JointTargetQd,
            ]);
            let columns = any_columns(dice, model.dofs());
            mask.fill(true);
            let row = |dice: &mut Dice| any_command(dice, scope, field, &columns);
            let rows = mask.iter().map(|_| Some(row(dice))).collect();
            Op::Command(field, Rows { columns, rows })
        }
        3 => {
            let columns = any_columns(dice, model.dofs());
            let row = |dice: &mut Dice| any_numbers(dice, columns.len(), 2.0, scope.huge);
            Op::Write(Field::JointQd, rows(dice, &columns, &row))
        }
        4 => {
            let bodies = &model.constants().bodies;
            let columns = match bodies.is_empty() || dice.chance(0.5) {
                true => 0..model.coords(),
                false => {
                    let body = &bodies[dice.below(bodies.len())];
                    body.coord..body.coord + body.motion.coords()
                }
            };
            let row = |dice: &mut Dice| any_place(dice, scope, &columns);
            Op::Write(Field::JointQ, rows(dice, &columns, &row))
        }
        5 => {
            let varying: Vec<Param> = model.constants().varying.params().collect();
            if varying.is_empty() {
                return None;
            }
            let param = dice.pick(&varying);
            let columns = any_columns(dice, param.columns(&model.sizes()));
            let row = |dice: &mut Dice| {
                let number = |column| any_param(dice, scope, param, column);
                columns.clone().map(number).collect()
            };
            Op::Param(param, rows(dice, &columns, &row))
        }
        6 => {
            let seeds = match dice.below(3) {
                0 => None,
                1 => Some(vec![dice.below(5) as u64]),
                _ => Some((0..worlds).map(|_| dice.below(5) as u64).collect()),
            };
            Op::Reset(mask, seeds)
        }
        7 => {
            *kept += 1;
            Op::Snapshot(scope.first_kept + *kept - 1)
        }
        _ if *kept > 0 => {
            let from = dice.chance(0.4).then(|| dice.pick(&scope.sources));
            Op::Restore(scope.first_kept + dice.below(*kept), mask, from)
        }
        _ => Op::Forward,
    })
}

/// All columns, or some that lie side by side.
fn any_columns(dice: &mut Dice, columns: usize) -> Range<usize> {
    if columns == 0 || dice.chance(0.5) {
        return 0..columns;
    }
    let first = dice.below(columns);
    first..first + 1 + dice.below(columns - first)
}

/// Numbers up to a size; some of them huge, if there are to be such.
fn any_numbers(dice: &mut Dice, n: usize, size: f64, huge: Option<f64>) -> Vec<f64> {
    let huge = huge.filter(|_| dice.chance(0.7));
    let share = dice.pick(&[0.1, 1.0]);
    let sizes = (0..n).map(|_| match huge {
        Some(huge) if dice.chance(share) => {
            dice.pick(&[huge, huge, 1e15, 1e6]) * dice.number().signum()
        }
        _ => size * dice.number(),
    });
    sizes.collect()
}

fn any_command(
    dice: &mut Dice,
    scope: &Scope<'_>,
    field: Field,
    columns: &Range<usize>,
) -> Vec<f64> {
    let size = dice.pick(&[0.0, 1.0, 20.0]);
    let mut row = any_numbers(dice, columns.len(), size, scope.huge);
    if field != Field::JointF {
        // nothing drives a free body
        let bodies = scope.model.constants().bodies.iter();
        for dof in bodies
            .filter(|body| body.motion == Motion::Free)
            .flat_map(|body| body.dofs())
        {
            if columns.contains(&dof) {
                row[dof - columns.start] = 0.0;
            }
        }
    }
    row
}

/// A position near the start.
fn any_place(dice: &mut Dice, scope: &Scope<'_>, columns: &Range<usize>) -> Vec<f64> {
    let start = &scope.model.start().joint_q;
    let offsets = any_numbers(dice, columns.len(), 0.3, scope.huge.map(|_| 1e30));
    let mut row: Vec<f64> = columns
        .clone()
        .zip(offsets)
        .map(|(k, x)| start[k] + x)
        .collect();
    for first in scope.model.constants().quaternions() {
        if columns.contains(&first) {
            let place = first - columns.start;
            row[place..place + 4].copy_from_slice(&dice.numbers(4, 1.0));
            // never without direction
            row[place + 3] += 1.5;
        }
    }
    row
}

/// A number of a parameter: near where it starts, another size, or where it ends.
fn any_param(dice: &mut Dice, scope: &Scope<'_>, param: Param, column: usize) -> f64 {
    let m = scope.model.constants();
    let first = m.varying.first(param).expect("it varies");
    let start = m.varying.starts()[first + column].1;
    let huge = scope.huge.filter(|_| dice.chance(0.4));
    match param {
        Param::Gravity | Param::BodyF => huge.unwrap_or(5.0) * dice.number(),
        Param::BodyInertia => start * dice.between(0.8, 1.2),
        Param::BodyMassScale => match huge {
            Some(_) => dice.pick(&[1e-3, 1e10, 1e30]),
            None => dice.order(0.2, 5.0),
        },
        Param::JointTargetKe if !m.dofs[column].follows_position => 0.0,
        Param::JointEffortLimit if start == NO_LIMIT => dice.pick(&[0.0, 10.0, NO_LIMIT]),
        Param::ShapeMu => match huge {
            Some(_) => dice.pick(&[1e6, 1e30]),
            None => dice.pick(&[0.0, 0.5, 2.0]),
        },
        Param::CommandDelay => {
            scope.model.command_delay_max() as f64 * dice.pick(&[0.0, 0.3, 0.5, 1.0])
        }
        _ if huge.is_some() => dice.pick(&[0.0, 1e10, 1e30]),
        _ => start * dice.between(0.5, 1.5) + dice.pick(&[0.0, 0.1]),
    }
}
