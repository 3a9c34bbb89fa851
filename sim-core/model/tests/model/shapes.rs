//! Shapes of a scene: surfaces, groups, planes, names, and pairs that never touch.

use std::collections::BTreeSet;

use sim_model::geometry::{MeshOptions, mass_properties};
use sim_model::{Body, Collision, Description, ModelError, Pose, Shape, Surface};

use crate::build::{INERTIAL, assert_says, joint, link, read};

const BALL: Shape = Shape::Sphere { radius: 0.1 };

fn collision(name: &str) -> String {
    format!("<collision name=\"{name}\"><geometry><sphere radius=\"0.1\"/></geometry></collision>")
}

/// Table and ground, an arm whose hand comes before its base in the file, and a cube of two shapes.
fn scene() -> Description {
    let unnamed = collision("").replace(" name=\"\"", "");
    let hand = [
        collision("1"),
        unnamed.clone(),
        collision("tip"),
        collision("tip"),
    ]
    .concat();
    let robot = link("hand", &(INERTIAL.to_owned() + &hand))
        + &link("base", &(INERTIAL.to_owned() + &unnamed))
        + &joint("wrist", "continuous", "base", "hand", "");
    let mut scene = Description::new(1.0 / 480.0, 8);
    scene.robots.push(read(&robot).unwrap());
    scene.add_box("table", [1.0; 3], Pose::identity());
    scene.add_ground("", -1.0);
    let mut cube = Body::new("cube", Pose::identity());
    for name in [Some("core".to_owned()), None] {
        let shape = Collision::new(name, BALL, Pose::identity());
        cube.shapes.push((shape, 400.0));
    }
    scene.add_body(cube).unwrap();
    scene
}

/// The message with which the scene is refused after this change.
#[track_caller]
fn refusal(change: impl FnOnce(&mut Description)) -> String {
    let mut scene = scene();
    change(&mut scene);
    scene.validate().expect_err("accepted").to_string()
}

#[test]
fn names_are_those_of_static_shapes_then_of_links_in_body_order() {
    let scene = scene();
    let names = [
        "table",
        "ground",
        "r/base/0",
        "r/hand/1",
        "r/hand/2",
        "r/hand/tip",
        "r/hand/3",
        "cube/core",
        "cube/1",
    ];
    assert_eq!(scene.shape_names(), names);
    assert_eq!(scene.compile().unwrap().shape_names(), names);
}

#[test]
fn two_shapes_of_one_full_name_are_refused() {
    let message = refusal(|scene| {
        scene.add_shape("cube/core", BALL, Pose::identity());
    });
    assert_says(&message, &["two shapes are named `cube/core`"]);
}

#[test]
fn surfaces_start_as_newton_has_them() {
    let expected = Surface {
        mu: 1.0,
        ke: 2500.0,
        kd: 100.0,
        kf: 1000.0,
        margin: 0.0,
        gap: 0.0,
        condim: 3,
        group: 1,
    };
    let scene = scene();
    assert_eq!(scene.shapes[0].surface, expected);
    assert_eq!(scene.robots[0].links[0].collisions[0].surface, expected);
}

#[test]
fn surfaces_that_no_contact_can_have_are_refused_by_shape_and_field() {
    type Change = fn(&mut Surface);
    let cases: [(Change, &[&str]); 11] = [
        (|s| s.mu = -0.5, &["mu is -0.5", "must not be negative"]),
        (|s| s.mu = f64::NAN, &["mu is NaN", "finite"]),
        (|s| s.ke = 0.0, &["ke is 0", "above 0"]),
        (|s| s.kd = -1.0, &["kd is -1", "above 0"]),
        (|s| s.kf = 1e13, &["kf is 1e13", "at most 1e12"]),
        (|s| s.kf = f64::INFINITY, &["kf is inf", "finite"]),
        (
            |s| s.margin = -1e-3,
            &["margin is -0.001", "must not be negative"],
        ),
        (|s| s.gap = 1e7, &["gap is 1e7", "at most 1e6 m"]),
        (
            |s| s.condim = 4,
            &["condim is 4", "not supported yet", "give 3"],
        ),
        (|s| s.condim = 6, &["condim is 6", "not supported yet"]),
        (|s| s.condim = 2, &["condim is 2", "give 3, or 1"]),
    ];
    for (change, says) in cases {
        let message = refusal(|scene| change(&mut scene.shapes[0].surface));
        assert_says(&message, &[&["shape `table`"], says].concat());
        let borne =
            |scene: &mut Description| change(&mut scene.robots[0].links[0].collisions[2].surface);
        let path = ["robot `r`", "link `hand`", "collision `tip`"];
        assert_says(&refusal(borne), &[&path, says].concat());
    }
    let mut smooth = scene();
    smooth.shapes[0].surface.condim = 1;
    smooth.shapes[0].surface.mu = 0.0;
    assert_eq!(smooth.validate(), Ok(()));
}

