//! The house rules of ARCHITECTURE.md and STYLE.md that a machine can check.

use sim_physics::arrays::Field;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Longest page of code [lines].
const LONGEST: usize = 500;

/// Modules of a crate, each of which may import those before it.
const ORDER: &[(&str, &[&str])] = &[
    (
        "sim-core/physics/src",
        &[
            "lane",
            "math",
            "constants",
            "arrays",
            "step",
            "schedule",
            "compiled",
        ],
    ),
    (
        "sim-core/device/src",
        &[
            "error",
            "source",
            "module",
            "cache",
            "raw_op",
            "allocation",
            "vulkan",
            "vulkan_absent",
            "adapter",
            "device",
            "portable",
            "memory",
            "workers",
            "program",
            "batch_op",
            "staging",
            "encode",
            "batch",
            "run",
            "software",
            "compile",
        ],
    ),
    (
        "sim-core/record/src",
        &[
            "error",
            "tree",
            "uses",
            "recording",
            "vectorize",
            "wgsl",
            "evaluate",
            "split",
            "loop_fusion",
            "handles",
            "known_values",
            "state",
            "memory",
            "fold",
            "iterations",
            "loops",
            "lists",
            "scalar",
            "recorder",
            "dead_code",
            "record",
        ],
    ),
    (
        "sim-core/record/src/split",
        &[
            "order",
            "cost",
            "kernel",
            "items",
            "live_out",
            "live_ranges",
            "partition",
            "private",
            "plan",
            "emit",
            "stops_last",
        ],
    ),
    (
        "sim-core/model/src",
        &[
            "joint_kind",
            "error",
            "pose",
            "value_checks",
            "inertia",
            "geometry",
            "distribution",
            "surface",
            "description",
            "validate",
            "urdf",
            "rigid_body",
            "hull_tables",
            "model",
            "compile",
        ],
    ),
    (
        "sim-core/engine/src",
        &[
            "random",
            "start",
            "backend",
            "snapshot",
            "options",
            "simulation",
            "checks",
            "params",
            "write",
            "command",
            "dynamics",
        ],
    ),
    (
        "sim-core/engine/src/backend",
        &[
            "error", "frozen", "state", "input", "noise", "gather", "cpu", "gpu",
        ],
    ),
    (
        "sim-core/engine/src/backend/cpu",
        &[
            "lane_assignment",
            "chunk",
            "delay",
            "faults",
            "noise",
            "records",
            "regroup",
            "reset",
            "transfer",
            "contacts",
            "run",
            "backend",
            "dispatch",
        ],
    ),
    (
        "sim-core/engine/src/backend/gpu",
        &[
            "words",
            "workgroups",
            "mirror",
            "places",
            "programs",
            "show",
            "bookkeeping",
            "software",
            "compiled",
            "uploads",
            "sizing",
            "tile",
            "imported",
            "backend",
            "worlds",
            "frame",
            "create",
        ],
    ),
    (
        "sim-daemon/picture/src",
        &[
            "vector", "view", "normals", "mesh", "clip", "cover", "threads", "project", "tile",
            "rays", "outlines", "shadow", "shade", "marks", "renderer",
        ],
    ),
    (
        "sim-daemon/protocol/src",
        &[
            "header",
            "journal_header",
            "error",
            "hash",
            "description",
            "control",
            "hook",
            "paths",
            "daemon_lock",
            "liveness",
            "discovery",
            "table",
            "digest",
            "transport",
            "connection",
            "heartbeat",
            "affinity",
            "waiter",
            "command",
            "memory",
            "loaned",
            "frame",
            "controller",
            "observer",
            "journal",
            "client",
            "host",
        ],
    ),
    (
        "sim-daemon/src",
        &[
            "config",
            "error",
            "cli",
            "environment",
            "devices",
            "inspect",
            "refusal",
            "snapshot",
            "export",
            "arrays",
            "recording",
            "observe",
            "groups",
            "log",
            "fault_log",
            "server",
            "watchdog",
            "session",
            "commands",
        ],
    ),
    (
        "py-client/src",
        &[
            "errors", "parts", "input", "frame", "client", "scene", "dynamics", "arrays",
            "picture", "observe", "random",
        ],
    ),
];

