//! The socket by which descriptors cross.

use std::fs::{self, Permissions};
use std::io::{IoSlice, IoSliceMut, Read, Write};
use std::mem::MaybeUninit;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{UnixListener, UnixStream};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use rustix::net::{
    RecvAncillaryBuffer, RecvAncillaryMessage, RecvFlags, SendAncillaryBuffer,
    SendAncillaryMessage, SendFlags, recvmsg, sendmsg, sockopt::socket_peercred,
};
use rustix::process::Uid;
use serde::{Deserialize, Serialize};

use super::{Delivery, DeviceMemory};
use crate::ProtocolError;
use crate::presence::paths::DaemonPaths;
use crate::waiting::hook::Hook;

/// Descriptors of one answer: memory, timeline of frames, timeline of commands.
const DESCRIPTORS_MAX: usize = 3;
/// Longest answer [bytes].
const ANSWER_MAX: usize = 1 << 16;
/// How long the hook waits for its turn.
const SLICE: Duration = Duration::from_millis(50);

/// The daemon's answer.
#[derive(Serialize, Deserialize)]
enum Answer {
    Memory(DeviceMemory),
    Refused(String),
}

fn path(paths: &DaemonPaths, session: u64) -> PathBuf {
    paths.shared_folder().join(format!("{session:016x}.socket"))
}

/// The connection of a client that has named its lease.
pub(crate) type Visitor = UnixStream;

/// The daemon's end.
#[derive(Debug)]
pub(crate) struct Door(UnixListener);

impl Door {
    /// Opens the socket of a run, for its user only.
    pub(crate) fn open(paths: &DaemonPaths, session: u64) -> Result<Door, ProtocolError> {
        let path = path(paths, session);
        let open = || -> std::io::Result<UnixListener> {
            let listener = UnixListener::bind(&path)?;
            fs::set_permissions(&path, Permissions::from_mode(0o600))?;
            listener.set_nonblocking(true)?;
            Ok(listener)
        };
        let opened = open().map(Door);
        opened.map_err(|error| ProtocolError::transport("open the socket of device memory", error))
    }

    /// The connection that has named this lease. All others that wait are closed.
    pub(crate) fn visitor(&self, epoch: u64) -> Result<UnixStream, String> {
        let mut visitor = Err("its holder has not connected".to_owned());
        while let Ok((stream, _)) = self.0.accept() {
            match admitted(stream, rustix::process::geteuid(), epoch) {
                Ok(Some(stream)) => visitor = Ok(stream),
                Ok(None) => {}
                Err(reason) if visitor.is_err() => visitor = Err(reason),
                Err(_) => {}
            }
        }
        visitor
    }
}

/// A connection of this user that has named this lease; none if it has named another one, or nothing.
fn admitted(mut stream: UnixStream, user: Uid, epoch: u64) -> Result<Option<UnixStream>, String> {
    let peer = socket_peercred(&stream).map_err(|error| format!("its user is unknown: {error}"))?;
    if peer.uid != user {
        let (peer_user, daemon_user) = (peer.uid.as_raw(), user.as_raw());
        return Err(format!(
            "process {} belongs to user {peer_user}, the daemon to user {daemon_user}; run both as one user",
            peer.pid.as_raw_nonzero()
        ));
    }
    let mut named = [0; 8];
    let is_read = stream.set_nonblocking(true).is_ok() && stream.read_exact(&mut named).is_ok();
    Ok((is_read && u64::from_le_bytes(named) == epoch).then_some(stream))
}

/// Answers a visitor. An error is ignored: a client that has gone needs no answer.
pub(crate) fn deliver(stream: &UnixStream, answer: Result<Delivery, String>) {
    let (answer, descriptors) = match answer {
        Ok((memory, descriptors)) => (Answer::Memory(memory), descriptors),
        Err(reason) => (Answer::Refused(reason), Vec::new()),
    };
    let text = serde_json::to_vec(&answer).expect("answers are plain data");
    let descriptors: Vec<_> = descriptors.iter().map(AsFd::as_fd).collect();
    let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(DESCRIPTORS_MAX))];
    let mut control = SendAncillaryBuffer::new(&mut space);
    if !descriptors.is_empty() {
        let fits = control.push(SendAncillaryMessage::ScmRights(&descriptors));
        assert!(fits, "{} descriptors", descriptors.len());
    }
    // it fits into the buffer of a new socket
    let _ = sendmsg(
        stream,
        &[IoSlice::new(&text)],
        &mut control,
        SendFlags::NOSIGNAL,
    );
}

/// Connects to a daemon and names a lease.
pub(crate) fn visit(
    paths: &DaemonPaths,
    session: u64,
    epoch: u64,
) -> Result<UnixStream, ProtocolError> {
    let visit = || -> std::io::Result<UnixStream> {
        let mut stream = UnixStream::connect(path(paths, session))?;
        stream.write_all(&epoch.to_le_bytes())?;
        stream.set_read_timeout(Some(SLICE))?;
        Ok(stream)
    };
    visit().map_err(|error| ProtocolError::transport("connect to the daemon's socket", error))
}

