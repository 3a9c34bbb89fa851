//! Lanes kept busy: a lane whose attempt ends gets the next attempt at its problem, or the next problem.

use crate::check::{Checker, Errors};
use crate::lanes::{FREE, Lanes, Limits, POSED, TARGET};
use crate::measure::Target;
use crate::plan::Plan;
use crate::random::Draws;
use crate::starts;
use crate::tables::Tables;
use sim_model::Model;
use sim_physics::lane::{Lane, Real};
use sim_physics::math::quat;
use sim_physics::math::vec3::{Mat3, Vec3};
use std::ops::Range;

/// Tolerances of `f32` lanes over those of the result, so that rounding moves no result over the edge.
const TOLERANCE_SHARE: f64 = 0.999;

/// Attempts that keep near the posture. It may hold all of them at the same bounds, so later ones leave it out.
const POSED_ATTEMPTS: usize = 6;

/// Problems that are solved together. A row of starts, references or targets stands for all if it is the only one.
pub struct Problems<'a> {
    /// How many.
    pub count: usize,
    /// Joint positions, `(1 or count, coords)` [rad or m].
    pub starts: &'a [f64],
    /// References of the posture, `(1 or count, coords)`; empty for the starts.
    pub postures: &'a [f64],
    /// Of each frame, positions, `(1 or count, 3)` [m]; empty where they do not count.
    pub positions: Vec<&'a [f64]>,
    /// Of each frame, quaternions (x, y, z, w), `(1 or count, 4)`; empty where they do not count.
    pub orientations: Vec<&'a [f64]>,
}

/// How a problem is solved.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Most iterations of an attempt.
    pub iterations: usize,
    /// Most attempts after the first.
    pub restarts: usize,
    /// Position [m] and rotation [rad] that count as reached.
    pub tolerance: [f64; 2],
    /// Seed of the restarts.
    pub seed: u64,
}

/// Whether nobody wants the solutions any more. Every thread asks now and then.
pub type Stop<'a> = &'a (dyn Fn() -> bool + Sync);

/// Iterations between two looks at [`Stop`]: some milliseconds.
const STOP_EVERY: u64 = 1024;

/// What has been found of a problem, beside its state.
#[derive(Clone, Copy, Debug, Default)]
pub struct Solution {
    /// Are all errors within the tolerances?
    pub is_solved: bool,
    /// Largest distance of a frame from its target [m].
    pub position_error: f64,
    /// Largest angle between a frame and its target [rad].
    pub rotation_error: f64,
    /// Iterations of all attempts.
    pub iterations: u32,
    /// Attempts after the first.
    pub restarts: u32,
}

/// What every thread reads.
pub struct Job<'a, R> {
    pub model: &'a Model,
    pub plan: &'a Plan,
    pub tables: &'a Tables<R>,
    /// The same in double precision.
    pub exact: &'a Tables<f64>,
    pub problems: &'a Problems<'a>,
    pub options: Options,
    pub stop: Stop<'a>,
}

/// A problem in a lane.
struct Open {
    problem: usize,
    attempt: usize,
    begun: u64,
    solution: Solution,
    /// Worst error of the best attempt so far, as a multiple of its tolerance.
    worst: f64,
    targets: Vec<Target<f64>>,
}

/// A row of an array with one row, or with one for each problem.
fn row(array: &[f64], columns: usize, problem: usize) -> &[f64] {
    match array.len() == columns {
        true => array,
        false => &array[problem * columns..(problem + 1) * columns],
    }
}

/// Solves a range of problems: writes their states to `joint_q`, `(range, coords)`, and the rest to `solutions`.
#[inline(always)]
pub fn run<F: Lane>(
    job: &Job<F::Real>,
    range: Range<usize>,
    joint_q: &mut [f64],
    solutions: &mut [Solution],
) {
    let options = &job.options;
    let share = if F::Real::DOUBLE {
        1.0
    } else {
        TOLERANCE_SHARE
    };
    let limits = Limits {
        iterations: options.iterations,
        tolerance: options.tolerance.map(|x| x * share),
    };
    let mut lanes = Lanes::<F>::new(job.tables, limits);
    let mut checker = Checker::new(job.exact);
    let coords = job.model.coords();
    let mut q = vec![0.0; coords];
    let mut open: Vec<Option<Open>> = (0..F::WIDTH).map(|_| None).collect();
    let (mut next, mut clock, mut busy) = (range.start, 0u64, 0usize);
    for lane in 0..F::WIDTH.min(range.len()) {
        open[lane] = Some(begin(job, &mut lanes, lane, next, clock));
        (next, busy) = (next + 1, busy + 1);
    }
    while busy > 0 {
        let mut ended = lanes.iterate(job.tables);
        clock += 1;
        if clock.is_multiple_of(STOP_EVERY) && (job.stop)() {
            return;
        }
        while ended != 0 {
            let lane = ended.trailing_zeros() as usize;
            ended &= ended - 1;
            let Some(open_problem) = open[lane].as_mut() else {
                continue;
            };
            open_problem.solution.iterations += (clock - open_problem.begun) as u32;
            q.copy_from_slice(row(job.problems.starts, coords, open_problem.problem));
            for &(k, c) in &job.tables.moved {
                q[c] = lanes.outbox.row(2 + k)[lane].to_f64();
            }
            starts::tidy(job.model, job.plan, &mut q);
            let own_reaches = job.plan.own_reaches;
            let errors = checker.errors(job.exact, &q, &open_problem.targets, own_reaches);
            let place = open_problem.problem - range.start;
            let is_last = take(open_problem, &errors, options);
            if open_problem.attempt as u32 == open_problem.solution.restarts {
                joint_q[place * coords..(place + 1) * coords].copy_from_slice(&q);
            }
            if !is_last {
                open_problem.attempt += 1;
                open_problem.begun = clock;
                again(job, &mut lanes, lane, open_problem);
                continue;
            }
            open_problem.solution.restarts = open_problem.attempt as u32;
            solutions[place] = open_problem.solution;
            (open[lane], busy) = (None, busy - 1);
            if next < range.end {
                open[lane] = Some(begin(job, &mut lanes, lane, next, clock));
                (next, busy) = (next + 1, busy + 1);
            }
        }
    }
}

