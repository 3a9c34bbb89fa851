//! Scene files: what is read, what is written back, what is refused.

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use sim_core::model::{Cone, Shape, Surface, TargetMode};
use sim_daemon::config::{self, ConfigError, Number, PerDof, SceneFile, UrdfOptions};

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

/// Every shape and bearer that contacts can have; the mesh lies beside the scene.
const CONTACTS: &str = r#"
dt = 0.002
substeps = 8
contacts_max = 40
rows_max = 120
contact_filters = [["ground", "arm/fr3_link0"], ["cube", "ramp"]]

[solver]
cone = "pyramidal"
impratio = 10

[[shape]]
name = "ground"
type = "plane"
pos = [0.0, 0.0, -0.5]
mu = 0.6
group = -1

[[shape]]
name = "ramp"
type = "mesh"
path = "wedge.obj"
scale = [1.0, 2.0, 0.5]
max_hull_vertices = 8
convex_decomposition = true
margin = 0.001
gap = 0.002

[[shape]]
type = "box"
half_extents = [0.025, 0.025, 0.025]
body = "cube"
density = 400
ke = 5000
kd = 200
kf = 500
condim = 1

[[shape]]
name = "pad"
type = "sphere"
radius = 0.01
body = "arm/fr3_hand"
mu = 2

[[robot]]
name = "arm"
urdf = "fr3_franka_hand.urdf"
mu = 0.8
margin = 0.003

[[body]]
name = "cube"
"#;

