//! Convex hulls as the narrow phase reads them: rows of the model's tables.

use crate::geometry::{Face, Hull};
use crate::hull_fans::Fans;
use sim_physics::constants::hull::{CLUSTER, CORNERS_MAX, HullTables};
use sim_physics::lane::{Fixed, Tables};

/// A cluster's ball is larger by this part of its hull's radius than its vertices need, more than `f32` rounds their heights.
const ROUNDING: f64 = 1e-5;

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

/// Appends hulls to the tables of a model; hull `i` is row `i` of `spans` and `sizes`. Where `with_fans` a plane touches them as in
/// MuJoCo.
pub fn append(
    hulls: &[Hull],
    with_fans: bool,
    tables: &mut Tables<f64>,
) -> (HullTables, Vec<HullFrame>) {
    let frames: Vec<HullFrame> = hulls.iter().map(HullFrame::from_hull).collect();
    let mut rows = Rows::default();
    let clustered = hulls.iter().any(|hull| hull.vertices.len() > CLUSTER);
    let mut fans = Fans::default();
    for (hull, frame) in hulls.iter().zip(&frames) {
        let order = rows.push(hull, frame, clustered);
        if with_fans {
            fans.push(hull, frame.center, &order);
        }
    }
    let spans = Fixed {
        base: tables.indices.len(),
        stride: 6,
        rows: hulls.len(),
    };
    tables.indices.extend(rows.spans);
    let mut clusters_of = |new: Vec<u32>| {
        let (base, rows) = (tables.indices.len(), new.len() / 2);
        tables.indices.extend(new);
        Fixed {
            base,
            stride: 2,
            rows,
        }
    };
    let (cluster_spans, cluster_rows) = match clustered {
        true => (
            clusters_of(rows.cluster_spans),
            clusters_of(rows.cluster_rows),
        ),
        false => Default::default(),
    };
    let mut numbers = |stride: usize, new: Vec<f64>| {
        let base = tables.numbers.len();
        let rows = new.len() / stride;
        tables.numbers.extend(new);
        Fixed { base, stride, rows }
    };
    let mut placed = HullTables {
        spans,
        sizes: numbers(4, rows.sizes),
        vertices: numbers(12, rows.vertices),
        faces: numbers(6, rows.faces),
        corners: numbers(3, rows.corners),
        edges: numbers(13, rows.edges),
        cluster_spans,
        cluster_rows,
        clusters: match clustered {
            true => numbers(4, rows.clusters),
            false => Fixed::default(),
        },
        ..HullTables::default()
    };
    if with_fans {
        fans.append(&mut placed, tables);
    }
    (placed, frames)
}

