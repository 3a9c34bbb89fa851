//! Errors of scene files.

use std::path::PathBuf;

use sim_model::ModelError;

/// Why a scene cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// A scene file that cannot be read.
    #[error("{}: cannot be read: {reason}; give the path of a file that you may read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        reason: String,
    },
    /// A scene file that cannot be written.
    #[error("{}: cannot be written: {reason}; name a file in a folder that you may write to", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the operating system said.
        reason: String,
    },
    /// A text that is not a scene, with the place.
    #[error("{place}: {reason}")]
    Syntax {
        /// The file, or what else held the text.
        place: String,
        /// What was found and what was expected.
        reason: String,
    },
    /// A shape whose sizes do not fit its type.
    #[error("shape `{shape}`: {reason}")]
    Shape {
        /// Its name, or its type and place in the list.
        shape: String,
        /// What is wrong, and the cure.
        reason: String,
    },
    /// A camera whose entries do not fit each other.
    #[error("camera `{camera}`: {reason}")]
    Camera {
        /// Its name.
        camera: String,
        /// What is wrong, and the cure.
        reason: String,
    },
    /// A distribution of the start state that nothing can have.
    #[error("{culprit}: {problem}")]
    Randomize {
        /// The entry.
        culprit: String,
        /// What is wrong, and the cure.
        problem: String,
    },
    /// A robot or value that physics cannot use.
    #[error(transparent)]
    Model(#[from] ModelError),
}
