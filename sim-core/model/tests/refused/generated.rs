//! Files made to do harm: too large, too deep, too many; refused, or read, within a second and within bounds.

use crate::measure::{read_in_bounds, time_run};
use sim_model::{Description, Robot, UrdfOptions};
use std::time::{Duration, Instant};

const INERTIAL: &str = r#"<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>"#;

fn robot(inside: &str) -> String {
    format!("<robot name=\"r\"><link name=\"base\"/>{inside}</robot>")
}

fn joint(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{inside}</joint>"
    )
}

/// Links one below the other.
fn chain(count: usize, kind: &str) -> String {
    let mut inside = String::new();
    for i in 0..count {
        let parent = match i {
            0 => "base".to_owned(),
            i => format!("l{}", i - 1),
        };
        inside += &format!("<link name=\"l{i}\">{INERTIAL}</link>");
        inside += &joint(&format!("j{i}"), kind, &parent, &format!("l{i}"), "");
    }
    robot(&inside)
}

#[track_caller]
fn refusal(text: &str) -> String {
    match read_in_bounds(text) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    }
}

#[track_caller]
fn assert_refused(text: &str, message: &str) {
    assert_eq!(refusal(text), format!("robot.urdf{message}"));
}

#[test]
fn entity_bombs_are_refused() {
    let mut bomb = String::from("<!DOCTYPE robot [<!ENTITY e0 \"aaaaaaaaaa\">");
    for i in 1..10 {
        let ten = format!("&e{};", i - 1).repeat(10);
        bomb += &format!("<!ENTITY e{i} \"{ten}\">");
    }
    bomb += "]><robot name=\"r\"><link name=\"&e9;\"/></robot>";
    let message = refusal(&bomb);
    assert!(message.contains("<!DOCTYPE> is refused"), "{message}");
    let wide = format!(
        "<!DOCTYPE robot [<!ENTITY e \"{}\">]>{}",
        "a".repeat(100_000),
        robot(&"&e;".repeat(100_000))
    );
    let message = refusal(&wide);
    assert!(message.contains("<!DOCTYPE> is refused"), "{message}");
}

#[test]
fn files_of_many_tags_attributes_and_namespaces_are_refused() {
    let what = "delete what is not the robot";
    assert_refused(
        &robot(&"<a/>".repeat(1_000_000)),
        &format!(": the number of XML tags exceeds the limit of 250000; {what}"),
    );
    assert_refused(
        &robot(&"<!---->".repeat(1_000_000)),
        &format!(": the number of XML tags exceeds the limit of 250000; {what}"),
    );
    let attributes: String = (0..300_001).map(|i| format!(" a{i}=\"\"")).collect();
    assert_refused(
        &robot(&format!("<a{attributes}/>")),
        &format!(": the number of XML attributes exceeds the limit of 300000; {what}"),
    );
    let some = &attributes[..attributes.find(" a65=").unwrap()];
    assert_refused(
        &robot(&format!("\n<a{some}/>")),
        ":2:1: broken XML: an element has more than 64 attributes; delete some",
    );
    let namespaces: String = (0..300)
        .map(|i| format!("<a xmlns:p{i}=\"n{i}\">"))
        .collect();
    assert_refused(
        &robot(&(namespaces + &"</a>".repeat(300))),
        &format!(": the number of namespaces exceeds the limit of 64; {what}"),
    );
}

#[test]
fn files_just_within_the_limits_are_read_in_bounds() {
    let attributes: String = (0..60).map(|i| format!(" a{i}=\"\"")).collect();
    let text = robot(&format!("<a{attributes}/>").repeat(4_990));
    assert_eq!(read_in_bounds(&text).unwrap().notes.len(), 1);
    let text = robot(&"<a b=\"c\"><!-- d --> e </a>".repeat(83_000));
    assert_eq!(read_in_bounds(&text).unwrap().notes.len(), 1);
    // a thousand names of unknown elements, at the end of a long file
    let unknown: String = (0..1_000).map(|i| format!("<unknown{i}/>")).collect();
    let text = robot(&(" \n".repeat(5_000_000) + &unknown));
    let notes = read_in_bounds(&text).unwrap().notes;
    assert_eq!(notes.len(), 201);
    assert_eq!(notes[199], "<unknown199> is ignored (line 5000001)");
    assert_eq!(
        notes[200],
        "800 further unknown elements and attributes are ignored"
    );
}

#[test]
fn large_texts_are_refused_unread() {
    let text = robot(&" ".repeat(17 << 20));
    assert_refused(
        &text,
        ": the size of the file exceeds the limit of 16 MiB; delete what is not the robot",
    );
    let path = std::env::temp_dir().join(format!("tightloop-large-{}.urdf", std::process::id()));
    // sparse: a terabyte of zeros
    std::fs::File::create(&path)
        .unwrap()
        .set_len(1 << 40)
        .unwrap();
    let start = Instant::now();
    let error = Robot::from_urdf(&path, UrdfOptions::default()).unwrap_err();
    std::fs::remove_file(&path).unwrap();
    assert!(
        error.to_string().contains("exceeds the limit of 16 MiB"),
        "{error}"
    );
    assert!(
        start.elapsed() < Duration::from_secs(1),
        "{:?}",
        start.elapsed()
    );
}

