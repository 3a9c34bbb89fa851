//! Tests that no runner sees.

use super::{files, read};

#[test]
fn a_library_that_is_not_tested_has_no_tests_in_its_sources() {
    let manifests =
        ["sim-core", "sim-daemon", "py-client"].map(|folder| files(folder, "Cargo.toml"));
    let mut untested = 0;
    for manifest in manifests.iter().flatten() {
        let text = read(manifest);
        let section = text.split_once("[lib]").map_or("", |(_, rest)| rest);
        let lib = section.split("\n[").next().unwrap_or(section);
        // sources of another package are tested there
        if !lib.contains("test = false") || lib.contains("path = ") {
            continue;
        }
        untested += 1;
        let folder = manifest.replace("Cargo.toml", "src");
        for source in files(&folder, ".rs") {
            assert!(
                !read(&source).contains("#[test]"),
                "{source} has tests, and {manifest} says `test = false`"
            );
        }
    }
    assert!(
        untested > 0,
        "no manifest says `test = false`; this check is not needed any more"
    );
}
