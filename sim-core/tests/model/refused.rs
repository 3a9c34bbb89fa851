//! Files that are refused: the message names the culprit.

use sim_core::model::{ModelError, Robot, UrdfOptions};

use crate::build::{INERTIAL, LIMIT, assert_says, joint, link, one_joint, read, refusal};

fn refusal_of_text(text: &str) -> String {
    Robot::from_urdf_text(text, "dir/robot.urdf", UrdfOptions::default())
        .unwrap_err()
        .to_string()
}

#[test]
fn missing_file_is_refused_with_its_path() {
    let error = Robot::from_urdf("/nowhere/robot.urdf", UrdfOptions::default()).unwrap_err();
    assert_says(
        &error.to_string(),
        &["/nowhere/robot.urdf", "cannot be read"],
    );
}

#[test]
fn folder_in_place_of_a_file_is_refused() {
    let error = Robot::from_urdf("/", UrdfOptions::default()).unwrap_err();
    assert_says(&error.to_string(), &["not a file"]);
}

#[test]
fn broken_xml_is_refused_with_file_and_line() {
    let message = refusal_of_text("<robot name=\"r\">\n<link name=\"a\">\n</robot>");
    assert_says(&message, &["dir/robot.urdf:3:", "link"]);
    assert_says(&refusal_of_text(""), &["dir/robot.urdf:1:1", "broken XML"]);
}

#[test]
fn another_root_element_is_refused() {
    assert_says(&refusal_of_text("<mujoco/>"), &["<mujoco>", "<robot>"]);
}

#[test]
fn floating_base_without_mass_is_refused() {
    let options = UrdfOptions {
        floating: true,
        ..UrdfOptions::named("dog")
    };
    let error = Robot::from_urdf_text(
        "<robot name=\"r\"><link name=\"a\"/></robot>",
        "x.urdf",
        options,
    )
    .unwrap_err();
    assert_says(&error.to_string(), &["`dog`", "`a`", "no mass"]);
}

#[test]
fn zero_axis_is_refused() {
    let error = read(&one_joint("continuous", "<axis xyz=\"0 0 0\"/>")).unwrap_err();
    assert!(
        matches!(&error, ModelError::ZeroAxis { joint, .. } if joint == "elbow"),
        "{error}"
    );
}

#[test]
fn inverted_range_is_refused() {
    let message = refusal(&one_joint(
        "revolute",
        "<limit lower=\"2\" upper=\"1\" effort=\"1\" velocity=\"1\"/>",
    ));
    assert_says(&message, &["`elbow`", "lower limit 2", "upper limit 1"]);
}

#[test]
fn negative_effort_damping_and_friction_are_refused() {
    let limit = "<limit lower=\"-1\" upper=\"1\" effort=\"-5\" velocity=\"1\"/>";
    assert_says(
        &refusal(&one_joint("revolute", limit)),
        &["`elbow`", "effort limit", "-5"],
    );
    assert_says(
        &refusal(&one_joint("continuous", "<dynamics damping=\"-1\"/>")),
        &["`elbow`", "damping", "-1"],
    );
    assert_says(
        &refusal(&one_joint("continuous", "<dynamics friction=\"-1\"/>")),
        &["`elbow`", "friction", "-1"],
    );
}

#[test]
fn numbers_that_are_none_are_refused_with_their_line() {
    assert_says(
        &refusal(&one_joint("continuous", "<axis xyz=\"0 nan 1\"/>")),
        &["robot.urdf:4", "`elbow`", "xyz", "nan"],
    );
    assert_says(
        &refusal(&one_joint("continuous", "<axis xyz=\"0 1\"/>")),
        &["`elbow`", "three numbers"],
    );
    assert_says(
        &refusal(&one_joint("continuous", "<dynamics damping=\"much\"/>")),
        &["<dynamics>", "`elbow`", "much"],
    );
    assert_says(
        &refusal(&one_joint("continuous", "<origin rpy=\"0 0 ${pi/2}\"/>")),
        &["`elbow`", "xacro"],
    );
    assert_says(
        &refusal(&one_joint("continuous", "<dynamics damping=\"1e400\"/>")),
        &["`elbow`", "finite"],
    );
}

#[test]
fn missing_and_repeated_parts_are_refused_by_element() {
    let without_mass = link(
        "base",
        "<inertial><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>",
    );
    assert_says(
        &refusal(&without_mass),
        &["<inertial> of link `base`", "<mass> is missing"],
    );
    let short_inertia = link(
        "base",
        "<inertial><mass value=\"1\"/><inertia ixx=\"1\"/></inertial>",
    );
    assert_says(&refusal(&short_inertia), &["link `base`", "ixy"]);
    assert_says(
        &refusal(&link("base", &INERTIAL.repeat(2))),
        &["<link> `base`", "2 times"],
    );
    assert_says(&refusal("<link/>"), &["<link>", "`name`"]);
    assert_says(
        &refusal(&(link("base", "") + "<joint name=\"elbow\" type=\"fixed\"/>")),
        &["`elbow`", "<parent>"],
    );
    assert_says(
        &refusal(&link("base", "<collision/>")),
        &["`base`", "<geometry>"],
    );
    let two_shapes =
        "<collision><geometry><sphere radius=\"1\"/><box size=\"1 1 1\"/></geometry></collision>";
    assert_says(&refusal(&link("base", two_shapes)), &["`base`", "2 shapes"]);
}

