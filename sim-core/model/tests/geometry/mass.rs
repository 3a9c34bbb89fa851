//! Mass properties against closed forms.

use std::f64::consts::PI;
use std::sync::Arc;

use sim_model::geometry::{DENSITY, TriMesh, mass_properties, triangles};
use sim_model::{Inertial, Shape};

use crate::files::{Folder, assert_alike, brick, inside_out, joined, mapped, obj, unit_density};

fn properties(shape: Shape) -> Inertial {
    mass_properties(&shape, 1.0).unwrap()
}

/// A body centred on its frame, with these moments.
fn body(mass: f64, moments: [f64; 3]) -> Inertial {
    let mut inertia = [[0.0; 3]; 3];
    for axis in 0..3 {
        inertia[axis][axis] = moments[axis];
    }
    Inertial {
        mass,
        pos: [0.0; 3],
        inertia,
    }
}

/// The solid that an OBJ file of these triangles bounds.
#[track_caller]
fn of_mesh(test: &str, mesh: &TriMesh) -> Inertial {
    let loaded = Folder::new(test).load("a.obj", obj(mesh)).unwrap();
    assert!(loaded.closed);
    unit_density(&loaded)
}

#[test]
fn primitives_have_their_textbook_inertia() {
    let (r, h) = (0.3, 0.7);
    let box_ = properties(Shape::Box {
        half_extents: [1.0, 2.0, 3.0],
    });
    assert_alike(
        &box_,
        &body(48.0, [16.0 * 13.0, 16.0 * 10.0, 16.0 * 5.0]),
        1e-15,
    );
    let ball = 4.0 / 3.0 * PI * r * r * r;
    assert_alike(
        &properties(Shape::Sphere { radius: r }),
        &body(ball, [0.4 * ball * r * r; 3]),
        1e-15,
    );
    let egg = 4.0 / 3.0 * PI * 0.3 * 0.5 * 0.7;
    assert_alike(
        &properties(Shape::Ellipsoid {
            radii: [0.3, 0.5, 0.7],
        }),
        &body(egg, [0.74, 0.58, 0.34].map(|squares| egg * squares / 5.0)),
        1e-14,
    );
    let rod = PI * r * r * 2.0 * h;
    let across = rod * (3.0 * r * r + (2.0 * h) * (2.0 * h)) / 12.0;
    let cylinder = properties(Shape::Cylinder {
        radius: r,
        half_height: h,
    });
    assert_alike(
        &cylinder,
        &body(rod, [across, across, 0.5 * rod * r * r]),
        1e-14,
    );
}

#[test]
fn a_capsule_is_the_limit_of_its_inscribed_polyhedra() {
    // the corners around are 48 and twice that half a turn: both errors fall with the square
    let capsule = Shape::Capsule {
        radius: 0.3,
        half_height: 0.7,
    };
    let inscribed = of_mesh("capsule", &triangles(&capsule));
    // area of a regular 48-gon over its circle's: 0.9971; the profile's error is of the same order
    assert_alike(&properties(capsule), &inscribed, 1e-2);
    let ball = Shape::Sphere { radius: 0.3 };
    let nearly = Shape::Capsule {
        radius: 0.3,
        half_height: 1e-9,
    };
    assert_alike(&properties(nearly), &properties(ball), 1e-7);
    // far apart ends: two half balls on a rod, by the parallel axis theorem
    let (r, h) = (0.01, 10.0);
    let caps = 4.0 / 3.0 * PI * r * r * r;
    let rod = PI * r * r * 2.0 * h;
    let long = properties(Shape::Capsule {
        radius: r,
        half_height: h,
    });
    let centre = h + 0.375 * r;
    let half_ball = 83.0 / 320.0 * r * r;
    let across = rod * (r * r / 4.0 + h * h / 3.0) + caps * (half_ball + centre * centre);
    assert!((long.inertia[0][0] / across - 1.0).abs() < 1e-14);
}

#[test]
fn tessellated_primitives_are_closed_and_face_outward() {
    let shapes = [
        Shape::Box {
            half_extents: [1.0, 2.0, 3.0],
        },
        Shape::Sphere { radius: 0.5 },
        Shape::Cylinder {
            radius: 0.5,
            half_height: 2.0,
        },
        Shape::Capsule {
            radius: 0.5,
            half_height: 2.0,
        },
        Shape::Ellipsoid {
            radii: [0.3, 0.5, 0.7],
        },
    ];
    for shape in shapes {
        let mesh = triangles(&shape);
        let volume = mass_properties(&shape, 1.0).unwrap().mass;
        assert!(mesh.is_closed(), "{shape:?}");
        let share = mesh.signed_volume() / volume;
        assert!((0.99..=1.0 + 1e-14).contains(&share), "{shape:?}: {share}");
        assert_eq!(
            mesh.vertices.len() + mesh.triangles.len() / 2,
            mesh.triangles.len() + 2,
            "Euler: {shape:?}"
        );
    }
}

