//! What is printed.

use serde_json::Value;

use super::{FR3, Folder, inspect, one_link, root};

/// The robot with a joint of every kind.
const KINDS: &str = "sim-daemon/tests/inspect/kinds.urdf";

#[test]
fn the_report_of_the_fr3_is_what_it_was() {
    let said = inspect(&root(), &[FR3]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let lines: Vec<&str> = said.out.lines().collect();
    let expected: Vec<&str> = include_str!("fr3.txt").lines().collect();
    assert_eq!(lines, expected, "if the change is wanted, change fr3.txt");
}

#[test]
fn the_report_of_every_joint_kind_is_what_it_was() {
    let said = inspect(&root(), &[KINDS, "--long", "--floating"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let lines: Vec<&str> = said.out.lines().collect();
    let expected: Vec<&str> = include_str!("kinds.txt").lines().collect();
    assert_eq!(lines, expected, "if the change is wanted, change kinds.txt");
    for line in &lines {
        assert!(line.chars().count() <= 100, "{line}");
    }
}

#[test]
fn json_has_the_same_facts() {
    let said = inspect(&root(), &[KINDS, "--json"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let all: Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(all["name"], "kinds");
    assert_eq!(all["file"], KINDS);
    assert_eq!(all["floating"], false);
    assert_eq!(all["mass"], 2.95);
    assert_eq!(all["picture"], Value::Null);
    let dofs = [
        "neck.wx",
        "neck.wy",
        "neck.wz",
        "table.x",
        "table.y",
        "table.angle",
    ];
    for (index, name) in dofs.iter().chain(&["slide", "twist"]).enumerate() {
        assert_eq!(all["dof_names"][index], **name);
    }
    assert_eq!(all["joint_range"][2][1], 0.3);
    assert_eq!(all["joint_mimic"][3]["joint"], "slide");
    let names: Vec<&str> = all["links"]
        .as_array()
        .unwrap()
        .iter()
        .map(|link| link["name"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["torso", "lid", "ball", "puck", "left", "right"]);
    let torso = &all["links"][0];
    assert_eq!(torso["joint"], Value::Null);
    assert_eq!(torso["principal_moments"][2], 0.04);
    assert_eq!(torso["collisions"][0]["type"], "box");
    assert_eq!(torso["collisions"][0]["name"], "hull");
    assert_eq!(torso["collisions"][0]["half_extents"][2], 0.2);
    assert_eq!(torso["collisions"][0]["pos"][2], 0.1);
    let lid = &all["links"][1];
    assert_eq!(
        (&lid["merged_into"], &lid["mass"]),
        (&torso["name"], &Value::Null)
    );
    let left = &all["links"][4];
    assert_eq!(left["joint"]["type"], "prismatic");
    assert_eq!(left["joint"]["axis"][1], -1.0);
    assert!(all["notes"][0].as_str().unwrap().contains("transmission"));
}

#[test]
fn a_chain_of_a_thousand_links_is_no_wider_than_one_of_two() {
    let folder = Folder::new("chain");
    let mut text = "<robot name=\"chain\"><link name=\"l0\"/>".to_owned();
    for link in 1..1000 {
        let parent = link - 1;
        text += &format!(
            "<link name=\"l{link}\"/><joint name=\"j{link}\" type=\"fixed\"><parent link=\"l{parent}\"/><child link=\"l{link}\"/></joint>"
        );
    }
    folder.file("chain.urdf", &(text + "</robot>"));
    let said = inspect(&folder.0, &["chain.urdf"]);
    assert_eq!(said.code, 0, "{}", said.err);
    let last = said
        .out
        .lines()
        .find(|line| line.starts_with("○ l999"))
        .unwrap();
    assert_eq!(last, "○ l999   j999: fixed, part of l0");
}

/// A ball with so many vertices that its hull leaves some out, in the format OBJ.
fn fine_ball(radius: f64) -> String {
    const SIDES: usize = 24;
    let angle = |step: usize| std::f64::consts::TAU * step as f64 / SIDES as f64;
    let mut text = String::new();
    for ring in 0..=SIDES / 2 {
        for side in 0..SIDES {
            let (z, across) = (angle(ring).cos(), angle(ring).sin());
            let (x, y) = (across * angle(side).cos(), across * angle(side).sin());
            text += &format!("v {} {} {}\n", radius * x, radius * y, radius * z);
        }
    }
    for ring in 0..SIDES / 2 {
        for side in 0..SIDES {
            let corner = |ring: usize, side: usize| 1 + ring * SIDES + side % SIDES;
            let (a, b) = (corner(ring, side), corner(ring, side + 1));
            let (c, d) = (corner(ring + 1, side), corner(ring + 1, side + 1));
            text += &format!("f {a} {c} {d}\nf {a} {d} {b}\n");
        }
    }
    text
}

#[test]
fn small_errors_of_hulls_are_one_line_and_large_ones_one_each() {
    let folder = Folder::new("balls");
    let mut shapes = String::new();
    for (name, radius) in [("a", 0.05), ("b", 0.06), ("c", 0.04), ("big", 1.0)] {
        folder.file(&format!("{name}.obj"), &fine_ball(radius));
        shapes +=
            &format!("<collision><geometry><mesh filename=\"{name}.obj\"/></geometry></collision>");
    }
    folder.file("r.urdf", &one_link("r", &shapes));
    let said = inspect(&folder.0, &["r.urdf"]);
    assert_eq!(said.code, 0, "{}", said.err);
    let (_, notes) = said.out.split_once("Ignored or mended\n").unwrap();
    let in_one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let joined = in_one_line(notes);
    assert_eq!(joined.matches("leave").count(), 2, "{notes}");
    assert!(
        joined.contains("mesh big.obj has a hull of more"),
        "{notes}"
    );
    assert!(
        joined.contains("the convex hulls of 3 meshes leave out up to ")
            && joined.contains(" mm of them; see --mesh-max-hull-vertices"),
        "{notes}"
    );
    let long = in_one_line(&inspect(&folder.0, &["r.urdf", "--long"]).out);
    assert_eq!(long.matches("has a hull of more").count(), 4, "{long}");
}

#[test]
fn what_a_simulation_would_refuse_is_refused() {
    let folder = Folder::new("refused");
    let cases = [
        ("gone.urdf", None, "gone.urdf"),
        ("broken.urdf", Some("<robot".to_owned()), "broken XML"),
        (
            "negative.urdf",
            Some(one_link(
                "n",
                "<inertial><mass value=\"-1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>",
            )),
            "negative.urdf:1: <mass> of link `only`",
        ),
        (
            "light.urdf",
            Some(
                "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/></joint></robot>"
                    .to_owned(),
            ),
            "link `b` is moved by joint `j` but has no mass",
        ),
    ];
    for (name, text, message) in cases {
        if let Some(text) = text {
            folder.file(name, &text);
        }
        let said = inspect(&folder.0, &[name]);
        assert_eq!((said.code, said.out.as_str()), (1, ""), "{name}");
        assert!(said.err.starts_with("tightloop: "), "{}", said.err);
        assert!(said.err.contains(message), "{}", said.err);
        assert_eq!(said.err.lines().count(), 1, "{}", said.err);
    }
    assert!(!folder.files().iter().any(|name| name.ends_with(".png")));
}

#[test]
fn a_wrong_inertia_is_mended_with_a_warning_or_refused() {
    let folder = Folder::new("strict");
    let inertia = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"3\"/></inertial>";
    folder.file("flat.urdf", &one_link("flat", inertia));
    let mended = inspect(&folder.0, &["flat.urdf"]);
    assert_eq!(mended.code, 0, "{}", mended.err);
    assert!(
        mended.out.contains("\n  ! ") && mended.out.contains("`only`"),
        "{}",
        mended.out
    );
    let refused = inspect(&folder.0, &["flat.urdf", "--strict"]);
    assert_eq!(refused.code, 1);
    assert!(refused.err.contains("`only`"), "{}", refused.err);
}

#[test]
fn a_misused_command_line_gets_an_error() {
    for (arguments, message) in [
        (&["--joint-q", "1,2", "--png", "a.png"][..], "has 2 values"),
        (
            &["--joint-q", "0,0,0,0,0,0,0,0,NaN", "--png", "a.png"],
            "NaN",
        ),
        (&["--joint-q", "a"], "invalid value 'a'"),
        (&["--mesh-max-hull-vertices", "3"], "between 8 and 1024"),
        (&["--package-dir", "no/such"], "no/such\": it is no folder"),
        (&["--png", "a.jpg"], "a.jpg\": the picture is PNG"),
        (&["--json", "--long"], "cannot be used with"),
        (&["--hulls"], "--png <FILE>"),
        (&["--colour"], "unexpected argument"),
    ] {
        let arguments = [&[FR3], arguments].concat();
        let said = inspect(&root(), &arguments);
        assert_eq!((said.code, said.out.as_str()), (2, ""), "{arguments:?}");
        assert!(said.err.contains(message), "{}", said.err);
    }
}

#[test]
fn files_that_hold_no_robot_are_named_with_what_takes_them() {
    let folder = Folder::new("kinds");
    for (file, what, cure) in [
        ("scene.toml", "a scene file", "tightloop serve"),
        ("run.tlrec", "a recording", "tightloop view"),
        ("robot.usda", "USD", "export the robot as URDF"),
    ] {
        folder.file(file, "dt = 0.002\n");
        let said = inspect(&folder.0, &[file]);
        assert_eq!((said.code, said.out.as_str()), (1, ""));
        for part in [file, what, cure] {
            assert!(said.err.contains(part), "{}", said.err);
        }
        assert!(!said.err.contains("XML"), "{}", said.err);
    }
}
