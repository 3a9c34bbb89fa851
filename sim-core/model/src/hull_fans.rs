//! Which corners of a hull rest on a plane with a vertex of it, as MuJoCo chooses them: rows of the model's tables.

use crate::geometry::Hull;
use crate::geometry::vector::Vector;
use sim_physics::constants::hull::HullTables;
use sim_physics::constants::hull::resting::{OTHERS, resting};
use sim_physics::lane::{Fixed, Tables};

/// The rows of hulls, one table each; see [`HullTables`].
#[derive(Default)]
pub(crate) struct Fans {
    ranks: Vec<f64>,
    spans: Vec<f64>,
    sizes: Vec<u32>,
    fans: Vec<f64>,
    origins: Vec<f64>,
}

impl Fans {
    /// Adds a hull with this centre, whose vertices the table of vertices has in this order.
    pub fn push(&mut self, hull: &Hull, center: Vector, order: &[u32]) {
        // as the table of vertices: the last row repeats the last vertex
        let first = self.ranks.len();
        let mut padded = order.to_vec();
        if let Some(&last) = order.last() {
            padded.resize(order.len().next_multiple_of(4), last);
        }
        let mut places = vec![0.0; hull.vertices.len()];
        for (place, &vertex) in order.iter().enumerate() {
            places[vertex as usize] = (first + place) as f64;
        }
        let around = around(hull);
        for &vertex in &padded {
            self.ranks.push(f64::from(vertex));
            self.spans.push((self.fans.len() / 6) as f64);
            self.spans.push(around[vertex as usize].len() as f64);
            for (normal, others) in &around[vertex as usize] {
                self.fans.extend(normal);
                let others = (0..OTHERS).map(|k| others.get(k).copied().unwrap_or(vertex));
                self.fans.extend(others.map(|other| places[other as usize]));
            }
        }
        let most = around.iter().map(Vec::len).max().unwrap_or(0);
        self.sizes.push(most as u32);
        // a mesh of MuJoCo has the origin of its vertices as its centre
        let is_mujocos = !hull.polygons.is_empty() || hull.whole.is_some();
        let origin = center.map(|x| if is_mujocos { -x } else { 0.0 });
        self.origins.extend(origin);
    }

    /// Appends them to the tables of a model.
    pub fn append(self, placed: &mut HullTables, tables: &mut Tables<f64>) {
        placed.fan_sizes = Fixed {
            base: tables.indices.len(),
            stride: 1,
            rows: self.sizes.len(),
        };
        tables.indices.extend(self.sizes);
        let mut numbers = |stride: usize, new: Vec<f64>| {
            let base = tables.numbers.len();
            let rows = new.len() / stride;
            tables.numbers.extend(new);
            Fixed { base, stride, rows }
        };
        placed.ranks = numbers(4, self.ranks);
        placed.fan_spans = numbers(2, self.spans);
        placed.fans = numbers(6, self.fans);
        placed.origins = numbers(3, self.origins);
    }
}

/// Of each vertex, the normals of the polygons beside it, and the corners of each that rest with it.
fn around(hull: &Hull) -> Vec<Vec<(Vector, Vec<u32>)>> {
    let mut around = vec![Vec::new(); hull.vertices.len()];
    for (corners, normal) in hull.sides() {
        for (at, &vertex) in corners.iter().enumerate() {
            let others = resting(&hull.vertices, corners, at);
            around[vertex as usize].push((normal, others));
        }
    }
    around
}
