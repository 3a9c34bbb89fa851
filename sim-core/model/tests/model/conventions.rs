//! Values and defaults of many conventions: which of them are read, and as what.

use crate::build::{INERTIAL, LIMIT, joint, link, one_joint};
use crate::oddities::{PLAIN, read};
use sim_model::{JointKind, Pose, Robot, Shape, UrdfOptions};

#[test]
fn quaternions_of_origins_count_from_version_1_1_on() {
    let inside = "<origin xyz=\"1 2 3\" quat_xyzw=\"0 0 0.6 0.8\"/>";
    let text = format!(
        "<robot name=\"r\">\n{}</robot>",
        one_joint("continuous", inside)
    );
    let robot = read(&text);
    assert_eq!(robot.joints[0].origin, Pose::at([1.0, 2.0, 3.0]));
    assert_eq!(
        robot.notes,
        [
            "attribute `quat_xyzw` of <origin>, without version=\"1.1\" of <robot>, is ignored (line 4)"
        ]
    );
    // also where the pitch is 90° to rounding, at which angles are not unique
    for quat in [
        [0.0, 0.0, 0.6, 0.8],
        [0.5, 0.5, -0.5, 0.5],
        [0.1, 0.7, -0.1, 0.7],
        [0.0, 0.5, 0.0, 0.5],
        [0.3, -0.7, 0.3, 0.7000001],
        [-2.0, 4.0, 6.0, -8.0],
        [1e-200, 0.0, 0.0, 1e-200],
    ] {
        let [x, y, z, w] = quat;
        let text = text
            .replace("name=\"r\"", "name=\"r\" version=\"1.1\"")
            .replace("0 0 0.6 0.8", &format!("{x} {y} {z} {w}"));
        let robot = read(&text);
        assert!(robot.notes.is_empty(), "{:?}", robot.notes);
        let length = quat
            .iter()
            .map(|part: &f64| (part / w).powi(2))
            .sum::<f64>()
            .sqrt()
            * w.abs();
        let read = robot.joints[0].origin.quat;
        let dot: f64 = read.iter().zip(quat).map(|(a, b)| a * b / length).sum();
        // both are unit quaternions: twice as far in angle as 1e-15 of a part
        let distance: f64 = read
            .iter()
            .zip(quat)
            .map(|(a, b)| (a - dot.signum() * b / length).powi(2))
            .sum::<f64>()
            .sqrt();
        assert!(distance < 4e-15, "{quat:?} is read as {read:?}");
    }
}

#[test]
fn absent_origins_axes_and_names_have_defaults() {
    let text = "<robot><link name=\"base\"><collision><geometry><sphere radius=\"1\"/></geometry></collision>\
        <collision name=\"\"><geometry><capsule radius=\"1\" length=\"2\"/></geometry></collision>\
        <collision name=\"c\"><geometry><sphere radius=\"2\"/></geometry></collision>\
        <collision name=\"c\"><origin/><geometry><sphere radius=\"3\"/></geometry></collision></link>"
        .to_owned()
        + &link("arm", INERTIAL)
        + &joint("j", "continuous", "base", "arm", "<origin/>")
        + "</robot>";
    let robot = read(&text);
    assert_eq!(robot.name, "robot");
    let collisions = &robot.links[0].collisions;
    assert_eq!(collisions.len(), 4);
    assert!(
        collisions
            .iter()
            .all(|collision| collision.pose == Pose::identity())
    );
    let capsule = Shape::Capsule {
        radius: 1.0,
        half_height: 1.0,
    };
    assert_eq!(
        (&collisions[0].name, &collisions[1].shape),
        (&None, &capsule)
    );
    assert_eq!(robot.joints[0].origin, Pose::identity());
    assert_eq!(robot.joints[0].axis, [1.0, 0.0, 0.0]);
}