/// A folder with the wedge and the arm, and no more, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Folder {
        let name = format!("tightloop-contacts-{}-{test}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let wedge = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
        std::fs::write(folder.join("wedge.obj"), wedge).unwrap();
        let arm = assets().join("fr3/fr3_franka_hand.urdf");
        std::fs::copy(arm, folder.join("fr3_franka_hand.urdf")).unwrap();
        Folder(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn contacts_of_a_file_become_those_of_its_description() {
    let folder = Folder::new("describe");
    let scene = parse(CONTACTS).describe(&folder.0).unwrap();
    assert_eq!((scene.contacts_max, scene.rows_max), (Some(40), Some(120)));
    assert_eq!(
        scene.filters,
        [["ground", "arm/fr3_link0"], ["cube", "ramp"]].map(|pair| pair.map(str::to_owned))
    );
    assert_eq!(
        (scene.solver.cone, scene.solver.impratio),
        (Cone::Pyramidal, 10.0)
    );

    let usual = Surface::default();
    let [ground, ramp] = &scene.shapes[..] else {
        panic!("{} static shapes", scene.shapes.len());
    };
    assert_eq!((&ground.shape, ground.pose.pos[2]), (&Shape::Plane, -0.5));
    let rough = Surface {
        mu: 0.6,
        group: -1,
        ..usual
    };
    assert_eq!(ground.surface, rough);
    let Shape::Mesh(mesh) = &ramp.shape else {
        panic!("{:?} is no mesh", ramp.shape);
    };
    assert_eq!(mesh.triangles.extent(), [[0.0; 3], [1.0, 2.0, 0.5]]);
    let wide = Surface {
        margin: 0.001,
        gap: 0.002,
        ..usual
    };
    assert_eq!(ramp.surface, wide);

    let cube = &scene.robots[1].links[0].collisions[0];
    let slick = Surface {
        ke: 5000.0,
        kd: 200.0,
        kf: 500.0,
        condim: 1,
        ..usual
    };
    assert_eq!(cube.surface, slick);
    for link in &scene.robots[0].links {
        for shape in &link.collisions {
            let expected = match shape.name.as_deref() {
                Some("pad") => Surface { mu: 2.0, ..usual },
                _ => Surface {
                    mu: 0.8,
                    margin: 0.003,
                    ..usual
                },
            };
            assert_eq!(shape.surface, expected, "{}: {:?}", link.name, shape.name);
        }
    }
    let names = scene.shape_names();
    for name in ["ground", "ramp", "cube/0", "arm/fr3_hand/pad"] {
        assert!(
            names.contains(&name.to_owned()),
            "{name} is not in {names:?}"
        );
    }
}

#[test]
fn contacts_survive_toml_json_and_another_folder() {
    let folder = Folder::new("round-trip");
    let scene = parse(CONTACTS);
    assert_eq!(parse(&scene.to_toml()), scene);
    let json = SceneFile::from_json(&scene.to_json().to_string());
    assert_eq!(json.unwrap(), scene);
    let below = folder.0.join("below");
    std::fs::create_dir_all(&below).unwrap();
    scene.save(&below.join("scene.toml"), &folder.0).unwrap();
    let saved = config::load(&below.join("scene.toml")).unwrap();
    let path = saved.shapes[1].path.as_deref();
    assert_eq!(path, Some(Path::new("../wedge.obj")));
    assert_eq!(saved.describe(&below).unwrap().shapes.len(), 2);
}

#[test]
fn what_contacts_cannot_have_is_refused_by_name() {
    let folder = Folder::new("refused");
    let cases: &[(&str, &str, &[&str])] = &[
        ("mu = 0.6", "mu = -0.6", &["shape `ground`", "mu is -0.6"]),
        ("mu = 0.8", "mu = -0.8", &["robot `arm`", "mu is -0.8"]),
        (
            "condim = 1",
            "condim = 4",
            &["condim is 4", "not supported"],
        ),
        ("condim = 1", "condim = -1", &["condim"]),
        ("group = -1", "group = 1.5", &["group", "1.5"]),
        (
            "group = -1",
            "radius = 1",
            &["shape `ground`", "a plane has no radius"],
        ),
        (
            "group = -1",
            "body = \"cube\"",
            &["shape `ground`", "a plane has no end"],
        ),
        (
            "group = -1",
            "scale = [1, 1, 1]",
            &["shape `ground`", "a plane has no scale"],
        ),
        (
            "path = \"wedge.obj\"",
            "",
            &["shape `ramp`", "path is missing"],
        ),
        ("wedge.obj", "ghost.obj", &["shape `ramp`", "ghost.obj"]),
        (
            "max_hull_vertices = 8",
            "max_hull_vertices = 7",
            &["shape `ramp`", "between 8 and 1024"],
        ),
        (
            "arm/fr3_hand\"",
            "arm/fr3_foot\"",
            &["robot `arm`", "no link `fr3_foot`"],
        ),
        (
            "arm/fr3_hand\"",
            "leg/fr3_hand\"",
            &["no robot `leg`", "`arm`"],
        ),
        (
            "arm/fr3_hand\"",
            "arm\"",
            &["shape `pad`", "`arm`", "`robot/link`"],
        ),
        ("mu = 2", "density = 2", &["shape `pad`", "has no density"]),
        (
            "contacts_max = 40",
            "contacts_max = 0",
            &["contacts_max is 0"],
        ),
        ("rows_max = 120", "rows_max = 99999", &["rows_max is 99999"]),
        (
            "\"ramp\"]",
            "\"ramq\"]",
            &["contact filter", "`ramq`", "`ground`, `ramp`"],
        ),
        (", \"ramp\"]", "]", &["contact_filters"]),
        ("impratio = 10", "impratio = 0", &["impratio is 0"]),
    ];
    for (from, to, says) in cases {
        assert!(CONTACTS.contains(from), "`{from}` is not in the scene");
        let text = CONTACTS.replacen(from, to, 1);
        let scene = config::parse(&text, "scene.toml");
        let error = scene.and_then(|scene| scene.describe(&folder.0));
        let error = error.map(|_| ()).expect_err(&format!("accepted `{to}`"));
        assert_says(&error.to_string(), says);
    }
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

#[test]
fn mesh_summary_tells_what_touches() {
    let folder = Folder::new("mesh");
    let file = folder.0.join("wedge.obj");
    let of = |scale| config::mesh_summary(&file, scale, &config::MeshOptions::default());
    let summary = of([2.0; 3]).unwrap();
    assert_eq!(summary["hull_vertices"], serde_json::json!([4]));
    assert_eq!(summary["closed"], true);
    assert_eq!(summary["extent"][1], serde_json::json!([2.0, 2.0, 2.0]));
    let message = of([1e-9; 3]).unwrap_err().to_string();
    assert_says(&message, &["wedge.obj", "mend the scale"]);
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
