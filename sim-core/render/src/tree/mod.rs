//! Triangles of one body in a tree of boxes, eight in a register.
//!
//! A node has eight children; a leaf has up to eight triangles. Both are met in one go by a ray.
//!
//! ```text
//! t = (h - n·o) / (n·d)              where a ray o + t d meets the plane of a triangle, n·p = h
//! u = ũ·p + u₀,  v = ṽ·p + v₀        barycentric coordinates of the point p there
//! ```
//!
//! The nine factors and three constants of a triangle are computed in `f64` when the tree is made (Baldwin and Weber, "Fast
//! Ray-Triangle Intersections by Coordinate Transformation", 2016). A triangle is met from its front alone, as by renderers.
//! Its sides are moved outwards by the rounding of p, so that no ray passes between neighbours.

mod build;
mod cast;
mod fill;
mod outer;
mod parts;
mod shade;

pub(crate) use fill::{Bundle, Waiting};
pub(crate) use parts::{PartTree, Walk};
pub(crate) use shade::Beam;

use crate::vector::Vector;

/// A child that is a leaf has this bit.
const LEAF: u32 = 1 << 31;
/// Most children that wait on the way down.
const STACK: usize = 512;

/// Eight children: the lowest and the highest corners of their boxes, and where they are.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
struct Node {
    low: [[f32; 8]; 3],
    high: [[f32; 8]; 3],
    children: [u32; 8],
}

/// Up to eight triangles.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
struct Leaf {
    /// Normals of length 1.
    normal: [[f32; 8]; 3],
    /// n·p of their planes [m].
    height: [f32; 8],
    /// ũ and ṽ [1/m].
    across: [[[f32; 8]; 3]; 2],
    /// u₀ and v₀ [–].
    start: [[f32; 8]; 2],
    /// The largest of |ũ|, |ṽ| and |ũ + ṽ| [1/m]: how far a distance is in barycentric coordinates.
    steep: [f32; 8],
    /// Numbers of the triangles among those given.
    number: [u32; 8],
}

/// Triangles that rays meet.
#[derive(Debug)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
    /// Half edges of the box around all [m]; its centre is the origin.
    pub(crate) half: Vector,
}
