//! What a URDF file may say and probably does not mean: a warning names it and what may be meant.

use sim_model::{ModelError, Robot, UrdfOptions};

use crate::build::assert_says;
use crate::oddities::{PLAIN, read};

/// The only warning of the plain text with something else in place of a part of it.
#[track_caller]
fn warning(part: &str, other: &str) -> String {
    assert!(PLAIN.contains(part), "{part}");
    let warnings = read(&PLAIN.replacen(part, other, 1)).warnings;
    match &warnings[..] {
        [warning] => warning.clone(),
        _ => panic!("{other}: {warnings:?}"),
    }
}

#[track_caller]
fn assert_silent(part: &str, other: &str) {
    assert!(PLAIN.contains(part), "{part}");
    let warnings = read(&PLAIN.replacen(part, other, 1)).warnings;
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn a_misspelt_name_is_warned_of_with_the_one_that_may_be_meant() {
    let cases = [
        (
            "<link name=\"base\"/>",
            "<link name=\"base\"><intertial/></link>",
            "<inertial>",
        ),
        (
            "<link name=\"base\"/>",
            "<link name=\"base\"><colision/></link>",
            "<collision>",
        ),
        (
            "<link name=\"base\"/>",
            "<link name=\"base\"><visuals/></link>",
            "<visual>",
        ),
        (
            "<origin xyz=\"1 0 0.001\" rpy=\"0 0 0.5\"/>",
            "<orgin xyz=\"1 0 0\"/>",
            "<origin>",
        ),
        ("<limit ", "<limits ", "<limit>"),
        (
            "lower=\"-1\" upper=\"1\"",
            "min=\"-1\" max=\"1\"",
            "`lower`",
        ),
        (
            "lower=\"-1\" upper=\"1\"",
            "Lower=\"-1\" Upper=\"1\"",
            "`upper`",
        ),
        ("rpy=\"0 0 0.5\"", "RPY=\"0 0 0.5\"", "`rpy`"),
        ("<origin xyz=\"1", "<origin pos=\"1", "`xyz`"),
        ("<axis", "<dynamics dampening=\"1\"/><axis", "`damping`"),
        ("<axis", "<dynamic damping=\"1\"/><axis", "<dynamics>"),
    ];
    for (part, other, meant) in cases {
        let text = warning(part, other);
        assert_says(
            &text,
            &["names that URDF does not have", " in line ", meant],
        );
    }
    let text = PLAIN.replace(
        "<joint name=\"elbow\"",
        "<link name=\"finger\"><inertial><mass value=\"1\"/>\
         <inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial></link>\
         <joint name=\"f\" type=\"continuous\"><parent link=\"arm\"/><child link=\"finger\"/>\
         <mimic joint=\"elbow\" multiplicator=\"2\"/></joint><joint name=\"elbow\"",
    );
    assert_says(
        &read(&text).warnings[0],
        &["`multiplicator` of <mimic>", "`multiplier`"],
    );
}

#[test]
fn what_simulators_add_to_urdf_is_no_mistake() {
    for extension in [
        "<contact><lateral_friction value=\"1\"/></contact>",
        "<self_collision_checking/>",
        "<collision_checking/>",
        "<gravity>1</gravity>",
    ] {
        assert_silent(
            "<link name=\"base\"/>",
            &format!("<link name=\"base\">{extension}</link>"),
        );
    }
    for extension in [
        "<safety_controller k_velocity=\"1\"/>",
        "<calibration rising=\"0\"/>",
        "<hardwareInterface/>",
        "<physics/>",
        "<damping_ratio/>",
    ] {
        assert_silent("<axis", &format!("{extension}<axis"));
    }
    assert_silent(
        "<limit ",
        "<limit acceleration=\"3\" jerk=\"9\" max_velocity=\"2\" ",
    );
    assert_silent(
        "<link name=\"base\"/>",
        "<link name=\"base\"/><gazebo/><transmission name=\"t\"/>",
    );
    // what is there as it should be is not missed
    assert_silent("<limit ", "<limits lower=\"0\"/><limit ");
}

#[test]
fn rpy_beyond_a_turn_is_warned_of_as_degrees() {
    let text = warning("rpy=\"0 0 0.5\"", "rpy=\"0 -90 0\"");
    assert_says(
        &text,
        &[
            "look like degrees",
            "<origin> of joint `elbow`",
            "(0 -90 0)",
            "57.29578",
        ],
    );
    assert_silent("rpy=\"0 0 0.5\"", "rpy=\"6.2832 -6.2832 3\"");
}

#[test]
fn what_is_not_included_is_refused() {
    let text = PLAIN.replacen("<link", "<xi:include href=\"arm.urdf\"/><link", 1);
    let error = Robot::from_urdf_text(&text, "r.urdf", UrdfOptions::default()).unwrap_err();
    assert!(matches!(error, ModelError::Urdf { .. }));
    assert_says(&error.to_string(), &["<xi:include>", "is not followed"]);
}

#[test]
fn a_tiny_axis_is_noted_in_few_digits() {
    let robot = read(&PLAIN.replacen("<axis xyz=\"0 0 1\"", "<axis xyz=\"0 0 1e-300\"", 1));
    assert_says(&robot.notes[0], &["axis of length 1e-300 is scaled to 1"]);
}

#[test]
fn thousands_of_likely_mistakes_are_counted_in_no_time_and_listed_in_few() {
    let links: String = (0..4000)
        .map(|index| {
            format!(
                "<link name=\"l{index}\"><colision/><collision><origin rpy=\"0 0 90\" pos=\"1\"/>{}\
                 <geometry><sphere radius=\"1\"/></geometry></collision></link>\n",
                " ".repeat(1000)
            )
        })
        .collect();
    let text = format!("<robot name=\"r\">{links}</robot>");
    let start = std::time::Instant::now();
    let error = Robot::from_urdf_text(&text, "r.urdf", UrdfOptions::default()).unwrap_err();
    // counting lines for each would take most of a minute
    assert!(
        start.elapsed() < std::time::Duration::from_secs(5),
        "{:?}",
        start.elapsed()
    );
    assert!(error.to_string().len() < 1000, "{error}");
    let [first, second] = [8, 20].map(|count| {
        let colisions = "<colision/>\n".repeat(count);
        let link = format!("<link name=\"base\">{colisions}</link>");
        warning("<link name=\"base\"/>", &link)
    });
    assert!(!first.contains('…') && second.contains('…'), "{second}");
    assert!(second.len() < 2 * first.len());
}
