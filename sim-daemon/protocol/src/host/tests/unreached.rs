//! Files of ports that cannot be opened: who would wait for a message gets the file instead.

use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::Fake;
use crate::presence::described;
use crate::presence::paths::DaemonPaths;
use crate::waiting::SLICE;
use crate::{AttachOptions, Client, ProtocolError, keep_waiting};

/// Much less than a client waits for an answer.
const AT_ONCE: Duration = Duration::from_secs(10);

fn files(fake: &Fake, extension: &str) -> Vec<PathBuf> {
    let paths = DaemonPaths::new(Some(&fake.root), &fake.name).unwrap();
    let entries = fs::read_dir(paths.shared_folder()).unwrap();
    let files = entries.map(|entry| entry.unwrap().path());
    files
        .filter(|path| path.extension().is_some_and(|kind| kind == extension))
        .collect()
}

#[test]
fn a_client_that_cannot_open_the_answers_of_the_daemon_names_the_file_at_once() {
    let fake = Fake::start("unopened");
    let cut = files(&fake, "data");
    for file in &cut {
        // nobody has touched the pages yet
        fs::rename(file, file.with_extension("kept")).unwrap();
        fs::write(file, []).unwrap();
    }
    let options = AttachOptions {
        root: Some(fake.root.clone()),
        ..AttachOptions::default()
    };
    let start = Instant::now();
    let refused = Client::attach(&fake.name, &options, &mut keep_waiting()).unwrap_err();
    assert!(start.elapsed() < AT_ONCE, "{:?}", start.elapsed());
    match &refused {
        ProtocolError::Damaged { path, .. } => assert!(cut.contains(&path.into()), "{refused}"),
        _ => panic!("{refused}"),
    }
    for file in &cut {
        fs::rename(file.with_extension("kept"), file).unwrap();
    }
    // what one client could not open costs no other one anything
    fake.attach().forward(&mut keep_waiting()).unwrap();
}

#[test]
fn clients_that_the_daemon_cannot_reach_get_its_reason() {
    let fake = Fake::start("unreached");
    let client = fake.attach();
    client.acquire(&mut keep_waiting()).unwrap();
    client.observers(&mut keep_waiting()).unwrap();
    client.latest(&mut keep_waiting()).unwrap();
    let paths = DaemonPaths::new(Some(&fake.root), &fake.name).unwrap();
    let session = client.description().session;
    let reason = ProtocolError::transport("reach the other side", "no such file");
    for connection in files(&fake, "connection") {
        let stem = connection.file_stem().unwrap().to_str().unwrap();
        for port in stem.split('_').filter_map(|part| part.parse().ok()) {
            described::mark_unreached(&paths, session, port, &reason);
        }
    }
    // a frame that is there comes first
    let mut looks = (0..100).map(|_| client.wait_newer(Some(SLICE), &mut keep_waiting()));
    let refused = looks.find_map(Result::err).unwrap();
    assert!(
        matches!(&refused, ProtocolError::Unreached { problem, .. } if *problem == reason.to_string()),
        "{refused}"
    );
}
