//! What a URDF file becomes.

use sim_model::{JointKind, Robot, Shape, UrdfOptions};

use crate::build::{INERTIAL, LIMIT, assert_says, joint, link, one_joint, read};

/// Eight roundings of numbers near 1.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

fn elbow(kind: &str, inside: &str) -> sim_model::Joint {
    read(&one_joint(kind, inside)).unwrap().joints.remove(0)
}

#[test]
fn absent_effort_and_velocity_are_no_limit_and_zero_is_zero() {
    let joint = elbow("revolute", "<limit lower=\"-1\" upper=\"1\"/>");
    assert_eq!(
        (joint.dofs[0].effort_limit, joint.velocity_limit),
        (None, None)
    );
    let joint = elbow(
        "revolute",
        "<limit lower=\"-1\" upper=\"1\" effort=\"0\" velocity=\"0\"/>",
    );
    assert_eq!(
        (joint.dofs[0].effort_limit, joint.velocity_limit),
        (Some(0.0), Some(0.0))
    );
    let joint = elbow(
        "revolute",
        "<limit lower=\"-1\" upper=\"1\" effort=\"inf\" velocity=\"inf\"/>",
    );
    assert_eq!(
        (joint.dofs[0].effort_limit, joint.velocity_limit),
        (None, None)
    );
    assert_eq!(elbow("continuous", "").dofs[0].effort_limit, None);
}

#[test]
fn limits_dynamics_and_kinds_are_read() {
    let joint = elbow(
        "prismatic",
        "<limit lower=\"-0.5\" upper=\"2\" effort=\"7\" velocity=\"3\"/><dynamics damping=\"0.25\" friction=\"0.125\"/>",
    );
    assert_eq!(joint.kind, JointKind::Prismatic);
    assert_eq!(joint.range, Some([-0.5, 2.0]));
    assert_eq!(
        (joint.dofs[0].effort_limit, joint.velocity_limit),
        (Some(7.0), Some(3.0))
    );
    assert_eq!(
        (joint.dofs[0].damping, joint.dofs[0].friction),
        (0.25, 0.125)
    );
    let joint = elbow("continuous", LIMIT);
    assert_eq!(
        (joint.kind, joint.range, joint.dofs[0].effort_limit),
        (JointKind::Revolute, None, Some(1.0))
    );
    assert_eq!(elbow("fixed", "").kind, JointKind::Fixed);
}

#[test]
fn range_with_one_end_takes_0_for_the_other_and_reports_it() {
    let robot = read(&one_joint(
        "revolute",
        "<limit upper=\"1\" effort=\"1\" velocity=\"1\"/>",
    ))
    .unwrap();
    assert_eq!(robot.joints[0].range, Some([0.0, 1.0]));
    assert_says(&robot.notes[0], &["`elbow`", "lower"]);
}

#[test]
fn range_that_is_absent_or_of_no_width_is_none_and_reports_it() {
    for limit in [
        "",
        "<limit effort=\"1\" velocity=\"1\"/>",
        "<limit lower=\"0\" upper=\"0\"/>",
    ] {
        let robot = read(&one_joint("prismatic", limit)).unwrap();
        assert_eq!(robot.joints[0].range, None, "{limit}");
        assert_says(&robot.notes[0], &["`elbow`", "unlimited"]);
    }
}

#[test]
fn range_from_minus_to_plus_infinity_is_none() {
    let joint = elbow(
        "revolute",
        "<limit lower=\"-inf\" upper=\"inf\" effort=\"1\" velocity=\"1\"/>",
    );
    assert_eq!(joint.range, None);
}

#[test]
fn axis_is_x_by_default_and_scaled_to_1_with_a_note() {
    assert_eq!(elbow("continuous", "").axis, [1.0, 0.0, 0.0]);
    let robot = read(&one_joint("continuous", "<axis xyz=\"0 3 4\"/>")).unwrap();
    for (part, expected) in robot.joints[0].axis.iter().zip([0.0, 0.6, 0.8]) {
        assert!((part - expected).abs() < ROUNDING);
    }
    assert_says(&robot.notes[0], &["`elbow`", "length 5"]);
    let tiny = elbow("continuous", "<axis xyz=\"0 0 1e-200\"/>");
    assert_eq!(tiny.axis, [0.0, 0.0, 1.0]);
}