#[test]
fn groups_meet_as_newtons_do() {
    let surface = |group| Surface {
        group,
        ..Surface::default()
    };
    let meet = [(1, 1), (2, 2), (1, -1), (1, -3), (-1, -2)];
    let miss = [(0, 0), (0, 1), (0, -1), (1, 2), (-2, -2), (-1, -1)];
    for (pairs, expected) in [(&meet[..], true), (&miss[..], false)] {
        for &(a, b) in pairs {
            assert_eq!(
                surface(a).meets(&surface(b)),
                expected,
                "groups {a} and {b}"
            );
            assert_eq!(
                surface(b).meets(&surface(a)),
                expected,
                "groups {b} and {a}"
            );
        }
    }
}

#[test]
fn a_plane_belongs_to_the_scene_and_not_to_a_link_or_body() {
    assert_eq!(scene().validate(), Ok(()));
    let plane = || Collision::new(Some("floor".to_owned()), Shape::Plane, Pose::identity());
    let message = refusal(|scene| {
        scene.add_link_shape("r", "base", plane()).unwrap();
    });
    let says = ["collision `floor`", "a plane has no end", "static shape"];
    assert_says(&message, &says);
    let mut body = Body::new("board", Pose::identity());
    body.fixed = true;
    body.shapes.push((plane(), 1000.0));
    let message = scene().add_body(body).unwrap_err().to_string();
    assert_says(&message, &["body `board`", "a plane has no end"]);
    let error = mass_properties(&Shape::Plane, 1.0).unwrap_err();
    assert!(matches!(error, ModelError::PlaneBorne { .. }));
}

#[test]
fn capacities_out_of_bounds_are_refused() {
    assert_says(
        &refusal(|scene| scene.contacts_max = Some(0)),
        &["contacts_max is 0", "between 1 and 4096"],
    );
    assert_says(
        &refusal(|scene| scene.contacts_max = Some(5000)),
        &["contacts_max is 5000"],
    );
    assert_says(
        &refusal(|scene| scene.rows_max = Some(0)),
        &["rows_max is 0", "between 1 and 16384"],
    );
    let mut scene = scene();
    (scene.contacts_max, scene.rows_max) = (Some(4096), Some(1));
    assert_eq!(scene.validate(), Ok(()));
}

#[test]
fn filters_name_shapes_or_all_shapes_of_a_robot_link_or_body() {
    let pairs = |filters: &[[&str; 2]]| {
        let mut scene = scene();
        scene.filters = filters.iter().map(|pair| pair.map(str::to_owned)).collect();
        assert_eq!(scene.validate(), Ok(()));
        scene.filtered_pairs().unwrap()
    };
    assert_eq!(pairs(&[]), BTreeSet::new());
    assert_eq!(pairs(&[["r/hand/tip", "table"]]), [[0, 5]].into());
    assert_eq!(
        pairs(&[["table", "cube"], ["cube/1", "table"]]),
        [[0, 7], [0, 8]].into()
    );
    assert_eq!(
        pairs(&[["r/hand", "cube/core"]]),
        [[3, 7], [4, 7], [5, 7], [6, 7]].into()
    );
    assert_eq!(pairs(&[["cube", "cube"]]), [[7, 8]].into());
    assert_eq!(pairs(&[["r", "r"]]).len(), 10);
}

#[test]
fn filter_of_a_name_that_is_none_is_refused_with_those_that_are() {
    let message = refusal(|scene| scene.filters = vec![["table".to_owned(), "r/han".to_owned()]]);
    let says = ["contact filter", "`r/han`", "`table`, `ground`, `r/base/0`"];
    assert_says(&message, &says);
}

