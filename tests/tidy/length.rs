//! Files are short enough to read: comments, docstrings and blank lines are free.

use crate::{files, read, sources};
use std::collections::BTreeMap;

/// Most lines of code of a file.
const LONGEST: usize = 400;
/// Most lines of code of a file below.
const LONGEST_OLDER: usize = 460;
/// Files that were longer when lines of code were first counted. None joins them, and one that is short enough leaves.
const OLDER: [&str; 14] = [
    "py-client/src/advice.rs",
    "sim-core/model/src/compile/bodies.rs",
    "sim-core/model/tests/geometry/hulls.rs",
    "sim-core/model/tests/geometry/looks.rs",
    "sim-core/physics/src/step/solver/contacts.rs",
    "sim-core/record/src/wgsl/mod.rs",
    "sim-core/record/tests/toy/program.rs",
    "sim-daemon/picture/src/tests/mod.rs",
    "sim-daemon/src/export/mod.rs",
    "sim-daemon/src/recording/record.rs",
    "sim-daemon/src/serve/session.rs",
    "tests/interventions.rs",
    "tests/params.rs",
    "tests/snapshot.rs",
];

/// Most files of a folder of Rust modules.
const FOLDER: usize = 20;

/// Lines of code of a Rust file: those that are neither blank nor a comment alone.
fn of_rust(text: &str) -> usize {
    let is_code = |line: &&str| !line.is_empty() && !line.starts_with("//");
    text.lines().map(str::trim).filter(is_code).count()
}

/// The same of a Python file, docstrings left out: strings of three quotes that begin a line.
fn of_python(text: &str) -> usize {
    let (mut count, mut is_string, mut is_docstring) = (0, false, false);
    for line in text.lines().map(str::trim) {
        let begins = !is_string && (line.starts_with("\"\"\"") || line.starts_with("r\"\"\""));
        is_docstring = begins || (is_string && is_docstring);
        let is_comment = !is_string && line.starts_with('#');
        count += usize::from(!line.is_empty() && !is_docstring && !is_comment);
        is_string ^= line.matches("\"\"\"").count() % 2 == 1;
    }
    count
}

/// Files of Rust and Python with the lines of code of each.
fn lengths() -> Vec<(String, usize)> {
    let python = [
        "py-client/python",
        "py-client/tests",
        "tests",
        "examples",
        "benches",
        "docs",
    ];
    let rust = [
        "tests",
        "benches",
        "examples",
        "sim-core/physics/tests",
        "sim-core/model/tests",
        "sim-core/record/src",
        "sim-core/record/tests",
        "sim-core/compile/tests",
        "sim-core/engine/tests",
        "sim-core/device/benches",
        "sim-core/device/tests",
        "sim-core/ik/tests",
        "sim-daemon/tests",
        "sim-daemon/client-c/tests",
    ];
    let python = python.iter().flat_map(|folder| files(folder, ".py"));
    let rust = rust.iter().flat_map(|folder| files(folder, ".rs"));
    let mut all: Vec<String> = python.chain(rust).chain(sources()).collect();
    all.sort();
    all.dedup();
    let count = |path: String| {
        let text = read(&path);
        let lines = match path.ends_with(".py") {
            true => of_python(&text),
            false => of_rust(&text),
        };
        (path, lines)
    };
    all.into_iter().map(count).collect()
}

#[test]
fn files_have_at_most_400_lines_of_code() {
    let mut wrong = Vec::new();
    for (path, lines) in lengths() {
        let is_older = OLDER.contains(&path.as_str());
        let most = if is_older { LONGEST_OLDER } else { LONGEST };
        if lines > most {
            wrong.push(format!("{path}: {lines} lines of code, {most} allowed"));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn folders_have_at_most_20_files() {
    let mut folders = BTreeMap::<String, usize>::new();
    let modules = files("sim-core/record/src", ".rs");
    let others = [
        ("docs", ".md"),
        ("docs", ".png"),
        ("docs", ".py"),
        ("docs", ".webp"),
        ("examples", ".csv"),
        ("examples", ".md"),
        ("examples", ".onnx"),
        ("examples", ".png"),
        ("examples", ".py"),
        ("examples", ".rs"),
    ];
    let shown = others
        .into_iter()
        .flat_map(|(folder, ending)| files(folder, ending));
    for path in sources().into_iter().chain(modules).chain(shown) {
        let (folder, _) = path.rsplit_once('/').expect("it is in a folder");
        *folders.entry(folder.to_owned()).or_default() += 1;
    }
    folders.retain(|_, count| *count > FOLDER);
    assert!(folders.is_empty(), "sort into folders: {folders:#?}");
}

#[test]
fn the_list_of_longer_files_has_none_that_is_short_enough() {
    let all = lengths();
    let is_longer = |path: &&str| all.iter().any(|(p, lines)| p == path && *lines > LONGEST);
    let shorter: Vec<&str> = OLDER.into_iter().filter(|path| !is_longer(path)).collect();
    assert!(shorter.is_empty(), "take off the list: {shorter:#?}");
}

#[test]
fn comments_docstrings_and_blank_lines_are_not_counted() {
    assert_eq!(
        of_rust("//! Page.\n\n/// Doc.\nfn f() {\n    // why\n    g(); // here\n}\n"),
        3
    );
    let python = "\"\"\"Page.\n\nMore.\n\"\"\"\n\nTEXT = \"\"\"\n# data\n\"\"\"\n\n\ndef f():\n    \"\"\"One line.\"\"\"\n    # why\n    return TEXT\n";
    assert_eq!(of_python(python), 5);
}