/// Keeps an attempt if it is the best so far; its number is then `solution.restarts`. True if it is the last one.
fn take(open_problem: &mut Open, errors: &Errors, options: &Options) -> bool {
    let worst = errors.worst(options.tolerance);
    if worst < open_problem.worst || open_problem.attempt == 0 {
        open_problem.worst = worst;
        open_problem.solution.position_error = errors.position;
        open_problem.solution.rotation_error = errors.rotation;
        open_problem.solution.is_solved = errors.within(options.tolerance);
        open_problem.solution.restarts = open_problem.attempt as u32;
    }
    open_problem.solution.is_solved || open_problem.attempt == options.restarts
}

/// Puts a problem into a lane.
fn begin<F: Lane>(
    job: &Job<F::Real>,
    lanes: &mut Lanes<F>,
    lane: usize,
    problem: usize,
    clock: u64,
) -> Open {
    let coords = job.model.coords();
    let mut q = row(job.problems.starts, coords, problem).to_vec();
    starts::tidy(job.model, job.plan, &mut q);
    let targets: Vec<Target<f64>> = (0..job.plan.reaches.len())
        .map(|reach| target(job, reach, problem))
        .collect();
    write_start(job, lanes, lane, &q, 0);
    let t = job.tables;
    if t.has_posture {
        let reference = match job.problems.postures {
            [] => &q[..],
            postures => row(postures, coords, problem),
        };
        for (k, &c) in t.coords.iter().enumerate() {
            lanes.inbox.row_mut(1 + t.coords.len() + k)[lane] = F::Real::from_f64(reference[c]);
        }
    }
    let mut at = 1 + 2 * t.coords.len();
    for target in &targets {
        let numbers = [
            target.position,
            target.axes[0],
            target.axes[1],
            target.axes[2],
        ];
        for (k, x) in numbers.iter().flat_map(|vector| vector.0).enumerate() {
            lanes.inbox.row_mut(at + k)[lane] = F::Real::from_f64(x);
        }
        at += TARGET;
    }
    Open {
        problem,
        attempt: 0,
        begun: clock,
        solution: Solution::default(),
        worst: f64::INFINITY,
        targets,
    }
}

/// Puts the next attempt at its problem into a lane.
fn again<F: Lane>(job: &Job<F::Real>, lanes: &mut Lanes<F>, lane: usize, open_problem: &Open) {
    let (problem, attempt) = (open_problem.problem, open_problem.attempt);
    let mut draws = Draws::new(job.options.seed, problem as u64, attempt as u64);
    let mut q = row(job.problems.starts, job.model.coords(), problem).to_vec();
    starts::draw(job.model, job.plan, &mut draws, &mut q);
    write_start(job, lanes, lane, &q, attempt);
}

fn write_start<F: Lane>(
    job: &Job<F::Real>,
    lanes: &mut Lanes<F>,
    lane: usize,
    q: &[f64],
    attempt: usize,
) {
    lanes.has_mail = true;
    let kind = if attempt < POSED_ATTEMPTS {
        POSED
    } else {
        FREE
    };
    lanes.inbox.row_mut(0)[lane] = F::Real::from_f64(kind);
    for (k, &c) in job.tables.coords.iter().enumerate() {
        lanes.inbox.row_mut(1 + k)[lane] = F::Real::from_f64(q[c]);
    }
}

/// The target of a frame; that of frames that the model ties together is none.
fn target<R: Real>(job: &Job<R>, reach: usize, problem: usize) -> Target<f64> {
    let mut position = [0.0; 3];
    let mut quaternion = [0.0, 0.0, 0.0, 1.0];
    if reach < job.plan.own_reaches {
        if !job.problems.positions[reach].is_empty() {
            position.copy_from_slice(row(job.problems.positions[reach], 3, problem));
        }
        if !job.problems.orientations[reach].is_empty() {
            quaternion.copy_from_slice(row(job.problems.orientations[reach], 4, problem));
        }
    }
    let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
    let axes: Mat3<f64> = quat::matrix(quaternion.map(|x| x / norm));
    let planned = &job.plan.reaches[reach];
    let mut position = Vec3(position);
    if let (None, false, Some(tree)) = (
        &planned.relative_to,
        job.exact.reaches[reach].moves_reference,
        planned.frame.tree,
    ) {
        position = position - Vec3(job.model.constants().trees[tree].base);
    }
    Target { position, axes }
}