#[test]
fn folders_devices_and_absent_files_are_refused() {
    for (path, what) in [
        ("/", "it is not a file"),
        ("/dev/zero", "it is not a file"),
        ("/dev/stdin/x", ""),
        ("/nowhere/robot.urdf", "No such file"),
        ("", ""),
    ] {
        let message = Robot::from_urdf(path, UrdfOptions::default())
            .unwrap_err()
            .to_string();
        assert!(
            message.starts_with(&format!("{path}: cannot be read: ")),
            "{message}"
        );
        assert!(message.contains(what), "{message}");
        assert!(
            message.ends_with("; give the path of an existing file"),
            "{message}"
        );
    }
}

#[test]
fn unknown_elements_nested_120_000_deep_overflow_no_stack() {
    let nest = "<a>".repeat(120_000) + &"</a>".repeat(120_000);
    let robot = read_in_bounds(&robot(&nest)).unwrap();
    assert_eq!(robot.notes, ["<a> is ignored (line 1)"]);
    // the same within what is known
    let nest = "<a>".repeat(100_000) + &"</a>".repeat(100_000);
    let inside = format!("<link name=\"l\"><inertial>{nest}<mass value=\"1\"/></inertial></link>");
    let message = refusal(&self::robot(&inside));
    assert!(message.contains("<inertia> is missing"), "{message}");
    let links = "<link name=\"a\">".repeat(100_000) + &"</link>".repeat(100_000);
    let message = refusal(&self::robot(&links));
    assert!(message.contains("has no place in <link>"), "{message}");
}

#[test]
fn names_and_values_of_10_mb_are_refused_in_short_messages() {
    let long = "n".repeat(10_000_000);
    for text in [
        robot(&format!("<link name=\"{long}\"/>")),
        robot(&format!(
            "<joint name=\"j\" type=\"{long}\"><parent link=\"a\"/><child link=\"b\"/></joint>"
        )),
        robot(&format!(
            "<joint name=\"j\" type=\"fixed\"><parent link=\"{long}\"/><child link=\"b\"/></joint>"
        )),
        robot(&format!(
            "<link name=\"l\"><inertial><mass value=\"{long}\"/></inertial></link>"
        )),
        robot(&format!(
            "<link name=\"l\"><inertial><mass value=\"{}\"/></inertial></link>",
            "1 ".repeat(5_000_000)
        )),
        robot(&format!(
            "<link name=\"l\"><inertial><mass value=\"{}\"/></inertial></link>",
            "1".repeat(10_000_000)
        )),
        robot(&format!(
            "<link name=\"l\"><collision><geometry><mesh filename=\"{long}\"/></geometry></collision></link>"
        )),
        robot(&format!("<link name=\"l\" {long}=\"1\"><inertial/></link>")),
        robot(&format!("<link><{long}/></link>")),
        robot(&format!("<link name=\"l\"></{long}>")),
        format!("<{long}/>"),
        format!("<{long}"),
        format!("<robot name=\"{long}\"><link name=\"a\"/></robot>"),
        format!("<!--{long}"),
        long.clone(),
    ] {
        let message = refusal(&text);
        assert!(
            message.len() < 1_000,
            "{} bytes: {}",
            message.len(),
            &message[..300]
        );
    }
    let long = &long[..5_000_000];
    let notes = read_in_bounds(&robot(&format!("<{long} {long}=\"\"/>")))
        .unwrap()
        .notes;
    assert!(notes[0].len() < 1_000, "{} bytes", notes[0].len());
}

#[test]
fn a_million_digits_are_a_number() {
    let digits = format!("0.{}", "3".repeat(1_000_000));
    let text = robot(&format!(
        "<link name=\"l\">{}</link>{}",
        INERTIAL.replace("value=\"1\"", &format!("value=\"{digits}\"")),
        joint("j", "continuous", "base", "l", "")
    ));
    let mass = read_in_bounds(&text).unwrap().links[1]
        .inertial
        .unwrap()
        .mass;
    assert_eq!(mass, 1.0 / 3.0);
}

#[test]
fn robots_of_too_many_links_joints_and_dofs_are_refused() {
    let links: String = (0..100_000)
        .map(|i| format!("<link name=\"l{i}\"/>"))
        .collect();
    let too_many = |what, most| {
        format!(": the number of {what} exceeds the limit of {most}; delete what is not the robot")
    };
    assert_refused(&robot(&links), &too_many("links", 4096));
    let joints = joint("j", "fixed", "base", "l", "").repeat(50_000);
    assert_refused(&robot(&joints), &too_many("joints", 4096));
    assert_refused(&chain(20_000, "fixed"), &too_many("links", 4096));
    let shape = "<collision><geometry><sphere radius=\"1\"/></geometry></collision>";
    let shapes = format!("<link name=\"l\">{}</link>", shape.repeat(40_000));
    assert_refused(&robot(&shapes), &too_many("collisions", 10_000));
    let visuals = shapes.replace("collision", "visual");
    assert_refused(&robot(&visuals), &too_many("visuals", 10_000));
    assert_refused(
        &chain(2_000, "continuous"),
        ":1: robot `r` has 2000 dofs, more than the 1024 that are supported; fix joints that need not move, or split it",
    );
    assert_refused(
        &chain(342, "planar"),
        ":1: robot `r` has 1026 dofs, more than the 1024 that are supported; fix joints that need not move, or split it",
    );
}

