//! Groups of worlds side by side: each is served on a thread of its own, and they end together.

use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::error::DaemonError;

/// Serves the first group on this thread and each other one on a thread of its own, until all have ended. When one ends, in
/// whatever way, `stop` asks the others to.
///
/// # Errors
/// The first failure, with the group's number where there are several.
pub(crate) fn serve_all<G: Send>(
    groups: Vec<G>,
    stop: &AtomicBool,
    serve: impl Fn(usize, G) -> Result<(), DaemonError> + Sync,
) -> Result<(), DaemonError> {
    let is_alone = groups.len() == 1;
    let serve = |number: usize, group: G| {
        let _end = EndAll(stop);
        serve(number, group).map_err(|problem| match is_alone {
            true => problem,
            false => DaemonError::Group {
                group: number,
                problem: Box::new(problem),
            },
        })
    };
    thread::scope(|scope| {
        let serve = &serve;
        let mut groups = groups.into_iter().enumerate();
        let first = groups.next();
        let others = groups.map(|(number, group)| {
            let thread = thread::Builder::new().name(format!("group-{number}"));
            let started = thread.spawn_scoped(scope, move || serve(number, group));
            started.map_err(|error| {
                drop(EndAll(stop));
                DaemonError::System {
                    action: "start a thread",
                    problem: error.to_string(),
                }
            })
        });
        // all run before the first one is waited for
        let others: Vec<_> = others.collect();
        let mut result = first.map_or(Ok(()), |(number, group)| serve(number, group));
        for other in others {
            let ended =
                other.and_then(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic)));
            result = result.and(ended);
        }
        result
    })
}

/// Asks all groups to end when it is dropped, hence also where a thread panics.
struct EndAll<'a>(&'a AtomicBool);

impl Drop for EndAll<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use std::panic::{AssertUnwindSafe, catch_unwind};

    use super::*;

    fn failure() -> DaemonError {
        DaemonError::System {
            action: "serve",
            problem: "it broke".to_owned(),
        }
    }

    /// Serves groups of which the one with that number ends at once, and the others when they are asked to.
    fn ends(
        first: usize,
        how: impl Fn() -> Result<(), DaemonError> + Sync,
    ) -> Result<(), DaemonError> {
        let stop = AtomicBool::new(false);
        serve_all(vec![0, 1, 2], &stop, |number, group| {
            assert_eq!(number, group);
            if number == first {
                return how();
            }
            while !stop.load(Ordering::Relaxed) {
                thread::yield_now();
            }
            Ok(())
        })
    }

    #[test]
    fn the_end_of_one_group_ends_all_and_its_failure_is_named() {
        for first in 0..3 {
            ends(first, || Ok(())).unwrap();
            let error = ends(first, || Err(failure())).unwrap_err();
            assert_eq!(error.to_string(), format!("group {first}: serve: it broke"));
            assert_eq!((error.kind(), error.exit_code()), ("LaunchError", 1));
        }
    }

    #[test]
    fn a_panic_in_one_group_ends_all_and_goes_on() {
        for first in 0..3 {
            let ended = catch_unwind(AssertUnwindSafe(|| ends(first, || panic!("a bug"))));
            assert_eq!(ended.unwrap_err().downcast_ref(), Some(&"a bug"));
        }
    }

    #[test]
    fn what_is_alone_has_no_number() {
        let error = serve_all(vec![()], &AtomicBool::new(false), |_, ()| Err(failure()));
        assert_eq!(error.unwrap_err().to_string(), "serve: it broke");
    }
}
