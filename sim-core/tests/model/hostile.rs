//! Files made to do harm, and files that were damaged: refused in time, never a panic.

use std::time::{Duration, Instant};

use proptest::prelude::*;
use sim_core::model::{Robot, UrdfOptions};

use crate::build::{INERTIAL, assert_says, joint, link, read};

fn refusal(text: &str) -> String {
    Robot::from_urdf_text(text, "robot.urdf", UrdfOptions::default())
        .unwrap_err()
        .to_string()
}

#[test]
fn xml_bombs_are_refused_within_a_second() {
    let mut bomb = String::from("<!DOCTYPE robot [<!ENTITY a \"aaaaaaaaaa\">");
    for (name, inner) in ["b", "c", "d", "e", "f", "g", "h", "i"]
        .iter()
        .zip(["a", "b", "c", "d", "e", "f", "g", "h"])
    {
        bomb.push_str(&format!(
            "<!ENTITY {name} \"{}\">",
            format!("&{inner};").repeat(10)
        ));
    }
    bomb.push_str("]><robot name=\"r\"><link name=\"&i;\"/></robot>");
    let start = Instant::now();
    assert_says(&refusal(&bomb), &["DOCTYPE", "refused"]);
    assert!(start.elapsed() < Duration::from_secs(1));
}

#[test]
fn too_many_nodes_are_refused() {
    let text = format!("<robot name=\"r\">{}</robot>", "<a/>".repeat(1_000_001));
    assert_says(&refusal(&text), &["number of XML nodes", "1000000"]);
}

#[test]
fn unknown_elements_nested_100_000_deep_overflow_no_stack() {
    let nest = "<a>".repeat(100_000) + &"</a>".repeat(100_000);
    let robot = read(&(nest + &link("base", ""))).unwrap();
    assert_says(&robot.notes[0], &["<a> is ignored"]);
}

#[test]
fn chain_of_10_000_links_that_follow_one_another_is_read_within_5_s() {
    let mut body = link("l0", "");
    for i in 1..=10_000 {
        let mimic = format!("<mimic joint=\"j{}\" multiplier=\"-1\"/>", i + 1);
        body += &link(&format!("l{i}"), INERTIAL);
        body += &joint(
            &format!("j{i}"),
            "continuous",
            &format!("l{}", i - 1),
            &format!("l{i}"),
            if i < 10_000 { &mimic } else { "" },
        );
    }
    let start = Instant::now();
    let robot = read(&body).unwrap();
    assert!(
        start.elapsed() < Duration::from_secs(5),
        "{:?}",
        start.elapsed()
    );
    assert_eq!(robot.moving_joints().len(), 10_000);
    let first = robot.joints[0].mimic.unwrap();
    assert_eq!((first.joint, first.multiplier), (9_999, -1.0));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_file_is_read_or_refused_without_panic(
        cut in any::<prop::sample::Index>(),
        length in 0..60_usize,
        patch in "[ -~]{0,12}",
    ) {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/assets/fr3/fr3_franka_hand.urdf");
        let text = std::fs::read_to_string(path).unwrap();
        let start = cut.index(text.len());
        let end = (start + length).min(text.len());
        let damaged = format!("{}{patch}{}", &text[..start], &text[end..]);
        match Robot::from_urdf_text(&damaged, path, UrdfOptions::default()) {
            Ok(robot) => prop_assert!(robot.moving_joints().len() <= 9),
            Err(error) => prop_assert!(!error.to_string().is_empty()),
        }
    }
}
