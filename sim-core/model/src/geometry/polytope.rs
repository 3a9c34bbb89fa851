//! Triangles around points: parry3d's hull of all of them, or of the few farthest out.

use super::parry;
use super::stretch::{NoHull, Stretched, stretched};
use super::vector::{Vector, add, area_vector, dot, extent, longest, norm, scale, size, sub, unit};

/// Most work on points that a thinned cloud lacks [points times triangles]: a second.
const REFINE_MAX: usize = 1 << 28;
/// Most iterations of that search; each leaves a small share of the error.
const ROUNDS: usize = 8;
/// Most points of a hull: its time can grow with their square, 0.1 s here.
const POINTS_MAX: usize = 4096;
/// Directions along each edge of a cube around larger clouds; the farthest point in each of the 6 × 22² directions is kept.
const DIRECTIONS: usize = 22;
/// Points nearer to the hull than this are left out where the number of vertices is limited, relative to the size.
const TOLERANCE: f64 = 1e-6;

/// Triangles of the hull of points, counter-clockwise from outside, as indices of the points; with at most `vertices_max`
/// corners, those farthest out.
///
/// # Errors
/// Points without extent in all three directions, and hulls that cannot be computed.
pub(super) fn triangles_around(
    points: &[Vector],
    vertices_max: usize,
) -> Result<Vec<[u32; 3]>, NoHull> {
    triangles_around_stretched(&stretched(points)?, vertices_max)
}

/// The same, of points that are not thin.
pub(super) fn triangles_around_stretched(
    stretched: &Stretched<'_>,
    vertices_max: usize,
) -> Result<Vec<[u32; 3]>, NoHull> {
    let (points, start) = (stretched.points.as_ref(), stretched.simplex);
    // few corners of a large cloud are found without the hull of all
    let work = points
        .len()
        .saturating_mul(vertices_max.saturating_mul(vertices_max));
    if points.len() > POINTS_MAX && work <= REFINE_MAX {
        let all = (0..points.len() as u32).collect();
        return farthest_first(points, start, all, vertices_max).ok_or(NoHull::Failed);
    }
    let mut some = outermost(points);
    let mut all = parry::hull(points, &some).ok_or(NoHull::Failed)?;
    // a thinned cloud gets back what stands out of its hull
    let thinned = some.len() < points.len();
    for _ in 0..if thinned { ROUNDS } else { 0 } {
        if points.len() * all.len() > REFINE_MAX {
            break;
        }
        let missing = standing_out(points, &all);
        if missing.is_empty() || some.len() + missing.len() > 2 * POINTS_MAX {
            break;
        }
        some.extend(missing);
        all = parry::hull(points, &some).ok_or(NoHull::Failed)?;
    }
    let mut corners: Vec<u32> = all.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    if corners.len() <= vertices_max {
        return Ok(all);
    }
    farthest_first(points, start, corners, vertices_max).ok_or(NoHull::Failed)
}

/// The farthest point above each triangle, where there is one.
fn standing_out(points: &[Vector], triangles: &[[u32; 3]]) -> Vec<u32> {
    let tolerance = TOLERANCE * size(points);
    let mut vertices = Vec::new();
    for (normal, base) in planes(points, triangles, tolerance) {
        let mut farthest = (tolerance, None);
        for (index, &point) in points.iter().enumerate() {
            let height = dot(normal, sub(point, base));
            if height > farthest.0 {
                farthest = (height, Some(index as u32));
            }
        }
        vertices.extend(farthest.1);
    }
    vertices.sort_unstable();
    vertices.dedup();
    vertices
}

/// Unit normal of each triangle and a point of it; slivers have no normal to speak of and are left out.
fn planes(points: &[Vector], triangles: &[[u32; 3]], thin: f64) -> Vec<(Vector, Vector)> {
    let places = triangles
        .iter()
        .map(|triangle| triangle.map(|corner| points[corner as usize]));
    places
        .filter(|&places| norm(area_vector(places)) > thin * longest(places))
        .map(|places| (unit(area_vector(places)), places[0]))
        .collect()
}

/// Grows a hull from a tetrahedron by the farthest of the points outside, until it has enough corners.
fn farthest_first(
    points: &[Vector],
    start: [u32; 4],
    mut outside: Vec<u32>,
    vertices_max: usize,
) -> Option<Vec<[u32; 3]>> {
    let tolerance = TOLERANCE * size(points);
    let mut chosen = start.to_vec();
    loop {
        let hull = parry::hull(points, &chosen)?;
        let planes = planes(points, &hull, tolerance);
        // the farthest point above each plane; what is inside stays inside, since the hull only grows
        let mut farthest = vec![(0.0, 0); planes.len()];
        outside.retain(|&point| {
            let place = points[point as usize];
            let heights = planes
                .iter()
                .map(|&(normal, base)| dot(normal, sub(place, base)));
            let (plane, height) =
                heights.enumerate().fold(
                    (0, 0.0),
                    |best, next| if next.1 > best.1 { next } else { best },
                );
            if height > tolerance && height > farthest[plane].0 {
                farthest[plane] = (height, point);
            }
            height > tolerance
        });
        farthest.retain(|&(height, _)| height > 0.0);
        farthest.sort_by(|a, b| b.0.total_cmp(&a.0));
        // one by one while they are few; of many corners the place of each matters less than the time
        let room = vertices_max.max(4) - chosen.len();
        farthest.truncate(room.min(1 + chosen.len() / 64));
        if farthest.is_empty() {
            return Some(hull);
        }
        chosen.extend(farthest.iter().map(|&(_, point)| point));
    }
}

/// Indices of all points, or of a large cloud those farthest from its middle in each of many directions.
fn outermost(points: &[Vector]) -> Vec<u32> {
    let all = 0..points.len() as u32;
    if points.len() <= POINTS_MAX {
        return all.collect();
    }
    let [low, high] = extent(points);
    let middle = scale(add(low, high), 0.5);
    let mut farthest = vec![(0.0, None); 6 * DIRECTIONS * DIRECTIONS];
    for index in all {
        let ray = sub(points[index as usize], middle);
        let axis = (1..3).fold(0, |best, axis| {
            if ray[axis].abs() > ray[best].abs() {
                axis
            } else {
                best
            }
        });
        if ray[axis] == 0.0 {
            continue; // the middle itself
        }
        let side = 2 * axis + usize::from(ray[axis] > 0.0);
        // a ray meets the cube's face at −1 to 1 along both other axes
        let cell = |other: usize| {
            let place = 0.5 * (ray[(axis + other) % 3] / ray[axis] + 1.0);
            ((place * DIRECTIONS as f64) as usize).min(DIRECTIONS - 1)
        };
        let slot = &mut farthest[(side * DIRECTIONS + cell(1)) * DIRECTIONS + cell(2)];
        let distance = dot(ray, ray);
        if distance > slot.0 {
            *slot = (distance, Some(index));
        }
    }
    farthest
        .into_iter()
        .filter_map(|(_, point)| point)
        .collect()
}
