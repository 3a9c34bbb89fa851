//! One run of a seed.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook};
use std::sync::Once;
use std::time::Duration;

use shuttle::{Config, FailurePersistence, MaxSteps, Runner};

use crate::process::Handle;
use crate::scheduler::ByTime;
use crate::thread;
use crate::world::{World, exchange, with};

/// Stack of a thread [bytes].
const STACK: usize = 512 << 10;

/// What a run is like.
#[derive(Debug, Clone)]
pub struct Run {
    /// Decides everything.
    pub seed: u64,
    /// Calls of the system in a million that fail.
    pub failing: u32,
    /// Notifications in a million that are lost.
    pub dropping: u32,
    /// Doors in a million behind which a thread loses its core.
    pub preempting: u32,
    /// How long at most, as a power of two [µs].
    pub longest: u32,
    /// Sleepers wake this much later, at most, once in sixteen times [ns].
    pub lateness: u64,
    /// Doors after which a run has failed: something never ends.
    pub steps_max: u64,
    /// Whether to keep the last doors that were passed.
    pub trace: bool,
}

/// What came of it.
#[derive(Debug)]
pub struct Outcome {
    /// Doors that were passed.
    pub steps: u64,
    /// Time that passed on the machine's clock [ns].
    pub time: u64,
    /// What went wrong, if something did.
    pub failure: Option<String>,
    /// The last doors, if they were kept.
    pub trace: Vec<String>,
}

thread_local! {
    /// What was said by the last panic of this thread of the host.
    static SAID: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// How a run ends that went well: threads of killed processes are left where they are.
struct Ended;

impl Run {
    /// Runs a scenario, which is the first thread, of no process.
    pub fn play(&self, scenario: impl Fn() + Send + Sync + 'static) -> Outcome {
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            set_hook(Box::new(|panic| {
                SAID.replace(Some(panic.to_string()));
            }));
        });
        let run = self.clone();
        // after a failure, shuttle's state of a thread is not fit for another run
        let thread = std::thread::spawn(move || run.here(scenario));
        thread.join().expect("what fails is caught")
    }

    fn here(&self, scenario: impl Fn() + Send + Sync + 'static) -> Outcome {
        let mut world = World::new(self.seed);
        (world.failing, world.lateness) = (self.failing, self.lateness);
        (world.dropping, world.steps_max) = (self.dropping, self.steps_max);
        (world.preempting, world.longest) = (self.preempting, self.longest);
        world.trace = self.trace.then(Default::default);
        let begin = world.now;
        exchange(Some(world));
        let mut config = Config::new();
        config.stack_size = STACK;
        config.failure_persistence = FailurePersistence::None;
        config.max_steps = MaxSteps::None;
        config.silence_warnings = true;
        config
            .ungraceful_shutdown_config
            .immediately_return_on_panic = true;
        let runner = Runner::new(ByTime::new(), config);
        let scenario = move || {
            scenario();
            resume_unwind(Box::new(Ended));
        };
        let ended = catch_unwind(AssertUnwindSafe(|| runner.run(scenario)));
        let world = exchange(None).expect("a run was on");
        let failure = match ended {
            Ok(_) if world.steps > world.steps_max => Some("it does not end".to_owned()),
            Ok(_) => Some("every thread sleeps for ever".to_owned()),
            Err(payload) if payload.is::<Ended>() => None,
            // shuttle's own panic comes last and says nothing
            Err(_) => Some(SAID.take().unwrap_or_default()),
        };
        Outcome {
            steps: world.steps,
            time: world.now - begin,
            failure,
            trace: world.trace.map(Vec::from).unwrap_or_default(),
        }
    }
}

/// From now on no call fails, no notification is lost, no thread loses its core, and nobody is killed who was to be.
pub fn calm() {
    with(|world| {
        (world.failing, world.dropping, world.preempting) = (0, 0, 0);
        for process in world.processes.values_mut() {
            (process.doors, process.changes) = (u64::MAX, u64::MAX);
            process.halt = None;
        }
    });
}

/// Does something after a time, in the process of the caller.
pub fn at(after: Duration, call: impl FnOnce() + Send + 'static) {
    thread::begin(Handle::this(), move || {
        thread::sleep(after);
        call();
    });
}
