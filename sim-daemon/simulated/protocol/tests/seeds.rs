//! A few seeds on every push; `make simulate` runs more.

use std::process::Command;

fn run(seed: &str, runs: &str) {
    let output = Command::new(env!("CARGO_BIN_EXE_simulate"))
        .args(["--seed", seed, "--runs", runs, "--jobs", "1"])
        .output()
        .expect("it runs");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}");
    assert!(said.contains(" steps, "), "{said}");
}

#[test]
fn nothing_breaks_in_a_few_hundred_lives_of_a_daemon() {
    run("1", "200");
}

#[test]
fn a_client_killed_before_its_monitor_was_finished_leaves_nothing_where_another_attaches() {
    run("12144", "1");
}
