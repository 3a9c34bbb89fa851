//! Why a daemon does not start, or ends.

use sim_engine::backend::BackendError;
use sim_model::ModelError;
use sim_protocol::ProtocolError;

use crate::config::ConfigError;

/// Everything that ends a daemon, or keeps it from starting.
#[derive(Debug, thiserror::Error)]
pub enum DaemonError {
    /// An argument is not one of those there are.
    #[error("{argument} {value:?}: {problem}")]
    Argument {
        /// Which argument.
        argument: &'static str,
        /// What was given.
        value: String,
        /// What is wrong, and what would be right.
        problem: String,
    },
    /// The scene cannot be read.
    #[error("scene {name}: {problem}")]
    Read {
        /// The file, or "standard input".
        name: String,
        /// What the system says.
        problem: String,
    },
    /// The scene makes no sense.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The model cannot be compiled.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The simulation cannot be built.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The protocol fails.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The log file cannot be written.
    #[error("log file {path:?}: {problem}; name a file in a folder that you may write to")]
    Log {
        /// The file.
        path: std::path::PathBuf,
        /// What the system says.
        problem: String,
    },
    /// A MuJoCo model has elements that are not supported.
    #[error(
        "{}: {count} of its elements or options have no support, listed above; remove them from the model",
        path.display()
    )]
    Refused {
        /// The file.
        path: std::path::PathBuf,
        /// How many.
        count: usize,
    },
    /// A file that holds no robot.
    #[error("{}: it is {what}, not a robot; {cure}", path.display())]
    NoRobot {
        /// The file.
        path: std::path::PathBuf,
        /// What it is.
        what: &'static str,
        /// What to do with it.
        cure: &'static str,
    },
    /// The picture cannot be written.
    #[error("picture {}: {problem}", path.display())]
    Picture {
        /// The file.
        path: std::path::PathBuf,
        /// What is wrong, and the cure.
        problem: String,
    },
    /// The recording cannot be made, or not go on.
    #[error("{}: {problem}", path.display())]
    Recording {
        /// The file.
        path: std::path::PathBuf,
        /// What is wrong, and the cure.
        problem: String,
    },
    /// The recording cannot be replayed, or not further.
    #[error("{}: {problem}", path.display())]
    Replay {
        /// The file.
        path: std::path::PathBuf,
        /// What is wrong, and the cure.
        problem: String,
    },
    /// A frame is not as it was recorded.
    #[error("{}: frame {frame}, of a {op}: {difference}; the {frame} frames before it are equal, bit for bit", path.display())]
    Differs {
        /// The file.
        path: std::path::PathBuf,
        /// The frame, counted from 0.
        frame: u64,
        /// The command that made it.
        op: String,
        /// World and field, and both numbers where they are known.
        difference: String,
    },
    /// A state that was shown is not one of these worlds.
    #[error("the state that was shown cannot be evaluated: {problem}")]
    State {
        /// What is wrong, and the cure.
        problem: String,
    },
    /// A group of worlds fails, and with it the daemon.
    #[error("group {group}: {problem}")]
    Group {
        /// Which one.
        group: usize,
        /// What is wrong with it.
        problem: Box<DaemonError>,
    },
    /// Something that happened was not recorded.
    #[error("{}: {frames} frames are equal, bit for bit; {gaps}", path.display())]
    Gap {
        /// The file.
        path: std::path::PathBuf,
        /// Frames that were compared.
        frames: u64,
        /// Where gaps are, and what is missing.
        gaps: String,
    },
    /// The manual pages cannot be written.
    #[error("manual pages in {}: {problem}", folder.display())]
    Pages {
        /// The folder.
        folder: std::path::PathBuf,
        /// What the system says.
        problem: String,
    },
    /// A command of the Python package, where there is none.
    #[error(
        "`{command}` comes with the Python package: run `pip install \"./py-client[view]\"` in the repository"
    )]
    NeedsPython {
        /// The command.
        command: &'static str,
    },
    /// The system refuses something that every system has.
    #[error("{action}: {problem}")]
    System {
        /// What was tried.
        action: &'static str,
        /// What the system says.
        problem: String,
    },
}

impl DaemonError {
    /// Standard output cannot be written.
    pub(crate) fn stdout(error: std::io::Error) -> DaemonError {
        DaemonError::System {
            action: "write to standard output",
            problem: error.to_string(),
        }
    }

    /// Class of the error, for programs: the name of the Python exception.
    pub fn kind(&self) -> &'static str {
        use DaemonError::*;
        match self {
            Group { problem, .. } => problem.kind(),
            Argument { .. } | Protocol(ProtocolError::BadName { .. }) => "ArgumentError",
            Backend(
                BackendError::NoWorlds
                | BackendError::NoThreads
                | BackendError::Lanes { .. }
                | BackendError::Adapter { .. }
                | BackendError::CompileLimit { .. }
                | BackendError::DoubleOnGpu
                | BackendError::LastSubstepOnGpu
                | BackendError::NoSlipOnGpu
                | BackendError::ImplicitOnGpu
                | BackendError::LastSubstepSensors,
            ) => "ArgumentError",
            Backend(BackendError::Memory { .. } | BackendError::DeviceMemory { .. })
            | Protocol(
                ProtocolError::SharedMemory { .. }
                | ProtocolError::Memory { .. }
                | ProtocolError::Descriptors { .. },
            ) => "ResourceError",
            Read { .. } | Config(_) | Model(_) | Refused { .. } | NoRobot { .. } => "SceneError",
            Recording { .. } | Replay { .. } | Differs { .. } | Gap { .. } => "RecordingError",
            State { .. } => "SnapshotError",
            NeedsPython { .. } => "MissingLibrary",
            Backend(_)
            | Protocol(_)
            | Log { .. }
            | Picture { .. }
            | Pages { .. }
            | System { .. } => "LaunchError",
        }
    }

    /// Exit code: 2 when the command line was wrong or a recording cannot be replayed, else 1.
    pub fn exit_code(&self) -> i32 {
        let is_misuse =
            self.kind() == "ArgumentError" || matches!(self, DaemonError::Replay { .. });
        if is_misuse { 2 } else { 1 }
    }
}
