//! Convex hulls: closed, convex, small, and never a panic.

use std::f64::consts::TAU;
use std::time::{Duration, Instant};

use parry3d_f64::math::Vector as Point;
use parry3d_f64::transformation::try_convex_hull;
use proptest::prelude::*;
use sim_model::geometry::{Hull, Mesh, MeshOptions, NoHull, TriMesh, triangles};
use sim_model::{Shape, UrdfOptions};

use crate::files::{Folder, brick, joined, mapped, obj};

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn size(points: &[[f64; 3]]) -> f64 {
    let span = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        values.clone().fold(f64::MIN, f64::max) - values.fold(f64::MAX, f64::min)
    };
    (0..3).map(|axis| span(axis).powi(2)).sum::<f64>().sqrt()
}

/// Asserts what contacts rely on: Euler's formula, each edge between two faces, corners on their faces' planes and below
/// all others, and the points inside up to the error it tells.
#[track_caller]
pub fn assert_sound(hull: &Hull, points: &[[f64; 3]]) {
    let size = size(points);
    assert_eq!(
        hull.vertices.len() + hull.faces.len(),
        hull.edges.len() + 2,
        "Euler"
    );
    let sides: usize = hull.faces.iter().map(|face| face.corners.len()).sum();
    assert_eq!(sides, 2 * hull.edges.len(), "each edge has two faces");
    for edge in &hull.edges {
        assert_ne!(edge.faces[0], edge.faces[1]);
        for (face, [from, to]) in [
            (edge.faces[0], edge.ends),
            (edge.faces[1], [edge.ends[1], edge.ends[0]]),
        ] {
            let corners = &hull.faces[face as usize].corners;
            let at = corners.iter().position(|&corner| corner == from).unwrap();
            assert_eq!(corners[(at + 1) % corners.len()], to);
        }
    }
    for face in &hull.faces {
        assert!((dot(face.normal, face.normal) - 1.0).abs() < 1e-12);
        for (index, &vertex) in hull.vertices.iter().enumerate() {
            let height = dot(face.normal, vertex) - face.offset;
            // ten times the slack within which corners are joined to one face
            assert!(
                height <= 1e-4 * size,
                "vertex {index} is {height:e} above a face, size {size:e}"
            );
            if face.corners.contains(&(index as u32)) {
                assert!(
                    height >= -1e-4 * size,
                    "corner {index} is {height:e} below its face"
                );
            }
        }
        for &point in points {
            let height = dot(face.normal, point) - face.offset;
            assert!(
                height <= hull.error + 1e-12 * size,
                "{height:e} above, told {:e}",
                hull.error
            );
        }
    }
    for vertex in &hull.vertices {
        assert!(
            points.contains(vertex),
            "a corner is one of the points, to the bit"
        );
    }
}

fn hull(points: &[[f64; 3]]) -> Hull {
    let hull = Hull::from_points(points, 4096).unwrap();
    assert_sound(&hull, points);
    hull
}

#[test]
fn a_box_of_many_points_has_8_corners_6_faces_and_12_edges() {
    let mut points = Vec::new();
    for i in 0..11 {
        for j in 0..11 {
            for k in 0..11 {
                points.push([f64::from(i) * 0.1, f64::from(j) * 0.2, f64::from(k) * 0.3]);
            }
        }
    }
    let cube = hull(&points);
    assert_eq!(
        (cube.vertices.len(), cube.faces.len(), cube.edges.len()),
        (8, 6, 12)
    );
    assert!((cube.volume() - 6.0).abs() < 1e-12);
    assert_eq!(cube.extent(), [[0.0; 3], [1.0, 2.0, 3.0]]);
    let (centre, radius) = cube.bounding_sphere();
    assert_eq!(centre, [0.5, 1.0, 1.5]);
    assert!((radius - 3.5_f64.sqrt()).abs() < 1e-15);
}