#[test]
fn shape_added_to_a_link_weighs_nothing_and_is_named_after_it() {
    let mut scene = scene();
    let mass = scene.robots[0].links[1].inertial;
    let shape = || Collision::new(Some("pad".to_owned()), BALL, Pose::at([0.0, 0.0, 1.0]));
    scene
        .add_link_shape("r", "base", shape())
        .unwrap()
        .surface
        .mu = 0.5;
    assert_eq!(scene.robots[0].links[1].inertial, mass);
    assert_eq!(scene.robots[0].links[1].collisions[1].surface.mu, 0.5);
    assert!(scene.shape_names().contains(&"r/base/pad".to_owned()));

    let before = scene.clone();
    let refusals = [
        (("r", "base"), ["link `base`", "two shapes are named `pad`"]),
        (("q", "base"), ["no robot `q`", "`r`, `cube`"]),
        (("r", "foot"), ["robot `r`", "no link `foot`"]),
    ];
    for ((robot, link), says) in refusals {
        let error = scene.add_link_shape(robot, link, shape()).unwrap_err();
        assert_says(&error.to_string(), &says);
    }
    assert_eq!(scene, before);
}

#[test]
fn static_mesh_comes_from_a_file() {
    let file = std::env::temp_dir().join(format!("tightloop-static-{}.obj", std::process::id()));
    std::fs::write(
        &file,
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n",
    )
    .unwrap();
    let mut scene = scene();
    let options = MeshOptions::default();
    let added = scene.add_mesh("", &file, [2.0; 3], &options, Pose::identity());
    let added = added.unwrap().clone();
    std::fs::remove_file(&file).unwrap();
    let Shape::Mesh(mesh) = &added.shape else {
        panic!("{:?} is no mesh", added.shape);
    };
    assert_eq!((added.name.as_str(), mesh.hulls.len()), ("mesh", 1));
    assert_eq!(mesh.triangles.extent(), [[0.0; 3], [2.0; 3]]);
    let before = scene.clone();
    let missing = scene.add_mesh("", &file, [1.0; 3], &options, Pose::identity());
    let message = missing.unwrap_err().to_string();
    assert_says(&message, &[file.to_str().unwrap()]);
    assert_eq!(scene, before);
}

/// A floor and a post that are fixed to the root, and two balls on joints of a kind below it; a hand hangs from the first.
fn with_floor(kind: &str, self_collisions: bool) -> BTreeSet<[String; 2]> {
    let ball = INERTIAL.to_owned() + &collision("s");
    let axis = "<axis xyz=\"0 0 1\"/><limit lower=\"-1\" upper=\"1\" effort=\"1\" velocity=\"1\"/>";
    let robot = link("base", "")
        + &link("floor", &collision("s"))
        + &joint("holds", "fixed", "base", "floor", "")
        + &link("a", &ball)
        + &joint("left", kind, "base", "a", axis)
        + &link("b", &ball)
        + &joint("right", kind, "base", "b", axis)
        + &link("hand", &ball)
        + &joint("wrist", "continuous", "a", "hand", "<axis xyz=\"0 0 1\"/>");
    let mut scene = Description::new(1.0 / 480.0, 8);
    scene.robots.push(read(&robot).unwrap());
    scene.robots[0].self_collisions = self_collisions;
    let names = scene.shape_names();
    let model = scene.compile().unwrap();
    let pairs = model.constants().contacts.pairs.iter();
    let name = |shape: usize| names[shape].split('/').nth(1).unwrap().to_owned();
    pairs
        .map(|pair| {
            let mut pair = pair.shapes.map(name);
            pair.sort();
            pair
        })
        .collect()
}

#[test]
fn what_leaves_a_fixed_link_touches_it_as_another_robot_would() {
    let pairs = |names: &[[&str; 2]]| -> BTreeSet<[String; 2]> {
        names.iter().map(|pair| pair.map(str::to_owned)).collect()
    };
    let apart = [["a", "floor"], ["b", "floor"], ["a", "b"]];
    let of_hand = [["floor", "hand"], ["b", "hand"]];
    let all = pairs(&[&apart[..], &of_hand].concat());
    for kind in ["floating", "planar"] {
        for self_collisions in [false, true] {
            assert_eq!(with_floor(kind, self_collisions), all, "{kind}");
        }
    }
    // a joint that holds its link to the fixed one makes them neighbours
    for kind in ["continuous", "prismatic"] {
        assert_eq!(with_floor(kind, false), pairs(&[]), "{kind}");
        let apart = [["a", "b"], ["floor", "hand"], ["b", "hand"]];
        assert_eq!(with_floor(kind, true), pairs(&apart), "{kind}");
    }
}
