//! The stages use the vector instructions of their registers, and call no function for each.
//!
//! The compiler inlines an intrinsic only into functions that have its instructions. A closure or generic function that it
//! keeps as a function of its own has none of them: it works, and takes a call and two copies through memory for each
//! operation. `sim_physics::lane::map` says how to write code that this does not happen to.

#![cfg(target_arch = "x86_64")]

use std::path::PathBuf;
use std::process::Command;

/// The library of a crate that was built last.
fn library(name: &str) -> PathBuf {
    let program = std::env::current_exe().unwrap();
    let begin = format!("lib{name}-");
    let files = program.parent().unwrap().read_dir().unwrap().flatten();
    let libraries = files.filter(|file| {
        let name = file.file_name();
        let name = name.to_str().unwrap_or_default();
        name.starts_with(&begin) && name.ends_with(".rlib")
    });
    let newest = libraries.max_by_key(|file| file.metadata().unwrap().modified().unwrap());
    newest.expect("the stages are built").path()
}

#[test]
fn no_stage_calls_an_intrinsic() {
    for name in ["stages_f32x8", "stages_f32x16"] {
        let path = library(name);
        let listed = Command::new("nm").arg(&path).output();
        let listed = listed.expect("nm comes with the linker");
        assert!(listed.status.success(), "{listed:?}");
        let symbols = String::from_utf8_lossy(&listed.stdout).into_owned();
        assert!(
            symbols.contains("solver"),
            "{} has no stages",
            path.display()
        );
        let called: Vec<&str> = symbols
            .lines()
            .filter(|line| line.contains("core_arch"))
            .collect();
        assert!(
            called.is_empty(),
            "{}: functions instead of instructions, {called:#?}; `objdump -dC` says what calls them",
            path.display()
        );
    }
}
