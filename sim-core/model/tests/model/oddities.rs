//! What published files hold that no standard asks for: read as its author meant it, noted where something has no effect.

use sim_model::{Robot, UrdfOptions};

/// One hinge, written plainly.
pub const PLAIN: &str = r#"<robot name="r">
  <link name="base"/>
  <link name="arm">
    <inertial><origin xyz="0.5 0 -1"/><mass value="2"/>
      <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision name="skin"><geometry><box size="1 2 3"/></geometry></collision>
  </link>
  <joint name="elbow" type="revolute">
    <origin xyz="1 0 0.001" rpy="0 0 0.5"/><parent link="base"/><child link="arm"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="3" velocity="4"/>
  </joint>
</robot>
"#;

pub fn read(text: &str) -> Robot {
    match Robot::from_urdf_text(text, "robot.urdf", UrdfOptions::default()) {
        Ok(robot) => robot,
        Err(error) => panic!("{error}"),
    }
}

/// Asserts that a text says the same as the plain one, and what is noted.
#[track_caller]
fn reads_as_plain(text: &str, notes: &[&str]) {
    let (odd, plain) = (read(text), read(PLAIN));
    assert_eq!((&odd.links, &odd.joints), (&plain.links, &plain.joints));
    assert_eq!(odd.name, "r");
    assert_eq!(odd.notes, notes);
}

/// The plain text with something else in place of a part of it.
#[track_caller]
fn with(part: &str, other: &str) -> String {
    assert!(PLAIN.contains(part), "{part}");
    PLAIN.replacen(part, other, 1)
}

#[test]
fn plain_text_has_no_notes() {
    reads_as_plain(PLAIN, &[]);
}

#[test]
fn xml_declarations_of_any_kind_are_passed_over() {
    for declaration in [
        "<?xml version=\"1.0\"?>",
        "<?xml version='1.0' encoding='utf-8' standalone='yes' ?>\n",
        "<?xml version=\"1.0\" encoding=\"ascii\"?>",
        "<?xml version=\"1.0\" encoding=\"us-ascii\"?>",
        "<?xml version=\"1.0\" encoding=\"ISO-8859-1\"?>",
        "<?xml version=\"1.1\"?>",
        "<?xml encoding=\"UTF8\"?>",
        "<?xml?>",
        "\u{feff}<?xml version=\"1.0\"?>",
        "\u{feff}",
        "<?xml-stylesheet href=\"style.css\"?>\n",
    ] {
        reads_as_plain(&(declaration.to_owned() + PLAIN), &[]);
    }
    let late = "the XML declaration is not at the start of the file and is ignored (line 3)";
    for before in ["\n\n", "<!-- made by\n hand -->\n", "<!-- a -->\n<?b?>\n"] {
        reads_as_plain(
            &format!("{before}<?xml version=\"1.0\"?>\n{PLAIN}"),
            &[late],
        );
    }
}

#[test]
fn comments_may_stand_anywhere_and_hold_anything() {
    let text = with(
        "<link name=\"base\"/>",
        "<!-- one -- two --- <link name=\"lost\"> & ]]> --->\n<link name=\"base\"/><!----><!-- -->",
    )
    .replace("<mass", "<!-- the mass\n-- of the arm --><mass")
    .replace("xyz=\"0.5 0 -1\"/>", "xyz=\"0.5 0 -1\"/><!-- é 漢 -- -->");
    reads_as_plain(
        &format!("<!-- -- before --->\n{text}<!-- after -- -->\n"),
        &[],
    );
}

#[test]
fn line_ends_tabs_and_blanks_do_not_matter() {
    reads_as_plain(&PLAIN.replace('\n', "\r\n"), &[]);
    reads_as_plain(&PLAIN.replace("  ", "\t"), &[]);
    reads_as_plain(&PLAIN.replace("=\"", " = \""), &[]);
    reads_as_plain(&PLAIN.replace('"', "'"), &[]);
    reads_as_plain(&format!("\n \t{PLAIN}\n\0\0"), &[]);
    reads_as_plain(&with("xyz=\"1 0 0.001\"", "xyz=\"  1\t0\n  0.001 \""), &[]);
}

