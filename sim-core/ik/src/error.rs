//! What is wrong with a task.

/// A task that cannot be solved, as a sentence with a cure.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IkError {
    /// There is no such frame.
    #[error("there is no link or site `{name}`; give one of {known}")]
    Frame {
        /// The name that was given.
        name: String,
        /// Names that are there.
        known: String,
    },
    /// No dof that may move moves a frame.
    #[error(
        "no joint that may move moves `{name}`; choose joints on its path, or leave `joints` out"
    )]
    Still {
        /// The frame.
        name: String,
    },
    /// An equality that is not kept.
    #[error(
        "the equality `{name}` is of a spatial tendon, which inverse kinematics does not keep; switch it off in the model, with active=\"false\""
    )]
    Tendon {
        /// The equality.
        name: String,
    },
    /// The limits of joints that move together exclude each other.
    #[error(
        "the limits of `{leader}` and of `{follower}`, which follows it, exclude each other; widen one of them"
    )]
    Limits {
        /// The joint that leads.
        leader: String,
        /// The joint that follows.
        follower: String,
    },
    /// An array of another length.
    #[error(
        "`{what}` has {got} entries; give {columns}, or {columns} for each of {count} problems"
    )]
    Length {
        /// The array.
        what: String,
        /// Its length.
        got: usize,
        /// Entries of a row.
        columns: usize,
        /// Problems.
        count: usize,
    },
    /// A number that is none, or out of its range.
    #[error("`{what}` has {value}; give finite numbers, weights from 0 on, and tolerances above 0")]
    Value {
        /// The array.
        what: String,
        /// What it has.
        value: f64,
    },
    /// More iterations than anybody waits for.
    #[error(
        "a problem may take {iterations} iterations in each of {attempts} attempts; give `iterations` and `restarts` \
         whose product is at most {max}"
    )]
    Work {
        /// Of an attempt.
        iterations: usize,
        /// The first one and the restarts.
        attempts: usize,
        /// The most of a problem.
        max: usize,
    },
    /// More threads than a system gives.
    #[error("{threads} threads are asked for; give 1 to {max}, or leave `threads` out")]
    Threads {
        /// What was asked for.
        threads: usize,
        /// The most.
        max: usize,
    },
    /// Its caller no longer waits for it.
    #[error("it was stopped before all problems were solved; ask again")]
    Stopped,
    /// The processor lacks instructions.
    #[error("this processor has no {instructions}; leave the lanes to be chosen")]
    Lanes {
        /// What it lacks.
        instructions: &'static str,
    },
}