/// The only door of each heavy package.
const DOORS: [(&str, &str); 20] = [
    ("ash", "sim-core/device/src/vulkan"),
    ("naga", "sim-core/device/src/module.rs"),
    ("wgpu", "sim-core/device/src"),
    ("urdf_rs", "sim-core/model/src/urdf"),
    ("faer", "sim-core/model/src"),
    ("parry3d_f64", "sim-core/model/src/geometry"),
    ("gltf", "sim-core/model/src/geometry/load"),
    ("base64", "sim-core/model/src/geometry/load"),
    ("rayon", "sim-core/engine/src/backend/cpu"),
    ("crc32fast", "sim-core/engine/src/snapshot.rs"),
    ("iceoryx2", "sim-daemon/protocol/src"),
    ("clap", "sim-daemon/src/cli"),
    ("clap_complete", "sim-daemon/src/cli/pages.rs"),
    ("clap_mangen", "sim-daemon/src/cli/pages.rs"),
    ("lz4_flex", "sim-daemon/src/recording/blocks.rs"),
    ("xxhash_rust", "sim-daemon/protocol/src/digest.rs"),
    ("noto_sans_mono_bitmap", "sim-daemon/src/inspect/picture"),
    ("png", "sim-daemon/src/inspect/picture"),
    ("pyo3", "py-client/src"),
    ("numpy", "py-client/src"),
];

/// Where `unsafe` may stand, and why.
const UNSAFE: [&str; 24] = [
    "py-client/src/frame.rs",                      // NumPy views
    "sim-core/device/src/memory.rs",               // imports pages of the host
    "sim-core/device/src/portable.rs",             // programs without checks at run time
    "sim-core/device/src/software/exit.rs",        // process exit beside a driver thread
    "sim-core/device/src/vulkan/memory.rs",        // the driver's memory, and the host's
    "sim-core/device/src/vulkan/mod.rs",           // the driver's handles
    "sim-core/device/src/vulkan/pipeline.rs",      // as mod.rs
    "sim-core/device/src/vulkan/recording.rs",     // as mod.rs
    "sim-core/device/src/vulkan_absent.rs",        // the same functions, never called
    "sim-core/engine/src/backend/cpu/backend.rs",  // calls what dispatch chose
    "sim-core/engine/src/backend/cpu/contacts.rs", // rows of a frame, as transfer.rs
    "sim-core/engine/src/backend/cpu/dispatch.rs", // instruction sets
    "sim-core/engine/src/backend/cpu/run.rs",      // calls the stages of an instruction set
    "sim-core/engine/src/backend/cpu/transfer.rs", // rows of a frame, written by several threads
    "sim-core/engine/src/backend/gpu/backend.rs",  // as imported.rs
    "sim-core/engine/src/backend/gpu/imported.rs", // memory of readers that a device writes to
    "sim-core/engine/src/backend/mod.rs",          // as imported.rs
    "sim-core/engine/src/simulation.rs",           // as imported.rs
    "sim-core/physics/src/compiled.rs", // what only a processor with the instructions may run
    "sim-core/physics/src/lane/simd.rs", // intrinsics
    "sim-daemon/protocol/src/frame.rs", // views of a sample
    "sim-daemon/protocol/src/loaned.rs", // loaned samples
    "sim-daemon/src/environment.rs",    // a variable, set while there is one thread
    "sim-daemon/src/server.rs",         // samples that a device writes to
];

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Files below a folder, as paths from the root of the repository.
fn files(folder: &str, ending: &str) -> Vec<String> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{folder:?}: {e}")) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, found);
            } else {
                found.push(path);
            }
        }
    }
    let mut found = Vec::new();
    walk(&root().join(folder), &mut found);
    let mut found: Vec<String> = found
        .iter()
        .map(|path| {
            path.strip_prefix(root())
                .unwrap()
                .to_str()
                .unwrap()
                .to_owned()
        })
        .filter(|path| path.ends_with(ending))
        .collect();
    found.sort();
    assert!(!found.is_empty(), "no {ending} below {folder}");
    found
}

