//! Normals to shade by: a curved surface looks round, an edge sharp.

use crate::vector::{Vector, along, cross, dot, sub, unit};

/// Facets that meet at less than this are one curved surface: its cosine, of 35°.
const SMOOTH: f64 = 0.82;
/// Most facets at a vertex that is smoothed: the pole of a ball has 48. It bounds the work, which is its square.
const FAN_MAX: usize = 128;

/// Twice the area of each triangle along its normal.
fn areas(vertices: &[Vector], triangles: &[[u32; 3]]) -> Vec<Vector> {
    let area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|vertex| vertices[vertex as usize]);
        cross(sub(b, a), sub(c, a))
    };
    triangles.iter().map(area).collect()
}

/// Parts in 32767ths.
fn quantised(normal: Vector) -> [i16; 3] {
    normal.map(|part| (part * 32767.0).round() as i16)
}

/// The triangle's own normal at each of its corners; parts in 32767ths.
pub(crate) fn facet_normals(vertices: &[Vector], triangles: &[[u32; 3]]) -> Vec<[[i16; 3]; 3]> {
    let areas = areas(vertices, triangles).into_iter();
    areas.map(|area| [quantised(unit(area)); 3]).collect()
}

/// Normal at each corner of each triangle: the mean of the facets around that vertex that form one smooth surface with
/// this one, weighted by area; parts in 32767ths.
pub(crate) fn corner_normals(vertices: &[Vector], triangles: &[[u32; 3]]) -> Vec<[[i16; 3]; 3]> {
    let areas = areas(vertices, triangles);
    let mut start = vec![0_usize; vertices.len() + 1];
    for &vertex in triangles.iter().flatten() {
        start[vertex as usize + 1] += 1;
    }
    for vertex in 0..vertices.len() {
        start[vertex + 1] += start[vertex];
    }
    let mut around = vec![0_u32; 3 * triangles.len()];
    let mut filled = start.clone();
    for (facet, corners) in triangles.iter().enumerate() {
        for &vertex in corners {
            around[filled[vertex as usize]] = facet as u32;
            filled[vertex as usize] += 1;
        }
    }
    let at_corner = |facet: usize, vertex: u32| {
        let normal = unit(areas[facet]);
        let fan = &around[start[vertex as usize]..start[vertex as usize + 1]];
        if fan.len() > FAN_MAX {
            return normal;
        }
        let mut sum = [0.0; 3];
        for &other in fan {
            let area = areas[other as usize];
            if dot(normal, area) > SMOOTH * dot(area, area).sqrt() {
                sum = along(sum, 1.0, area);
            }
        }
        unit(sum)
    };
    triangles
        .iter()
        .enumerate()
        .map(|(facet, corners)| corners.map(|vertex| quantised(at_corner(facet, vertex))))
        .collect()
}