impl HullFrame {
    fn from_hull(hull: &Hull) -> HullFrame {
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
    cluster_spans: Vec<u32>,
    cluster_rows: Vec<u32>,
    clusters: Vec<f64>,
}

impl Rows {
    /// Adds a hull. Returns its vertices in the order of `vertices`.
    fn push(&mut self, hull: &Hull, frame: &HullFrame, clustered: bool) -> Vec<u32> {
        let centred = |vertex: u32| -> [f64; 3] {
            let place = hull.vertices[vertex as usize];
            std::array::from_fn(|i| place[i] - frame.center[i])
        };
        let first = self.ends();
        let mut order: Vec<u32> = (0..hull.vertices.len() as u32).collect();
        if clustered {
            let first = self.clusters.len() / 4;
            sort_into_clusters(&mut order, &centred);
            for cluster in order.chunks(CLUSTER) {
                let points: Vec<[f64; 3]> = cluster.iter().map(|&vertex| centred(vertex)).collect();
                self.push_cluster(&points, frame.radius);
            }
            let end = self.clusters.len() / 4;
            self.cluster_spans.extend([first as u32, end as u32]);
        } else {
            self.push_vertices(order.iter().map(|&vertex| centred(vertex)).collect());
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
        order
    }

    /// Four vertices a row; the last row repeats the last vertex.
    fn push_vertices(&mut self, mut points: Vec<[f64; 3]>) {
        if let Some(&last) = points.last() {
            points.resize(points.len().next_multiple_of(4), last);
        }
        self.vertices.extend(points.into_iter().flatten());
    }

    /// A cluster of the vertices of a hull of this radius.
    fn push_cluster(&mut self, points: &[[f64; 3]], size: f64) {
        let among = |pick: fn(f64, f64) -> f64, i: usize| points.iter().map(|x| x[i]).reduce(pick);
        let center: [f64; 3] = std::array::from_fn(|i| {
            let (low, high) = (among(f64::min, i), among(f64::max, i));
            0.5 * (low.unwrap_or(0.0) + high.unwrap_or(0.0))
        });
        let squares = points.iter().map(|x| {
            let from_center: [f64; 3] = std::array::from_fn(|i| x[i] - center[i]);
            dot(from_center, from_center)
        });
        let radius = squares.fold(0.0, f64::max).sqrt() + ROUNDING * size;
        self.clusters.extend(center);
        self.clusters.push(radius);
        let first = self.ends()[0];
        self.push_vertices(points.to_vec());
        self.cluster_rows.extend([first, self.ends()[0]]);
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

/// Sorts vertices so that each [`CLUSTER`] of them are near each other: halves along the longest side of their bounding box,
/// in turn, until a cluster is left.
fn sort_into_clusters(vertices: &mut [u32], place: &impl Fn(u32) -> [f64; 3]) {
    if vertices.len() <= CLUSTER {
        // as they were given: of equal vertices the first one counts
        vertices.sort_unstable();
        return;
    }
    let extent = |i: usize| {
        let along = || vertices.iter().map(|&vertex| place(vertex)[i]);
        along().fold(f64::MIN, f64::max) - along().fold(f64::MAX, f64::min)
    };
    let sides: [f64; 3] = std::array::from_fn(extent);
    let longest = (0..3).fold(0, |best, i| if sides[i] > sides[best] { i } else { best });
    vertices.sort_unstable_by(|&a, &b| {
        let [x, y] = [a, b].map(|vertex| place(vertex)[longest]);
        x.total_cmp(&y).then(a.cmp(&b))
    });
    // all clusters but the last are full
    let half = (vertices.len() / 2).next_multiple_of(CLUSTER);
    let (low, high) = vertices.split_at_mut(half.min(vertices.len()));
    sort_into_clusters(low, place);
    sort_into_clusters(high, place);
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn kept(face: &Face) -> Vec<u32> {
    let count = face.corners.len();
    let few = count.min(CORNERS_MAX);
    (0..few).map(|i| face.corners[i * count / few]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a sphere, in a spiral.
    fn ball(count: usize) -> Hull {
        let points: Vec<[f64; 3]> = (0..count)
            .map(|k| {
                let z = 1.0 - (2 * k + 1) as f64 / count as f64;
                let (sin, cos) = libm::sincos(2.4 * k as f64);
                let radius = (1.0 - z * z).sqrt();
                [radius * cos, radius * sin, z]
            })
            .collect();
        Hull::from_points(&points, 1024).unwrap()
    }

    #[test]
    fn every_vertex_is_in_the_ball_of_its_cluster_and_in_no_other() {
        let (large, small) = (ball(500), ball(10));
        let mut tables = Tables::default();
        let (placed, frames) = append(&[large.clone(), small], false, &mut tables);
        let index =
            |t: Fixed, row: usize, k: usize| tables.indices[t.base + row * t.stride + k] as usize;
        let number = |t: Fixed, k: usize| tables.numbers[t.base + k];
        let spans = [0, 1].map(|hull| {
            let at = |k| index(placed.cluster_spans, hull, k);
            at(0)..at(1)
        });
        assert_eq!(spans, [0..32, 32..33]);
        let mut listed = Vec::new();
        for cluster in 0..placed.clusters.rows {
            let ball: [f64; 4] = std::array::from_fn(|k| number(placed.clusters, 4 * cluster + k));
            let rows =
                index(placed.cluster_rows, cluster, 0)..index(placed.cluster_rows, cluster, 1);
            assert!((1..=CLUSTER / 4).contains(&rows.len()));
            // a cluster is a small part of its hull
            assert!(cluster == 32 || ball[3] < 0.5, "radius {}", ball[3]);
            for vertex in 4 * rows.start..4 * rows.end {
                let x: [f64; 3] = std::array::from_fn(|i| number(placed.vertices, 3 * vertex + i));
                let from: [f64; 3] = std::array::from_fn(|i| x[i] - ball[i]);
                assert!(dot(from, from).sqrt() < ball[3], "cluster {cluster}: {x:?}");
                if spans[0].contains(&cluster) {
                    listed.push(x.map(f64::to_bits));
                }
            }
        }
        listed.sort_unstable();
        listed.dedup();
        let center = frames[0].center;
        let mut given: Vec<_> = large
            .vertices
            .iter()
            .map(|x| std::array::from_fn(|i| (x[i] - center[i]).to_bits()))
            .collect();
        given.sort_unstable();
        assert_eq!(listed, given);
    }

    #[test]
    fn small_hulls_have_no_clusters() {
        let (placed, _) = append(&[ball(CLUSTER)], false, &mut Tables::default());
        assert_eq!(placed.clusters, Fixed::default());
    }
}