#[test]
fn zero_axis_of_a_fixed_joint_does_not_matter() {
    assert!(read(&one_joint("fixed", "<axis xyz=\"0 0 0\"/>")).is_ok());
}

#[test]
fn rpy_turns_about_fixed_x_then_y_then_z() {
    // x → x by roll 90°, → −z by pitch 90°, → −z by yaw 90°;  y → z → x → y
    let origin =
        "<origin xyz=\"1 2 3\" rpy=\"1.5707963267948966 1.5707963267948966 1.5707963267948966\"/>";
    let pose = elbow("continuous", origin).origin;
    for (vector, expected) in [
        ([1.0, 0.0, 0.0], [0.0, 0.0, -1.0]),
        ([0.0, 1.0, 0.0], [0.0, 1.0, 0.0]),
    ] {
        let turned = pose.rotate(vector);
        for i in 0..3 {
            assert!(
                (turned[i] - expected[i]).abs() < ROUNDING,
                "{turned:?} is not {expected:?}"
            );
        }
    }
    assert_eq!(pose.pos, [1.0, 2.0, 3.0]);
}

#[test]
fn quarter_turn_of_the_inertial_frame_exchanges_two_moments() {
    let inside = "<inertial><origin xyz=\"1 2 3\" rpy=\"0 0 1.5707963267948966\"/><mass value=\"1\"/>\
        <inertia ixx=\"1\" iyy=\"2\" izz=\"2.5\" ixy=\"0.1\" ixz=\"0.2\" iyz=\"0.3\"/></inertial>";
    let inertial = read(&link("base", inside)).unwrap().links[0]
        .inertial
        .unwrap();
    // x' = y, y' = −x
    let expected = [[2.0, -0.1, -0.3], [-0.1, 1.0, 0.2], [-0.3, 0.2, 2.5]];
    for i in 0..3 {
        for j in 0..3 {
            assert!((inertial.inertia[i][j] - expected[i][j]).abs() < ROUNDING);
        }
    }
    assert_eq!(inertial.pos, [1.0, 2.0, 3.0]);
}

#[test]
fn turned_inertia_equals_mujocos() {
    let inside = "<inertial><origin rpy=\"0.3 -0.4 0.5\"/><mass value=\"1\"/>\
        <inertia ixx=\"1\" iyy=\"1.2\" izz=\"1.4\" ixy=\"0.1\" ixz=\"0\" iyz=\"0\"/></inertial>";
    let inertia = read(&link("base", inside)).unwrap().links[0]
        .inertial
        .unwrap()
        .inertia;
    // MuJoCo 3.17 from the same URDF: R(body_iquat) diag(body_inertia) R(body_iquat)ᵀ
    let expected = [
        [
            0.9857887174396083,
            -0.016585584634786335,
            -0.09524367159866491,
        ],
        [
            -0.016585584634786352,
            1.26848833037108,
            -0.06890144787118892,
        ],
        [
            -0.09524367159866486,
            -0.06890144787118903,
            1.3457229521893501,
        ],
    ];
    for i in 0..3 {
        for j in 0..3 {
            // MuJoCo's own eigenvalue iteration stops near 1e-12
            assert!((inertia[i][j] - expected[i][j]).abs() < 1e-11);
        }
    }
}

