//! Thin meshes: their hulls are as sound as those of thick ones, and their mass is their own.

use std::f64::consts::TAU;
use std::sync::Arc;

use sim_model::geometry::{Hull, Mesh, MeshOptions, NoHull, TriMesh, mass_properties};
use sim_model::{Inertial, Shape};

use crate::files::{Folder, assert_alike, mapped, obj};
use crate::hulls::{angle, assert_sound, dot};

/// Numbers between −1 and 1 from a fixed seed.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A number whose logarithm is uniform.
    fn power(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(low + (high - low) * 0.5 * (self.next() + 1.0))
    }

    /// Rows of a rotation.
    fn rotation(&mut self) -> [[f64; 3]; 3] {
        let [w, x, y, z] = loop {
            let q = [self.next(), self.next(), self.next(), self.next()];
            let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
            if length > 0.1 {
                break q.map(|x| x / length);
            }
        };
        [
            [
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - w * z),
                2.0 * (x * z + w * y),
            ],
            [
                2.0 * (x * y + w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - w * x),
            ],
            [
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
            ],
        ]
    }
}

/// A prism about z with corners on an ellipse.
fn prism(corners: usize, [a, b, thickness]: [f64; 3]) -> TriMesh {
    let mut mesh = TriMesh::default();
    let count = corners as u32;
    for i in 0..corners {
        let (sin, cos) = (TAU * (i as f64 + 0.5) / corners as f64).sin_cos();
        for z in [-0.5, 0.5] {
            mesh.vertices.push([a * cos, b * sin, z * thickness]);
        }
    }
    for i in 0..count {
        let next = (i + 1) % count;
        mesh.triangles.push([2 * i, 2 * next, 2 * next + 1]);
        mesh.triangles.push([2 * i, 2 * next + 1, 2 * i + 1]);
        if i > 0 && next > 0 {
            mesh.triangles.push([1, 2 * i + 1, 2 * next + 1]);
            mesh.triangles.push([0, 2 * next, 2 * i]);
        }
    }
    mesh
}

/// Volume of a prism.
fn volume(corners: usize, [a, b, thickness]: [f64; 3]) -> f64 {
    0.5 * corners as f64 * (TAU / corners as f64).sin() * a * b * thickness
}

/// Asserts that no corner is above a face by more than a share of the thickness, nor by the rounding of its coordinates.
#[track_caller]
fn assert_convex(hull: &Hull, thickness: f64) {
    let (center, radius) = hull.bounding_sphere();
    let rounding = 1e-14 * (radius + dot(center, center).sqrt());
    for face in &hull.faces {
        for &vertex in &hull.vertices {
            let height = dot(face.normal, vertex) - face.offset;
            assert!(
                height <= 0.01 * thickness + rounding,
                "{height:e} above a face, thickness {thickness:e}"
            );
        }
    }
}

#[test]
fn discs_needles_and_slabs_of_any_thickness_have_sound_hulls_wherever_they_lie() {
    let mut random = Random(1);
    for case in 0..1500 {
        let corners = [3, 4, 7, 32, 64][case % 5];
        let long = random.power(-2.0, 1.0);
        let sides = match case % 3 {
            0 => [long, long * random.power(-0.5, 0.0), 0.0],
            1 => [long, long * random.power(-7.0, -3.0), 0.0],
            _ => [long, long * random.power(-2.0, 0.0), 0.0],
        };
        let share = random.power(-7.0, -2.0);
        let thickness = match case % 3 {
            1 => sides[1] * random.power(-0.5, 0.0),
            _ => 2.0 * long * share,
        };
        let sides = [sides[0], sides[1], thickness];
        let (rows, far) = (random.rotation(), random.power(-2.0, 2.0) * long);
        let mesh = mapped(&prism(corners, sides), |p| {
            rows.map(|row| dot(row, p) + far)
        });
        let hull = Hull::from_points(&mesh.vertices, 1024).unwrap_or_else(|why| {
            panic!("case {case}, {corners} corners, {sides:?}, {far} away: {why}")
        });
        assert!(!hull.flat);
        assert_sound(&hull, &mesh.vertices);
        assert_convex(&hull, thickness);
        assert_eq!(
            (hull.vertices.len(), hull.faces.len()),
            (2 * corners, corners + 2),
            "case {case}: {sides:?}"
        );
        // each corner is rounded to 1e-16 of its distance
        let slack = 1e-15 * (long + far) / sides[1].min(thickness) + 1e-12;
        let share = hull.volume() / volume(corners, sides);
        assert!((share - 1.0).abs() < slack, "case {case}: {share}");
        let few = Hull::from_points(&mesh.vertices, 64).unwrap();
        assert!(few.vertices.len() <= 64);
        assert_sound(&few, &mesh.vertices);
        assert_convex(&few, thickness);
        // of a ring of 64 corners each second one is there, above and below
        let share = few.volume() / volume(corners, sides);
        assert!(share > 0.97, "case {case}: {share}");
    }
}

#[test]
fn a_floor_scan_with_noise_is_a_floor() {
    let mut random = Random(2);
    for case in 0..40 {
        let noise = random.power(-7.0, -3.5);
        let (rows, far) = match case % 2 {
            0 => ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], 0.0),
            _ => (random.rotation(), random.power(-2.0, 2.0)),
        };
        let points: Vec<[f64; 3]> = (0..2500)
            .map(|i| {
                let place = [
                    f64::from(i % 50) / 49.0,
                    f64::from(i / 50) / 49.0,
                    noise * random.next(),
                ];
                rows.map(|row| dot(row, place) + far)
            })
            .collect();
        for most in [16, 64, 1024] {
            let hull = Hull::from_points(&points, most).unwrap();
            assert_sound(&hull, &points);
            assert_convex(&hull, noise);
            let share = hull.volume() / (2.0 * noise);
            // 16 corners cut some of the floor's off; 64 are nearly all that there are
            let (off, least) = if most == 16 { (5.0, 0.7) } else { (0.05, 0.97) };
            assert!(hull.error <= off * noise, "{:e}", hull.error / noise);
            assert!((least..1.0).contains(&share), "case {case}: {share}");
        }
    }
}

