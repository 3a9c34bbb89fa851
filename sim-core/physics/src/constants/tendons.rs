//! Spatial tendons: lines from site to site, which bend around spheres and cylinders.

use super::recast::{Recast, recast, same};
use super::site::Mount;

recast! {
    /// A spatial tendon (MuJoCo: `tendon/spatial`).
    #[derive(Clone, Debug)]
    pub struct SpatialTendon<R> {
        /// Its pieces from site to site, in the order of the path.
        pub spans: Vec<Span<R>>,
        /// Bodies that it pulls.
        pub bodies: Vec<usize>,
        /// The dofs that change its length, rising.
        pub dofs: Vec<usize>,
        /// Of each of them, the bodies of the tendon that it moves.
        pub moved: Vec<Vec<usize>>,
        /// Place of its first moment in `ten_moment`; each dof has one.
        pub first: usize,
        /// Free bodies among those that carry its bodies, each with the place of its first dof in `dofs`.
        pub free_bodies: Vec<(usize, usize)>,
    }
}

recast! {
    /// The shortest way between two sites, around a shape if there is one.
    #[derive(Clone, Debug)]
    pub struct Span<R> {
        /// The site where it begins.
        pub from: Mount<R>,
        /// The site where it ends.
        pub to: Mount<R>,
        /// How much of it counts: 1, or 1 over the divisor of a pulley [–].
        pub share: R,
        /// What it bends around.
        pub wrap: Option<Wrap<R>>,
    }
}

recast! {
    /// A sphere or a cylinder of unlimited length around which a tendon bends.
    #[derive(Clone, Debug)]
    pub struct Wrap<R> {
        /// Its frame; the axis of a cylinder is z.
        pub at: Mount<R>,
        /// Whether it is a cylinder.
        pub is_cylinder: bool,
        /// [m]
        pub radius: R,
        /// The site on whose side the tendon stays.
        pub side: Option<Mount<R>>,
        /// Whether the tendon is on the inner side of the surface.
        pub inner: Inner,
    }
}

/// Whether a tendon is on the inner side of a surface: where the side site is nearer to its centre than the radius.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inner {
    /// In no state.
    Never,
    /// In every state.
    Always,
    /// Depending on the state.
    Sometimes,
}

same! { Inner }
