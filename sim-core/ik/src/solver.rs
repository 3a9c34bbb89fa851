//! The solver: a task on a model, and what runs it.

use crate::dispatch::{Width, double, single};
use crate::error::IkError;
use crate::plan::Plan;
use crate::queue::{Job, Options, Problems, Solution, Stop};
use crate::tables::Tables;
use crate::task::Task;
use sim_model::Model;
use sim_physics::constants::Recast;
use sim_physics::lane::Real;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// Iterations of all attempts at one problem at most: about a second [–].
const WORK_MAX: usize = 1_000_000;
/// Threads at most, as of a daemon: a system that gives no more of them would end the process [–].
const THREADS_MAX: usize = 1024;

/// Precision of the iterations. Errors are evaluated in double precision.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Single, in the lanes of vector registers.
    #[default]
    F32,
    /// Double.
    F64,
}

/// Solves inverse kinematics of a model.
pub struct Solver {
    model: Arc<Model>,
    plan: Plan,
    single: Tables<f32>,
    double: Tables<f64>,
}

impl Solver {
    /// For a task on a model.
    ///
    /// # Errors
    /// [`IkError::Still`], [`IkError::Limits`], [`IkError::Length`], [`IkError::Value`].
    pub fn new(model: Arc<Model>, task: &Task) -> Result<Solver, IkError> {
        check_task(&model, task)?;
        let plan = Plan::new(&model, task)?;
        Ok(Solver {
            single: Tables::new(&model, &plan),
            double: Tables::new(&model, &plan),
            model,
            plan,
        })
    }

    /// The model.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// The plan of the task.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Solves problems. Returns joint positions, `(count, coords)`, and what has been found of each. The result of a problem is
    /// the same bit for bit for any number of problems, lanes and threads.
    ///
    /// # Errors
    /// [`IkError::Lanes`], [`IkError::Length`], [`IkError::Value`], [`IkError::Work`], [`IkError::Threads`].
    pub fn solve(
        &self,
        problems: &Problems,
        options: Options,
        precision: Precision,
        width: Width,
        threads: usize,
    ) -> Result<(Vec<f64>, Vec<Solution>), IkError> {
        self.solve_until(&|| false, problems, options, precision, width, threads)
    }

    /// The same, until somebody stops it.
    ///
    /// # Errors
    /// As of [`Solver::solve`], and [`IkError::Stopped`].
    pub fn solve_until(
        &self,
        stop: Stop,
        problems: &Problems,
        options: Options,
        precision: Precision,
        width: Width,
        threads: usize,
    ) -> Result<(Vec<f64>, Vec<Solution>), IkError> {
        self.check(problems, &options)?;
        if threads > THREADS_MAX {
            let max = THREADS_MAX;
            return Err(IkError::Threads { threads, max });
        }
        let coords = self.model.coords();
        let count = problems.count;
        let mut joint_q = vec![0.0; count * coords];
        let mut solutions = vec![Solution::default(); count];
        let stopped = AtomicBool::new(false);
        // once it is asked for, no thread asks again
        let stop = &|| {
            let stops = stopped.load(Ordering::Relaxed) || stop();
            stopped.fetch_or(stops, Ordering::Relaxed) || stops
        };
        match precision {
            Precision::F32 => {
                let work = single(width)?;
                let job = self.job(&self.single, problems, options, stop);
                in_threads(&job, work, threads, &mut joint_q, &mut solutions);
            }
            Precision::F64 => {
                let work = double()?;
                let job = self.job(&self.double, problems, options, stop);
                in_threads(&job, work, threads, &mut joint_q, &mut solutions);
            }
        }
        match stopped.into_inner() {
            true => Err(IkError::Stopped),
            false => Ok((joint_q, solutions)),
        }
    }

