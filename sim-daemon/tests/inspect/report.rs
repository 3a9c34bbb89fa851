//! What is printed.

use serde_json::Value;

use super::{FR3, Folder, inspect, one_link, root};

/// The robot with a joint of every kind.
const KINDS: &str = "sim-daemon/tests/inspect/kinds.urdf";

#[test]
fn the_report_of_the_fr3_is_what_it_was() {
    let said = inspect(&root(), &[FR3, "--no-png"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    let lines: Vec<&str> = said.out.lines().collect();
    let expected: Vec<&str> = include_str!("fr3.txt").lines().collect();
    assert_eq!(lines, expected, "if the change is wanted, change fr3.txt");
}

#[test]
fn the_report_of_every_joint_kind_is_what_it_was() {
    let said = inspect(&root(), &[KINDS, "--no-png", "--long", "--floating"]);
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
    let said = inspect(&folder.0, &["chain.urdf", "--no-png"]);
    assert_eq!(said.code, 0, "{}", said.err);
    let last = said
        .out
        .lines()
        .find(|line| line.starts_with("○ l999"))
        .unwrap();
    assert_eq!(last, "○ l999   j999: fixed, part of l0");
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
    let mended = inspect(&folder.0, &["flat.urdf", "--no-png"]);
    assert_eq!(mended.code, 0, "{}", mended.err);
    assert!(
        mended.out.contains("\n  ! ") && mended.out.contains("`only`"),
        "{}",
        mended.out
    );
    let refused = inspect(&folder.0, &["flat.urdf", "--no-png", "--strict"]);
    assert_eq!(refused.code, 1);
    assert!(refused.err.contains("`only`"), "{}", refused.err);
}

#[test]
fn a_misused_command_line_is_told_so() {
    for (arguments, message) in [
        (&["--joint-q", "1,2"][..], "has 2 values"),
        (&["--joint-q", "0,0,0,0,0,0,0,0,NaN"], "NaN"),
        (&["--joint-q", "a"], "invalid value 'a'"),
        (&["--mesh-max-hull-vertices", "3"], "between 8 and 1024"),
        (&["--json", "--long"], "cannot be used with"),
        (&["--png", "a.png", "--no-png"], "cannot be used with"),
        (&["--colour"], "unexpected argument"),
    ] {
        let arguments = [&[FR3], arguments].concat();
        let said = inspect(&root(), &arguments);
        assert_eq!((said.code, said.out.as_str()), (2, ""), "{arguments:?}");
        assert!(said.err.contains(message), "{}", said.err);
    }
}
