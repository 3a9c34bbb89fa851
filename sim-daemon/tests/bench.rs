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
    let quick = QUICK.iter().filter(|short| !is_given(short));
    let all: Vec<&str> = quick.chain(arguments).copied().collect();
    run(&["bench"], scene, name, &all, &[])
}

/// Runs a command on a scene, in an environment with these variables.
fn run(
    command: &[&str],
    scene: &str,
    name: &str,
    arguments: &[&str],
    variables: &[(&str, &str)],
) -> Output {
    let folder: PathBuf = std::env::temp_dir().join(format!("bench-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    std::fs::write(folder.join("box.urdf"), BOX).unwrap();
    let done = Command::new(env!("CARGO_BIN_EXE_tightloop"))
        .args(command)
        .arg("scene.toml")
        .args(arguments)
        .envs(variables.iter().copied())
        .current_dir(&folder)
        .output()
        .unwrap();
    std::fs::remove_dir_all(folder).unwrap();
    done
}

/// The scene without the ground.
fn falling() -> &'static str {
    SCENE.split_once("[[shape]]").unwrap().0
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

/// Has this processor a compiler?
fn compiles() -> bool {
    cfg!(target_arch = "x86_64") && cpu::available(Lanes::Eight)
}

#[test]
fn machine_code_is_reported_where_it_runs() {
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
    // on other processors the stages run; the box on the ground is compiled but for its contacts
    for (scene, name) in [(falling(), "code"), (SCENE, "code-contacts")] {
        let made = code(scene, name, &[]);
        assert_eq!(made.is_array(), compiles(), "{made}");
        assert!(
            !compiles() || made[0]["instructions"].as_u64().unwrap() > 100,
            "{made}"
        );
    }
    assert!(code(falling(), "code-stages", &["--stages"]).is_null());
    let table = text(&bench_of(falling(), "code-table", &[]).stdout);
    assert_eq!(
        table.contains("machine code of a substep"),
        compiles(),
        "{table}"
    );
}

#[test]
fn a_listing_has_the_instructions_of_each_stage_below_the_lines_that_they_come_from() {
    let list = |scene, name, arguments: &[&str]| {
        let done = run(&["compile"], scene, name, arguments, &[]);
        assert!(done.status.success(), "{}", text(&done.stderr));
        text(&done.stdout)
    };
    if !cfg!(target_arch = "x86_64") {
        assert!(list(SCENE, "list", &[]).contains("no machine code"));
        return;
    }
    for (lanes, register) in [("--lanes=8", "ymm"), ("--lanes=16", "zmm")] {
        let sizes = list(SCENE, "list-sizes", &[lanes]);
        let lines = list(SCENE, "list-lines", &[lanes, "--listing"]);
        assert!(sizes.contains("stages kinematics to ") && sizes.contains("integrate"));
        // the first section's table is the sum of its lines
        let table = sizes.lines().find(|line| line.starts_with("all ")).unwrap();
        let all: usize = table.split_whitespace().last().unwrap().parse().unwrap();
        let of_first = lines.split("\nstages ").next().unwrap();
        let indented = |line: &&str| line.starts_with("        ");
        assert_eq!(of_first.lines().filter(indented).count(), all, "{lanes}");
        assert!(!sizes.contains(register) && lines.contains(register));
        let of_kinematics = lines.lines().filter(|line| line.contains("  kinematics, "));
        assert!(of_kinematics.clone().count() > 10, "{lines}");
        assert!(of_kinematics.clone().all(|line| line.contains(".rs:")));
        assert!(lines.contains("fmadd"), "{lines}");
    }
    let wrong = run(&["compile"], SCENE, "list-wrong", &["--lanes=4"], &[]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(text(&wrong.stderr).contains("use 8 or 16"));
}

#[test]
fn kernels_of_a_gpu_are_listed_on_any_computer() {
    let list = |name, arguments: &[&str]| run(&["compile"], SCENE, name, arguments, &[]);
    let table = text(&list("kernels", &["--gpu"]).stdout);
    let head: Vec<&str> = table.lines().next().unwrap().split_whitespace().collect();
    assert_eq!(
        head,
        ["kernel", "dispatches", "threads", "statements", "bytes"]
    );
    let is_kernel = |line: &&str| line.starts_with("step ") || line.starts_with("evaluate ");
    let kernels = table.lines().filter(is_kernel).count();
    assert!(
        kernels > 1 && table.contains("memory of a world: "),
        "{table}"
    );
    let sources = text(&list("kernels-wgsl", &["--gpu", "--listing"]).stdout);
    assert!(sources.starts_with(&table));
    assert_eq!(sources.matches("@compute").count(), kernels);
    let wrong = list("kernels-wrong", &["--gpu", "--lanes=8"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(text(&wrong.stderr).contains("leave it out"));
}

#[test]
fn machine_code_is_compared_with_the_stages_where_the_environment_asks() {
    for (scene, name) in [(falling(), "check"), (SCENE, "check-contacts")] {
        let all = [&QUICK[..], &["--json"]].concat();
        let done = run(&["bench"], scene, name, &all, &[("TIGHTLOOP_CHECK", "1")]);
        assert!(done.status.success(), "{}", text(&done.stderr));
        let report: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
        let device = report["device"].as_str().unwrap();
        assert_eq!(device.contains(" (checked)"), compiles(), "{device}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_map_for_perf_names_the_stages_of_machine_code() {
    let folder = std::env::temp_dir().join(format!("bench-map-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("scene.toml"), falling()).unwrap();
    std::fs::write(folder.join("box.urdf"), BOX).unwrap();
    let child = Command::new(env!("CARGO_BIN_EXE_tightloop"))
        .args(["bench", "scene.toml"])
        .args(QUICK)
        .env("TIGHTLOOP_PERF_MAP", "1")
        .stdout(std::process::Stdio::null())
        .current_dir(&folder)
        .spawn()
        .unwrap();
    let path = format!("/tmp/perf-{}.map", child.id());
    assert!(child.wait_with_output().unwrap().status.success());
    std::fs::remove_dir_all(folder).unwrap();
    let map = std::fs::read_to_string(&path);
    assert_eq!(map.is_ok(), compiles(), "{map:?}");
    if let Ok(map) = map {
        std::fs::remove_file(&path).unwrap();
        let piece = |line: &str| {
            let mut numbers = line
                .split(' ')
                .map_while(|word| u64::from_str_radix(word, 16).ok());
            (numbers.next().unwrap(), numbers.next().unwrap())
        };
        let mut pieces: Vec<(u64, u64)> = map.lines().map(piece).collect();
        pieces.sort_unstable();
        for pair in pieces.windows(2) {
            let [(first, bytes), (second, _)] = [pair[0], pair[1]];
            assert!(first + bytes <= second, "{map}");
        }
        assert!(map.contains("tightloop::kinematics"), "{map}");
    }
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
