//! What parry3d makes, checked: convex hulls and convex decompositions.

use std::collections::HashMap;
use std::panic::catch_unwind;

use parry3d_f64::math::Vector as Point;
use parry3d_f64::transformation::try_convex_hull;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};

use super::trimesh::TriMesh;
use super::vector::{Vector, add, area_vector, dot, extent, longest, norm, scale, size, sub};

/// Most points whose hull is asked for: its time grows with their square, 0.1 s here.
const POINTS_MAX: usize = 4096;
/// Points nearer to each other than this are one, and facets thinner have no normal, relative to the size.
const MERGED: f64 = 1e-7;
/// How far a point may lie outside, relative to the size.
const OUTSIDE: f64 = 1e-6;
/// Parts that a decomposition aims at; a mesh is halved until each is convex enough, up to twice as many.
const PARTS: u32 = 32;
/// Voxels along the longest side.
const RESOLUTION: u32 = 64;

/// Triangles of the hull of points, counter-clockwise from outside, as indices of the points; `None` where the points are
/// too many, or what parry3d makes is not closed, convex and around them all.
///
/// On the hull of 1592 published meshes it always is. Of 4000 latitude-longitude balls whose points are off by less than
/// 1e-4, 109 came out open, and of 4000 sheets of some 1e-5 thickness 509 left points out.
pub(super) fn hull(points: &[Vector]) -> Option<Vec<[u32; 3]>> {
    let [low, high] = extent(points);
    let (middle, size) = (scale(add(low, high), 0.5), size(points));
    let mut cells = HashMap::new();
    let mut merged = Vec::new();
    for (index, &point) in points.iter().enumerate() {
        let unit = scale(sub(point, middle), 1.0 / size);
        let cell = unit.map(|x| (x / MERGED).round() as i64);
        cells
            .entry(cell)
            .or_insert_with(|| merged.push((unit, index as u32)));
        if merged.len() > POINTS_MAX {
            return None;
        }
    }
    let cloud: Vec<Point> = merged
        .iter()
        .map(|&([x, y, z], _)| Point::new(x, y, z))
        .collect();
    // quickhull in floating point can meet a contradiction anywhere, and parry3d asserts that it does not
    let (corners, triangles) = catch_unwind(|| try_convex_hull(&cloud)).ok()?.ok()?;
    let bits = |[x, y, z]: Vector| [x.to_bits(), y.to_bits(), z.to_bits()];
    let index_of: HashMap<_, _> = merged
        .iter()
        .map(|&(unit, index)| (bits(unit), index))
        .collect();
    let index = |corner: u32| {
        index_of
            .get(&bits(corners[corner as usize].into()))
            .copied()
    };
    let triangles: Vec<[u32; 3]> = triangles
        .iter()
        .map(|&[a, b, c]| Some([index(a)?, index(b)?, index(c)?]))
        .collect::<Option<_>>()?;
    let inside = |triangle: &[u32; 3]| {
        let places = triangle.map(|corner| points[corner as usize]);
        let area = area_vector(places);
        let (thin, slack) = (MERGED * size * longest(places), OUTSIDE * size * norm(area));
        norm(area) <= thin
            || points
                .iter()
                .all(|&point| dot(area, sub(point, places[0])) <= slack)
    };
    (is_sphere(&triangles) && triangles.iter().all(inside)).then_some(triangles)
}

/// Whether every edge is run through once in each direction, and the whole is a sphere by Euler's formula.
fn is_sphere(triangles: &[[u32; 3]]) -> bool {
    let mut ways: Vec<(u32, u32)> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .collect();
    ways.sort_unstable();
    let once = ways.windows(2).all(|pair| pair[0] != pair[1]);
    let both = ways
        .iter()
        .all(|&(from, to)| ways.binary_search(&(to, from)).is_ok());
    let mut corners: Vec<u32> = ways.iter().map(|way| way.0).collect();
    corners.dedup();
    once && both && corners.len() + triangles.len() == ways.len() / 2 + 2
}

/// Clouds of points on a mesh's surface whose hulls cover it together, by V-HACD (Mamou 2016); `None` where it fails.
pub(super) fn convex_parts(mesh: &TriMesh) -> Option<Vec<Vec<Vector>>> {
    let points: Vec<Point> = mesh
        .vertices
        .iter()
        .map(|&[x, y, z]| Point::new(x, y, z))
        .collect();
    let parameters = VHACDParameters {
        resolution: RESOLUTION,
        max_convex_hulls: PARTS,
        ..VHACDParameters::default()
    };
    // it takes hulls of its own that may fail, by a panic
    let parts = catch_unwind(|| {
        let parts = VHACD::decompose(&parameters, &points, &mesh.triangles, true);
        parts.compute_primitive_intersections(&points, &mesh.triangles)
    });
    let place = |point: &Point| [point.x, point.y, point.z];
    Some(
        parts
            .ok()?
            .iter()
            .map(|part| part.iter().map(place).collect())
            .collect(),
    )
}