#[test]
fn the_longest_chains_are_read_and_compiled_within_bounds() {
    for (count, kind, dofs, seconds) in [
        (4095, "fixed", 0, 2),
        (1024, "continuous", 1024, 30),
        (512, "continuous", 512, 2),
        (65, "continuous", 65, 2),
    ] {
        let robot = read_in_bounds(&chain(count, kind)).unwrap();
        let mut scene = Description::new(1.0 / 480.0, 1);
        scene.robots.push(robot);
        let (start, ran) = (Instant::now(), time_run());
        assert_eq!(scene.compile().unwrap().dofs(), dofs);
        let time = match (ran, time_run()) {
            (Some(before), Some(after)) => after - before,
            _ => start.elapsed(),
        };
        // 0.5 s for 512 dofs, and with the cube of their number 4 s for 1024
        let most = Duration::from_secs(seconds);
        assert!(time < most, "{count} {kind}: {time:?}");
    }
}

#[test]
fn scenes_of_too_many_dofs_are_refused() {
    let robot = read_in_bounds(&chain(512, "continuous")).unwrap();
    let mut scene = Description::new(1.0 / 480.0, 1);
    for i in 0..5 {
        let name = format!("r{i}");
        scene.robots.push(Robot {
            name,
            ..robot.clone()
        });
    }
    assert_eq!(
        scene.compile().unwrap_err().to_string(),
        "the scene has 2560 dofs, more than the 2048 that are supported; fix joints that need not move, or split it"
    );
}

#[test]
fn a_chain_of_followers_is_flattened_in_time() {
    let mut inside = String::new();
    for i in 0..512 {
        let mimic = format!("<mimic joint=\"j{}\" multiplier=\"-1\"/>", i + 1);
        let mimic = if i < 511 { &mimic } else { "" };
        inside += &format!("<link name=\"l{i}\">{INERTIAL}</link>");
        inside += &joint(
            &format!("j{i}"),
            "continuous",
            "base",
            &format!("l{i}"),
            mimic,
        );
    }
    let robot = read_in_bounds(&robot(&inside)).unwrap();
    let first = robot.joints[0].mimic.unwrap();
    assert_eq!((first.joint, first.multiplier), (511, -1.0));
}

#[test]
fn many_shapes_in_one_link_are_read_in_time() {
    let shapes =
        "<collision><geometry><sphere radius=\"1\"/></geometry></collision>".repeat(10_000);
    let text = robot(&format!(
        "<link name=\"l\">{shapes}</link>{}",
        joint("j", "fixed", "base", "l", "")
    ));
    assert_eq!(
        read_in_bounds(&text).unwrap().links[1].collisions.len(),
        10_000
    );
}

#[test]
fn many_missing_visuals_are_noted_in_time_and_warned_of_in_short() {
    let mesh = format!("package://absent/{}.dae", "m".repeat(1_000));
    let visuals: String = (0..9_900)
        .map(|i| format!("<visual><geometry><mesh filename=\"{mesh}{i}\"/></geometry></visual>"))
        .collect();
    let robot = read_in_bounds(&robot(&format!(
        "<link name=\"l\">{visuals}</link>{}",
        joint("j", "fixed", "base", "l", "")
    )))
    .unwrap();
    assert_eq!(robot.notes.len(), 9_900);
    assert_eq!(robot.warnings.len(), 1);
    assert!(robot.warnings[0].len() < 2_000, "{}", robot.warnings[0]);
}

#[test]
fn a_thousand_floating_bodies_are_refused_in_time() {
    let mut inside = String::new();
    for i in 0..1_000 {
        inside += &format!("<link name=\"l{i}\">{INERTIAL}</link>");
        inside += &joint(&format!("j{i}"), "floating", "base", &format!("l{i}"), "");
    }
    let message = refusal(&robot(&inside));
    assert!(message.contains("6000 dofs"), "{message}");
}

#[test]
fn a_file_of_one_element_many_times_is_refused() {
    let origins = "<origin xyz=\"0 0 0\"/>".repeat(100_000);
    let text = robot(&format!(
        "<link name=\"l\"/>{}",
        joint("j", "fixed", "base", "l", &origins)
    ));
    let notes = read_in_bounds(&text).unwrap().notes;
    assert_eq!(
        notes,
        ["second <origin>, the same again, is ignored (99999 times, first in line 1)"]
    );
    let inertials = INERTIAL.repeat(20_000);
    let message = refusal(&robot(&format!("<link name=\"l\">{inertials}</link>")));
    assert!(
        message.contains("another <inertial> stands in line 1"),
        "{message}"
    );
}
