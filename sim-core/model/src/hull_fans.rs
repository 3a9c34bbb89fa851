//! Which corners of a hull rest on a plane with a vertex of it, as MuJoCo chooses them: rows of the model's tables.

use crate::geometry::Hull;
use crate::geometry::vector::{Vector, cross, norm, sub};
use sim_physics::constants::hull::HullTables;
use sim_physics::lane::{Fixed, Tables};

/// Most corners that rest with a vertex.
const OTHERS: usize = 3;

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
        let is_mujocos = !hull.polygons.is_empty();
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
    let mut add = |normal: Vector, corners: &[u32]| {
        for (at, &vertex) in corners.iter().enumerate() {
            let others = resting(&hull.vertices, corners, at);
            around[vertex as usize].push((normal, others));
        }
    };
    match hull.polygons.is_empty() {
        true => hull
            .faces
            .iter()
            .for_each(|face| add(face.normal, &face.corners)),
        false => hull
            .polygons
            .iter()
            .for_each(|side| add(side.normal, &side.corners)),
    }
    around
}

/// The corners of a polygon that make a large quadrilateral with corner `at`, in their order around it; all of a small one.
///
/// They begin as the next three. The last moves on while the area grows; after each of its steps so does the second, then the
/// first. This is MuJoCo's choice (3.13 and later), which is not always the largest quadrilateral.
fn resting(vertices: &[Vector], corners: &[u32], at: usize) -> Vec<u32> {
    let corner = |k: usize| corners[(at + k) % corners.len()];
    let count = corners.len().min(OTHERS + 1);
    let mut chosen: Vec<usize> = (1..count).collect();
    if corners.len() > OTHERS + 1 {
        let place = |k: usize| vertices[corner(k) as usize];
        // twice the area, by its diagonals
        let area = |of: &[usize]| {
            norm(cross(
                sub(place(0), place(of[1])),
                sub(place(of[0]), place(of[2])),
            ))
        };
        let mut largest = area(&chosen);
        let mut grows = |which: usize| {
            let mut moved = chosen.clone();
            moved[which] += 1;
            let here = area(&moved);
            let is_larger = here > largest;
            if is_larger {
                (chosen, largest) = (moved, here);
            }
            is_larger
        };
        while grows(2) {
            while grows(1) {}
            while grows(0) {}
        }
    }
    chosen.into_iter().map(corner).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of a polygon in the plane z = 0.
    fn flat<const N: usize>(places: [[f64; 2]; N]) -> Vec<Vector> {
        places.map(|[x, y]| [x, y, 0.0]).to_vec()
    }

    #[test]
    fn all_corners_of_a_small_polygon_rest() {
        let square = flat([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(resting(&square, &[0, 1, 2, 3], 2), [3, 0, 1]);
        assert_eq!(resting(&square, &[3, 1, 2], 1), [2, 3]);
    }

    #[test]
    fn corners_between_those_of_a_rectangle_do_not_rest() {
        let places = flat([
            [0.0, 0.0],
            [2.0, -0.1],
            [4.0, 0.0],
            [4.0, 3.0],
            [1.5, 3.1],
            [0.0, 3.0],
        ]);
        assert_eq!(resting(&places, &[0, 1, 2, 3, 4, 5], 0), [2, 3, 5]);
    }

    #[test]
    fn the_choice_ends_where_no_corner_alone_makes_it_larger() {
        // a step of the last corner makes the start smaller, though a larger one is beyond it
        let places = flat([
            [0.0, 0.0],
            [2.0, -1.0],
            [3.0, 0.0],
            [2.0, 1.0],
            [1.9, 0.9],
            [0.0, 3.0],
        ]);
        assert_eq!(resting(&places, &[0, 1, 2, 3, 4, 5], 0), [1, 2, 3]);
    }
}