#[test]
fn thin_meshes_rounded_to_f32_have_hulls_too() {
    let mut random = Random(3);
    for case in 0..300 {
        let sides = [1.0, random.power(-2.0, 0.0), random.power(-7.0, -3.0)];
        let (rows, far) = (random.rotation(), 10.0 * random.next());
        let mesh = mapped(&prism(32, sides), |p| {
            rows.map(|row| f64::from((dot(row, p) + far) as f32))
        });
        for most in [8, 64, 1024] {
            let hull = Hull::from_points(&mesh.vertices, most)
                .unwrap_or_else(|why| panic!("case {case}, {sides:?}: {why}"));
            assert_sound(&hull, &mesh.vertices);
        }
    }
}

#[test]
fn only_a_sheet_without_thickness_is_flat() {
    let sheet = |thickness: f64| {
        let mesh = prism(5, [1.0, 1.0, thickness]);
        Hull::from_points(&mesh.vertices, 64)
    };
    for thickness in [1e-3, 1e-5, 2e-7, 1e-8] {
        let hull = sheet(thickness).unwrap();
        assert!(!hull.flat && (hull.vertices.len(), hull.faces.len()) == (10, 7));
        let high = hull.extent()[1][2];
        assert_eq!(high, 0.5 * thickness);
    }
    assert!(sheet(0.0).unwrap().flat);
    let needle = prism(5, [1.0, 0.0, 0.0]);
    assert_eq!(Hull::from_points(&needle.vertices, 64), Err(NoHull::Thin));
}

/// Mass properties of a cuboid at the origin.
fn cuboid([x, y, z]: [f64; 3], density: f64) -> Inertial {
    let mass = density * x * y * z;
    let moments = [y * y + z * z, z * z + x * x, x * x + y * y];
    Inertial {
        mass,
        pos: [0.0; 3],
        inertia: std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                if i == j {
                    mass / 12.0 * moments[i]
                } else {
                    0.0
                }
            })
        }),
    }
}

#[test]
fn thin_plates_and_needles_weigh_and_turn_as_their_density_says() {
    let folder = Folder::new("thin-mass");
    let mut random = Random(4);
    for case in 0..200 {
        let long = random.power(-1.0, 0.5);
        let sides = match case % 2 {
            0 => [
                long,
                long * random.power(-1.0, 0.0),
                long * random.power(-7.0, -3.0),
            ],
            _ => {
                let width = random.power(-7.0, -3.0);
                [long, long * width, long * width * random.power(-0.5, 0.0)]
            }
        };
        let rows = random.rotation();
        // corners of a square on the ellipse
        let [a, b, c] = [sides[0] / 2_f64.sqrt(), sides[1] / 2_f64.sqrt(), sides[2]];
        let mesh = mapped(&prism(4, [a, b, c]), |p| rows.map(|row| dot(row, p)));
        let loaded = folder.load("a.obj", obj(&mesh)).unwrap();
        assert!(loaded.closed, "case {case}: {sides:?}");
        let computed = mass_properties(&Shape::Mesh(Arc::new(loaded)), 700.0).unwrap();
        let exact = cuboid(sides, 700.0);
        // in the frame of the corners: R I Rᵀ
        let turned = |i: usize, j: usize| -> f64 {
            (0..3)
                .map(|k| rows[i][k] * exact.inertia[k][k] * rows[j][k])
                .sum()
        };
        let expected = Inertial {
            inertia: std::array::from_fn(|i| std::array::from_fn(|j| turned(i, j))),
            ..exact
        };
        // corners are rounded to 1e-16 of the length, and a needle is as wide as 1e-7 of it
        assert_alike(&computed, &expected, 1e-8);
    }
}

#[test]
fn a_thin_angle_is_decomposed_and_a_thin_plate_stays_whole() {
    let folder = Folder::new("thin-parts");
    let load = |mesh: &TriMesh| {
        let options = MeshOptions {
            convex_decomposition: true,
            ..MeshOptions::default()
        };
        Mesh::load(&folder.put("a.obj", obj(mesh)), [1.0; 3], &options).unwrap()
    };
    for thickness in [1e-3, 1e-5, 1e-7] {
        assert_eq!(load(&prism(4, [1.0, 1.0, thickness])).hulls.len(), 1);
        let parts = load(&mapped(&angle(), |[x, y, z]| [x, y, z * thickness])).hulls;
        assert!((2..=4).contains(&parts.len()), "{}", parts.len());
        for part in &parts {
            assert!(!part.flat);
            assert_sound(part, &part.vertices);
            let [low, high] = part.extent();
            let share = (high[2] - low[2]) / thickness;
            assert!((share - 1.0).abs() < 1e-6, "{share} of {thickness:e}");
        }
        // the cut is within a voxel of the corner: a 64th of the longest side
        let volume = parts.iter().map(Hull::volume).sum::<f64>() / thickness;
        assert!((volume - 3.0).abs() < 3.0 / 64.0 * 2.0, "{volume}");
    }
}
