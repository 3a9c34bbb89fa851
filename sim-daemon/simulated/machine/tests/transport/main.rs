//! The transport by itself: what iceoryx2 promises, and what it leaves behind when a process dies.

mod death;
mod events;
mod requests;
mod samples;

use std::mem::MaybeUninit;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use sim_machine::iceoryx2::config::Config;
use sim_machine::iceoryx2::node::{NodeCleanupFailure, NodeView};
use sim_machine::iceoryx2::overwritten;
use sim_machine::iceoryx2::port::client::{Client, RequestSendError};
use sim_machine::iceoryx2::port::listener::Listener;
use sim_machine::iceoryx2::port::notifier::Notifier;
use sim_machine::iceoryx2::port::publisher::Publisher;
use sim_machine::iceoryx2::port::server::Server;
use sim_machine::iceoryx2::port::subscriber::{Subscriber, SubscriberCreateError};
use sim_machine::iceoryx2::port::update_connections::UpdateConnections;
use sim_machine::iceoryx2::port::{LoanError, ReceiveError};
use sim_machine::iceoryx2::prelude::{
    CallbackProgression, FileName, Node, NodeBuilder, NodeName, NodeState, Path as IoxPath,
    PortFactory, SemanticString, ServiceName,
};
use sim_machine::iceoryx2::service::builder::event::EventOpenError;
use sim_machine::iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;
use sim_machine::iceoryx2::service::port_factory::publish_subscribe::PortFactory as Samples;
use sim_machine::memory::service::AnyThread as S;
use sim_machine::thread;
use sim_machine::time::Instant;
use sim_machine::{Run, fs, process};

type Service = Samples<S, [u64], u64>;
type Sender = Publisher<S, [u64], u64>;
type Receiver = Subscriber<S, [u64], u64>;

const ROOT: &str = "/dev/shm/transport/";
const SEEDS: u64 = 60;

fn run(seed: u64) -> Run {
    Run {
        seed,
        failing: 0,
        dropping: 0,
        preempting: 0,
        longest: 14,
        lateness: 1_000_000,
        steps_max: 300_000,
        trace: true,
    }
}

/// Runs a scenario with several seeds.
fn check(scenario: impl Fn() + Send + Sync + Clone + 'static) {
    check_with(run, scenario);
}

fn check_with(run: impl Fn(u64) -> Run, scenario: impl Fn() + Send + Sync + Clone + 'static) {
    for seed in 0..SEEDS {
        let outcome = run(seed).play(scenario.clone());
        if let Some(failure) = outcome.failure {
            let last = outcome.trace.len().saturating_sub(60);
            panic!(
                "seed {seed}: {failure}\n{}",
                outcome.trace[last..].join("\n")
            );
        }
    }
}

fn config() -> Config {
    let mut config = Config::default();
    config.global.prefix = FileName::new(b"12345678_").unwrap();
    config
        .global
        .set_root_path(&IoxPath::new(ROOT.as_bytes()).unwrap());
    config
}

fn node() -> Node<S> {
    let name = NodeName::new("client").unwrap();
    let builder = NodeBuilder::new().name(&name).config(&config());
    builder.create::<S>().unwrap()
}

fn name(name: &str) -> ServiceName {
    ServiceName::new(name).unwrap()
}

fn create(node: &Node<S>, buffer: usize, held: usize, history: usize) -> Service {
    node.service_builder(&name("samples"))
        .publish_subscribe::<[u64]>()
        .user_header::<u64>()
        .enable_safe_overflow(true)
        .subscriber_max_buffer_size(buffer)
        .subscriber_max_borrowed_samples(held)
        .history_size(history)
        .max_publishers(1)
        .max_subscribers(2)
        .max_nodes(3)
        .create()
        .unwrap()
}

fn open(node: &Node<S>) -> Result<Service, PublishSubscribeOpenError> {
    node.service_builder(&name("samples"))
        .publish_subscribe::<[u64]>()
        .user_header::<u64>()
        .open()
}

fn publisher(service: &Service) -> Sender {
    let builder = service.publisher_builder().initial_max_slice_len(8);
    builder.max_loaned_samples(1).create().unwrap()
}

fn subscriber(service: &Service) -> Receiver {
    service.subscriber_builder().create().unwrap()
}

fn send(publisher: &Sender, value: u64) -> usize {
    let mut loan = publisher.loan_slice_uninit(4).unwrap();
    *loan.user_header_mut() = value;
    loan.payload_mut().iter_mut().for_each(|entry| {
        entry.write(value);
    });
    // SAFETY: it was written.
    unsafe { loan.assume_init() }.send().unwrap()
}

fn values(subscriber: &Receiver) -> Vec<u64> {
    let next = || subscriber.receive().unwrap();
    let values = std::iter::from_fn(next).map(|sample| {
        assert_eq!(sample.payload(), [*sample.user_header(); 4]);
        *sample.user_header()
    });
    values.collect()
}

/// Looks for the dead, and removes what they left.
fn clean() -> usize {
    let mut cleaned = 0;
    let _ = Node::<S>::list(&config(), |node| {
        if let NodeState::Dead(dead) = node {
            cleaned += usize::from(dead.try_remove_stale_resources().is_ok());
        }
        CallbackProgression::Continue
    });
    cleaned
}

/// Names of all files below the folder, but the folders.
fn files() -> Vec<String> {
    fn below(path: &Path, into: &mut Vec<String>) {
        for entry in fs::read_dir(path).into_iter().flatten().flatten() {
            match entry.metadata().is_ok_and(|status| status.is_file()) {
                true => into.push(entry.path().to_string_lossy().into_owned()),
                false => below(&entry.path(), into),
            }
        }
    }
    let mut files = Vec::new();
    below(Path::new(ROOT), &mut files);
    files
}

/// Does something in a process of its own, and waits until it says that it is ready; it stays until it is killed.
fn in_process<T: 'static>(make: impl FnOnce() -> T + Send + 'static) -> u32 {
    let ready = Arc::new(AtomicBool::new(false));
    let other = Arc::clone(&ready);
    let pid = process::spawn(move || {
        let _made = make();
        other.store(true, Ordering::Relaxed);
        loop {
            thread::sleep(Duration::from_secs(1));
        }
    });
    while !ready.load(Ordering::Relaxed) {
        thread::sleep(Duration::from_micros(100));
    }
    pid
}
