//! Concave meshes as several convex hulls, by approximate convex decomposition (parry3d's V-HACD, Mamou 2016).

use std::panic::catch_unwind;

use parry3d_f64::math::Vector as Point;
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};

use super::hull::Hull;
use super::trimesh::TriMesh;

/// Share of the hull's volume that a mesh may lack and still count as convex [–].
const CONVEX: f64 = 1e-3;
/// Parts that are aimed at; a mesh is halved until each is convex enough, up to twice as many.
const PARTS: u32 = 32;
/// Voxels along the longest side.
const RESOLUTION: u32 = 64;

/// Hulls that cover a mesh together, the mesh's own where it is convex; `None` where none can be made.
pub(super) fn decompose(
    mesh: &TriMesh,
    closed: bool,
    whole: Hull,
    vertices_max: usize,
) -> Option<Vec<Hull>> {
    let volume = mesh.signed_volume();
    // measured on the hull of all points: that of few vertices is smaller
    let full = Hull::of(&mesh.vertices, usize::MAX)?.volume();
    if closed && volume >= (1.0 - CONVEX) * full {
        return Some(vec![whole]);
    }
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
    // V-HACD takes the hulls of clouds that no check foresees, and parry3d panics where such a hull fails; the closure
    // only reads what it borrows
    let parts = catch_unwind(|| {
        let parts = VHACD::decompose(&parameters, &points, &mesh.triangles, true);
        parts.compute_primitive_intersections(&points, &mesh.triangles)
    });
    // a part without surface is inside others; a flat or thin one adds nothing to its neighbours
    let hulls: Vec<Hull> = parts
        .ok()?
        .iter()
        .map(|part| {
            part.iter()
                .map(|point| [point.x, point.y, point.z])
                .collect::<Vec<_>>()
        })
        .filter_map(|part| Hull::of(&part, vertices_max))
        .collect();
    (!hulls.is_empty()).then_some(hulls)
}
