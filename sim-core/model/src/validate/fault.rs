//! What is wrong with a robot, and which of its parts it is about.

use crate::error::ModelError;

/// What a fault of a robot is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Culprit {
    Robot,
    /// By its index.
    Link(usize),
    /// By its index.
    Joint(usize),
}

/// What is wrong with a robot, and where.
#[derive(Debug)]
pub(crate) struct Fault {
    pub culprit: Culprit,
    pub error: Box<ModelError>,
}

impl Culprit {
    /// An error as a fault of this.
    pub fn blame(self, error: ModelError) -> Fault {
        Fault {
            culprit: self,
            error: Box::new(error),
        }
    }
}