#[test]
fn bodies_and_dofs_come_depth_first_in_the_order_of_the_joints() {
    let links: String = ["e", "d", "c", "b", "a"]
        .iter()
        .map(|name| link(name, INERTIAL))
        .collect();
    let j1 = joint("j1", "continuous", "a", "c", "");
    let j2 = joint("j2", "continuous", "a", "b", "");
    let j3 = joint("j3", "continuous", "b", "e", "");
    let j4 = joint("j4", "continuous", "c", "d", "");
    // body and joint names as MuJoCo 3.17 orders them from the same URDF, without fusestatic
    let cases = [
        (
            [&j1, &j2, &j3, &j4],
            ["a", "c", "d", "b", "e"],
            ["j1", "j4", "j2", "j3"],
        ),
        (
            [&j3, &j4, &j2, &j1],
            ["a", "b", "e", "c", "d"],
            ["j2", "j3", "j1", "j4"],
        ),
    ];
    for (joints, bodies, dofs) in cases {
        let robot = read(&(links.clone() + &joints.map(String::as_str).concat())).unwrap();
        let names: Vec<&str> = robot
            .link_order()
            .iter()
            .map(|&link| robot.links[link].name.as_str())
            .collect();
        assert_eq!(names, bodies);
        let names: Vec<&str> = robot
            .moving_joints()
            .iter()
            .map(|&dof| robot.joints[dof].name.as_str())
            .collect();
        assert_eq!(names, dofs);
    }
}

#[test]
fn shapes_become_halves() {
    let shapes = [
        (
            "<box size=\"2 4 6\"/>",
            Shape::Box {
                half_extents: [1.0, 2.0, 3.0],
            },
        ),
        ("<sphere radius=\"2\"/>", Shape::Sphere { radius: 2.0 }),
        (
            "<cylinder radius=\"2\" length=\"3\"/>",
            Shape::Cylinder {
                radius: 2.0,
                half_height: 1.5,
            },
        ),
        (
            "<capsule radius=\"2\" length=\"3\"/>",
            Shape::Capsule {
                radius: 2.0,
                half_height: 1.5,
            },
        ),
    ];
    for (text, expected) in shapes {
        let inside = format!(
            "<collision name=\"skin\"><origin xyz=\"0 0 1\"/><geometry>{text}</geometry></collision>"
        );
        let robot = read(&link("base", &inside)).unwrap();
        let collision = &robot.links[0].collisions[0];
        assert_eq!(
            (collision.name.as_deref(), &collision.shape),
            (Some("skin"), &expected)
        );
        assert_eq!(collision.pose.pos, [0.0, 0.0, 1.0]);
    }
}

#[test]
fn impossible_inertia_becomes_its_mean_with_one_note() {
    let impossible = INERTIAL.replace("izz=\"1\"", "izz=\"3\"");
    let robot = read(&link("base", &impossible)).unwrap();
    // as MuJoCo 3.17 with balanceinertia: (1 + 1 + 3) / 3
    let mean = 5.0 / 3.0;
    let inertia = robot.links[0].inertial.unwrap().inertia;
    assert_eq!(
        inertia,
        [[mean, 0.0, 0.0], [0.0, mean, 0.0], [0.0, 0.0, mean]]
    );
    assert_eq!(robot.notes.len(), 1);
    assert_says(&robot.notes[0], &["`base`", "1.5000"]);
    assert_eq!(robot.warnings.len(), 1);
    assert_says(&robot.warnings[0], &["`base` (1.5000)", "strict"]);
    // a flat plate, whose moments just fulfil A + B = C, stays
    let plate = read(&link("base", &INERTIAL.replace("izz=\"1\"", "izz=\"2\""))).unwrap();
    assert!(plate.notes.is_empty(), "{:?}", plate.notes);
    assert!(plate.warnings.is_empty(), "{:?}", plate.warnings);
}

#[test]
fn impossible_inertia_is_an_error_if_strict() {
    let impossible = link("base", &INERTIAL.replace("izz=\"1\"", "izz=\"3\""));
    let text = format!("<robot name=\"r\">{impossible}</robot>");
    let strict = UrdfOptions {
        strict: true,
        ..UrdfOptions::default()
    };
    let error = Robot::from_urdf_text(&text, "r.urdf", strict).unwrap_err();
    assert_says(&error.to_string(), &["link `base`", "1.5000"]);
}

