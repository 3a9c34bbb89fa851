//! A look in the text format of Prometheus.
//! <https://prometheus.io/docs/instrumenting/exposition_formats/>

use std::fmt::Write;

use super::look::Look;
use super::page::percentiles;

/// A name of a metric without `tightloop_`, its help, its type, and its values.
type Metric = (&'static str, &'static str, &'static str, Vec<(String, f64)>);

pub(super) fn text(look: &Look) -> String {
    let all = |value: f64| vec![(String::new(), value)];
    let groups = |of: &dyn Fn(&sim_protocol::Timing) -> u64| {
        let timing = look.timing.iter().enumerate();
        timing
            .map(|(group, timing)| (format!("group=\"{group}\""), of(timing) as f64))
            .collect()
    };
    let mut metrics: Vec<Metric> = vec![
        (
            "worlds",
            "Worlds of the daemon",
            "gauge",
            all(look.worlds as f64),
        ),
        (
            "steps_per_second",
            "Physics steps of all worlds per second since the last scrape",
            "gauge",
            all(look.steps_per_s),
        ),
        (
            "controllers",
            "Clients in control",
            "gauge",
            all(look.controllers.len() as f64),
        ),
        (
            "observers",
            "Clients that observe",
            "gauge",
            all(look.observers as f64),
        ),
        (
            "faulted_worlds",
            "Faulted worlds of those that observers see",
            "gauge",
            all(look.frozen as f64),
        ),
        (
            "frames_total",
            "Frames that steps made",
            "counter",
            groups(&|timing| timing.frames),
        ),
        (
            "missed_deadlines_total",
            "Frames that left too late",
            "counter",
            groups(&|timing| timing.missed),
        ),
        (
            "late_commands_total",
            "Frames whose command was late",
            "counter",
            groups(&|timing| timing.late),
        ),
        (
            "skipped_frames_total",
            "Periods without a frame",
            "counter",
            groups(&|timing| timing.skipped),
        ),
    ];
    if let Some(contacts) = look.contacts {
        metrics.push((
            "contacts_per_world",
            "Contacts of a world in the mean",
            "gauge",
            all(contacts),
        ));
    }
    if let Some(memory) = look.memory {
        metrics.push((
            "memory_bytes",
            "Memory of the daemon",
            "gauge",
            all(memory as f64),
        ));
    }
    if let Some(shared) = look.memory_shared {
        metrics.push((
            "shared_memory_bytes",
            "Memory that it shares",
            "gauge",
            all(shared as f64),
        ));
    }
    let mut durations = Vec::new();
    for (group, timing) in look.timing.iter().enumerate() {
        for (name, each) in percentiles(timing) {
            for (quantile, micros) in [
                ("0.5", each.p50),
                ("0.99", each.p99),
                ("0.999", each.p999),
                ("1", each.worst),
            ] {
                let labels = format!("group=\"{group}\",of=\"{name}\",quantile=\"{quantile}\"");
                durations.push((labels, micros / 1e6));
            }
        }
    }
    metrics.push((
        "frame_seconds",
        "Percentiles of frames, by what was measured",
        "gauge",
        durations,
    ));
    let mut text = String::new();
    for (name, help, kind, values) in metrics {
        let _ = writeln!(
            text,
            "# HELP tightloop_{name} {help}.\n# TYPE tightloop_{name} {kind}"
        );
        for (labels, value) in values {
            let comma = if labels.is_empty() { "" } else { "," };
            let _ = writeln!(
                text,
                "tightloop_{name}{{daemon=\"{}\"{comma}{labels}}} {value}",
                look.name
            );
        }
    }
    text
}
