//! Doors of what a user or a client controls: files that it names, loops as long as it says, and requests over HTTP.

use crate::{begins_word, code, files, names_package, read, sources};
use std::collections::BTreeSet;

/// Calls that open a file of Rust.
const OPENS: [&str; 5] = [
    "fs::read(",
    "fs::read_to_string(",
    "File::open(",
    "File::options(",
    "OpenOptions::new(",
];

/// Where Rust opens files itself, and why. A file that a user names is read through `sim-core/model/src/files.rs`: it may be
/// a pipe that nobody writes to, or have no end.
const OPENERS: [&str; 22] = [
    "py-client/src/policy.rs", // weights beside an ONNX file, which sim-model must not read; looked at first
    "sim-core/device/src/shader/cache.rs", // files of our cache
    "sim-core/engine/src/auto.rs", // as cache.rs
    "sim-core/engine/src/backend/cpu/compiled/stack.rs", // /proc
    "sim-core/engine/src/backend/mod.rs", // /proc
    "sim-core/engine/src/options.rs", // /proc
    "sim-core/model/src/cache_files.rs", // as cache.rs
    "sim-core/model/src/files.rs", // the door
    "sim-daemon/protocol/src/presence/daemon_lock.rs", // files of a daemon
    "sim-daemon/protocol/src/transport/budget.rs", // as daemon_lock.rs
    "sim-daemon/src/export/snapshot.rs", // an empty file that a client made, to be written
    "sim-daemon/src/output.rs", // the door to files that are written
    "sim-daemon/src/recording/record.rs", // through output.rs
    "sim-daemon/src/serve/exchange.rs", // a question that a client made, to be answered in place
    "sim-daemon/src/serve/log.rs", // through output.rs
    "sim-daemon/system/src/linux/cgroup.rs", // /sys
    "sim-daemon/system/src/linux/memory.rs", // /proc
    "sim-daemon/system/src/linux/process.rs", // /proc
    "sim-daemon/system/src/linux/storage.rs", // files of a daemon
    "sim-daemon/system/src/unix/files.rs", // how files of a daemon, and files to write, are opened
    "sim-daemon/system/src/unix/open_files.rs", // whether a file can be opened at all
    "sim-daemon/system/src/windows/files.rs", // as that of unix
];

/// Code of a file without its tests, which open what they like.
fn without_tests(path: &str) -> Vec<String> {
    let lines = code(path);
    let tests = ["#[cfg(test)]", "#[cfg(all(test"];
    let is_tests = |pair: &[String]| {
        tests.iter().any(|start| pair[0].starts_with(start)) && pair[1].starts_with("mod ")
    };
    let end = lines.windows(2).position(is_tests).unwrap_or(lines.len());
    lines[..end].to_vec()
}

fn of_no_test(path: &str) -> bool {
    !path.ends_with("tests.rs") && !path.contains("/tests/")
}

fn opens(lines: &[String]) -> bool {
    let opening = |line: &String| OPENS.iter().any(|call| begins_word(line, call));
    lines.iter().any(opening)
}

#[test]
fn rust_opens_files_where_it_may() {
    let opening: BTreeSet<String> = sources()
        .into_iter()
        .filter(|path| of_no_test(path) && !path.contains("/simulated/"))
        .filter(|path| opens(&without_tests(path)))
        .collect();
    let listed = OPENERS.map(str::to_owned).into();
    assert_eq!(opening, listed, "use sim_model::files, or give the reason");
    let wrong = ["let text = std::fs::read_to_string(path)?;".to_owned()];
    assert!(opens(&wrong));
}

/// Calls that open a file of Python to be read.
const READS: [&str; 8] = [
    "open(",
    "os.open(",
    ".read_text(",
    ".read_bytes(",
    ".open(\"r",
    "np.load(",
    "np.fromfile(",
    "Image.open(",
];