#[test]
fn numbers_are_read_as_c_writes_them() {
    for one in ["1.", "+1", "01.0", "1e0", "1.0E+00", "10e-1", " 1 "] {
        reads_as_plain(
            &with("xyz=\"1 0 0.001\"", &format!("xyz=\"{one} -0.0 1e-3\"")),
            &[],
        );
    }
    reads_as_plain(&with("xyz=\"0.5 0 -1\"", "xyz=\".5  0.  -1.\""), &[]);
    reads_as_plain(
        &with("xyz=\"1 0 0.001\"", "xyz=\"1, 0,\t0.001\""),
        &["comma in attribute `xyz` of <origin> is ignored (line 9)"],
    );
}

#[test]
fn elements_come_in_any_order() {
    let [head, base, rest] = PLAIN.splitn(3, '\n').collect::<Vec<_>>()[..] else {
        unreachable!()
    };
    let (arm, joint) = rest.split_once("  <joint").unwrap();
    let joint = format!("<joint{}", joint.replace("</robot>\n", ""));
    let text = format!("{head}{joint}{base}{arm}</robot>");
    reads_as_plain(&text, &[]);
    let mass = "<mass value=\"2\"/>";
    let text = with(mass, "").replace("</inertial>", &format!("{mass}</inertial>"));
    reads_as_plain(&text, &[]);
    let collision =
        "<collision name=\"skin\"><geometry><box size=\"1 2 3\"/></geometry></collision>";
    let text = with(collision, "").replace("<inertial>", &format!("{collision}<inertial>"));
    reads_as_plain(&text, &[]);
    let child = "<child link=\"arm\"/>";
    let text = with(child, "").replace("<origin xyz=\"1", &format!("{child}<origin xyz=\"1"));
    reads_as_plain(&text, &[]);
}

#[test]
fn leftovers_of_xacro_are_noted() {
    let text = PLAIN.replace(
        "<robot name=\"r\">",
        "<robot name=\"r\" xmlns:xacro=\"http://www.ros.org/wiki/xacro\" xmlns:sensor=\"http://playerstage.sourceforge.net/gazebo/xmlschema/#sensor\">\
         <xacro:property name=\"pi\" value=\"3.14\"/><xacro:arg name=\"x\" default=\"${pi}\"/>\
         <xacro:macro name=\"m\" params=\"a\"><link name=\"${a}\"/></xacro:macro>",
    );
    reads_as_plain(
        &text,
        &[
            "<xacro:property> is ignored (line 1)",
            "<xacro:arg> is ignored (line 1)",
            "<xacro:macro> is ignored (line 1)",
        ],
    );
}

#[test]
fn calls_of_macros_that_are_nowhere_defined_are_warned_of() {
    let text = with(
        "<link name=\"base\"/>",
        "<link name=\"base\"><xacro:look/></link><xacro:sensors_usb/><xacro:sensors_usb/>",
    );
    reads_as_plain(
        &text,
        &[
            "<xacro:look> is ignored (line 2)",
            "<xacro:sensors_usb> is ignored (2 times, first in line 2)",
            "the XML prefix `xacro` is not declared",
        ],
    );
    let warnings = read(&text).warnings;
    assert_eq!(warnings.len(), 1);
    assert!(
        warnings[0].contains("<xacro:look>, <xacro:sensors_usb>"),
        "{warnings:?}"
    );
}

#[test]
fn prefixes_that_nobody_declared_are_noted() {
    let text = with(
        "<link name=\"base\"/>",
        "<link name=\"base\" cad:id=\"7\"/><drake:joint name=\"d\"/>\n<drake:joint/>",
    );
    reads_as_plain(
        &text,
        &[
            "attribute `id` of <link> is ignored (line 2)",
            "<drake:joint> is ignored (2 times, first in line 2)",
            "the XML prefix `cad` is not declared",
            "the XML prefix `drake` is not declared",
        ],
    );
    let text =
        format!("<?xml version=\"1.0\"?>\n<!-- -- -->{PLAIN}").replace("<mass", "<cad:note/><mass");
    reads_as_plain(
        &text,
        &[
            "<cad:note> is ignored (line 5)",
            "the XML prefix `cad` is not declared",
        ],
    );
}

