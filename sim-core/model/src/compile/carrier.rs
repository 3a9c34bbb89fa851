//! What carries a link.

use crate::pose::Pose;

/// The body and tree that carry a link, and the link's frame in that body's.
#[derive(Clone, Copy)]
pub(super) struct Carrier {
    pub body: Option<usize>,
    pub tree: usize,
    pub pose: Pose,
}
