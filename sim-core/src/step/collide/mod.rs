//! Contact points of pairs of shapes.

pub mod cylinders;
mod gjk;
mod hull_axes;
mod hull_depth;
pub mod hulls;
pub mod manifold;
pub mod points;
mod sides;
mod spread;
mod support;
