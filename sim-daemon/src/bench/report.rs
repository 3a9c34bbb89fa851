//! What a benchmark prints.

use serde_json::{Value, json};
use sim_engine::simulation::{Histogram, LaneWork, MachineCode, Part};

use super::Measured;
use crate::error::DaemonError;
use crate::output;

/// Prints the report, as tables or as JSON.
pub(super) fn print(measured: &Measured, as_json: bool) -> Result<(), DaemonError> {
    let text = match as_json {
        true => format!("{:#}\n", json_of(measured)),
        false => text(measured),
    };
    output::print(text.as_bytes()).map_err(DaemonError::stdout)
}

/// The histograms, with what they count.
fn counts(measured: &Measured) -> [(&'static str, &Histogram); 8] {
    let p = &measured.profile;
    [
        ("contacts", &p.contacts),
        ("constraint rows", &p.rows),
        ("solver iterations", &p.iterations),
        ("  of a block until it pauses", &p.block_iterations),
        ("line searches", &p.searches),
        ("line-search evaluations", &p.evaluations),
        ("  of a block", &p.block_evaluations),
        ("lanes of a visited contact", &p.contact_lanes),
    ]
}

/// What blocks did for their worlds, and what these needed.
fn lane_work(measured: &Measured) -> [(&'static str, LaneWork); 4] {
    let p = &measured.profile;
    [
        ("contacts, each iteration", p.lane_contacts),
        ("iterations", p.lane_iterations),
        ("line-search evaluations", p.lane_evaluations),
        ("iterations, coupled", p.lane_couplings),
    ]
}

fn text(measured: &Measured) -> String {
    let p = &measured.profile;
    let rates = &measured.rates;
    let threads = match measured.threads {
        1 => String::new(),
        n => format!(" ({n} threads)"),
    };
    let mut lines = vec![
        format!("{}, {} worlds", measured.device, measured.worlds),
        format!("commands: {}", measured.command.unwrap_or("held")),
        format!(
            "{:.0} steps/s{threads}, median of {}, from {:.0} to {:.0}",
            rates[rates.len() / 2],
            rates.len(),
            rates[0],
            rates[rates.len() - 1],
        ),
        format!(
            "worlds faulted: {}, not converged in the last frame: {}",
            measured.faulted, measured.unconverged
        ),
    ];
    if let Some([usual, full]) = measured.compiled {
        let size = |code: MachineCode| {
            let kilobytes = code.bytes as f64 / 1e3;
            format!("{kilobytes:.0} kB, {} instructions", code.instructions)
        };
        lines.push(format!("machine code of a substep: {}", size(usual)));
        if usual.bytes != full.bytes {
            lines.push(format!("  where a joint is at a limit: {}", size(full)));
        }
        lines.push("times below are of the stages that it stands for".to_owned());
    }
    lines.extend([
        String::new(),
        format!(
            "{:<28}{:>9}{:>7}{:>9}",
            "a world and step", "mean", "99 %", "largest"
        ),
    ]);
    for (name, of) in counts(measured) {
        if !of.is_empty() {
            let (mean, most, all) = (of.mean(), of.quantile(0.99), of.max());
            lines.push(format!("{name:<28}{mean:>9.2}{most:>7}{all:>9}"));
        }
    }
    let steps = p.world_steps.max(1) as f64;
    lines.push(String::new());
    lines.push(format!(
        "{:<28}{:>9}{:>9}{:>7}",
        "solver, a world and step", "executed", "needed", "share"
    ));
    for (name, work) in lane_work(measured) {
        if let Some(share) = work.share() {
            let [executed, needed] = [work.executed, work.needed].map(|n| n as f64 / steps);
            let share = format!("{:.0} %", 100.0 * share);
            lines.push(format!("{name:<28}{executed:>9.2}{needed:>9.2}{share:>7}"));
        }
    }
    let moves = p.moves as f64 / steps;
    lines.push(format!("{:<28}{moves:>9.2}", "moves between blocks"));
    lines.push(String::new());
    lines.push(format!(
        "{:<28}{:>9}{:>7}{:>9}",
        "stage, one thread", "ns", "share", "masked"
    ));
    let all = p.total_ns as f64 / steps;
    let mut others = all;
    let mut outputs = 0.0;
    for (name, stage) in p.stages() {
        let ns = stage.step_ns as f64 / steps;
        outputs += stage.evaluation_ns as f64 / steps;
        others -= ns;
        if stage.step_ns > 0 {
            let masked = stage
                .masked()
                .map_or(String::new(), |x| format!("{:.0} %", 100.0 * x));
            lines.push(row(name, ns, all, &masked));
        }
    }
    lines.push(row("outputs", outputs, all, ""));
    others -= outputs;
    for (part, name) in Part::ALL {
        let ns = p.parts[part as usize] as f64 / steps;
        others -= ns;
        lines.push(row(name, ns, all, ""));
    }
    lines.push(row("everything else", others, all, ""));
    lines.push(String::new());
    lines.join("\n")
}

fn row(name: &str, ns: f64, all: f64, masked: &str) -> String {
    let share = format!("{:.1} %", 100.0 * ns / all);
    format!("{name:<28}{ns:>9.1}{share:>7}{masked:>9}")
}

fn json_of(measured: &Measured) -> Value {
    let p = &measured.profile;
    let steps = p.world_steps.max(1) as f64;
    let stages = p.stages().map(|(name, stage)| {
        json!({
            "stage": name,
            "step_ns": stage.step_ns as f64 / steps,
            "output_ns": stage.evaluation_ns as f64 / steps,
            "masked": stage.masked(),
        })
    });
    let stages: Vec<Value> = stages.collect();
    let work =
        lane_work(measured)
            .into_iter()
            .zip(["contacts", "iterations", "evaluations", "couplings"]);
    let work = work.map(|((_, work), name)| {
        let [executed, needed] = [work.executed, work.needed].map(|n| n as f64 / steps);
        let numbers = json!({"executed": executed, "needed": needed, "share": work.share()});
        (name.to_owned(), numbers)
    });
    let parts = Part::ALL.map(|(part, name)| {
        let ns = p.parts[part as usize] as f64 / steps;
        (name.to_owned(), json!(ns))
    });
    let counts = counts(measured).into_iter().zip([
        "contacts",
        "rows",
        "iterations",
        "block_iterations",
        "searches",
        "evaluations",
        "block_evaluations",
        "contact_lanes",
    ]);
    let counts = counts
        .filter(|((_, of), _)| !of.is_empty())
        .map(|((_, of), name)| {
            let numbers = json!({"mean": of.mean(), "p99": of.quantile(0.99), "max": of.max()});
            (name.to_owned(), numbers)
        });
    json!({
        "device": measured.device,
        "worlds": measured.worlds,
        "threads": measured.threads,
        "machine_code": measured.compiled.map(|programs| programs.map(|code| json!({
            "bytes": code.bytes,
            "instructions": code.instructions,
            "spills": code.spills,
        }))),
        "commands": measured.command,
        "steps_per_s": measured.rates[measured.rates.len() / 2],
        "steps_per_s_turns": measured.rates,
        "faulted": measured.faulted,
        "unconverged": measured.unconverged,
        "counts": counts.collect::<serde_json::Map<_, _>>(),
        "moves": p.moves as f64 / steps,
        "lanes": work.collect::<serde_json::Map<_, _>>(),
        "total_ns": p.total_ns as f64 / steps,
        "parts_ns": serde_json::Map::from_iter(parts),
        "stages": stages,
    })
}
