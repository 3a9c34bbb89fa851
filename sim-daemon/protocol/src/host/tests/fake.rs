//! A daemon without physics, on a thread.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Sender, channel};
use std::thread::JoinHandle;

use super::super::*;
use crate::presence::connection::Connection;
use crate::presence::liveness::Peer;
use crate::presence::paths::{DaemonPaths, Presence};
use crate::{AttachOptions, Client, Dtype, InputInfo, keep_waiting};

/// Bytes of the state of the daemon: several entries long.
pub(super) const STATE: usize = 40_000;
/// How late the daemon refuses a step whose client has gone [ms].
const LATE_MS: u64 = 200;

/// A daemon on a thread: it answers every command with the number of commands so far.
pub(super) struct Fake {
    pub name: String,
    pub root: PathBuf,
    pub stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

fn description() -> Description {
    let input = |name: &str| InputInfo {
        name: name.to_owned(),
        columns: 3,
        unit: "-".to_owned(),
        doc: String::new(),
    };
    Description {
        groups: 1,
        worlds: 2,
        precision: "f32".to_owned(),
        threads: 1,
        dof_names: ["a/x", "a/y", "a/z"].map(str::to_owned).to_vec(),
        commands: vec![input("joint_f")],
        writes: vec![input("joint_q")],
        frames_held: 2,
        watch_worlds: 1,
        watch_state_bytes: STATE as u64,
        ..Description::default()
    }
}

/// Worlds whose frames and state are a number; the state takes a time to give. They own the pages of frames, as a GPU does.
pub(super) struct Counted<'a>(pub u64, pub Duration, pub &'a mut Vec<Arc<Pages>>);

impl Worlds for Counted<'_> {
    fn frame(&mut self, arena: &mut [u64], memory: Option<&FrameMemory>) -> bool {
        if let Some(memory) = memory {
            let pages = memory.pages(arena).expect("the frame lies in them");
            if !self.2.iter().any(|owned| Arc::ptr_eq(owned, &pages)) {
                self.2.push(pages);
            }
            assert_eq!(self.2.len(), 1, "those of one lease");
        }
        arena[..2].fill(self.0);
        true
    }

    fn state(&mut self, to: &mut [u8]) -> bool {
        std::thread::sleep(self.1);
        to.fill(self.0 as u8);
        true
    }
}

/// The host of such a daemon.
pub(super) fn open(paths: &DaemonPaths, stop: Arc<AtomicBool>) -> Host {
    let table = Table::over_arena([("count".to_owned(), Dtype::U64, vec![2], 0)], 64);
    let daemon_lock = DaemonLock::take(paths).unwrap();
    Host::open(daemon_lock, description(), table, &[], stop).unwrap()
}

/// Calls with a host that nobody else looks after.
pub(super) fn alone(test: &str, call: impl FnOnce(&mut Host)) {
    let root = std::env::temp_dir().join(format!("tightloop-{test}-{}", std::process::id()));
    let paths = DaemonPaths::new(Some(&root), "fake").unwrap();
    let mut host = open(&paths, Arc::default());
    call(&mut host);
    drop(host);
    std::fs::remove_dir(&root).expect("nothing is left in the root folder");
}

/// A connection to such a host, which need not answer for it.
pub(super) fn connect(host: &Host) -> Connection {
    let paths = host.daemon_lock().paths().clone();
    let Ok(Presence::Running(beacon)) = paths.presence() else {
        panic!("it has announced itself");
    };
    let peer = Peer::find(paths, beacon).unwrap();
    Connection::open(&peer, &mut keep_waiting()).unwrap().0
}

/// Serves until it is stopped; sends word when clients may come.
fn serve(paths: &DaemonPaths, stop: Arc<AtomicBool>, ready: Sender<()>, takes: Duration) {
    let mut host = open(paths, stop);
    let mut cleanup = host.client_cleanup();
    ready.send(()).unwrap();
    let (mut count, mut owned) = (0, Vec::new());
    loop {
        match host.wait().unwrap() {
            Next::Command if host.inbox().on_device().is_some() => {
                // a card that never gets there
                while host.is_waited_for() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                // meanwhile another client gets the lease and sends a command
                for _ in 0..LATE_MS {
                    std::thread::sleep(Duration::from_millis(1));
                    host.is_waited_for();
                }
                host.refuse(RefusalKind::Stale, "nobody waits");
            }
            Next::Command => {
                count += 1;
                host.answer(Instant::now(), &mut Counted(count, takes, &mut owned));
            }
            Next::Observe => host.show(&mut [0; 8], &mut Counted(count, takes, &mut owned)),
            Next::DeviceMemory => host.deliver(|host| {
                let slots = host.frame_slots();
                Err(format!("no card for {slots} slots"))
            }),
            Next::Late => unreachable!("it keeps no pace"),
            Next::LeaseEnded => {
                // nobody else has them, and there is no other lease before they go
                assert_eq!(owned.drain(..).filter_map(Arc::into_inner).count(), 1);
                assert_eq!(host.lease(), 0);
            }
            Next::Record => host.record_state(&[count as u8; STATE], false),
            Next::End => break,
        }
    }
    cleanup.clean();
}

impl Fake {
    pub fn start(test: &str) -> Fake {
        Fake::slow(test, Duration::ZERO)
    }

    /// One whose state takes a time to give.
    pub fn slow(test: &str, takes: Duration) -> Fake {
        let root = std::env::temp_dir().join(format!("tightloop-{test}-{}", std::process::id()));
        let paths = DaemonPaths::new(Some(&root), "fake").unwrap();
        let (stop, (ready, wait)) = (Arc::new(AtomicBool::new(false)), channel());
        let thread_stop = Arc::clone(&stop);
        let thread = std::thread::spawn(move || serve(&paths, thread_stop, ready, takes));
        wait.recv().unwrap();
        Fake {
            name: "fake".to_owned(),
            root,
            stop,
            thread: Some(thread),
        }
    }

    pub fn attach(&self) -> Client {
        let options = AttachOptions {
            root: Some(self.root.clone()),
            ..AttachOptions::default()
        };
        Client::attach(&self.name, &options, &mut keep_waiting()).unwrap()
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
        std::fs::remove_dir(&self.root).expect("nothing is left in the root folder");
    }
}
