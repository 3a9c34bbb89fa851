//! Refusals that depend on the options; `tests/malformed` has the files that are refused whatever the options.

use sim_model::{ModelError, Robot, UrdfOptions};

use crate::build::{INERTIAL, assert_says, joint, link, one_joint};

fn refusal(inside: &str, options: UrdfOptions) -> String {
    let text = format!("<robot name=\"r\">\n{inside}</robot>");
    Robot::from_urdf_text(&text, "x.urdf", options)
        .unwrap_err()
        .to_string()
}

fn floating() -> UrdfOptions {
    UrdfOptions {
        floating: true,
        ..UrdfOptions::named("dog")
    }
}

#[test]
fn floating_base_without_mass_is_refused() {
    assert_says(
        &refusal(&link("a", ""), floating()),
        &["x.urdf:2:", "`dog`", "`a`", "no mass"],
    );
}

#[test]
fn joint_of_a_floating_robot_is_refused_with_its_own_line() {
    let limit = "<limit lower=\"2\" upper=\"1\"/>";
    let text = one_joint("revolute", limit)
        .replace("<link name=\"base\"></link>\n", &link("base", INERTIAL));
    assert_says(&refusal(&text, floating()), &["x.urdf:4:", "`elbow`"]);
    assert_says(
        &refusal(&text, UrdfOptions::default()),
        &["x.urdf:4:", "`elbow`"],
    );
}

#[test]
fn floating_joint_of_a_floating_robot_is_refused() {
    let text = link("a", INERTIAL) + &link("b", INERTIAL) + &joint("j", "floating", "a", "b", "");
    assert_says(
        &refusal(&text, floating()),
        &["x.urdf:4:", "`j`", "`floating_base`"],
    );
}

#[test]
fn robot_names_with_a_slash_or_without_letters_are_refused() {
    for (name, rule) in [
        ("left/arm", "slash"),
        ("", "printable"),
        (" ", "printable"),
        ("a\nb", "printable"),
        (&"a".repeat(257), "at most 256 bytes"),
    ] {
        assert_says(
            &refusal(&link("a", ""), UrdfOptions::named(name)),
            &["robot name", rule],
        );
    }
}

#[test]
fn error_in_a_file_holds_what_is_wrong() {
    let text = format!(
        "<robot name=\"r\">{}</robot>",
        one_joint("continuous", "<axis xyz=\"0 0 0\"/>")
    );
    let error = Robot::from_urdf_text(&text, "x.urdf", UrdfOptions::default()).unwrap_err();
    let ModelError::InFile { line, error, .. } = error else {
        panic!("{error}");
    };
    assert!(matches!(*error, ModelError::ZeroAxis { ref joint, .. } if joint == "elbow"));
    assert_eq!(line, 3);
}