/// Where Python reads files itself, and why. A file that a user names is read through `files/named.py`.
const READERS: [&str; 17] = [
    "adapters/jax/programs.py",       // a header of jaxlib
    "assets/policy.py",               // what named.py has opened
    "datasets/rerun.py",              // the file that it writes
    "demo/lesson.py",                 // a file of the package
    "examples/__init__.py",           // files of the package
    "examples/files/learning/log.py", // what the training itself writes
    "files/named.py",                 // the door
    "mujoco/position_actuators.py",   // what export.py has just written
    "planning/ik_of_daemon.py",       // the daemon's answer, in a file of ours
    "planning/policy_rollouts.py",    // as ik_of_daemon.py
    "scene/height_fields.py",         // what named.py has opened
    "sim/sim.py",                     // as ik_of_daemon.py
    "system.py",                      // folders and files whose names it makes durable
    "tasks/legged_models/urdf.py",    // what the reader of the scene has accepted
    "view/meshes/paint.py",           // what named.py has checked
    "view/meshes/visual.py",          // bytes in memory
    "whole_files.py",                 // files that are written
];

fn reads(line: &str) -> bool {
    READS.iter().any(|call| match *call {
        // a method of that name opens something else
        "open(" => line.match_indices(call).any(|(at, _)| {
            let before = line[..at].chars().next_back();
            before.is_none_or(|c| !c.is_alphanumeric() && c != '_' && c != '.')
                && !line[..at].ends_with("def ")
        }),
        call => line.contains(call),
    })
}

#[test]
fn python_reads_files_where_it_may() {
    let reading: BTreeSet<String> = files("py-client/python/tightloop", ".py")
        .into_iter()
        .filter(|path| {
            let text = read(path);
            let lines = text.lines().filter(|line| !line.trim().starts_with('#'));
            lines.into_iter().any(reads)
        })
        .map(|path| path.replace("py-client/python/tightloop/", ""))
        .collect();
    let listed = READERS.map(str::to_owned).into();
    assert_eq!(reading, listed, "use files/named.py, or give the reason");
    assert!(reads("    with open(path) as file:") && reads("text = path.read_text()"));
    assert!(!reads("    def open(self) -> bool:") && !reads("webbrowser.open(url)"));
}

/// What a client counts: how often, or how long, it is worked for.
const COUNTS: [&str; 6] = [
    "frames",
    "count",
    "iterations",
    "restarts",
    "problems",
    "steps",
];

/// What shows that a loop ends with its daemon: the flag, what looks at it, or the end of the channel that a thread waits on.
const ENDS: [&str; 5] = [
    "stop",
    "is_waited_for",
    "Next::End",
    "ended.recv_timeout",
    // it looks each frame, see below
    "rollout.step(",
];

/// A range over something that a client counts, such as `0..asked.question.frames`.
fn is_counted(line: &str) -> bool {
    line.match_indices("0..").any(|(at, _)| {
        let bound: String = line[at + 3..]
            .chars()
            .take_while(|&c| c.is_alphanumeric() || c == '_' || c == '.')
            .collect();
        let name = bound.rsplit('.').next().unwrap_or_default();
        COUNTS.contains(&name)
    })
}

fn is_loop(line: &str) -> bool {
    let starts = ["while ", "loop {"];
    starts.iter().any(|start| line.starts_with(start)) || is_counted(line)
}

/// Functions of a file, as rustfmt lays them out: their first line, and their code.
fn functions(text: &str) -> Vec<(&str, Vec<&str>)> {
    let lines: Vec<&str> = text.lines().collect();
    let mut functions = Vec::new();
    for (first, line) in lines.iter().enumerate() {
        let words = line.trim_start();
        if !words.starts_with("fn ") && !words.starts_with("pub fn ") && !words.starts_with("pub(")
        {
            continue;
        }
        let end = format!("{}}}", &line[..line.len() - words.len()]);
        if let Some(length) = lines[first..].iter().position(|line| *line == end) {
            let body = lines[first..first + length].iter().map(|line| line.trim());
            functions.push((words, body.filter(|line| !line.starts_with("//")).collect()));
        }
    }
    functions
}

/// First lines of functions with a loop that does not end with its daemon.
fn endless(text: &str) -> Vec<&str> {
    let all = functions(text).into_iter();
    all.filter(|(_, body)| body.iter().any(|line| is_loop(line)))
        .filter(|(_, body)| {
            let ends = |line: &&str| ENDS.iter().any(|end| line.contains(end));
            !body.iter().any(ends)
        })
        .map(|(first, _)| first)
        .collect()
}

