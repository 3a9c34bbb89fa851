//! A thread that writes messages, so that its sender never waits for its reader.
//!
//! A pipe that nobody reads and a stopped terminal block a write for as long as they like. The queue is bounded: when it is
//! full, messages are dropped, and their number is written once somebody reads again.

use std::fs::File;
use std::io;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::Ordering;
#[cfg(not(loom))]
use std::sync::{atomic::AtomicU64, mpsc};
#[cfg(not(loom))]
use std::thread;
#[cfg(not(loom))]
use std::time::{Duration, Instant};

#[cfg(loom)]
use loom::sync::atomic::AtomicU64;
use sim_system::{signals, streams};

#[cfg(loom)]
use crate::doors::time::{Duration, Instant};
#[cfg(loom)]
use crate::doors::{mpsc, thread};
use crate::error::DaemonError;
use crate::terminal::printable;
use mpsc::{Receiver, Sender, SyncSender, TryRecvError, TrySendError, channel};

/// Messages that wait at most [–]: the notes of a large scene come at once.
const QUEUE: usize = 1024;
/// Longest wait for messages to be written. An end has two of them, and the watchdog does not wait longer.
const FLUSH_MAX: Duration = Duration::from_millis(300);
/// A full queue is tried again this often while somebody waits for its end.
const RETRY: Duration = Duration::from_millis(1);

/// What waits to be written.
enum Item {
    Message(String),
    /// Everything before it is written: somebody waits for that.
    Flushed(Sender<()>),
}

/// The end that takes messages; clones write to the same place.
#[derive(Debug, Clone)]
pub(crate) struct Printer {
    queue: SyncSender<Item>,
    dropped: Arc<AtomicU64>,
}

impl Printer {
    /// Starts a thread that writes to stdout.
    pub(crate) fn stdout() -> Result<Printer, DaemonError> {
        Printer::of_stream(streams::stdout())
    }

    /// Starts a thread that writes to stderr.
    pub(crate) fn stderr() -> Result<Printer, DaemonError> {
        Printer::of_stream(streams::stderr())
    }

    fn of_stream(stream: io::Result<File>) -> Result<Printer, DaemonError> {
        match stream {
            Ok(stream) => Printer::start(stream),
            // a stream that was closed: nobody reads it
            Err(_) => Printer::start(io::sink()),
        }
    }

    /// Starts a thread that writes to `target`.
    pub(crate) fn start(target: impl Write + Send + 'static) -> Result<Printer, DaemonError> {
        let (queue, items) = mpsc::sync_channel(QUEUE);
        let dropped = Arc::new(AtomicU64::new(0));
        let counter = Arc::clone(&dropped);
        thread::Builder::new()
            .name("tightloop-printer".to_owned())
            .spawn(move || {
                signals::keep_writing_in_the_background();
                print(target, &items, &counter);
            })
            .map_err(|error| DaemonError::System {
                action: "start a thread",
                problem: error.to_string(),
            })?;
        Ok(Printer { queue, dropped })
    }

    /// Hands a message over, or drops it if the queue is full. Never waits.
    pub(crate) fn print(&self, message: String) {
        if let Err(TrySendError::Full(_)) = self.queue.try_send(Item::Message(message)) {
            self.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn flush(&self, deadline: Instant) {
        let (done, written) = channel();
        let mut item = Item::Flushed(done);
        while let Err(TrySendError::Full(same)) = self.queue.try_send(item) {
            if Instant::now() >= deadline {
                return;
            }
            item = same;
            thread::sleep(RETRY);
        }
        // what is not written by then is lost
        let _ = written.recv_timeout(deadline.saturating_duration_since(Instant::now()));
    }
}

/// Waits until everything handed over is written, or until that takes too long.
pub(crate) fn flush<'a>(printers: impl IntoIterator<Item = &'a Printer>) {
    flush_within(FLUSH_MAX, printers);
}

/// The same with a limit of its own.
pub(crate) fn flush_within<'a>(limit: Duration, printers: impl IntoIterator<Item = &'a Printer>) {
    let deadline = Instant::now() + limit;
    printers
        .into_iter()
        .for_each(|printer| printer.flush(deadline));
}

/// Writes what comes until all senders are gone. A message that cannot be written is not worth an error.
fn print(mut target: impl Write, items: &Receiver<Item>, dropped: &AtomicU64) {
    loop {
        let next = items.try_recv().or_else(|error| match error {
            TryRecvError::Disconnected => Err(error),
            TryRecvError::Empty => {
                // the queue was full before it was empty: what was dropped came after all that is written
                report_dropped(&mut target, dropped);
                items.recv().map_err(|_| TryRecvError::Disconnected)
            }
        });
        match next {
            Ok(Item::Message(message)) => {
                // progress returns to the beginning of its line
                let (back, rest) = match message.strip_prefix('\r') {
                    Some(rest) => ("\r", rest),
                    None => ("", &*message),
                };
                let _ = target.write_all(format!("{back}{}", printable(rest)).as_bytes());
            }
            Ok(Item::Flushed(done)) => {
                report_dropped(&mut target, dropped);
                let _ = target.flush();
                // the caller may have given up
                let _ = done.send(());
            }
            Err(_) => return,
        }
    }
}

