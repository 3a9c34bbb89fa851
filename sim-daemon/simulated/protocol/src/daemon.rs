//! A daemon without physics, with the threads of the real one: its worlds count steps.

use std::path::PathBuf;
use std::time::Duration;

use sim_machine::sync::Arc;
use sim_machine::sync::atomic::AtomicBool;
use sim_machine::sync::mpsc::{RecvTimeoutError, channel};
use sim_machine::system::signals;
use sim_machine::time::Instant;
use sim_machine::{process, step, thread};
use sim_protocol_simulated::daemon_lock::DaemonLock;
use sim_protocol_simulated::host::watch::{Places, Watch};
use sim_protocol_simulated::host::{FrameMemory, Host, Next, Worlds};
use sim_protocol_simulated::paths::{DaemonPaths, default_root};
use sim_protocol_simulated::{
    Description, Dtype, FieldInfo, Op, ProtocolError, RefusalKind, Table, sweep,
};

use crate::facts::{Facts, kinds_of_files};

/// Where daemons are: in the folder that goes with the last of them.
pub fn root() -> PathBuf {
    default_root()
}

/// Its name.
pub const NAME: &str = "counter";

/// Words of a frame besides the count, all of which have its value.
pub const BODY: usize = 48;
/// Bytes of the state of the worlds.
const STATE: usize = 3000;
/// How often the real one looks for dead clients.
const CLEAN_PERIOD: Duration = Duration::from_millis(100);

/// Runs until it is stopped, in a process of its own.
///
/// # Errors
/// Those of a start that fails, and of a loop that cannot go on.
pub fn run(facts: &Facts, parent: u32) -> Result<(), ProtocolError> {
    let stop = Arc::new(AtomicBool::new(false));
    let signalled = Arc::new(AtomicBool::new(false));
    for flag in [&stop, &signalled] {
        signals::on_stop(flag).map_err(|error| ProtocolError::Transport {
            action: "handle signals".to_owned(),
            problem: error.to_string(),
        })?;
    }
    let (places, (end, ended)) = (Places::default(), channel());
    let watch = Watch {
        stop: Arc::clone(&stop),
        signalled,
        parent: Some(parent),
        places: places.clone(),
    };
    let remains = places.clone();
    let spawned = thread::Builder::new().spawn(move || {
        watch.run(&ended, |_| {
            remains.remove();
            process::exit()
        });
    });
    let Ok(watchdog) = spawned else {
        return Ok(()); // no thread, no daemon
    };
    let served = serve(facts, &stop, &places);
    drop(end);
    let _ = watchdog.join();
    served
}

fn serve(facts: &Facts, stop: &Arc<AtomicBool>, places: &Places) -> Result<(), ProtocolError> {
    let root = root();
    let root = Some(root.as_path());
    sweep(root)?;
    let daemon_lock = DaemonLock::take(&DaemonPaths::new(root, NAME)?)?;
    places.keep(&daemon_lock);
    let slots = [("count", vec![2, 1], 0), ("body", vec![2, BODY / 2], 64)];
    let slots = slots.map(|(name, shape, first)| (name.to_owned(), Dtype::U64, shape, first));
    let table = Table::over_arena(slots, 64 + 8 * BODY);
    let mut host = Host::open(daemon_lock, description(), table, &[], Arc::clone(stop))?;
    facts.serves(host.description().session, kinds_of_files());
    let (end, ended) = channel::<()>();
    let mut cleanup = host.client_cleanup();
    let janitor = thread::Builder::new().spawn(move || {
        while ended.recv_timeout(CLEAN_PERIOD) == Err(RecvTimeoutError::Timeout) {
            cleanup.clean();
        }
    });
    let result = answer(&mut host, facts);
    drop(end);
    if let Ok(janitor) = janitor {
        let _ = janitor.join();
    }
    result
}

fn answer(host: &mut Host, facts: &Facts) -> Result<(), ProtocolError> {
    let mut worlds = Counting(0);
    loop {
        match host.wait()? {
            Next::Command => {
                let (started, head) = (Instant::now(), *host.inbox().header());
                match host.inbox().op() {
                    Op::Step => worlds.0 += 1,
                    // as a command that only the backend refuses
                    Op::Snapshot => {
                        host.refuse(RefusalKind::Backend, "these worlds are in no file");
                        continue;
                    }
                    Op::Reset => thread::sleep(facts.slow()),
                    _ => {}
                }
                facts.carry_out((head.session, head.epoch, head.seq), worlds.0);
                host.answer(started, &mut worlds);
            }
            Next::Observe => host.show(&mut [0; 8 + BODY], &mut worlds),
            Next::Record => host.record_state(&[worlds.0 as u8; STATE], false),
            Next::End => return Ok(()),
            Next::LeaseEnded | Next::Late | Next::DeviceMemory => {
                unreachable!("it owns no pages, keeps no pace and has no card")
            }
        }
    }
}

/// Worlds whose frames and state are a number.
struct Counting(u64);

impl Worlds for Counting {
    fn frame(&mut self, arena: &mut [u64], _memory: Option<&FrameMemory>) -> bool {
        let (first, second) = arena.split_at_mut(arena.len() / 2);
        first.fill(self.0);
        // a reader that looks now would see a torn frame
        step("writes a frame");
        second.fill(self.0);
        true
    }

    fn state(&mut self, to: &mut [u8]) -> bool {
        to.fill(self.0 as u8);
        true
    }
}

fn description() -> Description {
    let field = |name: &str, columns| FieldInfo {
        name: name.to_owned(),
        dtype: Dtype::U64,
        shape: vec![2, columns],
        axes: "(worlds, columns)".to_owned(),
        unit: "–".to_owned(),
        doc: "Commands that were carried out.".to_owned(),
    };
    Description {
        groups: 1,
        worlds: 2,
        precision: "f32".to_owned(),
        threads: 1,
        fields: vec![field("count", 1), field("body", BODY / 2)],
        frames_held: 2,
        watch_worlds: 1,
        watch_state_bytes: STATE as u64,
        state_bytes: STATE as u64,
        ..Description::default()
    }
}
