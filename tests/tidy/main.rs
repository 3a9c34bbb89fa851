//! The house rules of ARCHITECTURE.md and STYLE.md that a machine can check.

mod doors;
mod hidden;
mod law;
mod length;
mod order;
mod order_daemon;
mod protocol;

use law::{DOORS, STRANGERS, UNSAFE, names_package};
use order::ORDER;
use sim_physics::arrays::Field;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Files below a folder, as paths from the root of the repository.
fn files(folder: &str, ending: &str) -> Vec<String> {
    fn walk(folder: &Path, files: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{folder:?}: {e}")) {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, files);
            } else {
                files.push(path);
            }
        }
    }
    let mut paths = Vec::new();
    walk(&root().join(folder), &mut paths);
    let mut files: Vec<String> = paths
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
    files.sort();
    assert!(!files.is_empty(), "no {ending} below {folder}");
    files
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

/// Whether a word of the line begins so: `PosedBox<` is not `Box<`.
fn begins_word(line: &str, start: &str) -> bool {
    line.match_indices(start).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        before.is_none_or(|c| !c.is_alphanumeric() && c != '_')
    })
}

fn sources() -> Vec<String> {
    [
        "sim-core/physics/src",
        "sim-core/model/src",
        "sim-core/compile/src",
        "sim-core/device/src",
        "sim-core/engine/src",
        "sim-core/ik/src",
        "sim-core/policy/src",
        "sim-core/render/src",
        "sim-core/stages",
        "sim-daemon/src",
        "sim-daemon/client-c/src",
        "sim-daemon/protocol/src",
        "sim-daemon/simulated/machine/src",
        "sim-daemon/simulated/protocol/src",
        "sim-daemon/picture/src",
        "sim-daemon/system/src",
        "py-client/src",
    ]
    .iter()
    .flat_map(|folder| files(folder, ".rs"))
    .collect()
}

