//! A stack that is large enough to record on, whatever the caller's is.

use super::Refusal;
use std::thread;

/// Least stack on which code is recorded [bytes]. The code that records is compiled without optimisation, and takes more than
/// half a megabyte.
const STACK_MIN: u64 = 2 << 20;

/// Runs `work` here, or where stacks may be small, on a thread. Threads take address space that a process may lack.
///
/// # Errors
/// No thread starts, and what `work` returns.
pub(super) fn with_stack<T: Send>(
    work: impl FnOnce() -> Result<T, Refusal> + Send,
) -> Result<T, Refusal> {
    if limit().is_some_and(|bytes| bytes >= STACK_MIN) {
        return work();
    }
    thread::scope(|scope| {
        let thread = thread::Builder::new().name("compile".to_owned());
        let thread = thread.stack_size(4 * STACK_MIN as usize);
        let started = thread.spawn_scoped(scope, work);
        let thread = started.map_err(|e| format!("no thread starts that compiles: {e}"))?;
        let made = thread.join();
        made.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

/// Largest stack of the first thread [bytes], where Linux says it.
fn limit() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/self/limits").ok()?;
    let line = text
        .lines()
        .find_map(|line| line.strip_prefix("Max stack size"))?;
    match line.split_whitespace().next()? {
        "unlimited" => Some(u64::MAX),
        bytes => bytes.parse().ok(),
    }
}
