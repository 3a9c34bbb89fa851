//! Scene files: what is read, what is written back, what is refused.

mod contacts;
mod param_ranges;
mod randomize;

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use sim_daemon::config::{self, ConfigError, Number, PerDof, SceneFile, UrdfOptions};
use sim_model::{Cone, Shape, TargetMode};

const LESSON: &str = r#"
dt = 0.0020833333333333333
substeps = 8

[[shape]]
name = "table"
type = "box"
half_extents = [0.4, 0.4, 0.05]
pos = [0.0, -0.5, 0.05]

[[robot]]
name = "arm"
urdf = "fr3/fr3_franka_hand.urdf"
pos = [-0.5, -0.5, 0.1]
joint_q = [0.0, 0.02, 0.0, -2.4, 0.0, 2.4, 0.8, 0.05, 0.05]
joint_target_mode = ["position", "velocity", "both", "position", "position", "position", "position", "position", "position"]
joint_target_ke = 100
joint_effort_limit = [87.0, 87, 87, 87, 12, 12, 12, inf, inf]
"#;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/assets")
}

fn parse(text: &str) -> SceneFile {
    config::parse(text, "lesson.toml").unwrap()
}

/// The message with which this text, or what it describes, is refused.
fn refusal(text: &str) -> String {
    let described = config::parse(text, "lesson.toml").and_then(|scene| scene.describe(&assets()));
    described.expect_err("accepted").to_string()
}

/// The lesson with one piece of its text exchanged.
fn lesson(from: &str, to: &str) -> String {
    assert!(LESSON.contains(from), "`{from}` is not in the lesson");
    LESSON.replacen(from, to, 1)
}

#[track_caller]
fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "`{part}` is not said in: {message}");
    }
}

#[test]
fn lesson_becomes_its_description() {
    let scene = parse(LESSON).describe(&assets()).unwrap();
    assert_eq!(
        (scene.dt.to_bits(), scene.substeps),
        ((1.0 / 480.0_f64).to_bits(), 8)
    );
    assert_eq!(scene.gravity, [0.0, 0.0, -9.81]);
    assert_eq!(
        (scene.solver.iterations, scene.solver.ls_iterations),
        (20, 100)
    );
    assert_eq!(
        (
            scene.solver.tolerance,
            scene.solver.impratio,
            scene.solver.cone
        ),
        (1e-8, 1000.0, Cone::Elliptic)
    );
    assert_eq!(scene.shapes[0].name, "table");
    assert_eq!(scene.shapes[0].pose.pos, [0.0, -0.5, 0.05]);
    assert_eq!(
        scene.shapes[0].shape,
        Shape::Box {
            half_extents: [0.4, 0.4, 0.05]
        }
    );
    let arm = &scene.robots[0];
    assert_eq!(
        (arm.name.as_str(), arm.pose.pos),
        ("arm", [-0.5, -0.5, 0.1])
    );
    let joints: Vec<_> = arm
        .moving_joints()
        .into_iter()
        .map(|dof| &arm.joints[dof])
        .collect();
    assert_eq!((joints[3].q[0], joints[8].q[0]), (-2.4, 0.05));
    assert_eq!(
        (
            joints[3].dofs[0].target_q,
            joints[3].dofs[0].target_kd,
            joints[3].dofs[0].armature
        ),
        (None, 0.0, 0.0)
    );
    assert!(joints.iter().all(|joint| joint.dofs[0].target_ke == 100.0));
    assert_eq!(
        (
            joints[0].dofs[0].target_mode,
            joints[1].dofs[0].target_mode,
            joints[2].dofs[0].target_mode
        ),
        (TargetMode::Position, TargetMode::Velocity, TargetMode::Both)
    );
    assert_eq!(
        (
            joints[0].dofs[0].effort_limit,
            joints[7].dofs[0].effort_limit
        ),
        (Some(87.0), None)
    );
}

