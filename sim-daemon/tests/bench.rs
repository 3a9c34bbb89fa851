//! `tightloop bench`: what it measures, and which arguments it refuses.

use sim_engine::backend::cpu;
use sim_engine::simulation::Lanes;
use std::path::PathBuf;
use std::process::{Command, Output};

const SCENE: &str = r#"
dt = 0.002
substeps = 2
[[robot]]
name = "box"
urdf = "box.urdf"
floating = true
pos = [0.0, 0.0, 0.099]
[[shape]]
name = "ground"
type = "plane"
"#;
const BOX: &str = r#"<robot name="box"><link name="base">
<inertial><mass value="1"/><inertia ixx="0.007" iyy="0.007" izz="0.007" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>
</link></robot>"#;

/// Few worlds and a short time, where a test says nothing else.
const QUICK: [&str; 3] = ["--worlds=11", "--settle=0.1", "--seconds=0.05"];

/// Runs `tightloop bench` on a box that stands on the ground.
fn bench(name: &str, arguments: &[&str]) -> Output {
    bench_of(SCENE, name, arguments)
}

/// Runs `tightloop bench` on a scene.
fn bench_of(scene: &str, name: &str, arguments: &[&str]) -> Output {
    let is_given = |short: &str| {
        let (name, _) = short.split_once('=').expect("a value");
        arguments.iter().any(|given| given.starts_with(name))
    };
    let folder: PathBuf = std::env::temp_dir().join(format!("bench-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    std::fs::write(folder.join("box.urdf"), BOX).unwrap();
    let done = Command::new(env!("CARGO_BIN_EXE_tightloop"))
        .args(["bench", "scene.toml"])
        .args(QUICK.iter().filter(|short| !is_given(short)))
        .args(arguments)
        .current_dir(&folder)
        .output()
        .unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    done
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_standing_box_has_four_contacts_and_a_solver() {
    let done = bench("json", &["--json"]);
    assert!(done.status.success(), "{}", text(&done.stderr));
    let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert!(report["steps_per_s"].as_f64().unwrap() > 0.0);
    assert_eq!(report["worlds"], 11);
    assert_eq!(report["faulted"], 0);
    let mean = |count: &str| report["counts"][count]["mean"].as_f64().unwrap();
    assert_eq!((mean("contacts"), mean("rows")), (4.0, 12.0));
    // two blocks, which do not pause
    assert!(mean("iterations") >= 1.0 && mean("block_iterations") >= mean("iterations"));
    assert_eq!(report["moves"], 0.0);
    let lanes = |work: &str, number: &str| report["lanes"][work][number].as_f64().unwrap();
    for work in ["contacts", "iterations"] {
        assert!(lanes(work, "executed") >= lanes(work, "needed") && lanes(work, "needed") > 0.0);
    }
    for part in ["load", "store", "fields", "grouping", "gathering"] {
        assert!(report["parts_ns"][part].as_f64().unwrap() >= 0.0, "{part}");
    }
    let stages = report["stages"].as_array().unwrap();
    let time = |name: &str| {
        let stage = stages.iter().find(|stage| stage["stage"] == name);
        stage.unwrap_or_else(|| panic!("{name}"))["step_ns"]
            .as_f64()
            .unwrap()
    };
    let times: f64 = stages
        .iter()
        .map(|stage| stage["step_ns"].as_f64().unwrap())
        .sum();
    assert!(time("plane_box") > 0.0 && time("solver") > 0.0);
    assert!(times <= report["total_ns"].as_f64().unwrap());
}

#[test]
fn f64_has_one_world_a_block_and_no_masked_lanes() {
    let done = bench("double", &["--json", "--precision", "f64"]);
    assert!(done.status.success(), "{}", text(&done.stderr));
    let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    let mean = |count: &str| report["counts"][count]["mean"].as_f64().unwrap();
    assert_eq!(mean("block_iterations"), mean("iterations"));
}

#[test]
fn people_get_a_table() {
    let done = bench("table", &[]);
    let said = text(&done.stdout);
    for word in [
        "steps/s",
        "contacts",
        "solver iterations",
        "plane_box",
        "masked",
    ] {
        assert!(said.contains(word), "{word} in {said}");
    }
}

#[test]
fn machine_code_is_reported_where_it_runs() {
    let (falling, _) = SCENE.split_once("[[shape]]").unwrap();
    let code = |scene, name, arguments: &[&str]| {
        let done = bench_of(scene, name, &[&["--json"], arguments].concat());
        assert!(done.status.success(), "{}", text(&done.stderr));
        let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        assert!(
            report["stages"].as_array().unwrap().len() > 3,
            "stages are profiled"
        );
        report["machine_code"].clone()
    };
    // on other processors the stages run
    let is_here = cfg!(target_arch = "x86_64") && cpu::available(Lanes::Eight);
    let made = code(falling, "code", &[]);
    assert_eq!(made.is_array(), is_here, "{made}");
    assert!(
        !is_here || made[0]["instructions"].as_u64().unwrap() > 100,
        "{made}"
    );
    assert!(code(falling, "code-stages", &["--stages"]).is_null());
    assert!(code(SCENE, "code-contacts", &[]).is_null());
    let table = text(&bench_of(falling, "code-table", &[]).stdout);
    assert_eq!(
        table.contains("machine code of a substep"),
        is_here,
        "{table}"
    );
}

#[test]
fn wrong_arguments_are_named() {
    for (arguments, words) in [
        (["--worlds", "0"], "ask for 1 to 16777216"),
        (["--threads", "0"], "ask for 1 to 1024"),
        (["--commands", "walk"], "use random or hold"),
        (["--swing", "nan"], "from 0 to 1"),
        (["--seconds", "-1"], "from 0 to"),
        (["--lanes", "7"], "use 1, 8 or 16"),
        (["--precision", "f16"], "use f32 or f64"),
        (["--keyframe", "home"], "no keyframes"),
    ] {
        let argument = format!("{}={}", arguments[0], arguments[1]);
        let done = bench("wrong", &[&argument]);
        let said = text(&done.stderr);
        assert_eq!(done.status.code(), Some(2), "{arguments:?}: {said}");
        assert!(said.contains(words), "{arguments:?}: {said}");
    }
}

#[test]
fn f64_has_no_lanes() {
    let done = bench("lanes", &["--precision", "f64", "--lanes", "8"]);
    assert_eq!(done.status.code(), Some(2));
    assert!(text(&done.stderr).contains("one world a block"));
}
