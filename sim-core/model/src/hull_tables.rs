//! Convex hulls as the narrow phase reads them: rows of the model's tables.

use crate::geometry::{Face, Hull};
use sim_physics::constants::hull::{CORNERS_MAX, HullTables};
use sim_physics::lane::{Fixed, Tables};

/// The frame of a hull in a table, and how large it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HullFrame {
    /// Its centre in the frame that the vertices were given in [m].
    pub center: [f64; 3],
    /// Half the extents of its bounding box [m].
    pub half_extents: [f64; 3],
    /// Radius of a ball about the centre that holds it [m].
    pub radius: f64,
}

/// Appends hulls to the tables of a model; hull `i` is row `i` of `spans` and `sizes`.
pub fn append(hulls: &[Hull], tables: &mut Tables<f64>) -> (HullTables, Vec<HullFrame>) {
    let frames: Vec<HullFrame> = hulls.iter().map(HullFrame::of).collect();
    let mut rows = Rows::default();
    for (hull, frame) in hulls.iter().zip(&frames) {
        rows.push(hull, frame);
    }
    let spans = Fixed {
        base: tables.indices.len(),
        stride: 6,
        rows: hulls.len(),
    };
    tables.indices.extend(rows.spans);
    let mut numbers = |stride: usize, new: Vec<f64>| {
        let base = tables.numbers.len();
        let rows = new.len() / stride;
        tables.numbers.extend(new);
        Fixed { base, stride, rows }
    };
    let placed = HullTables {
        spans,
        sizes: numbers(4, rows.sizes),
        vertices: numbers(12, rows.vertices),
        faces: numbers(6, rows.faces),
        corners: numbers(3, rows.corners),
        edges: numbers(13, rows.edges),
    };
    (placed, frames)
}

impl HullFrame {
    fn of(hull: &Hull) -> HullFrame {
        let [low, high] = hull.extent();
        let (center, radius) = hull.bounding_sphere();
        HullFrame {
            center,
            half_extents: std::array::from_fn(|i| 0.5 * (high[i] - low[i])),
            radius,
        }
    }
}

/// The rows of hulls, one table each.
#[derive(Default)]
struct Rows {
    spans: Vec<u32>,
    sizes: Vec<f64>,
    vertices: Vec<f64>,
    faces: Vec<f64>,
    corners: Vec<f64>,
    edges: Vec<f64>,
}

impl Rows {
    fn push(&mut self, hull: &Hull, frame: &HullFrame) {
        let centred = |vertex: u32| -> [f64; 3] {
            let place = hull.vertices[vertex as usize];
            std::array::from_fn(|i| place[i] - frame.center[i])
        };
        let first = self.ends();
        let count = hull.vertices.len() as u32;
        for place in 0..count.next_multiple_of(4) {
            self.vertices.extend(centred(place.min(count - 1)));
        }
        for face in &hull.faces {
            let offset = face.offset - dot(face.normal, frame.center);
            let corners = kept(face);
            self.faces.extend(face.normal);
            self.faces.push(offset);
            self.faces.push((self.corners.len() / 3) as f64);
            self.faces.push(corners.len() as f64);
            self.corners.extend(corners.into_iter().flat_map(centred));
        }
        for edge in &hull.edges {
            let [from, to] = edge.ends.map(centred);
            let along: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
            let length = dot(along, along).sqrt();
            self.edges.extend(from);
            self.edges.extend(along.map(|x| x / length));
            for face in edge.faces {
                self.edges.extend(hull.faces[face as usize].normal);
            }
            self.edges.push(length);
        }
        let end = self.ends();
        self.spans
            .extend((0..3).flat_map(|table| [first[table], end[table]]));
        self.sizes.extend(frame.half_extents);
        self.sizes.push(frame.radius);
    }

    fn ends(&self) -> [u32; 3] {
        let rows = [
            self.vertices.len() / 12,
            self.faces.len() / 6,
            self.edges.len() / 13,
        ];
        rows.map(|rows| rows as u32)
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn kept(face: &Face) -> Vec<u32> {
    let count = face.corners.len();
    let few = count.min(CORNERS_MAX);
    (0..few).map(|i| face.corners[i * count / few]).collect()
}
