//! `tightloop list`: the running daemons, who uses them, and how fast they step.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use sim_protocol::{AttachOptions, Client, ProtocolError};
use sim_system::process;

use crate::error::DaemonError;
use crate::output;

/// Steps are counted for so long.
const COUNTED: Duration = Duration::from_millis(500);
/// A daemon that does not answer is listed without its news after so long.
const PATIENCE: Duration = Duration::from_secs(2);
const COLUMNS: [&str; 9] = [
    "NAME",
    "WORLDS",
    "GROUPS",
    "PID",
    "CONTROLLER",
    "OBSERVERS",
    "STEPS/S",
    "AGE",
    "DEVICE",
];

/// What one daemon says.
struct Row {
    name: String,
    news: Option<News>,
}

struct News {
    worlds: usize,
    groups: usize,
    device: String,
    pid: u32,
    /// Processes in control, of any group.
    controllers: Vec<u32>,
    observers: usize,
    /// Physics steps of all worlds per second.
    rate: f64,
    age: Option<Duration>,
}

/// Prints a table, names alone, or JSON.
pub(crate) fn run(names_only: bool, as_json: bool) -> Result<(), DaemonError> {
    let names = sim_protocol::running(None)?;
    let text = if names_only {
        names.iter().map(|name| format!("{name}\n")).collect()
    } else {
        // each is asked on a thread of its own, since each takes half a second
        let rows: Vec<Row> = std::thread::scope(|scope| {
            let asked: Vec<_> = names
                .iter()
                .map(|name| scope.spawn(|| ask(name).ok().flatten()))
                .collect();
            let news = asked.into_iter().map(|thread| thread.join().ok().flatten());
            let rows = names.iter().zip(news);
            rows.map(|(name, news)| Row {
                name: name.clone(),
                news,
            })
            .collect()
        });
        match as_json {
            true => format!(
                "{}\n",
                Value::from(rows.iter().map(Row::json).collect::<Vec<_>>())
            ),
            false => table(&rows),
        }
    };
    output::print(text.as_bytes()).map_err(DaemonError::stdout)
}

/// Asks a daemon; `None` where it ended meanwhile.
fn ask(name: &str) -> Result<Option<News>, ProtocolError> {
    let options = AttachOptions::default();
    let began = Instant::now();
    let mut hook = || match began.elapsed() < PATIENCE {
        true => ControlFlow::Continue(()),
        false => ControlFlow::Break(()),
    };
    let groups = sim_protocol::find(name, &options, &mut hook)?.groups;
    let names: Vec<String> = match groups {
        1 => vec![name.to_owned()],
        _ => (0..groups).map(|group| format!("{name}.{group}")).collect(),
    };
    let mut clients = Vec::new();
    for name in &names {
        clients.push(Client::attach(name, &options, &mut hook)?);
    }
    let (mut controllers, mut observers, mut rate) = (Vec::new(), 0, 0.0);
    for client in &clients {
        controllers.extend(client.controller(&mut hook)?);
        observers += client.observers(&mut hook)?;
    }
    let mut firsts = Vec::new();
    for client in &clients {
        // the state at which it pauses, or the newest
        let first = match client.wait_newer(Some(COUNTED / 5), &mut hook) {
            // where the daemon has no room for another observer, no frame is counted
            Err(ProtocolError::TooManyClients { .. }) => None,
            first => first?,
        };
        firsts.push(first.map(|frame| (frame.header().frame, Instant::now())));
    }
    std::thread::sleep(COUNTED);
    for (client, first) in clients.iter().zip(firsts) {
        let Some((first, since)) = first else {
            continue;
        };
        if let Some(last) = client.latest(&mut hook)? {
            let frames = last.header().frame.saturating_sub(first) as f64;
            let description = client.description();
            let steps = (description.worlds * description.substeps) as f64;
            rate += frames * steps / since.elapsed().as_secs_f64();
        }
    }
    let description = clients[0].description();
    Ok(Some(News {
        worlds: description.worlds * groups,
        groups,
        device: description.device.clone(),
        pid: description.pid,
        controllers,
        observers,
        rate,
        age: process::age(description.pid),
    }))
}

impl Row {
    fn cells(&self) -> [String; 9] {
        let Some(news) = &self.news else {
            let mut cells = [const { String::new() }; 9];
            cells[0].clone_from(&self.name);
            cells[8] = "does not answer".to_owned();
            return cells;
        };
        let controllers: Vec<String> = news.controllers.iter().map(u32::to_string).collect();
        [
            self.name.clone(),
            news.worlds.to_string(),
            news.groups.to_string(),
            news.pid.to_string(),
            match controllers.is_empty() {
                true => "–".to_owned(),
                false => controllers.join(","),
            },
            news.observers.to_string(),
            rounded(news.rate),
            news.age.map_or_else(|| "–".to_owned(), in_words),
            news.device.clone(),
        ]
    }

    fn json(&self) -> Value {
        let Some(news) = &self.news else {
            return json!({ "name": self.name });
        };
        json!({
            "name": self.name,
            "worlds": news.worlds,
            "groups": news.groups,
            "device": news.device,
            "pid": news.pid,
            "controllers": news.controllers,
            "observers": news.observers,
            "steps_per_s": news.rate,
            "age_s": news.age.map(|age| age.as_secs_f64()),
        })
    }
}

fn table(rows: &[Row]) -> String {
    let mut lines = vec![COLUMNS.map(str::to_owned)];
    lines.extend(rows.iter().map(Row::cells));
    let width = |column: usize| {
        let cells = lines.iter().map(|line| line[column].chars().count());
        cells.max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..COLUMNS.len()).map(width).collect();
    let mut text = String::new();
    for line in &lines {
        let cells = line.iter().zip(&widths);
        let padded: Vec<String> = cells
            .map(|(cell, &width)| format!("{cell:<width$}"))
            .collect();
        text.push_str(padded.join("  ").trim_end());
        text.push('\n');
    }
    text
}

/// A rate with three digits, such as `1.23 M`.
pub(crate) fn rounded(rate: f64) -> String {
    match rate {
        rate if rate >= 1e6 => format!("{:.3} M", rate / 1e6),
        rate if rate >= 1e3 => format!("{:.1} k", rate / 1e3),
        rate => format!("{rate:.0}"),
    }
}

/// A duration in its two largest units.
pub(crate) fn in_words(age: Duration) -> String {
    match age.as_secs() {
        seconds @ 0..60 => format!("{seconds} s"),
        seconds @ 60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        seconds @ 3600..86_400 => format!("{} h {} min", seconds / 3600, seconds / 60 % 60),
        seconds => format!("{} d {} h", seconds / 86_400, seconds / 3600 % 24),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_ages_are_short() {
        assert_eq!(
            [0.0, 999.0, 1234.0, 7_654_321.0].map(rounded),
            ["0", "999", "1.2 k", "7.654 M"]
        );
        let ages = [59, 61, 3660, 90_000].map(|seconds| in_words(Duration::from_secs(seconds)));
        assert_eq!(ages, ["59 s", "1 min 1 s", "1 h 1 min", "1 d 1 h"]);
    }

    #[test]
    fn a_daemon_that_does_not_answer_is_listed() {
        let row = Row {
            name: "one".to_owned(),
            news: None,
        };
        let text = table(&[row]);
        assert!(text.lines().count() == 2 && text.contains("\none"));
    }
}
