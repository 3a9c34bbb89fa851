//! A thread that starts before anything else: it hears signals, `tightloop stop` and the death of our parent in every state.
//! What it does then is in [`Watch`].

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use sim_protocol::daemon_lock::DaemonLock;
use sim_protocol::host::watch::{Places, Watch};
use sim_system::signals;

use crate::cli::Serve;
use crate::error::DaemonError;
use crate::printer::{self, Printer};

/// Longest wait for the last message.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// The running thread; dropping it ends it.
#[derive(Debug)]
pub(crate) struct Watchdog {
    stop: Arc<AtomicBool>,
    places: Places,
    /// Nothing is sent: the thread sees that it is gone.
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Watchdog {
    /// Starts watching: signals, and whether our parent is still the one that launched us.
    pub(crate) fn start(serve: &Serve, stderr: &Printer) -> Result<Watchdog, DaemonError> {
        let stop = Arc::new(AtomicBool::new(false));
        let signalled = Arc::new(AtomicBool::new(false));
        for flag in [&stop, &signalled] {
            signals::on_stop(flag).map_err(|error| DaemonError::System {
                action: "handle signals",
                problem: error.to_string(),
            })?;
        }
        let places = Places::default();
        let watch = Watch {
            stop: Arc::clone(&stop),
            signalled,
            parent: serve.parent,
            places: places.clone(),
        };
        let (end, ended) = channel();
        let (stderr, remains) = (stderr.clone(), places.clone());
        let priority = serve.priority;
        let work = move || {
            // threads that step at that priority would leave it no core; a client that asks for one gets an error if it is not granted
            let _ = priority.map(signals::set_priority);
            watch.run(&ended, |reason| end_at_once(&stderr, &remains, reason));
        };
        let thread = std::thread::Builder::new()
            .name("tightloop-watchdog".to_owned())
            .spawn(work)
            .map_err(|error| DaemonError::System {
                action: "start a thread",
                problem: error.to_string(),
            })?;
        Ok(Watchdog {
            stop,
            places,
            end: Some(end),
            thread: Some(thread),
        })
    }

    /// The flag that is set when somebody asks us to stop.
    pub(crate) fn stop(&self) -> &Arc<AtomicBool> {
        &self.stop
    }

    /// From now on, this place is ours, and its files go with us. A request to stop the first one stops us.
    pub(crate) fn keep(&self, place: &DaemonLock) {
        self.places.keep(place);
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.end.take();
        if let Some(thread) = self.thread.take() {
            // a panic there has been printed on stderr already
            let _ = thread.join();
        }
    }
}

/// Ends the process, whatever its other threads do.
fn end_at_once(stderr: &Printer, places: &Places, reason: &str) -> ! {
    stderr.print(format!("tightloop: ended at once: {reason}\n"));
    printer::flush_within(LAST_WORDS, [stderr]);
    // last: another daemon may take the name then
    places.remove();
    sim_engine::options::leave_at_once(1)
}