/// Waits for the answer, at most for `limit`; none if it does not come.
pub(crate) fn receive(
    stream: &UnixStream,
    limit: Duration,
    hook: Hook<'_>,
) -> Result<Option<Delivery>, ProtocolError> {
    let failed = |error| ProtocolError::transport("receive device memory", error);
    let (start, mut text, mut descriptors) = (Instant::now(), Vec::new(), Vec::new());
    loop {
        let mut bytes = [0; 4096];
        let mut space = [MaybeUninit::uninit(); rustix::cmsg_space!(ScmRights(DESCRIPTORS_MAX))];
        let mut control = RecvAncillaryBuffer::new(&mut space);
        let mut into = [IoSliceMut::new(&mut bytes)];
        match recvmsg(stream, &mut into, &mut control, RecvFlags::CMSG_CLOEXEC) {
            Ok(received) => {
                for message in control.drain() {
                    if let RecvAncillaryMessage::ScmRights(all) = message {
                        descriptors.extend(all);
                    }
                }
                if received.bytes == 0 {
                    return read(&text, descriptors).map(Some);
                }
                text.extend_from_slice(&bytes[..received.bytes]);
            }
            Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => {}
            Err(error) => return Err(failed(error)),
        }
        if hook().is_break() {
            return Err(ProtocolError::Interrupted);
        }
        if start.elapsed() > limit || text.len() > ANSWER_MAX {
            return Ok(None);
        }
    }
}

/// Reads an answer.
fn read(text: &[u8], descriptors: Vec<OwnedFd>) -> Result<Delivery, ProtocolError> {
    let malformed = |problem: String| ProtocolError::Malformed {
        from: "the daemon",
        problem: format!("device memory: {problem}"),
    };
    let answer = serde_json::from_slice(text).map_err(|error| malformed(error.to_string()))?;
    let memory = match answer {
        Answer::Memory(memory) => memory,
        Answer::Refused(reason) => return Err(ProtocolError::NotShared { reason }),
    };
    let expected = if memory.host_order.is_some() { 1 } else { 3 };
    if descriptors.len() != expected {
        let got = descriptors.len();
        return Err(malformed(format!("{got} descriptors of {expected}")));
    }
    Ok((memory, descriptors))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::waiting::hook::keep_waiting;

    fn pair(epoch: u64) -> (UnixStream, UnixStream) {
        let (mut client, daemon) = UnixStream::pair().unwrap();
        client.write_all(&epoch.to_le_bytes()).unwrap();
        client.set_read_timeout(Some(SLICE)).unwrap();
        (client, daemon)
    }

    /// A client and the daemon's end, which has read what the client named.
    fn visit_of(epoch: u64) -> (UnixStream, UnixStream) {
        let (client, daemon) = pair(epoch);
        let user = rustix::process::geteuid();
        let daemon = admitted(daemon, user, epoch).unwrap();
        (client, daemon.expect("it named this lease"))
    }

    fn memory(host_order: Option<&str>) -> DeviceMemory {
        DeviceMemory {
            uuid: "00".repeat(16),
            allocated: 4096,
            dedicated: false,
            slots: 1,
            stride: 4096,
            offsets: vec![0],
            commands: Vec::new(),
            host_order: host_order.map(str::to_owned),
        }
    }

    #[test]
    fn another_user_is_refused_by_name_and_another_lease_gets_nothing() {
        let user = rustix::process::geteuid();
        let other = Uid::from_raw(user.as_raw() + 1);
        let refused = admitted(pair(7).1, other, 7).unwrap_err();
        let told = format!(
            "belongs to user {}, the daemon to user {}",
            user.as_raw(),
            other.as_raw()
        );
        assert!(refused.contains(&told), "{refused}");
        assert!(admitted(pair(7).1, user, 7).unwrap().is_some());
        assert!(admitted(pair(7).1, user, 8).unwrap().is_none());
        let (_silent, daemon) = UnixStream::pair().unwrap();
        assert!(admitted(daemon, user, 7).unwrap().is_none());
    }

    #[test]
    fn descriptors_arrive_as_they_were_sent_and_their_number_is_checked() {
        let file = || {
            let name = "tightloop-test";
            rustix::fs::memfd_create(name, rustix::fs::MemfdFlags::CLOEXEC).unwrap()
        };
        let sent = |memory: DeviceMemory, files: usize| {
            let (client, daemon) = visit_of(1);
            let files: Vec<OwnedFd> = (0..files).map(|_| file()).collect();
            for (k, file) in files.iter().enumerate() {
                rustix::fs::ftruncate(file, 1 + k as u64).unwrap();
            }
            deliver(&daemon, Ok((memory, files)));
            drop(daemon);
            receive(&client, SLICE, &mut keep_waiting())
        };
        let (there, files) = sent(memory(None), 3).unwrap().unwrap();
        assert_eq!(there, memory(None));
        let size = |fd: &OwnedFd| rustix::fs::fstat(fd).unwrap().st_size;
        assert_eq!(files.iter().map(size).collect::<Vec<_>>(), [1, 2, 3]);
        assert_eq!(
            sent(memory(Some("no timelines")), 1)
                .unwrap()
                .unwrap()
                .1
                .len(),
            1
        );
        let wrong = sent(memory(None), 1).unwrap_err().to_string();
        assert!(wrong.contains("1 descriptors of 3"), "{wrong}");
    }

    #[test]
    fn a_refusal_arrives_as_its_sentence_and_silence_ends() {
        let (client, daemon) = visit_of(1);
        deliver(&daemon, Err("the worlds are on the CPU".to_owned()));
        drop(daemon);
        let refused = receive(&client, SLICE, &mut keep_waiting()).unwrap_err();
        assert!(refused.to_string().contains("the worlds are on the CPU"));
        let (client, _daemon) = visit_of(1);
        assert!(
            receive(&client, SLICE, &mut keep_waiting())
                .unwrap()
                .is_none()
        );
    }
}
