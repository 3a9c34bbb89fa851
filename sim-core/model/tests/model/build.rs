//! Small robots as text.

use sim_model::{ModelError, Robot, UrdfOptions};

/// A unit mass with unit inertia.
pub const INERTIAL: &str = r#"<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>"#;

/// A range of one radian or metre to either side.
pub const LIMIT: &str = r#"<limit lower="-1" upper="1" effort="1" velocity="1"/>"#;

/// A link that holds this.
pub fn link(name: &str, inside: &str) -> String {
    format!("<link name=\"{name}\">{inside}</link>\n")
}

/// A joint that holds this besides its links.
pub fn joint(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    format!(
        "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>{inside}</joint>\n"
    )
}

/// Links `base` and `arm`, and the joint `elbow` between them that holds this.
pub fn one_joint(kind: &str, inside: &str) -> String {
    link("base", "") + &link("arm", INERTIAL) + &joint("elbow", kind, "base", "arm", inside)
}

/// Reads the robot `r` that holds this, as if from `robot.urdf` in the working directory.
pub fn read(inside: &str) -> Result<Robot, ModelError> {
    Robot::from_urdf_text(
        &format!("<robot name=\"r\">\n{inside}</robot>"),
        "robot.urdf",
        UrdfOptions::default(),
    )
}

/// Asserts that a message holds every one of these parts.
#[track_caller]
pub fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not said in: {message}");
    }
}