#[test]
fn effort_limits_are_the_robots_unless_given() {
    let text = lesson(
        "joint_effort_limit = [87.0, 87, 87, 87, 12, 12, 12, inf, inf]",
        "",
    );
    let scene = parse(&text).describe(&assets()).unwrap();
    let arm = &scene.robots[0];
    let limits: Vec<_> = arm
        .moving_joints()
        .into_iter()
        .map(|dof| arm.joints[dof].dofs[0].effort_limit.unwrap())
        .collect();
    assert_eq!(
        limits,
        [87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0, 100.0, 100.0]
    );
}

#[test]
fn toml_and_json_round_trips_change_nothing() {
    let scene = parse(LESSON);
    assert_eq!(parse(&scene.to_toml()), scene);
    assert_eq!(
        SceneFile::from_json(&scene.to_json().to_string()).unwrap(),
        scene
    );
}

#[test]
fn infinity_is_a_number_in_toml_and_a_string_in_json() {
    let scene = parse(LESSON);
    assert_says(&scene.to_toml(), &["12.0, inf, inf]"]);
    assert_eq!(scene.to_json()["robot"][0]["joint_effort_limit"][8], "inf");
    let mut named = scene.clone();
    named.robots[0].name = Some("inf".to_owned());
    named.robots[0].joint_effort_limit = Some(PerDof::All(Number(f64::INFINITY)));
    assert_eq!(parse(&named.to_toml()), named);
    assert_eq!(
        SceneFile::from_json(&named.to_json().to_string()).unwrap(),
        named
    );
}

#[test]
fn shapes_take_the_sizes_of_their_type() {
    let shapes = [
        (
            "type = \"sphere\"\nradius = 2",
            Shape::Sphere { radius: 2.0 },
        ),
        (
            "type = \"cylinder\"\nradius = 2\nhalf_height = 1",
            Shape::Cylinder {
                radius: 2.0,
                half_height: 1.0,
            },
        ),
        (
            "type = \"ellipsoid\"\nradii = [1, 2, 3]",
            Shape::Ellipsoid {
                radii: [1.0, 2.0, 3.0],
            },
        ),
        (
            "type = \"capsule\"\nradius = 2\nhalf_height = 1",
            Shape::Capsule {
                radius: 2.0,
                half_height: 1.0,
            },
        ),
    ];
    for (text, expected) in shapes {
        let scene = parse(&format!("dt = 0.01\nsubsteps = 1\n[[shape]]\n{text}"))
            .describe(&assets())
            .unwrap();
        assert_eq!(
            (&scene.shapes[0].shape, scene.shapes[0].name.as_str()),
            (&expected, expected.kind())
        );
    }
    let wrong = lesson("half_extents = [0.4, 0.4, 0.05]", "radius = 1.0");
    assert_says(&refusal(&wrong), &["shape `table`", "half_extents"]);
    let more = lesson(
        "half_extents = [0.4, 0.4, 0.05]",
        "half_extents = [0.4, 0.4, 0.05]\nradius = 1.0",
    );
    assert_says(&refusal(&more), &["shape `table`", "a box has no radius"]);
}

#[test]
fn slips_in_a_file_are_named_with_their_line() {
    assert_says(
        &refusal(&lesson("substeps", "substep")),
        &["lesson.toml", "line 3", "substep", "unknown field"],
    );
    assert_says(
        &refusal(&lesson("joint_q =", "joint_p =")),
        &["joint_p", "unknown field"],
    );
    assert_says(
        &refusal(&lesson("type = \"box\"", "type = \"bax\"")),
        &["bax", "sphere"],
    );
    assert_says(
        &refusal(&lesson("\"both\"", "\"torque\"")),
        &["torque", "velocity"],
    );
    assert_says(
        &refusal(&lesson("dt = 0.0020833333333333333", "dt = \"fast\"")),
        &["fast", "a number"],
    );
    assert_says(
        &refusal(&lesson("substeps = 8", "")),
        &["substeps", "missing"],
    );
    assert_says(
        &refusal(&lesson("substeps = 8", "substeps = -1")),
        &["line 3"],
    );
    assert_says(
        &refusal(&lesson("[[robot]]", "[[robot]")),
        &["lesson.toml", "line 11"],
    );
    assert_says(
        &refusal(&lesson("pos = [0.0, -0.5, 0.05]", "pos = [0.0, -0.5]")),
        &["line 9"],
    );
}