#[test]
fn modules_import_only_those_before_them() {
    let mut wrong = Vec::new();
    for (folder, order) in ORDER.iter().chain(order_daemon::ORDER) {
        // modules of a folder inside a crate stand below its own path
        let inner = folder.split_once("/src/").map_or("", |(_, inner)| inner);
        let root = format!("crate::{inner}/")
            .replace('/', "::")
            .replace("crate::::", "crate::");
        for path in files(folder, ".rs") {
            let module = path.trim_start_matches(folder).trim_start_matches('/');
            let module = module.trim_end_matches(".rs").split('/').next().unwrap();
            let Some(place) = order.iter().position(|&m| m == module) else {
                continue;
            };
            // `super` once for each folder between a file and the crate's root leads there too
            let depth = path.trim_start_matches(folder).matches('/').count();
            let is_parent = path.ends_with("/mod.rs");
            let up = "super::".repeat(depth - usize::from(is_parent));
            for line in code(&path) {
                let imports = |later: &str| {
                    let roots = [root.as_str(), up.as_str()].map(|root| format!("{root}{later}"));
                    roots.iter().any(|later| has_path(&line, later))
                };
                if order[place + 1..].iter().any(|later| imports(later)) {
                    wrong.push(format!("{path}: {line}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn crates_know_only_what_they_may() {
    for (folder, strangers) in STRANGERS {
        for path in files(folder, ".rs") {
            for &stranger in *strangers {
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
    // and one lays images out behind them
    assert_eq!(
        both,
        [
            "sim-daemon/src/export/mod.rs",
            "sim-daemon/src/eyes/images.rs"
        ]
    );
}

#[test]
fn heavy_packages_have_one_door() {
    for path in sources() {
        for (package, door) in DOORS {
            let used = code(&path).iter().any(|line| names_package(line, package));
            let mut doors = DOORS.iter().filter(|(other, _)| *other == package);
            let is_door = doors.any(|(_, door)| path.starts_with(door));
            assert!(!used || is_door, "{path} uses {package}, not {door}");
        }
    }
}

#[test]
fn kept_programs_name_the_naga_that_wrote_them() {
    let cargo = read("Cargo.toml");
    let version = cargo.split("naga = { version = \"=").nth(1).unwrap();
    let version = version.split('"').next().unwrap();
    let writer = format!("\"naga {version}\"");
    assert!(
        read("sim-core/device/src/shader/cache.rs").contains(&writer),
        "{writer}"
    );
}

#[test]
fn unsafe_stands_where_it_may() {
    let with_unsafe: BTreeSet<String> = sources()
        .into_iter()
        .filter(|path| !path.ends_with("tests.rs"))
        .filter(|path| code(path).iter().any(|line| line.contains("unsafe ")))
        .collect();
    let listed: BTreeSet<String> = UNSAFE.iter().map(|&path| path.to_owned()).collect();
    assert_eq!(with_unsafe, listed);
}

/// Code for GPUs alone: it is recorded, but no CPU runs it, so it may take memory.
const RECORDED_ALONE: [&str; 3] = ["solver/own_rows.rs", "solver/rolled.rs", "solver/spread.rs"];

#[test]
fn a_step_names_no_backend_returns_no_result_and_takes_no_memory() {
    let stages = files("sim-core/physics/src/step", ".rs").into_iter();
    for path in stages.filter(|path| !path.ends_with("tests.rs")) {
        let takes_memory = RECORDED_ALONE.iter().any(|file| path.ends_with(file));
        for line in code(&path) {
            for word in ["Result<", "Vec<", "vec!", "Box<", "backend"] {
                let is_allowed = takes_memory && matches!(word, "Vec<" | "vec!");
                assert!(is_allowed || !begins_word(&line, word), "{path}: {line}");
            }
        }
    }
}

/// Longest function of a stage [lines of code].
const LONGEST_FUNCTION: usize = 80;

#[test]
fn functions_of_a_step_have_at_most_80_lines_of_code() {
    let mut wrong = Vec::new();
    for path in files("sim-core/physics/src/step", ".rs") {
        let text = read(&path);
        let lines: Vec<&str> = text.lines().collect();
        for (first, line) in lines.iter().enumerate() {
            let words = line.trim_start().trim_start_matches("pub(super) ");
            if !words.starts_with("fn ") && !words.starts_with("pub fn ") {
                continue;
            }
            // rustfmt closes a function where it began
            let end = format!("{}}}", &line[..line.len() - line.trim_start().len()]);
            let length = lines[first..].iter().position(|line| *line == end);
            let lines = &lines[first..=first + length.unwrap_or(0)];
            let is_code =
                |line: &&&str| !line.trim().is_empty() && !line.trim_start().starts_with("//");
            if lines.iter().filter(is_code).count() > LONGEST_FUNCTION {
                wrong.push(format!("{path}:{}: {words}", first + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_step_has_eight_comments_in_a_hundred_lines_of_code() {
    let (mut comments, mut code) = (0, 0);
    for path in files("sim-core/physics/src/step", ".rs") {
        for line in read(&path).lines().map(str::trim) {
            match line {
                "" => {}
                line if line.starts_with("///") || line.starts_with("//!") => {}
                line if line.starts_with("//") => comments += 1,
                _ => code += 1,
            }
        }
    }
    assert!(100 * comments >= 8 * code, "{comments} for {code} lines");
}

#[test]
fn names_say_what_they_are_of() {
    let pronouns = [
        "let own ",
        "let mut own ",
        "let found ",
        "let mut found ",
        "fn of(",
        "fn of<",
    ];
    let mut wrong = Vec::new();
    for path in sources()
        .into_iter()
        .chain(files("sim-core/record/src", ".rs"))
    {
        let lines = code(&path);
        let named = lines
            .iter()
            .filter(|line| pronouns.iter().any(|name| begins_word(line, name)));
        wrong.extend(named.map(|line| format!("{path}: {line}")));
    }
    assert!(wrong.is_empty(), "name what is held or made: {wrong:#?}");
}

#[test]
fn the_list_of_stages_is_a_page() {
    let lines = read("sim-core/physics/src/step/mod.rs").lines().count();
    assert!(lines <= 130, "{lines} lines");
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
            let is_in_tree = word
                .split('/')
                .next()
                .is_some_and(|first| first != "out" && root().join(first).exists());
            if looks && is_in_tree && !root().join(word).exists() {
                wrong.push(format!("{document}: {word}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// pytest imports tests by their file's name alone, and refuses all of them at the second of one name.
#[test]
fn python_tests_have_names_of_their_own() {
    let mut seen = BTreeSet::new();
    for path in files("tests/python", ".py")
        .into_iter()
        .chain(files("py-client/tests", ".py"))
    {
        let name = path.rsplit('/').next().unwrap().to_owned();
        assert!(
            !name.starts_with("test_") || seen.insert(name),
            "{path}: another folder has tests of this name"
        );
    }
}
