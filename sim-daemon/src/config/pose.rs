//! Frames in scene files.

use sim_model::Pose;

use super::number::Number;

/// The quaternion (x, y, z, w) of no rotation.
pub(super) fn no_rotation() -> [Number; 4] {
    Pose::identity().quat.map(Number)
}

/// A frame of position [m] and quaternion, which need not have length 1.
pub(super) fn pose(pos: &[Number; 3], quat: &[Number; 4]) -> Pose {
    Pose {
        pos: pos.map(|part| part.0),
        quat: quat.map(|part| part.0),
    }
    .normalized()
}
