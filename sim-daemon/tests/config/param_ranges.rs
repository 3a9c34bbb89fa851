//! Ranges of parameters in scene files.

use super::{assert_says, assets, parse, refusal};
use sim_daemon::config::SceneFile;
use sim_model::Distribution;
use sim_physics::constants::params::Param;

const SCENE: &str = r#"
dt = 0.002
substeps = 8
params = ["joint_armature"]

[randomize.params]
gravity = { z = { normal = [-9.81, 0.1] } }

[randomize.params.shape_mu]
"cube/0" = { uniform = [0.1, 1] }
ground = { normal = [0.5, 0.1] }

[randomize.params.joint_damping]
arm = { uniform = [0, 1] }
"arm/fr3_joint1" = { uniform = [1, 2] }

[[shape]]
name = "ground"
type = "plane"

[[shape]]
type = "box"
half_extents = [0.1, 0.1, 0.1]
body = "cube"

[[robot]]
name = "arm"
urdf = "fr3/fr3_franka_hand.urdf"

[[body]]
name = "cube"
"#;

fn exchanged(from: &str, to: &str) -> String {
    assert!(SCENE.contains(from), "`{from}` is not in the scene");
    SCENE.replacen(from, to, 1)
}

#[test]
fn ranges_become_those_of_the_description_and_vary() {
    let described = parse(SCENE).describe(&assets()).unwrap();
    let range = |param, name| described.param_ranges[&param][name];
    assert_eq!(
        range(Param::Gravity, "z"),
        Distribution::Normal {
            mean: -9.81,
            std: 0.1
        }
    );
    assert_eq!(
        range(Param::ShapeMu, "cube/0"),
        Distribution::Uniform {
            low: 0.1,
            high: 1.0
        }
    );
    assert_eq!(described.param_ranges[&Param::JointDamping].len(), 2);
    let model = described.compile().unwrap();
    let varying: Vec<Param> = model.constants().varying.params().collect();
    let expected = [
        Param::Gravity,
        Param::JointArmature,
        Param::JointDamping,
        Param::ShapeMu,
    ];
    assert_eq!(varying, expected);
}

#[test]
fn ranges_survive_toml_and_json() {
    let scene = parse(SCENE);
    assert_eq!(parse(&scene.to_toml()), scene);
    let json = scene.to_json().to_string();
    assert_eq!(SceneFile::from_json(&json).unwrap(), scene);
    // a robot may be called as a distribution is
    let named = exchanged("ground = { normal", "uniform = { normal").replacen(
        "name = \"ground\"",
        "name = \"uniform\"",
        1,
    );
    parse(&named).describe(&assets()).unwrap();
    assert_eq!(parse(&parse(&named).to_toml()), parse(&named));
}

#[test]
fn wrong_ranges_are_refused_by_name() {
    for (from, to, parts) in [
        (
            "params.shape_mu",
            "params.friction",
            &["no parameter `friction`", "shape_mu"][..],
        ),
        (
            "cube/0",
            "cube/1",
            &["shape_mu of `cube/1`", "there are: `cube/0`"],
        ),
        (
            "arm = {",
            "\"arm/\" = {",
            &["joint_damping of `arm/`", "`arm/fr3_joint1`"],
        ),
        (
            "[0, 1]",
            "[-1, 1]",
            &["joint_damping of `arm`: low is -1; give at least 0"],
        ),
        (
            "[0.5, 0.1]",
            "[0.5, -0.1]",
            &["shape_mu of `ground`: std is -0.1"],
        ),
        (
            "[0.5, 0.1]",
            "[0.5, nan]",
            &["shape_mu of `ground`: std is NaN"],
        ),
        (
            "gravity = { z = { normal = [-9.81, 0.1] } }",
            "gravity = { normal = [-9.81, 0.1] }",
            &["randomize: gravity: give distributions by name; there are: `x`, `y`, `z`"],
        ),
        (
            "[0.5, 0.1]",
            "[0.5]",
            &["lesson.toml", "expected distributions by name, such as"],
        ),
        (
            "ground = {",
            "ground.normal = {",
            &["expected distributions by name"],
        ),
        (
            "[randomize.params.joint_damping]",
            "[randomize.params.body_f]",
            &["body_f of `arm`: it is a load"],
        ),
    ] {
        assert_says(&refusal(&exchanged(from, to)), parts);
    }
}