#[test]
fn a_cylinder_in_f32_has_two_polygons_and_its_sides() {
    // rounded as files are, turned so that no face is along an axis, and far from the origin
    let ring = (0..32).flat_map(|step| {
        let (sin, cos) = (TAU * f64::from(step) / 32.0).sin_cos();
        [-0.5, 0.5].map(|z| [0.3 * cos, 0.3 * sin, z])
    });
    let turn = |[x, y, z]: [f64; 3]| [0.6 * x + 0.8 * z + 2.0, y, -0.8 * x + 0.6 * z];
    let points: Vec<[f64; 3]> = ring.map(|p| turn(p).map(|x| f64::from(x as f32))).collect();
    let cylinder = hull(&points);
    assert_eq!((cylinder.vertices.len(), cylinder.faces.len()), (64, 34));
    assert!(
        cylinder
            .faces
            .iter()
            .filter(|face| face.corners.len() == 32)
            .count()
            == 2
    );
    assert!(cylinder.error < 1e-6);
}

#[test]
fn fewer_vertices_leave_a_measured_error_that_falls_as_they_grow() {
    // a Fibonacci sphere of radius 1
    let points: Vec<[f64; 3]> = (0..20_000)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 20_000.0;
            let (sin, cos) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
            let out = (1.0 - z * z).sqrt();
            [out * cos, out * sin, z]
        })
        .collect();
    let mut last = f64::MAX;
    for most in [8, 16, 32, 64, 256, 1024] {
        let hull = Hull::from_points(&points, most).unwrap();
        assert_sound(&hull, &points);
        assert!(hull.vertices.len() <= most);
        // cap of one vertex's share of the sphere, 4 π / n, is 2 / n high; farthest-first is within 4 times that
        assert!(
            hull.error < 8.0 / most as f64 && hull.error < last,
            "{most}: {}",
            hull.error
        );
        last = hull.error;
    }
}

#[test]
fn hulls_of_random_clouds_are_parrys() {
    let mut seed = 1_u64;
    let mut random = move || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    for count in [5, 20, 100, 1000] {
        let points: Vec<[f64; 3]> = (0..count).map(|_| [random(), random(), random()]).collect();
        let cloud: Vec<Point> = points
            .iter()
            .map(|&[x, y, z]| Point::new(x, y, z))
            .collect();
        let (vertices, triangles) = try_convex_hull(&cloud).unwrap();
        let expected = TriMesh {
            vertices: vertices.iter().map(|p| [p.x, p.y, p.z]).collect(),
            triangles,
        };
        let actual = hull(&points);
        let share = actual.volume() / expected.signed_volume();
        assert_eq!(actual.vertices.len(), expected.vertices.len());
        // faces are planes to 1e-5 of the size only, over an area of some six times its square
        assert!((share - 1.0).abs() < 1e-4, "{share}");
    }
}

#[test]
fn a_flat_cloud_becomes_a_plate_and_a_line_nothing() {
    let sheet: Vec<[f64; 3]> = (0..100)
        .map(|i| {
            [
                f64::from(i % 10),
                f64::from(i / 10),
                0.5 * f64::from(i % 10),
            ]
        })
        .collect();
    let plate = Hull::from_points(&sheet, 64).unwrap();
    assert_eq!(
        (plate.vertices.len(), plate.faces.len(), plate.edges.len()),
        (8, 6, 12)
    );
    let area = 9.0 * 81.0_f64.mul_add(1.25, 0.0).sqrt();
    let thickness = 1e-3 * size(&sheet);
    assert!((plate.volume() / (area * thickness) - 1.0).abs() < 1e-9);
    let line: Vec<[f64; 3]> = (0..100)
        .map(|i| [f64::from(i), 2.0 * f64::from(i), 0.0])
        .collect();
    assert_eq!(Hull::from_points(&line, 64), Err(NoHull::Thin));
    for cloud in [
        vec![],
        vec![[1.0, 2.0, 3.0]; 1000],
        vec![[0.0; 3], [1.0; 3]],
        vec![[f64::NAN; 3]; 9],
    ] {
        assert_eq!(Hull::from_points(&cloud, 64), Err(NoHull::Thin));
    }
    assert_eq!(
        Hull::from_points(&[[f64::INFINITY, 0.0, 0.0], [0.0; 3], [1.0; 3]], 64),
        Err(NoHull::Thin)
    );
}