#[test]
fn sizes_that_are_not_positive_are_refused() {
    for shape in [
        "<box size=\"1 0 1\"/>",
        "<sphere radius=\"-1\"/>",
        "<cylinder radius=\"1\" length=\"0\"/>",
    ] {
        let collision =
            format!("<collision name=\"palm\"><geometry>{shape}</geometry></collision>");
        assert_says(
            &refusal(&link("base", &collision)),
            &["`base`", "`palm`", "above 0"],
        );
    }
}

#[test]
fn negative_mass_and_inertia_are_refused() {
    assert_says(
        &refusal(&link(
            "base",
            &INERTIAL.replace("mass value=\"1\"", "mass value=\"-2\""),
        )),
        &["`base`", "mass", "-2"],
    );
    assert_says(
        &refusal(&link("base", &INERTIAL.replace("ixx=\"1\"", "ixx=\"-3\""))),
        &["`base`", "negative", "-3"],
    );
    // the diagonal is positive here, a principal moment is not: 1 − 2
    assert_says(
        &refusal(&link("base", &INERTIAL.replace("ixy=\"0\"", "ixy=\"2\""))),
        &["`base`", "negative principal moment"],
    );
}

#[test]
fn massless_moving_link_is_refused() {
    let body = link("base", INERTIAL)
        + &link("arm", "")
        + &joint("elbow", "continuous", "base", "arm", "");
    assert_says(&refusal(&body), &["`arm`", "`elbow`", "mass"]);
    let point = INERTIAL.replace("=\"1\" iyy=\"1\" izz=\"1\"", "=\"0\" iyy=\"0\" izz=\"0\"");
    let body =
        link("base", "") + &link("arm", &point) + &joint("elbow", "continuous", "base", "arm", "");
    assert_says(&refusal(&body), &["`arm`", "`elbow`", "no inertia"]);
}

#[test]
fn trees_that_are_none_are_refused_by_the_links() {
    assert_says(&refusal(""), &["`r`", "no links"]);
    assert_says(
        &refusal(&(link("a", "") + &link("b", ""))),
        &["2 roots", "`a`", "`b`"],
    );
    let unknown = link("a", "") + &joint("j", "fixed", "a", "b", "");
    assert_says(&refusal(&unknown), &["`j`", "child link `b`", "`a`"]);
    let unknown = link("a", "") + &joint("j", "fixed", "z", "a", "");
    assert_says(&refusal(&unknown), &["`j`", "parent link `z`"]);
    let ring = link("a", "")
        + &link("b", "")
        + &joint("j", "fixed", "a", "b", "")
        + &joint("k", "fixed", "b", "a", "");
    assert_says(&refusal(&ring), &["loop", "`a`", "`b`"]);
    let tail = link("root", "") + &ring;
    assert_says(&refusal(&tail), &["loop", "`a`", "`b`"]);
    let own_parent = link("a", "") + &joint("j", "fixed", "a", "a", "");
    assert_says(&refusal(&own_parent), &["loop", "`a`"]);
    let three = link("a", "") + &link("b", "") + &link("c", "");
    let two_parents = three
        + &joint("j", "fixed", "a", "c", "")
        + &joint("k", "fixed", "a", "b", "")
        + &joint("l", "fixed", "b", "c", "");
    assert_says(&refusal(&two_parents), &["`c`", "`j`", "`l`"]);
}

#[test]
fn names_that_come_twice_are_refused() {
    assert_says(
        &refusal(&(link("a", "") + &link("a", ""))),
        &["two links", "`a`"],
    );
    let joints = joint("j", "fixed", "a", "b", "") + &joint("j", "fixed", "a", "c", "");
    let body = link("a", "") + &link("b", "") + &link("c", "") + &joints;
    assert_says(&refusal(&body), &["two joints", "`j`"]);
}

#[test]
fn robot_name_with_a_slash_is_refused() {
    let text = "<robot name=\"r\"><link name=\"a\"/></robot>";
    let error = Robot::from_urdf_text(text, "x.urdf", UrdfOptions::named("left/arm")).unwrap_err();
    assert_says(&error.to_string(), &["left/arm", "slash"]);
    let error = Robot::from_urdf_text(text, "x.urdf", UrdfOptions::named("")).unwrap_err();
    assert_says(&error.to_string(), &["robot name"]);
}

#[test]
fn half_infinite_range_is_refused() {
    let limit = LIMIT.replace("lower=\"-1\"", "lower=\"-inf\"");
    assert_says(
        &refusal(&one_joint("revolute", &limit)),
        &["`elbow`", "lower limit", "inf"],
    );
}
