//! A few seeds on every push; `make simulate` runs more.

use std::process::Command;

#[test]
fn nothing_breaks_in_a_few_hundred_lives_of_a_daemon() {
    let output = Command::new(env!("CARGO_BIN_EXE_simulate"))
        .args(["--seed", "1", "--runs", "200", "--jobs", "1"])
        .output()
        .expect("it runs");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}");
    assert!(said.contains(" steps, "), "{said}");
}