fn report_dropped(target: &mut impl Write, dropped: &AtomicU64) {
    let count = dropped.swap(0, Ordering::Relaxed);
    if count > 0 {
        let _ = writeln!(
            target,
            "tightloop: {count} messages were dropped: nobody read them in time"
        );
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use std::io::{BufRead, BufReader, Read};

    use super::*;

    /// Messages of 1 kB, until the queue and the pipe behind it are full.
    fn fill(printer: &Printer) {
        while printer.dropped.load(Ordering::Relaxed) == 0 {
            printer.print(format!("{:1023}\n", "line"));
        }
    }

    #[test]
    fn nobody_waits_for_a_pipe_that_is_not_read_and_what_is_dropped_is_counted() {
        let (reader, writer) = std::io::pipe().unwrap();
        let printer = Printer::start(writer).unwrap();
        fill(&printer);
        let more = 5;
        (0..more).for_each(|_| printer.print("dropped\n".to_owned()));
        // waits, and gives up
        flush([&printer]);
        let mut lines = BufReader::new(reader).lines().map(Result::unwrap);
        let said = lines.find(|line| line.contains("were dropped")).unwrap();
        let count: u64 = said.split(' ').nth(1).unwrap().parse().unwrap();
        assert!(count > more, "{said}");
        printer.print("again\n".to_owned());
        assert_eq!(lines.next().unwrap(), "again");
    }

    #[test]
    fn what_was_handed_over_is_written_when_a_flush_returns() {
        let (mut reader, writer) = std::io::pipe().unwrap();
        let printer = Printer::start(writer).unwrap();
        for index in 0..50 {
            printer.print(format!("{index}\n"));
        }
        flush([&printer]);
        let expected: String = (0..50).map(|index| format!("{index}\n")).collect();
        let mut said = vec![0; expected.len()];
        reader.read_exact(&mut said).unwrap();
        assert_eq!(said, expected.as_bytes());
    }

    #[test]
    fn a_pipe_whose_reader_went_stops_nothing() {
        let (reader, writer) = std::io::pipe().unwrap();
        let printer = Printer::start(writer).unwrap();
        drop(reader);
        for _ in 0..10 * QUEUE {
            printer.print("line\n".to_owned());
        }
        flush([&printer]);
    }
}

#[cfg(all(test, loom))]
mod models {
    use super::*;
    use crate::doors::time;
    use std::sync::Mutex;

    /// What was written; the threads of a model take turns.
    #[derive(Debug, Clone, Default)]
    struct Page(Arc<Mutex<String>>);

    impl Page {
        fn lines(&self) -> Vec<String> {
            let text = self.0.lock().unwrap();
            text.lines().map(str::to_owned).collect()
        }
    }

    impl Write for Page {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let text = std::str::from_utf8(bytes).unwrap();
            self.0.lock().unwrap().push_str(text);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// Runs a model with a printer, in every order of a few switches between threads.
    fn model(run: fn(Printer, Page)) {
        let mut orders = loom::model::Builder::new();
        orders.preemption_bound = Some(2);
        orders.check(move || {
            time::begin();
            let page = Page::default();
            run(Printer::start(page.clone()).unwrap(), page);
        });
    }

    #[test]
    fn a_flush_returns_when_each_message_is_written_or_counted() {
        model(|printer, page| {
            let messages = mpsc::BOUND + 2;
            for index in 0..messages {
                printer.print(format!("{index}\n"));
            }
            flush([&printer]);
            let (mut written, mut dropped) = (Vec::new(), 0);
            for line in page.lines() {
                match line.parse::<usize>() {
                    Ok(index) => written.push(index),
                    Err(_) => dropped += line.split(' ').nth(1).unwrap().parse::<usize>().unwrap(),
                }
            }
            assert!(written.is_sorted(), "{written:?}");
            assert_eq!(written.len() + dropped, messages, "{written:?}");
        });
    }

    #[test]
    fn messages_of_two_threads_are_all_written_where_there_is_room() {
        model(|printer, page| {
            let other = printer.clone();
            let thread = thread::spawn(move || other.print("other\n".to_owned()));
            printer.print("one\n".to_owned());
            thread.join().unwrap();
            flush([&printer]);
            let mut lines = page.lines();
            lines.sort();
            assert_eq!(lines, ["one", "other"]);
        });
    }
}