#[test]
fn values_that_physics_cannot_use_are_refused_by_name() {
    assert_says(
        &refusal(&lesson("dt = 0.0020833333333333333", "dt = 0.0")),
        &["dt is 0"],
    );
    assert_says(
        &refusal(&lesson("dt = 0.0020833333333333333", "dt = nan")),
        &["dt is NaN"],
    );
    assert_says(
        &refusal(&lesson("substeps = 8", "substeps = 0")),
        &["substeps is 0"],
    );
    let seven = lesson(", 0.05, 0.05]\njoint_target_mode", "]\njoint_target_mode");
    assert_says(
        &refusal(&seven),
        &["robot `arm`: joint_q has 7 values, the robot has 9 coordinates"],
    );
    assert_says(
        &refusal(&lesson("-2.4", "nan")),
        &["robot `arm`", "joint_q", "`fr3_joint4`", "NaN"],
    );
    assert_says(
        &refusal(&lesson("joint_target_ke = 100", "joint_target_ke = -1")),
        &["joint_target_ke", "`fr3_joint1`"],
    );
    assert_says(
        &refusal(&lesson("urdf =", "floating = true\nurdf =")),
        &["robot `arm`: joint_q has 9 values, the robot has 16 coordinates"],
    );
    assert_says(
        &refusal(&lesson("urdf =", "quat = [0.0, 0.0, 0.0, 0.0]\nurdf =")),
        &["`arm`", "quaternion", "length 0"],
    );
    assert_says(
        &refusal(&lesson("fr3_franka_hand.urdf", "ghost.urdf")),
        &["assets/fr3/ghost.urdf", "cannot be read"],
    );
    let twice = LESSON.to_owned() + &LESSON[LESSON.find("[[robot]]").unwrap()..];
    assert_says(&refusal(&twice), &["two robots", "`arm`"]);
}

#[test]
fn missing_scene_file_is_refused_with_its_path() {
    let error = config::load(Path::new("/nowhere/scene.toml")).unwrap_err();
    assert!(matches!(error, ConfigError::Read { .. }));
    assert_says(
        &error.to_string(),
        &["/nowhere/scene.toml", "cannot be read"],
    );
}