#[test]
fn balls_by_latitude_and_longitude_whose_points_are_a_little_off_have_sound_hulls() {
    let mut seed = 1_u64;
    let mut random = move || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    for _ in 0..2000 {
        let rings = 3 + (4.0 * (random() + 1.0)) as u32;
        let off = 10_f64.powf(-10.0 + 6.0 * random());
        let points: Vec<[f64; 3]> = (0..12 * rings)
            .map(|i| {
                let (sin, cos) = (TAU * f64::from(i % 12) / 12.0).sin_cos();
                let (out, up) = (TAU * 0.5 * f64::from(i / 12) / f64::from(rings - 1)).sin_cos();
                [out * cos, out * sin, up].map(|x| x + off * random())
            })
            .collect();
        hull(&points);
    }
}

#[test]
fn a_million_points_on_a_ball_take_no_minute() {
    let points: Vec<[f64; 3]> = (0..1_000_000)
        .map(|i| {
            let (a, b) = (
                f64::from(i) * 0.618_034 % 1.0 * TAU,
                f64::from(i) * 1e-6 * 2.0 - 1.0,
            );
            let out = (1.0 - b * b).sqrt();
            [out * a.cos(), out * a.sin(), b]
        })
        .collect();
    let start = Instant::now();
    let hull = Hull::from_points(&points, 64).unwrap();
    assert!(
        start.elapsed() < Duration::from_secs(60),
        "{:?}",
        start.elapsed()
    );
    assert!(hull.vertices.len() <= 64 && hull.error < 0.1);
}

/// Coordinates that break hulls: grids, doubles, neighbours in the last bit, planes, huge and tiny ones.
fn nasty_cloud() -> impl Strategy<Value = Vec<[f64; 3]>> {
    let grid = prop::array::uniform3((-2..=2).prop_map(f64::from));
    let near_grid = (grid.clone(), prop::array::uniform3(-1.0..1.0), 1..18).prop_map(
        |(p, jitter, digits): ([f64; 3], [f64; 3], i32)| {
            [0, 1, 2].map(|i| p[i] + jitter[i] * 10_f64.powi(-digits))
        },
    );
    let wild = prop::array::uniform3(any::<f64>());
    let flat = prop::array::uniform2(-1.0..1.0).prop_map(|[x, y]| [x, y, 0.3 * x - 0.7 * y]);
    let rounded = prop::array::uniform3(-1.0_f32..1.0).prop_map(|p| p.map(f64::from));
    let tiny = prop::array::uniform3(-1e-300..1e-300);
    let mixed = prop_oneof![grid.clone(), near_grid.clone(), flat.clone(), tiny.clone()];
    let cloud = prop_oneof![
        prop::collection::vec(grid, 0..80),
        prop::collection::vec(near_grid, 0..80),
        prop::collection::vec(flat, 0..80),
        prop::collection::vec(rounded, 0..80),
        prop::collection::vec(tiny, 0..20),
        prop::collection::vec(mixed, 0..80),
        prop::collection::vec(wild, 0..20),
    ];
    (
        cloud,
        prop::array::uniform3(prop_oneof![Just(1.0), Just(1e-9), Just(1e9)]),
    )
        .prop_map(|(cloud, scale)| {
            cloud
                .into_iter()
                .map(|p| [0, 1, 2].map(|i| p[i] * scale[i]))
                .collect()
        })
}

/// Whether some of the first points span a tetrahedron that no rounding makes.
fn is_fat(cloud: &[[f64; 3]]) -> bool {
    let some = &cloud[..cloud.len().min(9)];
    let size = size(cloud);
    let from = |a: &[f64; 3], b: &[f64; 3]| [0, 1, 2].map(|i| (b[i] - a[i]) / size);
    let volume = |a, b, c, d| {
        let ([ux, uy, uz], [vx, vy, vz], w) = (from(a, b), from(a, c), from(a, d));
        dot([uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx], w).abs()
    };
    let pairs = || some.iter().flat_map(|a| some.iter().map(move |b| (a, b)));
    size.is_finite() && pairs().any(|(a, b)| pairs().any(|(c, d)| volume(a, b, c, d) > 1e-3))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nasty_clouds_have_a_sound_hull_or_none(cloud in nasty_cloud(), most in prop_oneof![Just(8), Just(64), Just(4096)]) {
        let hull = Hull::from_points(&cloud, most);
        prop_assert!(hull.is_ok() || !is_fat(&cloud), "{:?}", hull);
        if let Ok(hull) = hull {
            prop_assert!(hull.vertices.len() <= most);
            let plate = hull.vertices.iter().any(|vertex| !cloud.contains(vertex));
            if plate {
                prop_assert_eq!(hull.vertices.len() + hull.faces.len(), hull.edges.len() + 2);
            } else {
                assert_sound(&hull, &cloud);
            }
        }
    }
}

