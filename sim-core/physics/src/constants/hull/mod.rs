//! Where the convex hulls of a model are in its tables.

pub mod reference;
pub mod resting;

use crate::lane::Fixed;

/// Most corners of a face in a table: of a face with more, so many are kept, evenly around it.
/// The deepest point of a contact does not depend on them, only how far its support reaches.
pub const CORNERS_MAX: usize = 12;

/// Most vertices of a cluster: four rows.
pub const CLUSTER: usize = 16;

/// Where the hulls of a model are in its tables.
///
/// A hull's frame has the axes of the frame that its vertices were given in and the centre of their bounding box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HullTables {
    /// Of each hull: first and end of its rows of vertices, of faces, of edges. Indices. `(hulls, 6)`
    pub spans: Fixed,
    /// Of each hull: half extents of its bounding box, then its radius about the centre. `(hulls, 4)` [m]
    pub sizes: Fixed,
    /// Four vertices a row; the last row of a hull repeats its last vertex. `(rows, 12)` [m]
    pub vertices: Fixed,
    /// Outward unit normal and offset of the plane; first row in `corners`, and how many. `(faces, 6)` [–, m, –]
    pub faces: Fixed,
    /// Corners of the faces, counter-clockwise from outside. `(corners, 3)` [m]
    pub corners: Fixed,
    /// One end, unit direction, outward normals of the faces beside it, and length. `(edges, 13)` [m, –]
    pub edges: Fixed,
    /// Of each hull: first and end of its clusters of vertices. Without rows where every hull is one cluster. Indices.
    /// `(hulls, 2)`
    pub cluster_spans: Fixed,
    /// First and end of the rows of a cluster in `vertices`. Indices. `(clusters, 2)`
    pub cluster_rows: Fixed,
    /// Centre of a cluster, and radius of a ball about it that holds its vertices. `(clusters, 4)` [m]
    pub clusters: Fixed,
    /// Of each of the four vertices of a row, its place in the order in which equally deep ones count. With the tables below it
    /// has rows where a plane touches hulls as in MuJoCo. `(rows, 4)`
    pub ranks: Fixed,
    /// Of each vertex: its first row in `fans`, and how many. `(4 * rows, 2)`
    pub fan_spans: Fixed,
    /// Of each hull, most rows of a vertex in `fans`. Indices. `(hulls, 1)`
    pub fan_sizes: Fixed,
    /// Of each vertex and polygon beside it: outward unit normal, then the places in `vertices` of up to three corners that span
    /// a large part of the polygon with the vertex; the vertex itself where there are fewer. `(rows, 6)` [–]
    pub fans: Fixed,
    /// Of each hull, what MuJoCo takes for its centre, in its frame. `(hulls, 3)` [m]
    pub origins: Fixed,
}