#[test]
fn a_loop_that_a_client_counts_looks_at_the_stop_flag() {
    let mut paths = files("sim-daemon/src/serve", ".rs");
    paths.push("sim-core/ik/src/queue.rs".to_owned());
    let mut wrong = Vec::new();
    for path in paths.into_iter().filter(|path| of_no_test(path)) {
        let text = read(&path);
        let end = text.find("#[cfg(test)]\nmod ").unwrap_or(text.len());
        let found = endless(&text[..end]);
        wrong.extend(found.into_iter().map(|first| format!("{path}: {first}")));
    }
    // those of a start: `serve` has not begun
    wrong.retain(|line| !line.starts_with("sim-daemon/src/serve/session.rs: "));
    assert!(wrong.is_empty(), "{wrong:#?}");
    let text = read("sim-daemon/src/serve/rollout/run.rs");
    let (_, step) = (functions(&text).into_iter())
        .find(|(first, _)| first.starts_with("fn step("))
        .expect("the step of a rollout");
    assert!(step.iter().any(|line| line.contains("is_waited_for")));
    let bad = "fn play(question: &Question) {\n    for frame in 0..question.frames {\n        play(frame);\n    }\n}\n";
    assert_eq!(endless(bad), ["fn play(question: &Question) {"]);
    assert_eq!(
        endless(&bad.replace("play(frame)", "stop.load(frame)")).len(),
        0
    );
}

/// Packages that speak HTTP beside the one that does, hyper, whose limits keep hostile clients out.
const OTHER_HTTP: [&str; 14] = [
    "actix-web",
    "attohttpc",
    "axum",
    "curl",
    "isahc",
    "minreq",
    "reqwest",
    "rocket",
    "rouille",
    "tide",
    "tiny_http",
    "ureq",
    "warp",
    "tungstenite",
];
/// The same of Python: the viewer's page and stream come from `websockets`.
const OTHER_HTTP_OF_PYTHON: [&str; 14] = [
    "aiohttp",
    "bottle",
    "cherrypy",
    "django",
    "fastapi",
    "flask",
    "http.client",
    "http.server",
    "httpx",
    "requests",
    "socketserver",
    "starlette",
    "tornado",
    "urllib.request",
];

/// The package that a line of a manifest depends on.
fn dependency(line: &str) -> &str {
    line.split(['=', '.', ' ']).next().unwrap_or_default()
}

/// Whether a line of Python imports a module.
fn imports(line: &str, module: &str) -> bool {
    let line = line.trim();
    let (package, name) = module.rsplit_once('.').unwrap_or(("", module));
    let whole = ["import ", "from "].iter().any(|word| {
        let rest = line
            .strip_prefix(word)
            .and_then(|rest| rest.strip_prefix(module));
        rest.is_some_and(|rest| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_'))
    });
    whole || !package.is_empty() && line == format!("from {package} import {name}")
}

#[test]
fn one_library_speaks_http() {
    for manifest in [
        "Cargo.toml",
        "sim-daemon/Cargo.toml",
        "py-client/Cargo.toml",
    ] {
        let text = read(manifest);
        for line in text.lines() {
            assert!(
                !OTHER_HTTP.contains(&dependency(line)),
                "{manifest}: {line}"
            );
        }
    }
    for path in files("py-client/python/tightloop", ".py") {
        for line in read(&path).lines() {
            let other = OTHER_HTTP_OF_PYTHON
                .iter()
                .find(|module| imports(line, module));
            assert!(other.is_none(), "{path}: {line}");
            let door = "py-client/python/tightloop/view/browser/";
            assert!(
                !imports(line, "websockets") || path.starts_with(door),
                "{path}: {line}"
            );
        }
    }
    assert_eq!(dependency("axum = \"=0.8\""), "axum");
    assert!(imports("from http import server", "http.server") && imports("import flask", "flask"));
    assert!(
        !imports("from http import HTTPStatus", "http.server")
            && !imports("import flasks", "flask")
    );
    assert!(names_package("hyper::Request", "hyper"));
}
