//! `simulate`: runs seeds of daemon, clients and observers on a simulated machine, until one fails.

mod calls;
mod client;
mod daemon;
mod facts;
mod plan;
mod scene;

use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use clap::Parser;
use plan::Plan;
use sim_protocol_simulated::paths::RUNTIME_FOLDER;

/// The variable that names the root folder.
const ROOT: &str = "TIGHTLOOP_ROOT";

/// Runs of a process: stacks of killed threads stay until it ends.
const RUNS_MAX: u64 = 200;

/// Runs the protocol of daemon and clients on a machine that follows a seed.
///
/// Processes are killed and stopped, calls fail, notifications are lost. A seed that fails is printed, with the least plan that
/// still fails and the last doors that were passed.
#[derive(Debug, Parser)]
struct Simulate {
    /// First seed.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Number of seeds; without it, seeds are run for `--minutes`.
    #[arg(long)]
    runs: Option<u64>,
    /// How long to go on.
    #[arg(long, default_value_t = 1.0)]
    minutes: f64,
    /// Processes at once.
    #[arg(long, default_value_t = 2)]
    jobs: usize,
    /// Prints what happens in the first seed.
    #[arg(long)]
    trace: bool,
    /// Runs seeds in this process.
    #[arg(long, hide = true)]
    here: bool,
}

fn main() -> ExitCode {
    // where daemons are follows the seed, too
    if [RUNTIME_FOLDER, ROOT]
        .iter()
        .any(|name| std::env::var_os(name).is_some())
    {
        return without_folders();
    }
    let args = Simulate::parse();
    if args.trace {
        let plan = Plan::from_seed(args.seed);
        let (outcome, _) = scene::run(&plan, true);
        println!(
            "{plan:#?}\n{}\n{:?}",
            outcome.trace.join("\n"),
            outcome.failure
        );
        return ExitCode::from(u8::from(outcome.failure.is_some()));
    }
    let done = if args.here {
        here(&args)
    } else {
        by_children(&args)
    };
    match done {
        Some((steps, commands)) => {
            println!("{steps} steps, {commands} commands");
            ExitCode::SUCCESS
        }
        None => ExitCode::FAILURE,
    }
}

/// Begins again without the variables that name the root folder.
fn without_folders() -> ExitCode {
    let program = std::env::current_exe().expect("it runs");
    let mut again = Command::new(program);
    again.args(std::env::args_os().skip(1));
    again.env_remove(RUNTIME_FOLDER).env_remove(ROOT);
    let status = again.status().expect("it runs again");
    ExitCode::from(u8::from(!status.success()))
}

/// Runs seeds here; returns steps and commands, or none after a failure.
fn here(args: &Simulate) -> Option<(u64, u64)> {
    let (mut steps, mut commands) = (0, 0);
    for seed in args.seed..args.seed + args.runs.unwrap_or(RUNS_MAX) {
        let plan = Plan::from_seed(seed);
        let (outcome, carried_out) = scene::run(&plan, false);
        steps += outcome.steps;
        commands += carried_out;
        if let Some(failure) = outcome.failure {
            report(&plan, &failure);
            return None;
        }
    }
    Some((steps, commands))
}

/// Prints a failure with the least plan that fails, and its trace.
fn report(plan: &Plan, failure_said: &str) {
    println!("seed {} fails: {failure_said}", plan.seed);
    // a part that is needed for another failure is not needed for this one
    let place = |failure: &str| failure.lines().next().map(str::to_owned);
    let fails_so = |plan: &Plan| {
        let failure = scene::run(plan, false).0.failure;
        failure.is_some_and(|other| place(&other) == place(failure_said))
    };
    let mut least = plan.clone();
    while let Some(smaller) = least.smaller().into_iter().find(&fails_so) {
        least = smaller;
    }
    let (outcome, _) = scene::run(&least, true);
    let failure = outcome.failure.unwrap_or_default();
    println!(
        "least plan, {} of {} parts: {least:#?}",
        least.size(),
        plan.size()
    );
    let skip = outcome.trace.len().saturating_sub(150);
    println!("{}\n{failure}", outcome.trace[skip..].join("\n"));
}

/// Runs seeds in other processes.
fn by_children(args: &Simulate) -> Option<(u64, u64)> {
    let end = Instant::now() + Duration::from_secs_f64(60.0 * args.minutes);
    let mut next = args.seed;
    let last = args.runs.map(|runs| args.seed + runs);
    let (mut running, mut steps, mut commands) = (Vec::new(), 0, 0);
    let mut is_good = true;
    loop {
        let wanted = is_good && last.map_or(Instant::now() < end, |last| next < last);
        if wanted && running.len() < args.jobs {
            let runs = last.map_or(RUNS_MAX, |last| RUNS_MAX.min(last - next));
            let mut child = Command::new(std::env::current_exe().ok()?);
            let numbers = [("--seed", next), ("--runs", runs)];
            let numbers = numbers
                .iter()
                .flat_map(|(name, number)| [(*name).to_owned(), number.to_string()]);
            child
                .arg("--here")
                .args(numbers)
                .stdout(std::process::Stdio::piped());
            running.push(child.spawn().ok()?);
            next += runs;
            continue;
        }
        if running.is_empty() {
            break;
        }
        let output = running.remove(0).wait_with_output().ok()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let numbers: Vec<u64> = text
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        if output.status.success() && numbers.len() == 2 {
            (steps, commands) = (steps + numbers[0], commands + numbers[1]);
        } else {
            println!("{text}");
            is_good = false;
        }
    }
    println!("seeds {} to {}", args.seed, next);
    is_good.then_some((steps, commands))
}
