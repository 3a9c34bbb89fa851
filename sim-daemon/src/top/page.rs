//! A look as text and as JSON.

use std::fmt::Write;

use serde_json::{Value, json};
use sim_protocol::{Percentiles, Timing};

use super::look::Look;
use crate::list::{in_words, rounded};

/// A few lines for a terminal.
pub(super) fn text(look: &Look) -> String {
    let mut text = String::new();
    let age = look.age.map_or_else(|| "–".to_owned(), in_words);
    let controllers: Vec<String> = look.controllers.iter().map(u32::to_string).collect();
    let controller = match controllers.is_empty() {
        true => "none".to_owned(),
        false => controllers.join(", "),
    };
    let contacts = look.contacts.map_or_else(
        || "not in its frames".to_owned(),
        |count| format!("{count:.1} a world"),
    );
    let megabytes = |bytes: u64| format!("{:.0} MB", bytes as f64 / 1e6);
    let memory = match (
        look.memory.map(megabytes),
        look.memory_shared.map(megabytes),
    ) {
        (Some(all), Some(shared)) => format!("{all}, of it {shared} shared"),
        (Some(all), None) => all,
        (None, _) => "–".to_owned(),
    };
    let pace = look.realtime.map_or_else(
        || "as fast as it can".to_owned(),
        |factor| format!("{factor} of real time"),
    );
    let worlds = match look.groups {
        1 => look.worlds.to_string(),
        groups => format!("{} in {groups} groups", look.worlds),
    };
    let lines = [
        (
            "daemon",
            format!("{}, pid {}, {age}, {}", look.name, look.pid, look.device),
        ),
        ("worlds", worlds),
        (
            "speed",
            format!(
                "{} steps/s, {} frames/s, {pace}",
                rounded(look.steps_per_s),
                rounded(look.frames_per_s)
            ),
        ),
        (
            "clients",
            format!("controller {controller}, {} observers", look.observers),
        ),
        (
            "faulted",
            format!(
                "{} of the {} worlds that observers see",
                look.frozen, look.seen
            ),
        ),
        ("contacts", contacts),
        ("memory", memory),
    ];
    for (name, value) in lines {
        let _ = writeln!(text, "{name:<10}{value}");
    }
    for (group, timing) in look.timing.iter().enumerate() {
        if look.groups > 1 {
            let _ = writeln!(text, "\ngroup {group}");
        }
        let Timing {
            frames,
            missed,
            late,
            skipped,
            ..
        } = timing;
        let _ = writeln!(
            text,
            "frames    {frames}, {missed} missed, {late} late, {skipped} skipped"
        );
        let _ = writeln!(
            text,
            "[µs]            mean       p50       p99     p99.9     worst"
        );
        for (name, each) in percentiles(timing) {
            let Percentiles {
                mean,
                p50,
                p99,
                p999,
                worst,
            } = each;
            let _ = writeln!(
                text,
                "{name:<10}{mean:10.1}{p50:10.1}{p99:10.1}{p999:10.1}{worst:10.1}"
            );
        }
    }
    text
}

/// The same for programs.
pub(super) fn json(look: &Look) -> Value {
    json!({
        "name": look.name,
        "device": look.device,
        "pid": look.pid,
        "age_s": look.age.map(|age| age.as_secs_f64()),
        "worlds": look.worlds,
        "groups": look.groups,
        "frames_per_s": look.frames_per_s,
        "steps_per_s": look.steps_per_s,
        "controllers": look.controllers,
        "observers": look.observers,
        "seen_worlds": look.seen,
        "faulted_worlds": look.frozen,
        "contacts_per_world": look.contacts,
        "memory_bytes": look.memory,
        "shared_bytes": look.memory_shared,
        "realtime": look.realtime,
        "timing_us": look.timing,
    })
}

/// What is measured of frames, by name.
pub(super) fn percentiles(timing: &Timing) -> [(&'static str, Percentiles); 4] {
    [
        ("period", timing.period),
        ("lateness", timing.lateness),
        ("latency", timing.latency),
        ("busy", timing.busy),
    ]
}
