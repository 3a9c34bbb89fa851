//! Sites: frames of interest, as physics code reads them.

use super::recast::{Recast, recast, same};

recast! {
    /// A frame of interest.
    #[derive(Clone, Debug)]
    pub struct Site<R> {
        /// Where it is.
        pub mount: Mount<R>,
        /// What its pose and velocity are measured from; none for the world.
        pub relative_to: Option<Mount<R>>,
        /// Damping λ of its inverse Jacobian [m and rad alike].
        pub damping: R,
        /// The dofs that move it against what it is measured from, rising.
        pub columns: Vec<Column>,
    }
}

/// A dof that moves a site against the frame that it is measured from.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// The dof.
    pub dof: usize,
    /// Does it move that frame instead of the site?
    pub is_of_other: bool,
}

recast! {
    /// A frame on a body, or in the world.
    #[derive(Clone, Debug)]
    pub struct Mount<R> {
        /// The body that carries it; none for a static frame.
        pub body: Option<usize>,
        /// The robot of that body.
        pub tree: Option<usize>,
        /// Origin in the carrier's frame, or in the world [m].
        pub position: [R; 3],
        /// Orientation in the carrier's frame, (x, y, z, w) [–].
        pub quat: [R; 4],
        /// The same by columns [–].
        pub rotation: [[R; 3]; 3],
    }
}

same! { Column }