#[test]
fn a_tetrahedron_has_its_closed_form() {
    let mesh = TriMesh {
        vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    // ∫ x² = 2 V a² / 20 about the corner, ∫ x y = V a b / 20; centre a/4, so a² V (1/10 − 1/16) = 3/80 V a² about it
    let (a, b, c, volume) = (1.0, 2.0, 3.0, 1.0);
    let square = |x: f64| 3.0 / 80.0 * volume * x * x;
    let product = |x: f64, y: f64| volume * x * y * (1.0 / 20.0 - 1.0 / 16.0);
    let expected = Inertial {
        mass: volume,
        pos: [a / 4.0, b / 4.0, c / 4.0],
        inertia: [
            [square(b) + square(c), -product(a, b), -product(a, c)],
            [-product(a, b), square(c) + square(a), -product(b, c)],
            [-product(a, c), -product(b, c), square(a) + square(b)],
        ],
    };
    assert_alike(&of_mesh("tetrahedron", &mesh), &expected, 1e-14);
    // from a kilometre away the same body is found to roundings of the place
    let far = mapped(&mesh, |[x, y, z]| [x + 1000.0, y, z]);
    let mut there = of_mesh("far", &far);
    there.pos[0] -= 1000.0;
    assert_alike(&there, &expected, 1e-12);
}

/// A torus about z of these radii, with `n` corners around both circles.
fn torus(ring: f64, tube: f64, n: u32) -> TriMesh {
    let angle = |step: u32| 2.0 * PI * f64::from(step) / f64::from(n);
    let mut mesh = TriMesh::default();
    for i in 0..n {
        for j in 0..n {
            let out = ring + tube * angle(j).cos();
            mesh.vertices.push([
                out * angle(i).cos(),
                out * angle(i).sin(),
                tube * angle(j).sin(),
            ]);
            let at = |i: u32, j: u32| i % n * n + j % n;
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[test]
fn a_fine_torus_converges_to_its_closed_form_with_the_square_of_its_edges() {
    let (ring, tube): (f64, f64) = (0.5, 0.2);
    let mass = 2.0 * PI * PI * ring * tube * tube;
    let across = mass * (0.5 * ring * ring + 0.625 * tube * tube);
    let along = mass * (ring * ring + 0.75 * tube * tube);
    let exact = body(mass, [across, across, along]);
    let error = |n: u32| {
        let computed = of_mesh(&format!("torus-{n}"), &torus(ring, tube, n));
        assert!((computed.inertia[2][2] / along - 1.0).abs() < 40.0 / f64::from(n * n));
        assert!((computed.inertia[0][0] / across - 1.0).abs() < 40.0 / f64::from(n * n));
        1.0 - computed.mass / exact.mass
    };
    let (coarse, fine) = (error(60), error(120));
    assert!(
        fine > 0.0 && fine < 1e-2 && (coarse / fine - 4.0).abs() < 0.05,
        "{coarse} {fine}"
    );
}

#[test]
fn a_cavity_is_subtracted_and_a_part_inside_out_is_turned() {
    let outer = brick();
    let centre = [0.5, 0.25, 0.125];
    let about_centre = |factor: f64| {
        move |p: [f64; 3]| std::array::from_fn(|i| centre[i] + factor * (p[i] - centre[i]))
    };
    let inner = mapped(&outer, about_centre(0.5));
    let solid = of_mesh("solid", &outer);
    let hollow = of_mesh("hollow", &joined(&[outer.clone(), inside_out(&inner)]));
    assert!((hollow.mass - solid.mass * 7.0 / 8.0).abs() < 1e-15);
    for axis in 0..3 {
        // of a homothetic body the inertia goes with the fifth power
        let expected = solid.inertia[axis][axis] * 31.0 / 32.0;
        assert!((hollow.inertia[axis][axis] - expected).abs() < 1e-15);
    }
    // the whole file the other way round is the same body
    let reversed = joined(&[inside_out(&outer), inner]);
    assert_alike(&of_mesh("reversed", &reversed), &hollow, 1e-14);
    // a shell beside the first is no cavity, whichever way round it is
    let beside = mapped(&outer, |[x, y, z]| [x + 3.0, y, z]);
    let two = of_mesh(
        "beside",
        &joined(&[outer, inside_out(&mapped(&beside, |p| p))]),
    );
    assert!(
        (two.mass - 2.0 * solid.mass).abs() < 1e-15 && (two.pos[0] - 2.0).abs() < 1e-14,
        "{two:?}"
    );
}

#[test]
fn an_open_mesh_weighs_as_its_hull_and_reports_it() {
    let folder = Folder::new("open");
    let mut open = brick();
    open.triangles.remove(3);
    folder.put("open.obj", obj(&open));
    let robot = folder.robot("open.obj", "").unwrap();
    let Shape::Mesh(mesh) = &robot.links[0].collisions[0].shape else {
        panic!()
    };
    assert!(!mesh.closed);
    let solid = mass_properties(
        &Shape::Box {
            half_extents: [0.5, 0.25, 0.125],
        },
        DENSITY,
    )
    .unwrap();
    let inertial = robot.links[0].inertial.unwrap();
    assert!((inertial.mass - solid.mass).abs() < 1e-12);
    let notes = robot.notes.join("\n");
    assert!(
        notes.contains("`hand`") && notes.contains("open.obj is not closed"),
        "{notes}"
    );
}

#[test]
fn a_link_without_inertial_weighs_as_its_collisions_together() {
    let text = "<robot name=\"r\"><link name=\"a\">\
        <collision><origin xyz=\"1 0 0\"/><geometry><sphere radius=\"0.1\"/></geometry></collision>\
        <collision><origin xyz=\"-1 0 0\" rpy=\"0 1.5707963267948966 0\"/><geometry><cylinder radius=\"0.1\" length=\"0.2\"/>\
        </geometry></collision></link></robot>";
    let robot = sim_model::Robot::from_urdf_text(text, "r.urdf", Default::default()).unwrap();
    let ball = 1000.0 * 4.0 / 3.0 * PI * 1e-3;
    let rod = 1000.0 * PI * 2e-3;
    let inertial = robot.links[0].inertial.unwrap();
    assert!((inertial.mass - ball - rod).abs() < 1e-12);
    let centre = (ball - rod) / (ball + rod);
    assert!((inertial.pos[0] - centre).abs() < 1e-15);
    // along x: the ball about its middle, the rod about its axis
    let along = 0.4 * ball * 0.01 + 0.5 * rod * 0.01;
    assert!((inertial.inertia[0][0] - along).abs() < 1e-12);
    // across: both about their own, and the distances
    let central = 0.4 * ball * 0.01 + rod * (0.03 + 0.04) / 12.0;
    let apart = ball * (1.0 - centre) * (1.0 - centre) + rod * (1.0 + centre) * (1.0 + centre);
    assert!((inertial.inertia[1][1] - central - apart).abs() < 1e-12);
    assert!(
        robot
            .notes
            .iter()
            .any(|note| note.contains("`a` has no <inertial>") && note.contains("1000 kg/m³"))
    );
}

#[test]
fn inertial_wins_over_collisions() {
    let folder = Folder::new("wins");
    folder.put("brick.obj", obj(&brick()));
    let inertial = "<inertial><mass value=\"3\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    let robot = folder.robot("brick.obj", inertial).unwrap();
    assert_eq!(
        robot.links[0].inertial.unwrap().mass.to_bits(),
        3.0_f64.to_bits()
    );
    assert_eq!(robot.notes, [""; 0]);
    // a mass of 0 is a mass that is given
    let robot = folder
        .robot("brick.obj", &inertial.replace("\"3\"", "\"0\""))
        .unwrap();
    assert_eq!(
        robot.links[0].inertial.unwrap().mass.to_bits(),
        0.0_f64.to_bits()
    );
}

#[test]
fn the_same_file_at_the_same_scale_is_held_once() {
    let folder = Folder::new("once");
    folder.put("a.obj", obj(&brick()));
    let collision = "<collision><geometry><mesh filename=\"a.obj\"/></geometry></collision>";
    let robot = folder.robot("a.obj", collision).unwrap();
    let [Shape::Mesh(first), Shape::Mesh(second)] =
        [0, 1].map(|i| &robot.links[0].collisions[i].shape)
    else {
        panic!()
    };
    assert!(Arc::ptr_eq(first, second));
}