/// An L of two bricks that share a side, as one closed surface.
pub fn angle() -> TriMesh {
    let outline = [
        [0.0, 0.0],
        [2.0, 0.0],
        [2.0, 1.0],
        [1.0, 1.0],
        [1.0, 2.0],
        [0.0, 2.0],
    ];
    let mut mesh = TriMesh::default();
    for z in [0.0, 1.0] {
        mesh.vertices.extend(outline.map(|[x, y]| [x, y, z]));
    }
    for corner in 0..6_u32 {
        let next = (corner + 1) % 6;
        mesh.triangles
            .extend([[corner, next, next + 6], [corner, next + 6, corner + 6]]);
    }
    for [a, b, c] in [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]] {
        mesh.triangles.extend([[a, c, b], [a + 6, b + 6, c + 6]]);
    }
    mesh
}

#[test]
fn decomposition_fills_a_concave_mesh_and_leaves_a_convex_one_whole() {
    let folder = Folder::new("decompose");
    let load = |mesh: &TriMesh, convex_decomposition: bool| {
        let options = MeshOptions {
            convex_decomposition,
            ..MeshOptions::default()
        };
        Mesh::load(&folder.put("a.obj", obj(mesh)), [1.0; 3], &options).unwrap()
    };
    let volume = |mesh: &Mesh| mesh.hulls.iter().map(Hull::volume).sum::<f64>();
    let whole = load(&angle(), false);
    assert_eq!(whole.hulls.len(), 1);
    assert!((volume(&whole) - 3.5).abs() < 1e-12);
    let parts = load(&angle(), true);
    assert!(
        (2..=4).contains(&parts.hulls.len()),
        "{}",
        parts.hulls.len()
    );
    // the cut is within a voxel of the corner: a 64th of the longest side
    assert!(
        (volume(&parts) - 3.0).abs() < 3.0 / 64.0 * 2.0,
        "{}",
        volume(&parts)
    );
    assert!(parts.notes.iter().any(|note| note.contains("convex parts")));
    for hull in &parts.hulls {
        assert_sound(hull, &hull.vertices);
        assert!(hull.vertices.len() <= 64);
    }
    assert_eq!(load(&brick(), true).hulls, load(&brick(), false).hulls);
    // two bricks apart are two hulls
    let apart = joined(&[brick(), mapped(&brick(), |[x, y, z]| [x + 3.0, y, z])]);
    assert_eq!(load(&apart, true).hulls.len(), 2);
}

#[test]
fn hull_error_and_flat_meshes_are_noted_with_the_link() {
    let folder = Folder::new("notes");
    folder.put("ball.obj", obj(&triangles(&Shape::Sphere { radius: 1.0 })));
    let robot = folder.robot("ball.obj", "").unwrap();
    let note = robot
        .notes
        .iter()
        .find(|note| note.contains("mesh_max_hull_vertices"))
        .unwrap();
    assert!(
        note.contains("`hand`") && note.contains("ball.obj") && note.contains("64 vertices"),
        "{note}"
    );
    let Shape::Mesh(mesh) = &robot.links[0].collisions[0].shape else {
        panic!()
    };
    assert!(mesh.hulls[0].vertices.len() == 64 && mesh.hulls[0].error > 0.01);
    // mass is the mesh's own, not that of the simplified hull
    let ball = 4000.0 / 3.0 * std::f64::consts::PI;
    assert!((robot.links[0].inertial.unwrap().mass / ball - 1.0).abs() < 0.01);
}

#[test]
fn numbers_of_hull_vertices_out_of_bounds_are_refused() {
    for max_hull_vertices in [0, 7, 1025] {
        let options = UrdfOptions {
            meshes: MeshOptions {
                max_hull_vertices,
                ..MeshOptions::default()
            },
            ..UrdfOptions::default()
        };
        let text = "<robot name=\"r\"><link name=\"a\"/></robot>";
        let error = sim_model::Robot::from_urdf_text(text, "r.urdf", options)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("mesh_max_hull_vertices") && error.contains("between 8 and 1024"),
            "{error}"
        );
    }
}