#[test]
fn mass_of_a_fixed_child_counts_for_the_moving_link() {
    let body = link("base", "")
        + &link("arm", "")
        + &link("hand", INERTIAL)
        + &joint("elbow", "continuous", "base", "arm", "")
        + &joint("grip", "fixed", "arm", "hand", "");
    assert!(read(&body).is_ok());
}

#[test]
fn what_is_ignored_is_noted_once_each_by_name() {
    let body = one_joint(
        "revolute",
        &format!("{LIMIT}<safety_controller k_velocity=\"1\"/><dynamics D=\"1\" damping=\"2\"/>"),
    ) + "<transmission name=\"t\"><joint name=\"elbow\"/></transmission>\n<gazebo/>\n<gazebo/><mujoco/>"
        + "<gripper><link name=\"no link\"/></gripper>";
    let robot = read(&body).unwrap();
    let notes = robot.notes.join("\n");
    assert_says(
        &notes,
        &[
            "<safety_controller> is ignored",
            "attribute `D` of <dynamics> is ignored",
            "<transmission> is ignored",
            "<gazebo> is ignored (2 times, first in line 6)",
            "<mujoco> is ignored",
            "<gripper> is ignored",
        ],
    );
    assert_eq!(robot.notes.len(), 6);
    assert_eq!((robot.links.len(), robot.joints.len()), (2, 1));
    assert_eq!(robot.joints[0].dofs[0].damping, 2.0);
}

#[test]
fn elements_of_another_vocabulary_are_noted_with_their_prefix() {
    let text = "<robot name=\"r\" xmlns:xacro=\"http://ros.org/wiki/xacro\"><link name=\"a\"/><xacro:macro name=\"b\"/></robot>";
    let robot = Robot::from_urdf_text(text, "x.urdf", UrdfOptions::default()).unwrap();
    assert_eq!(robot.links.len(), 1);
    assert_says(&robot.notes[0], &["<xacro:macro>"]);
    let text = "<robot name=\"r\" xmlns=\"http://www.ros.org\"><link name=\"a\"/></robot>";
    let robot = Robot::from_urdf_text(text, "x.urdf", UrdfOptions::default()).unwrap();
    assert_eq!(robot.links.len(), 1);
}

#[test]
fn collisions_without_inertial_are_noted() {
    let inside = "<collision><geometry><sphere radius=\"1\"/></geometry></collision>";
    let robot = read(&link("base", inside)).unwrap();
    assert_says(&robot.notes[0], &["`base`", "no <inertial>"]);
}

#[test]
fn names_keep_their_special_characters() {
    let robot = read(&link("a &amp; &quot;b&quot; &lt;c&gt; ü", "")).unwrap();
    assert_eq!(robot.links[0].name, "a & \"b\" <c> ü");
}

#[test]
fn name_comes_from_the_options_or_the_file() {
    assert_eq!(read(&link("a", "")).unwrap().name, "r");
    let options = UrdfOptions {
        self_collisions: true,
        ..UrdfOptions::named("left")
    };
    let robot = Robot::from_urdf_text(
        "\n<robot name=\"r\"><link name=\"a\"/></robot>",
        "x.urdf",
        options,
    )
    .unwrap();
    assert_eq!(
        (robot.name.as_str(), robot.self_collisions, robot.floating),
        ("left", true, false)
    );
}

#[test]
fn a_floating_base_gets_a_name_that_no_joint_of_the_file_has() {
    let body = link("trunk", INERTIAL)
        + &link("mount", INERTIAL)
        + &joint("floating_base", "fixed", "trunk", "mount", "");
    let text = format!("<robot name=\"r\">{body}</robot>");
    let floating = UrdfOptions {
        floating: true,
        ..UrdfOptions::default()
    };
    let robot = Robot::from_urdf_text(&text, "r.urdf", floating).unwrap();
    assert_eq!(robot.dof_names()[0], "floating_base_2.vx");
}
