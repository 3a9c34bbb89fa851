//! Inverse kinematics as a command: a file asks, and the answer takes its place.
//!
//! ```text
//! question   length u64 · JSON of that length, a [`Question`] · f64 of its arrays, one after another
//! answer     f64 per problem: joint positions, then 1 if solved, errors of position [m] and rotation [rad], iterations, restarts
//! ```
//! Everything is little endian. The worlds start at their positions unless the question has others. No world moves.

use std::sync::atomic::{AtomicBool, Ordering};

use serde::Deserialize;
use sim_engine::simulation::Simulation;
use sim_ik::{IkError, Options, Precision, Problems, Solution, Solver, Stop, Width};
use sim_protocol::RefusalKind;
use sim_protocol::host::Inbox;

use crate::config::IkTask;
use crate::export::refusal::{Refusal, refusal};
use crate::export::snapshot;
use crate::serve::exchange::{Exchange, arrays};

/// What a file asks for, beside its arrays.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Question {
    task: IkTask,
    /// Problems.
    count: usize,
    /// Lengths of the arrays: starts (0 for the worlds' positions), references of the posture, then of each frame its positions
    /// and its quaternions.
    lengths: Vec<usize>,
    iterations: usize,
    restarts: usize,
    seed: u64,
    tolerance: [f64; 2],
    double: bool,
    /// 0 for those of the simulation.
    threads: usize,
}

/// The solver of the last question: a control loop asks the same task again and again.
#[derive(Default)]
pub(crate) struct Ik {
    last: Option<(String, Solver)>,
}

impl Ik {
    /// Answers the question in the file that the command names.
    pub(crate) fn answer(
        &mut self,
        simulation: &Simulation,
        inbox: &Inbox,
        stop: &AtomicBool,
    ) -> Result<(), Refusal> {
        let path = snapshot::path(inbox)?;
        let refuse = |problem: String| refused(&format!("{}: {problem}", path.display()));
        let question = Exchange::read(path, 3).map_err(refuse)?;
        let stop = || stop.load(Ordering::Relaxed);
        let answer = self.solve(simulation, &question, &stop);
        let answer = answer.map_err(|problem| refused(&problem))?;
        question.answer(&answer).map_err(refuse)
    }

    /// The answer to a question.
    ///
    /// # Errors
    /// One sentence about what does not fit.
    pub(crate) fn solve(
        &mut self,
        simulation: &Simulation,
        question: &Exchange,
        stop: Stop<'_>,
    ) -> Result<Vec<u8>, String> {
        let (question, task, arrays) =
            parse(question).ok_or("the file is no question; use sim.ik")??;
        let [starts, posture, targets @ ..] = &arrays[..] else {
            return Err("the question lacks arrays; use sim.ik".to_owned());
        };
        let present = match starts[..] {
            [] => simulation.positions(),
            _ => Vec::new(),
        };
        let starts = if starts.is_empty() { &present } else { starts };
        let coords = simulation.model().coords();
        let has_rows = |array: &Vec<f64>| array.len() >= question.count;
        // so that no count asks for more memory than its arrays
        if question.count != 1 && !has_rows(starts) && !targets.iter().any(has_rows) {
            return Err(format!(
                "the question has no array of {} problems; give as many as arrays have",
                question.count
            ));
        }
        let solver = self
            .solver(simulation, &question.task, task)
            .map_err(said)?;
        let problems = Problems {
            count: question.count,
            starts,
            postures: posture,
            positions: targets.iter().step_by(2).map(Vec::as_slice).collect(),
            orientations: targets
                .iter()
                .skip(1)
                .step_by(2)
                .map(Vec::as_slice)
                .collect(),
        };
        let options = Options {
            iterations: question.iterations.max(1),
            restarts: question.restarts,
            tolerance: question.tolerance,
            seed: question.seed,
        };
        let precision = if question.double {
            Precision::F64
        } else {
            Precision::F32
        };
        let threads = match question.threads {
            0 => simulation.threads(),
            asked => asked,
        };
        let width = Width::Auto;
        let solved = solver.solve_until(stop, &problems, options, precision, width, threads);
        let (joint_q, solutions) = solved.map_err(said)?;
        Ok(rows(coords, &joint_q, &solutions))
    }

    /// The solver of a task; `text` is what it was read from.
    fn solver(
        &mut self,
        simulation: &Simulation,
        task: &IkTask,
        text: &str,
    ) -> Result<&Solver, IkError> {
        if self.last.as_ref().is_none_or(|(last, _)| last != text) {
            let solver = task.solver(simulation.model())?;
            self.last = Some((text.to_owned(), solver));
        }
        Ok(&self.last.as_ref().expect("it was just made").1)
    }
}

/// A question, the text of its task, and its arrays; none for other bytes.
#[allow(clippy::type_complexity)]
fn parse(question: &Exchange) -> Option<Result<(Question, &str, Vec<Vec<f64>>), String>> {
    let (text, rest) = question.parts()?;
    let question: Question = match serde_json::from_str(text) {
        Ok(question) => question,
        Err(problem) => {
            return Some(Err(format!(
                "the file is no question: {problem}; use sim.ik"
            )));
        }
    };
    let arrays = arrays(rest, &question.lengths)?;
    Some(Ok((question, task_of(text), arrays)))
}

/// The text of a question's task, and all of it where that does not come first: what follows differs from call to call.
fn task_of(text: &str) -> &str {
    let is_first = text.starts_with("{\"task\":");
    let parts = text.split_once(",\"count\"").filter(|_| is_first);
    parts.map_or(text, |(task, _)| task)
}

/// The answer.
fn rows(coords: usize, joint_q: &[f64], solutions: &[Solution]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(8 * (coords + 5) * solutions.len());
    for (k, solution) in solutions.iter().enumerate() {
        let results = [
            f64::from(u8::from(solution.is_solved)),
            solution.position_error,
            solution.rotation_error,
            f64::from(solution.iterations),
            f64::from(solution.restarts),
        ];
        let q = &joint_q[k * coords..(k + 1) * coords];
        for number in q.iter().chain(&results) {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
    }
    bytes
}

fn said(error: IkError) -> String {
    error.to_string()
}

fn refused(problem: &str) -> Refusal {
    refusal(RefusalKind::Backend, format!("ik: {problem}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_with_the_same_task_text_have_the_same_task() {
        let first = r#"{"task":{"moves":[true]},"count":2,"seed":1}"#;
        assert_eq!(task_of(first), r#"{"task":{"moves":[true]}"#);
        for last in [
            r#"{"seed":1,"count":2,"task":{"moves":[true]}}"#,
            r#"{"seed":1,"count":2,"task":{"moves":[false]}}"#,
        ] {
            assert_eq!(task_of(last), last);
        }
    }
}
