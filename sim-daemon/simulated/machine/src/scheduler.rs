//! Who goes on: a thread of a process that runs, chosen by the seed. Where all of them sleep, the clock goes to the first that wakes.

use shuttle::scheduler::{Schedule, Scheduler, Task, TaskId};

use crate::world::{World, with};

/// One run.
#[derive(Debug)]
pub(crate) struct ByTime {
    is_begun: bool,
}

impl ByTime {
    pub(crate) fn new() -> ByTime {
        ByTime { is_begun: false }
    }
}

impl Scheduler for ByTime {
    fn new_execution(&mut self) -> Option<Schedule> {
        let first = !std::mem::replace(&mut self.is_begun, true);
        first.then(|| Schedule::new(0))
    }

    fn next_task(
        &mut self,
        runnable: &[&Task],
        _current: Option<TaskId>,
        _is_yielding: bool,
    ) -> Option<TaskId> {
        with(|world| {
            if world.steps > world.steps_max {
                return None;
            }
            let wake = |world: &World, task: &Task| world.wake(usize::from(task.id()));
            let first = runnable.iter().filter_map(|task| wake(world, task)).min()?;
            if first == u64::MAX {
                return None;
            }
            world.now = world.now.max(first);
            let ready = |task: &&&Task| wake(world, task).is_some_and(|wake| wake <= world.now);
            let count = runnable.iter().filter(ready).count();
            let chosen = runnable
                .iter()
                .filter(ready)
                .nth(world.rng.clone().usize(0..count))?;
            let chosen = chosen.id();
            world.rng.u64(..);
            world.goes_on(usize::from(chosen));
            Some(chosen)
        })
    }

    fn next_u64(&mut self) -> u64 {
        with(|world| world.rng.u64(..))
    }
}
