//! The protocol reaches what is outside of it by `sim-daemon/protocol/src/doors.rs` alone, so that all of it can be simulated.

use crate::{files, read};

/// What a door leads to.
const OUTSIDE: [&str; 12] = [
    "std::fs",
    "std::process",
    "std::sync",
    "std::thread",
    "std::hint::spin_loop",
    "time::{Duration, Instant}",
    "std::time::Instant",
    "std::time::SystemTime",
    "sim_system",
    "iceoryx2",
    ".exists()",
    ".read_dir()",
];

/// Files that have no part in a simulation, which has its own, and the doors themselves.
const REAL: [&str; 8] = [
    "doors.rs",
    "lease/device_memory/sockets.rs",
    "memory/descriptors.rs",
    "memory/mapping.rs",
    "memory/reentrant.rs",
    "memory/service.rs",
    "memory/storage.rs",
    "waiting/park.rs",
];

/// Files whose types lie in shared memory, and have the transport's marker for that.
const MARKED: [&str; 2] = ["wire/header.rs", "wire/journal_header.rs"];

/// Whether a line names what a door leads to, past the door.
fn goes_past_the_doors(line: &str) -> bool {
    let line = line.trim();
    let is_comment = line.starts_with("//");
    let is_by_door = line.contains("crate::doors::");
    !is_comment && !is_by_door && OUTSIDE.iter().any(|name| line.contains(name))
}

#[test]
fn the_protocol_goes_out_by_its_doors() {
    let folder = "sim-daemon/protocol/src/";
    let mut wrong = Vec::new();
    for path in files(folder, ".rs") {
        let inner = path.trim_start_matches(folder);
        if REAL.contains(&inner) || inner.contains("tests") {
            continue;
        }
        let text = read(&path);
        // unit tests run on the real system
        let code = text.split("\nmod tests {").next().unwrap_or_default();
        for line in code.lines().filter(|line| goes_past_the_doors(line)) {
            if !MARKED.contains(&inner) || line != "use iceoryx2::prelude::ZeroCopySend;" {
                wrong.push(format!("{path}: {line}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_way_past_the_doors_is_seen() {
    assert!(goes_past_the_doors("use std::time::{Duration, Instant};"));
    assert!(goes_past_the_doors("    std::thread::sleep(PAUSE);"));
    assert!(!goes_past_the_doors(
        "use crate::doors::iceoryx2::port::LoanError;"
    ));
    assert!(!goes_past_the_doors("use std::time::Duration;"));
}
