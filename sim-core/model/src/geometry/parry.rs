//! Convex hulls and convex decompositions from parry3d, each checked.

use std::collections::HashMap;
use std::panic::catch_unwind;

use parry3d_f64::math::Vector as Point;
use parry3d_f64::transformation::try_convex_hull;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};

use super::trimesh::TriMesh;
use super::vector::{Vector, add, area_vector, dot, extent, longest, norm, scale, size, sub};

/// Points nearer to each other than this are merged, relative to the size. Thinner facets have no normal.
const MERGED: f64 = 1e-7;
/// How far a point may lie outside, relative to the size.
const OUTSIDE: f64 = 1e-6;
/// Target number of parts. A mesh is halved until each part is convex enough, up to twice as many.
const PARTS: u32 = 32;
/// Voxels along the longest side.
const RESOLUTION: u32 = 64;

/// Shifts of the points with which a failed hull is tried again, relative to the size.
const SHIFTS: [f64; 6] = [0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5];

/// Triangles of the hull of some of the points, counter-clockwise from outside, as indices of the points; `None` where
/// nothing that parry3d makes is closed, convex and around them all.
///
/// parry3d left 109 of 4000 latitude-longitude balls open (points off by less than 1e-4), and left points out of 509 of
/// 4000 sheets of thickness 1e-5. So each hull is checked, and tried again with slightly shifted points.
pub(super) fn hull(points: &[Vector], some: &[u32]) -> Option<Vec<[u32; 3]>> {
    let places: Vec<Vector> = some.iter().map(|&index| points[index as usize]).collect();
    let [low, high] = extent(&places);
    let (middle, size) = (scale(add(low, high), 0.5), size(&places));
    let mut cells = HashMap::new();
    let mut merged: Vec<(Vector, u32)> = Vec::new();
    for (&place, &index) in places.iter().zip(some) {
        let unit = scale(sub(place, middle), 1.0 / size);
        let cell = unit.map(|x| (x / MERGED).round() as i64);
        cells
            .entry(cell)
            .or_insert_with(|| merged.push((unit, index)));
    }
    SHIFTS.iter().find_map(|&shift| {
        let triangles = try_hull(&merged, shift)?;
        let inside = |triangle: &[u32; 3]| {
            let corners = triangle.map(|corner| points[corner as usize]);
            let area = area_vector(corners);
            let (thin, slack) = (
                MERGED * size * longest(corners),
                OUTSIDE * size * norm(area),
            );
            norm(area) <= thin
                || places
                    .iter()
                    .all(|&place| dot(area, sub(place, corners[0])) <= slack)
        };
        (is_sphere(&triangles) && triangles.iter().all(inside)).then_some(triangles)
    })
}

/// parry3d's hull of points with their indices, each shifted by up to `shift` along each axis.
fn try_hull(points: &[(Vector, u32)], shift: f64) -> Option<Vec<[u32; 3]>> {
    // Knuth's MMIX generator from a fixed seed: the same file has the same hull
    let mut random = 1_u64;
    let mut shifted = |x: f64| {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        x + shift * ((random >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
    };
    let cloud: Vec<Point> = points
        .iter()
        .map(|&(place, _)| Point::from(place.map(&mut shifted)))
        .collect();
    // quickhull in floating point can meet a contradiction anywhere, and parry3d asserts that it does not
    let (corners, triangles) = catch_unwind(|| try_convex_hull(&cloud)).ok()?.ok()?;
    let bits = |point: &Point| [point.x.to_bits(), point.y.to_bits(), point.z.to_bits()];
    let index_of: HashMap<_, _> = cloud
        .iter()
        .map(bits)
        .zip(points.iter().map(|point| point.1))
        .collect();
    let index = |corner: u32| index_of.get(&bits(&corners[corner as usize])).copied();
    triangles
        .iter()
        .map(|&[a, b, c]| Some([index(a)?, index(b)?, index(c)?]))
        .collect()
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
