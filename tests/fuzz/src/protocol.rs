//! What daemon and clients read of each other.

use sim_protocol::host::{Inbox, Numbers};
use sim_protocol::{
    CommandHeader, Description, Dtype, JournalHeader, ROWS_MAX, Row, Table, outside,
};

/// A daemon with four worlds of a few dofs, whose commands are short.
const DESCRIPTION: &str = include_str!("../corpus/description/daemon.json");

/// Words of bytes; what is left over is dropped.
fn words(bytes: &[u8]) -> Vec<u64> {
    let words = bytes.as_chunks::<8>().0.iter();
    words.map(|&word| u64::from_le_bytes(word)).collect()
}

/// The line of a lock file.
pub fn beacon(bytes: &[u8]) {
    if let sim_protocol::paths::Presence::Running(beacon) = outside::presence(bytes) {
        // programs ask each group, one after another
        assert!((1..=1 << 20).contains(&beacon.groups), "{beacon:?}");
    }
}

/// Requests and answers of the control service. What was read is the same after it was written.
pub fn control(bytes: &[u8]) {
    for read in [outside::request, outside::response] {
        if let Ok(written) = read(bytes) {
            assert_eq!(read(&written).as_ref(), Ok(&written));
        }
    }
}

/// A description, and what clients compute of it.
pub fn description(bytes: &[u8]) {
    let Some(description) = outside::description(bytes) else {
        return;
    };
    let written = serde_json::to_vec(&description).expect("descriptions are plain data");
    assert_eq!(outside::description(&written).as_ref(), Some(&description));
    description.schema_hash();
    assert!(description.busy_threads() > 0);
    let inputs = || description.commands.iter().chain(&description.writes);
    let entries = inputs().map(|input| description.worlds.checked_mul(input.columns));
    let most = entries.max().flatten().unwrap_or_default();
    if most < 1 << 16 && description.worlds < 1 << 16 {
        let _ = Inbox::for_commands_of(&description);
    }
    for robot in &description.robots {
        for axis in ["dofs", "coords", "bodies", "actuators"] {
            let [start, stop] = robot.columns(axis).expect("robots have parts of it");
            let names = description.names(axis).expect("it has names");
            assert!(start <= stop && stop <= names.len(), "{robot:?}");
        }
    }
}

/// Asserts what readers of a table rely on.
fn check_table(table: &Table, payload_bytes: usize) {
    let mut end = Table::head_bytes(table.rows().len());
    for row in table.rows() {
        assert!(row.offset >= end && row.offset % 64 == 0, "{row:?}");
        assert_eq!(
            row.shape.iter().product::<usize>() * row.dtype.size(),
            row.bytes
        );
        end = row.offset + row.bytes;
    }
    assert!(end <= payload_bytes || table.rows().is_empty());
}

/// A field table: the number of rows, then the sample.
pub fn table(bytes: &[u8]) {
    let Some((&rows, sample)) = bytes.split_first() else {
        return;
    };
    let payload = words(sample);
    if let Ok(table) = Table::parse(&payload, rows.into()) {
        check_table(&table, 8 * payload.len());
        assert!(table.describes(&payload, rows.into()));
        assert!(table.rows().len() <= ROWS_MAX);
    }
}

thread_local! {
    static INBOX: std::cell::RefCell<(Description, Inbox)> = {
        let description = outside::description(DESCRIPTION.as_bytes()).expect("it is a description");
        let inbox = Inbox::for_commands_of(&description);
        std::cell::RefCell::new((description, inbox))
    };
}

/// A command at the daemon: operation, number of rows, then the sample.
pub fn command(bytes: &[u8]) {
    let &[op, rows, ref sample @ ..] = bytes else {
        return;
    };
    let header = CommandHeader {
        op: op.into(),
        rows: rows.into(),
        ..CommandHeader::default()
    };
    let payload = words(sample);
    INBOX.with_borrow_mut(|(description, inbox)| {
        let taken = inbox.take(header, &payload);
        // the daemon answers a command that it refuses, by the same inbox
        let rows: Vec<Row> = inbox.arrays().cloned().collect();
        if taken.is_err() {
            return;
        }
        for row in &rows {
            let entries = match inbox.numbers(row) {
                Some(Numbers::F32(numbers)) => 4 * numbers.len(),
                Some(Numbers::F64(numbers)) => 8 * numbers.len(),
                Some(Numbers::U64(numbers)) => 8 * numbers.len(),
                None => row.bytes,
            };
            assert_eq!(entries, row.bytes);
        }
        let _ = (inbox.mask(), inbox.path(), inbox.from_world());
        if let Some(left) = inbox.on_device() {
            let brought = [("joint_f".to_owned(), vec![0.0; 4])];
            let _ = (left, inbox.bring_here(description, &brought));
        }
    });
}

/// The head of an entry of a journal: its seven words, then the size of the payload.
pub fn journal(bytes: &[u8]) {
    let &[
        session,
        entry,
        bytes,
        first,
        observed,
        operation,
        digests,
        payload,
        ..,
    ] = &words(bytes)[..]
    else {
        return;
    };
    let header = JournalHeader {
        session,
        entry,
        bytes,
        first,
        observed,
        op: operation as u32,
        rows: (operation >> 32) as u32,
        digests: digests as u32,
        reserved: 0,
    };
    let payload = payload as usize;
    if let Some(parts) = outside::journal_parts(&header, payload) {
        let padded = |bytes: usize| bytes.checked_next_multiple_of(64).expect("it fits");
        let end = padded(parts[0])
            .checked_add(padded(parts[1]))
            .and_then(|end| end.checked_add(parts[2]))
            .expect("it fits");
        assert!(end <= payload, "{parts:?} in {payload}");
        assert_eq!(parts[1] % Dtype::U32.size(), 0);
    }
}
