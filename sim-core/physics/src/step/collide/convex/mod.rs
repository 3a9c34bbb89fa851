//! Convex pairs: distances and depths by GJK and by axes, for hulls and for prisms of height fields.
//!
//! `pairs` is the general case; a pair of two hulls begins in `hulls`, one with a prism in `prisms`.

pub mod ellipsoid;
pub mod features;
pub mod gjk;
pub mod hull;
pub mod hull_axes;
pub mod hull_depth;
pub mod hulls;
pub mod pairs;
pub mod plane_hull;
pub mod posed;
pub mod prism;
pub mod prism_axes;
pub mod prism_ellipsoid;
pub mod prism_hull;
pub mod prisms;
pub mod restart;
pub mod simplex;
pub mod start_axes;
pub mod support;