#[test]
fn json_slips_are_named() {
    let message = SceneFile::from_json(r#"{"dt": 0.1, "substeps": 1, "gravty": 3}"#)
        .unwrap_err()
        .to_string();
    assert_says(&message, &["gravty", "unknown field"]);
    let nan = SceneFile::from_json(r#"{"dt": "nan", "substeps": 1}"#).unwrap();
    assert_says(
        &nan.describe(&assets()).unwrap_err().to_string(),
        &["dt is NaN"],
    );
}

#[test]
fn saved_scene_finds_its_robot_from_any_folder() {
    let folder = std::env::temp_dir().join(format!("tightloop-config-{}/deep", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let robot = "<robot name=\"r\"><link name=\"a\"/></robot>";
    std::fs::write(folder.join("../robot.urdf"), robot).unwrap();
    let mut scene = parse("dt = 0.01\nsubsteps = 1\n[[robot]]\nurdf = \"../robot.urdf\"");
    scene.robots[0].package_dirs = vec![folder.clone()];
    for (file, urdf) in [
        ("scene.toml", "../robot.urdf"),
        ("../scene.toml", "robot.urdf"),
    ] {
        let file = folder.join(file);
        scene.save(&file, &folder).unwrap();
        let saved = config::load(&file).unwrap();
        assert_eq!(saved.robots[0].urdf, Path::new(urdf));
        assert_eq!(
            saved.describe(file.parent().unwrap()).unwrap().robots[0].name,
            "r"
        );
    }
    let error = scene
        .save(&folder.join("ghost/scene.toml"), &folder)
        .unwrap_err();
    assert_says(
        &error.to_string(),
        &["ghost/scene.toml", "cannot be written"],
    );
    std::fs::remove_dir_all(folder.parent().unwrap()).unwrap();
}

#[test]
fn summary_tells_what_a_client_shows() {
    let path = assets().join("fr3/fr3_franka_hand.urdf");
    let summary = config::urdf_summary(&path, UrdfOptions::default()).unwrap();
    assert_eq!(summary["name"], "fr3");
    assert_eq!(summary["joint_names"].as_array().unwrap().len(), 9);
    assert_eq!(summary["joint_names"][8], "fr3_finger_joint2");
    assert_eq!(summary["joint_types"][6], "revolute");
    assert_eq!(summary["joint_types"][7], "prismatic");
    assert_eq!(summary["joint_q"], serde_json::json!(vec![0.0; 9]));
    assert_eq!(
        summary["joint_range"][3],
        serde_json::json!([-3.0421, -0.1518])
    );
    assert_eq!(summary["joint_effort_limit"][0], 87.0);
    assert_eq!(summary["joint_velocity_limit"][5], 4.18);
    assert_eq!(
        (&summary["joint_damping"][0], &summary["joint_friction"][0]),
        (&0.003.into(), &0.2.into())
    );
    assert_eq!(summary["joint_mimic"][0], serde_json::Value::Null);
    let mimic = serde_json::json!({"joint": "fr3_finger_joint1", "multiplier": 1.0, "offset": 0.0});
    assert_eq!(summary["joint_mimic"][8], mimic);
    assert_eq!(summary["link_names"].as_array().unwrap().len(), 14);
    let shapes = summary["shape_names"].as_array().unwrap();
    assert_eq!(shapes[0], "fr3_link0/0");
    assert_eq!(summary["notes"], serde_json::json!([]));
}

#[test]
fn summary_tells_no_limit_from_a_limit() {
    let path = std::env::temp_dir().join(format!("tightloop-summary-{}.urdf", std::process::id()));
    let inertial = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" iyz=\"0\"/></inertial>";
    let text = format!(
        "<robot name=\"r\"><link name=\"a\"/><link name=\"b\">{inertial}</link>\
         <joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/></joint><gazebo/></robot>"
    );
    std::fs::write(&path, text).unwrap();
    let summary = config::urdf_summary(&path, UrdfOptions::default()).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(
        (
            &summary["joint_types"][0],
            &summary["joint_effort_limit"][0]
        ),
        (&"continuous".into(), &"inf".into())
    );
    assert_eq!(summary["joint_range"][0], serde_json::Value::Null);
    assert_says(summary["notes"][0].as_str().unwrap(), &["<gazebo>"]);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_number_survives_toml_and_json_to_the_bit(bits in prop::collection::vec(any::<u64>(), 9), dt in any::<u64>()) {
        let numbers: Vec<Number> =
            bits.iter().map(|&bits| f64::from_bits(bits)).map(|x| Number(if x.is_nan() { 0.5 } else { x })).collect();
        let mut scene = parse(LESSON);
        scene.dt = Number(f64::from_bits(dt & (u64::MAX >> 2)));
        scene.robots[0].joint_q = Some(PerDof::Each(numbers));
        let bits = |scene: &SceneFile| match scene.robots[0].joint_q.as_ref().unwrap() {
            PerDof::Each(each) => each.iter().map(|number| number.0.to_bits()).chain([scene.dt.0.to_bits()]).collect::<Vec<_>>(),
            PerDof::All(_) => Vec::new(),
        };
        prop_assert_eq!(bits(&parse(&scene.to_toml())), bits(&scene));
        prop_assert_eq!(bits(&SceneFile::from_json(&scene.to_json().to_string()).unwrap()), bits(&scene));
    }
}