#[test]
fn limits_of_many_conventions_are_read() {
    let read = |kind: &str, limit: &str| {
        let text = format!("<robot name=\"r\">{}</robot>", one_joint(kind, limit));
        let mut robot = read(&text);
        let joint = robot.joints.remove(0);
        (
            (
                joint.range,
                joint.dofs[0].effort_limit,
                joint.velocity_limit,
            ),
            robot.notes,
        )
    };
    let no_range = "joint `elbow`: no range is given, taken as unlimited";
    assert_eq!(
        read("revolute", ""),
        ((None, None, None), vec![no_range.to_owned()])
    );
    assert_eq!(read("continuous", "").0, (None, None, None));
    assert_eq!(
        read("continuous", LIMIT),
        (
            (None, Some(1.0), Some(1.0)),
            vec!["range of a continuous joint is ignored (line 3)".to_owned()]
        )
    );
    for (lower, upper) in [
        ("-1e16", "1e16"),
        ("-1.7976931348623157e+308", "1.7976931348623157e308"),
    ] {
        let (limits, notes) = read(
            "revolute",
            &format!("<limit lower=\"{lower}\" upper=\"{upper}\"/>"),
        );
        assert_eq!(limits, (None, None, None));
        assert!(
            notes[0].starts_with("joint `elbow`: the range from -1"),
            "{notes:?}"
        );
    }
    let one_sided = "<limit lower=\"0\" upper=\"1e16\"/>";
    assert_eq!(
        read("prismatic", one_sided).0,
        (Some([0.0, 1e16]), None, None)
    );
    let unlimited = "<limit lower=\"-inf\" upper=\"INF\" effort=\"Infinity\" velocity=\"+inf\"/>";
    assert_eq!(read("revolute", unlimited), ((None, None, None), vec![]));
    let huge = "<limit lower=\"-1\" upper=\"1\" effort=\"1e308\" velocity=\"1e16\"/>";
    assert_eq!(
        read("revolute", huge).0,
        (Some([-1.0, 1.0]), Some(1e308), Some(1e16))
    );
    let (limits, notes) = read(
        "revolute",
        "<limit lower=\"0\" upper=\"0\" effort=\"0\" velocity=\"0\"/>",
    );
    assert_eq!(limits, (None, Some(0.0), Some(0.0)));
    assert_eq!(notes.len(), 2, "{notes:?}");
}

#[test]
fn names_may_be_of_any_letters() {
    for name in [
        "world",
        "map",
        "/base_link",
        "left arm",
        "Ärm 漢",
        "a.b:c-d|e",
        "<&>\"'",
        "1",
        "$x",
    ] {
        let written = name
            .replace('&', "&amp;")
            .replace('<', "&lt;")
            .replace('"', "&#34;");
        let text = format!(
            "<robot name=\"r\">{}{}{}</robot>",
            link(&written, ""),
            link("arm", INERTIAL),
            joint(&written, "continuous", &written, "arm", "")
        );
        let robot = read(&text);
        assert_eq!(robot.links[0].name, name);
        assert_eq!(robot.joints[0].name, name);
    }
}

#[test]
fn fixed_links_may_weigh_nothing() {
    let zero = INERTIAL.replace("=\"1\"", "=\"0\"");
    let text = format!(
        "<robot name=\"r\">{}{}{}{}{}</robot>",
        link("base", &zero),
        link("arm", INERTIAL),
        link("tip", &zero),
        joint("j", "spherical", "base", "arm", ""),
        joint("t", "fixed", "arm", "tip", "<axis xyz=\"0 0 0\"/>"),
    );
    let robot = read(&text);
    assert_eq!(robot.joints[0].kind, JointKind::Ball);
    assert_eq!(robot.links[2].inertial.unwrap().mass, 0.0);
    assert!(robot.notes.is_empty(), "{:?}", robot.notes);
}

/// Reads a file of these bytes.
fn read_bytes(name: &str, bytes: &[u8]) -> Robot {
    let path = std::env::temp_dir().join(format!(
        "tightloop-oddities-{}-{name}.urdf",
        std::process::id()
    ));
    std::fs::write(&path, bytes).unwrap();
    let robot = Robot::from_urdf(&path, UrdfOptions::default());
    std::fs::remove_file(&path).unwrap();
    robot.unwrap()
}

#[test]
fn latin_1_is_read_with_a_note() {
    let text = PLAIN
        .replace("\"elbow\"", "\"Schnur\u{f6}\"")
        .replace("<axis", "<!-- 90\u{b0} --><axis");
    let latin_1: Vec<u8> = text.chars().map(|c| c as u8).collect();
    let robot = read_bytes("latin-1", &latin_1);
    assert_eq!(robot.joints[0].name, "Schnur\u{f6}");
    assert_eq!(
        robot.notes,
        ["bytes that are not UTF-8 are read as Latin-1 (first in line 8)"]
    );
    let robot = read_bytes("utf-8", text.as_bytes());
    assert_eq!(robot.joints[0].name, "Schnur\u{f6}");
    assert!(robot.notes.is_empty(), "{:?}", robot.notes);
}
