//! Distributions of the start state in scene files.

use super::{assert_says, assets, parse, refusal};
use sim_model::Distribution;

const SCENE: &str = r#"
dt = 0.002
substeps = 8

[randomize.joint_q]
arm = { uniform = [-0.1, 0.1] }
"arm/fr3_joint4" = { normal = [0.0, 0.02] }

[randomize.joint_qd]
"arm/fr3_finger_joint1" = { normal = [0.0, 0.5] }

[randomize.body_q.cube]
x = { uniform = [-0.05, 0.05] }
yaw = { uniform = [-3, 3] }

[randomize.body_qd.dog]
vz = { normal = [1, 0.5] }

[[robot]]
name = "arm"
urdf = "fr3/fr3_franka_hand.urdf"

[[robot]]
name = "dog"
urdf = "fr3/fr3_franka_hand.urdf"
floating = true

[[body]]
name = "cube"
mass = 1

[[body]]
name = "post"
mass = 1
fixed = true
"#;

fn exchanged(from: &str, to: &str) -> String {
    assert!(SCENE.contains(from), "`{from}` is not in the scene");
    SCENE.replacen(from, to, 1)
}

#[test]
fn names_become_distributions_of_dofs_and_the_special_one_holds() {
    let scene = parse(SCENE);
    let described = scene.describe(&assets()).unwrap();
    let robot = |name: &str| {
        let mut robots = described.robots.iter();
        robots.find(|robot| robot.name == name).unwrap()
    };
    let uniform = |low, high| Some(Distribution::Uniform { low, high });
    let normal = |mean, std| Some(Distribution::Normal { mean, std });
    for joint in robot("arm").joints.iter().filter(|joint| joint.moves()) {
        let expected = match joint.name.as_str() {
            "fr3_joint4" => normal(0.0, 0.02),
            "fr3_finger_joint2" => None,
            _ => uniform(-0.1, 0.1),
        };
        assert_eq!(joint.dofs[0].offset_q, expected, "{}", joint.name);
        let moves = joint.name == "fr3_finger_joint1";
        let expected = normal(0.0, 0.5).filter(|_| moves);
        assert_eq!(joint.dofs[0].offset_qd, expected, "{}", joint.name);
    }
    let offsets = |name: &str| {
        let dofs = &robot(name).joints[0].dofs;
        let q: Vec<_> = dofs.iter().map(|dof| dof.offset_q).collect();
        let qd: Vec<_> = dofs.iter().map(|dof| dof.offset_qd).collect();
        (q, qd)
    };
    let (x, yaw) = (uniform(-0.05, 0.05), uniform(-3.0, 3.0));
    let none = vec![None; 6];
    assert_eq!(
        offsets("cube"),
        (vec![x, None, None, None, None, yaw], none.clone())
    );
    let fall = vec![None, None, normal(1.0, 0.5), None, None, None];
    assert_eq!(offsets("dog"), (none, fall));
}

#[test]
fn distributions_survive_toml_and_json_and_are_hashed() {
    let scene = parse(SCENE);
    assert_eq!(parse(&scene.to_toml()), scene);
    let json = scene.to_json().to_string();
    assert_eq!(
        sim_daemon::config::SceneFile::from_json(&json).unwrap(),
        scene
    );
    let hash = |text: &str| {
        let described = parse(text).describe(&assets()).unwrap();
        described.compile().unwrap().hash()
    };
    assert_ne!(
        hash(SCENE),
        hash(&exchanged("[-0.05, 0.05]", "[-0.05, 0.06]"))
    );
}

#[test]
fn wrong_distributions_are_refused_by_name() {
    for (from, to, parts) in [
        (
            "arm = {",
            "leg = {",
            &[
                "randomize: joint_q of `leg`",
                "no robot or body `leg`",
                "arm, dog, cube, post",
            ][..],
        ),
        (
            "arm/fr3_joint4",
            "arm/elbow",
            &[
                "joint_q of `arm/elbow`",
                "no moving joint `elbow`",
                "fr3_joint1, ",
            ],
        ),
        (
            "arm/fr3_finger_joint1",
            "arm/fr3_finger_joint2",
            &[
                "joint_qd of `arm/fr3_finger_joint2`",
                "give `fr3_finger_joint1` the",
            ],
        ),
        (
            "arm/fr3_joint4",
            "dog/floating_base",
            &["is a floating joint; give body_q"],
        ),
        (
            "arm = {",
            "cube = {",
            &["joint_q of `cube`", "body_q and body_qd"],
        ),
        (
            "body_q.cube",
            "body_q.post",
            &["body_q of `post`", "does not move freely"],
        ),
        (
            "body_q.cube",
            "body_q.arm",
            &["body_q of `arm`", "does not move freely"],
        ),
        (
            "body_qd.dog",
            "body_qd.\"dog/fr3_joint1\"",
            &["name one of its floating joints: floating_base"],
        ),
        (
            "yaw =",
            "jaw =",
            &[
                "body_q of `cube`",
                "no part `jaw`",
                "x, y, z, roll, pitch, yaw",
            ],
        ),
        ("vz =", "z =", &["no part `z`", "vx, vy, vz, wx, wy, wz"]),
        (
            "[-0.05, 0.05]",
            "[0.05, -0.05]",
            &["body_q of `cube`, x: low is 0.05 and high is -0.05"],
        ),
        (
            "[0.0, 0.02]",
            "[0.0, -0.02]",
            &["`arm/fr3_joint4`: std is -0.02", "negative"],
        ),
        (
            "[0.0, 0.02]",
            "[nan, 0.02]",
            &["`arm/fr3_joint4`: mean is NaN"],
        ),
        ("[-3, 3]", "[-3, inf]", &["`cube`, yaw: high is inf"]),
        ("[0.0, 0.02]", "[0.0]", &["lesson.toml"]),
        ("normal", "gauss", &["gauss", "uniform"]),
        ("randomize.joint_qd", "randomize.joint_qdd", &["joint_qdd"]),
    ] {
        assert_says(&refusal(&exchanged(from, to)), parts);
    }
}