    /// Refuses arrays of other lengths, and numbers that are none.
    fn check(&self, problems: &Problems, options: &Options) -> Result<(), IkError> {
        let (coords, count) = (self.model.coords(), problems.count);
        let mut arrays = vec![("joint_q".to_owned(), problems.starts, coords, false)];
        arrays.push(("posture".to_owned(), problems.postures, coords, true));
        let reaches = &self.plan.reaches[..self.plan.own_reaches];
        for (what, all, columns) in [
            ("position", &problems.positions, 3),
            ("orientation", &problems.orientations, 4),
        ] {
            if all.len() != reaches.len() {
                return Err(length(what, all.len(), reaches.len(), 1));
            }
            for (reach, &array) in reaches.iter().zip(all) {
                let weights = match columns {
                    3 => reach.position_weight,
                    _ => reach.orientation_weight,
                };
                let may_be_empty = weights == [0.0; 3];
                arrays.push((
                    format!("{what} of {}", reach.name),
                    array,
                    columns,
                    may_be_empty,
                ));
            }
        }
        for (what, array, columns, may_be_empty) in arrays {
            let lengths = [columns, count * columns];
            let left_out = may_be_empty && array.is_empty();
            if !(lengths.contains(&array.len()) || left_out) {
                return Err(length(&what, array.len(), columns, count));
            }
            finite(&what, array)?;
        }
        finite("tolerance", &options.tolerance)?;
        let (iterations, attempts) = (options.iterations, options.restarts.saturating_add(1));
        if iterations.saturating_mul(attempts) > WORK_MAX {
            let max = WORK_MAX;
            return Err(IkError::Work {
                iterations,
                attempts,
                max,
            });
        }
        match options.tolerance.into_iter().find(|&x| x <= 0.0) {
            Some(value) => Err(IkError::Value {
                what: "tolerance".to_owned(),
                value,
            }),
            None => Ok(()),
        }
    }

    fn job<'a, R: Real>(
        &'a self,
        tables: &'a Tables<R>,
        problems: &'a Problems<'a>,
        options: Options,
        stop: Stop<'a>,
    ) -> Job<'a, R>
    where
        f64: Recast<R, Out = R>,
    {
        Job {
            model: &self.model,
            plan: &self.plan,
            tables,
            exact: &self.double,
            problems,
            options,
            stop,
        }
    }
}

fn length(what: &str, got: usize, columns: usize, count: usize) -> IkError {
    let what = what.to_owned();
    IkError::Length {
        what,
        got,
        columns,
        count,
    }
}

fn finite(what: &str, values: &[f64]) -> Result<(), IkError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(IkError::Value {
            what: what.to_owned(),
            value,
        }),
        None => Ok(()),
    }
}

/// Refuses a task of another model, and weights that are none.
fn check_task(model: &Model, task: &Task) -> Result<(), IkError> {
    let dofs = model.dofs();
    for (what, got) in [
        ("moves", task.moves.len()),
        ("posture_weight", task.posture_weight.len()),
    ] {
        if got != dofs {
            return Err(length(what, got, dofs, 1));
        }
    }
    let reaches = task.reaches.iter();
    let of_reaches = reaches.flat_map(|reach| [reach.position_weight, reach.orientation_weight]);
    let mut weights = of_reaches
        .flatten()
        .chain(task.posture_weight.iter().copied());
    match weights.find(|weight| !weight.is_finite() || *weight < 0.0) {
        Some(value) => Err(IkError::Value {
            what: "weight".to_owned(),
            value,
        }),
        None => Ok(()),
    }
}

/// Gives each thread a part of the problems.
fn in_threads<R: Real>(
    job: &Job<R>,
    work: crate::dispatch::Work<R>,
    threads: usize,
    joint_q: &mut [f64],
    solutions: &mut [Solution],
) {
    let (count, coords) = (job.problems.count, job.model.coords());
    let part = count.div_ceil(threads.max(1)).max(1);
    let ranges = (0..count)
        .step_by(part)
        .map(|first| first..count.min(first + part));
    let rows = joint_q
        .chunks_mut((part * coords).max(1))
        .zip(solutions.chunks_mut(part));
    let mut parts = ranges.zip(rows);
    let Some((range, (q, s))) = parts.next() else {
        return;
    };
    thread::scope(|scope| {
        for (range, (q, s)) in parts {
            scope.spawn(move || work(job, range, q, s));
        }
        // the caller's thread works as well
        work(job, range, q, s);
    });
}