fn read(path: &str) -> String {
    std::fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// Lines of code: comments left out.
fn code(path: &str) -> Vec<String> {
    let text = read(path);
    text.lines()
        .map(str::trim)
        .filter(|line| !line.starts_with("//"))
        .map(str::to_owned)
        .collect()
}

/// Whether a line has this path, whole or followed by `::`.
fn has_path(line: &str, path: &str) -> bool {
    let mut ends = line.match_indices(path).map(|(at, _)| at + path.len());
    ends.any(|end| !line[end..].starts_with(|c: char| c.is_alphanumeric() || c == '_'))
}

fn sources() -> Vec<String> {
    [
        "sim-core/physics/src",
        "sim-core/model/src",
        "sim-core/device/src",
        "sim-core/engine/src",
        "sim-core/stages",
        "sim-daemon/src",
        "sim-daemon/protocol/src",
        "sim-daemon/picture/src",
        "py-client/src",
    ]
    .iter()
    .flat_map(|folder| files(folder, ".rs"))
    .collect()
}

#[test]
fn modules_import_only_those_before_them() {
    let mut wrong = Vec::new();
    for (folder, order) in ORDER {
        for path in files(folder, ".rs") {
            let module = path.trim_start_matches(folder).trim_start_matches('/');
            let module = module.trim_end_matches(".rs").split('/').next().unwrap();
            let Some(own) = order.iter().position(|&m| m == module) else {
                continue;
            };
            // `super` once for each folder between a file and the crate's root leads there too
            let depth = path.trim_start_matches(folder).matches('/').count();
            let is_parent = path.ends_with("/mod.rs");
            let up = "super::".repeat(depth - usize::from(is_parent));
            for line in code(&path) {
                let imports = |later: &str| {
                    let roots = ["crate::", up.as_str()].map(|root| format!("{root}{later}"));
                    roots.iter().any(|later| has_path(&line, later))
                };
                if order[own + 1..].iter().any(|later| imports(later)) {
                    wrong.push(format!("{path}: {line}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn crates_know_only_what_they_may() {
    for (folder, strangers) in [
        (
            "sim-core/physics/src",
            &[
                "sim_model",
                "sim_device",
                "sim_engine",
                "sim_protocol",
                "sim_daemon",
            ][..],
        ),
        (
            "sim-core/model/src",
            &["sim_device", "sim_engine", "sim_protocol", "sim_daemon"],
        ),
        (
            "sim-core/device/src",
            &[
                "sim_physics",
                "sim_model",
                "sim_engine",
                "sim_protocol",
                "sim_daemon",
            ],
        ),
        ("sim-core/engine/src", &["sim_protocol", "sim_daemon"]),
        (
            "sim-daemon/protocol/src",
            &[
                "sim_physics",
                "sim_model",
                "sim_device",
                "sim_engine",
                "sim_daemon",
            ],
        ),
        (
            "sim-daemon/picture/src",
            &[
                "sim_physics",
                "sim_model",
                "sim_device",
                "sim_engine",
                "sim_protocol",
                "sim_daemon",
            ],
        ),
        (
            "py-client/src",
            &["sim_physics", "sim_model", "sim_device", "sim_engine"],
        ),
    ] {
        for path in files(folder, ".rs") {
            for stranger in strangers {
                assert!(
                    !code(&path).iter().any(|l| l.contains(stranger)),
                    "{path}: {stranger}"
                );
            }
        }
    }
    // one file turns fields into samples
    let both: Vec<String> = files("sim-daemon/src", ".rs")
        .into_iter()
        .filter(|path| {
            let text = code(path).join("\n");
            text.contains("sim_physics::arrays") && text.contains("Layout")
        })
        .collect();
    assert_eq!(both, ["sim-daemon/src/export.rs"]);
}

#[test]
fn heavy_packages_have_one_door() {
    for path in sources() {
        for (package, door) in DOORS {
            let used = code(&path).iter().any(|line| names_package(line, package));
            assert!(
                !used || path.starts_with(door),
                "{path} uses {package}; its door is {door}"
            );
        }
    }
}

/// Whether a line has `package::` as a word of its own: `hash::` is not `ash::`.
fn names_package(line: &str, package: &str) -> bool {
    let path = format!("{package}::");
    line.match_indices(&path).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        before.is_none_or(|c| !c.is_alphanumeric() && c != '_')
    })
}

#[test]
fn kept_programs_name_the_naga_that_wrote_them() {
    let cargo = read("Cargo.toml");
    let version = cargo.split("naga = { version = \"=").nth(1).unwrap();
    let version = version.split('"').next().unwrap();
    let writer = format!("\"naga {version}\"");
    assert!(
        read("sim-core/device/src/cache.rs").contains(&writer),
        "{writer}"
    );
}

#[test]
fn unsafe_stands_where_it_may() {
    let found: BTreeSet<String> = sources()
        .into_iter()
        .filter(|path| !path.ends_with("tests.rs"))
        .filter(|path| code(path).iter().any(|line| line.contains("unsafe ")))
        .collect();
    let listed: BTreeSet<String> = UNSAFE.iter().map(|&path| path.to_owned()).collect();
    assert_eq!(found, listed);
}

#[test]
fn a_step_names_no_backend_returns_no_result_and_takes_no_memory() {
    for path in files("sim-core/physics/src/step", ".rs") {
        for line in code(&path) {
            for word in ["Result<", "Vec<", "vec!", "Box<", "backend"] {
                assert!(!line.contains(word), "{path}: {line}");
            }
        }
    }
}

#[test]
fn a_model_cannot_be_changed() {
    let text = read("sim-core/model/src/model.rs");
    let start = text.find("impl Model {").expect("the model has methods");
    let body = &text[start..start + text[start..].find("\n}").unwrap()];
    assert!(body.contains("&self") && !body.contains("&mut self"));
}

#[test]
fn every_field_has_a_name_a_unit_and_a_line_of_text() {
    let mut names = BTreeSet::new();
    for field in Field::ALL {
        let row = field.row();
        assert!(names.insert(row.name), "{} stands twice", row.name);
        assert!(
            !row.unit.is_empty() && row.doc.ends_with('.'),
            "{}",
            row.name
        );
        assert_eq!(Field::named(row.name), Some(*field));
    }
}

#[test]
fn pages_of_code_are_at_most_500_lines() {
    let python = [
        "py-client/python",
        "tests/python",
        "examples",
        "benches",
        "docs/generate",
    ];
    let rust = [
        "tests",
        "benches",
        "examples",
        "sim-core/physics/tests",
        "sim-core/model/tests",
        "sim-core/record/tests",
        "sim-core/engine/tests",
        "sim-core/device/benches",
        "sim-core/device/tests",
        "sim-daemon/tests",
    ];
    let long: Vec<String> = python
        .iter()
        .flat_map(|folder| files(folder, ""))
        .filter(|path| path.ends_with(".py"))
        .chain(
            rust.iter()
                .flat_map(|f| files(f, ""))
                .filter(|path| path.ends_with(".rs")),
        )
        .chain(sources())
        .filter(|path| read(path).lines().count() > LONGEST)
        .collect();
    assert!(long.is_empty(), "{long:?}");
}

#[test]
fn paths_named_in_the_documents_exist() {
    let mut wrong = Vec::new();
    let mut documents = files("docs/pages", ".md");
    documents
        .extend(["README.md", "ARCHITECTURE.md", "STYLE.md", "CHANGELOG.md"].map(str::to_owned));
    for document in documents {
        for word in read(&document).split('`').skip(1).step_by(2) {
            let looks = word.contains('/')
                && word
                    .chars()
                    .all(|c| c.is_ascii_alphanumeric() || "/_-.".contains(c))
                && [".rs", ".py", ".md", ".toml", ".urdf", "/"]
                    .iter()
                    .any(|e| word.ends_with(e));
            // other projects' files are named too: ours begin with a folder of the root; what is in out/ is made by use
            let ours = word
                .split('/')
                .next()
                .is_some_and(|first| first != "out" && root().join(first).exists());
            if looks && ours && !root().join(word).exists() {
                wrong.push(format!("{document}: {word}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