#[test]
fn a_default_namespace_changes_nothing() {
    reads_as_plain(
        &with(
            "<robot name=\"r\">",
            "<robot name=\"r\" xmlns=\"http://www.ros.org\">",
        ),
        &[],
    );
    let text = PLAIN
        .replace("<robot", "<u:robot xmlns:u=\"urn:urdf\"")
        .replace("</robot", "</u:robot");
    let text = [
        "link",
        "joint",
        "inertial",
        "origin",
        "mass",
        "inertia",
        "collision",
        "geometry",
        "box",
        "parent",
        "child",
        "axis",
        "limit",
    ]
    .iter()
    .fold(text, |text, tag| {
        text.replace(&format!("<{tag} "), &format!("<u:{tag} "))
            .replace(&format!("<{tag}>"), &format!("<u:{tag}>"))
            .replace(&format!("</{tag}>"), &format!("</u:{tag}>"))
    });
    reads_as_plain(&text, &[]);
}

#[test]
fn elements_of_simulators_are_noted_once_each() {
    let text = with(
        "<inertial>",
        "<contact><lateral_friction value=\"1\"/></contact><inertial>",
    )
    .replace("<geometry>", "<verbose value=\"Yes\"/><contact_coefficients mu=\"0\"/><geometry>")
    .replace("<axis xyz", "<hardwareInterface>x</hardwareInterface><axis xyz")
    .replace(
        "</robot>",
        "<sensor name=\"s\"><parent link=\"arm\"/><joint name=\"lost\"/></sensor>\n<mujoco><compiler/></mujoco>\
         <ros2_control name=\"c\"><joint name=\"elbow\"/></ros2_control><transmission name=\"t\"/>\n\
         <gazebo reference=\"arm\"/><gazebo><plugin/></gazebo><loop_joint name=\"l\"/></robot>",
    );
    let text = text.replace(
        "velocity=\"4\"/>",
        "velocity=\"4\"/><safety_controller k_velocity=\"1\"/><calibration rising=\"0\"/>",
    );
    reads_as_plain(
        &text,
        &[
            "<contact> is ignored (line 4)",
            "<verbose> is ignored (line 6)",
            "<contact_coefficients> is ignored (line 6)",
            "<hardwareInterface> is ignored (line 10)",
            "<safety_controller> is ignored (line 10)",
            "<calibration> is ignored (line 10)",
            "<sensor> is ignored (line 12)",
            "<mujoco> is ignored (line 13)",
            "<ros2_control> is ignored (line 13)",
            "<transmission> is ignored (line 13)",
            "<gazebo> is ignored (2 times, first in line 14)",
            "<loop_joint> is ignored (line 14)",
        ],
    );
}

#[test]
fn materials_may_be_twice_undefined_or_anywhere() {
    let text = with(
        "<link name=\"base\"/>",
        "<material name=\"red\"/><material name=\"red\"><color rgba=\"1 0 0 1\"/></material>\
         <link name=\"base\"><visual><geometry><box size=\"1 1 1\"/></geometry><material name=\"undefined\"/></visual><visual/></link>",
    )
    .replace("<geometry>", "<material name=\"\"/><geometry>");
    reads_as_plain(&text, &[]);
}

#[test]
fn parts_that_are_said_twice_alike_are_noted() {
    reads_as_plain(
        &with(
            "<axis xyz=\"0 0 1\"/>",
            "<axis xyz=\"0 0 1\"/>\n<axis xyz=\"0 0 1\"></axis>",
        ),
        &["second <axis>, the same again, is ignored (line 11)"],
    );
}

#[test]
fn attributes_that_urdf_does_not_have_are_noted() {
    reads_as_plain(
        &with(
            "<link name=\"base\"/>",
            "<link name=\"base\" type=\"laser\" concave=\"yes\"/>",
        )
        .replace("velocity=\"4\"", "velocity=\"4\" acceleration=\"9\""),
        &[
            "attribute `type` of <link> is ignored (line 2)",
            "attribute `concave` of <link> is ignored (line 2)",
            "attribute `acceleration` of <limit> is ignored (line 10)",
        ],
    );
}

#[test]
fn text_between_elements_and_cdata_mean_nothing() {
    reads_as_plain(
        &with(
            "<inertial>",
            "stray text<inertial><![CDATA[<mass value=\"9\"/>]]>",
        ),
        &[],
    );
}

#[test]
fn versions_up_to_1_2_are_known() {
    for version in ["1", "1.0", "1.1", "1.2", " 1.0 "] {
        reads_as_plain(
            &with("<robot name", &format!("<robot version=\"{version}\" name")),
            &[],
        );
    }
    reads_as_plain(
        &with("<robot name", "<robot version=\"2.0\" name"),
        &["unknown version `2.0` of URDF is ignored (line 1)"],
    );
}
