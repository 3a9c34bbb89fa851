//! Frames and commands that stay on the card of a daemon in another process; the software driver is the card.

use std::io::Write;
use std::os::unix::net::UnixStream;
use std::time::Duration;

use sim_protocol::paths::{DaemonPaths, shared_memory};
use sim_protocol::{Client, DeviceMemory, Frame, OnDevice, ProtocolError, keep_waiting};

use crate::daemon::Daemon;
use crate::imported_memory::ImportedMemory;
use crate::{command, reset, step};

const WORLDS: usize = 5;

fn start(name: &str) -> Daemon {
    let fields = "joint_q,joint_qd,body_q,mass_matrix";
    let flags = ["--worlds", "5", "--device", "gpu", "--frames-held", "3"];
    let daemon = Daemon::start(name, &[&flags[..], &["--fields", fields]].concat());
    assert!(daemon.said["ready"].is_object(), "{:?}", daemon.said);
    daemon
}

/// The memory that a client asked for.
struct Card {
    memory: ImportedMemory,
    there: DeviceMemory,
}

impl Card {
    fn new(client: &Client) -> Card {
        let (there, mut descriptors) = client.device_memory(&mut keep_waiting()).unwrap();
        let digits = (0..16).map(|k| u8::from_str_radix(&there.uuid[2 * k..2 * k + 2], 16));
        let uuid: Vec<u8> = digits.collect::<Result<_, _>>().unwrap();
        let expected = if there.host_order.is_some() { 1 } else { 3 };
        assert_eq!(descriptors.len(), expected, "{:?}", there.host_order);
        let memory = descriptors.remove(0);
        Card {
            memory: ImportedMemory::new(memory, there.allocated, uuid.try_into().unwrap()),
            there,
        }
    }

    /// Fails unless every array of the frame is on the card, bit for bit.
    #[track_caller]
    fn holds(&self, frame: &Frame) {
        let slot = frame.header().slot.checked_sub(1).expect("it has a slot");
        let first = (slot * self.there.stride) as usize;
        for (view, offset) in frame.fields().zip(&self.there.offsets) {
            let first = first + *offset as usize;
            let here = &self.memory.bytes()[first..first + view.bytes];
            assert!(here == view.as_bytes(), "{}", view.name);
        }
    }

    /// Leaves a command, and returns its bit.
    fn leave(&mut self, field: &str, values: &[f32]) -> u64 {
        let mut places = self.there.commands.iter();
        let number = places.position(|place| place.name == field).unwrap();
        let place = &self.there.commands[number];
        assert_eq!(values.len(), WORLDS * place.columns);
        let (first, bytes) = (place.offset as usize, bytemuck::cast_slice(values));
        self.memory.bytes_mut()[first..first + bytes.len()].copy_from_slice(bytes);
        1 << number
    }
}

fn step_on(client: &Client, commands: u64) -> Result<Frame, ProtocolError> {
    // this driver has no timelines of other processes: the order is that of the protocol
    let on_device = OnDevice { ready: 1, commands };
    client.step_on_device(&[], on_device, &mut keep_waiting())
}

fn targets(n: usize) -> Vec<f32> {
    let value = |i| 0.3 * ((n + i) as f32).sin();
    (0..9 * WORLDS).map(value).collect()
}

#[test]
fn every_frame_is_on_the_card_as_it_is_here_for_as_long_as_it_is_held() {
    let daemon = start("on-card");
    let client = daemon.attach();
    assert_eq!(reset(&client).header().slot, 0, "nobody has asked yet");
    let card = Card::new(&client);
    let mut held: Vec<Frame> = Vec::new();
    let mut slots = Vec::new();
    for n in 0..20 {
        if held.len() == 3 {
            // in no order: slots come back one by one
            held.remove(n % 3);
        }
        let values = targets(n);
        held.push(step(&client, &[command("joint_target_q", &values)]).unwrap());
        slots.push(held[held.len() - 1].header().slot);
        held.iter().for_each(|frame| card.holds(frame));
    }
    slots.sort_unstable();
    slots.dedup();
    assert!(slots.len() >= 3 && slots[slots.len() - 1] <= card.there.slots as u64);
    // of another lease the memory is another's to ask for
    drop(held);
    client.release(&mut keep_waiting()).unwrap();
    for frame in [step(&client, &[]), step_on(&client, 0)] {
        assert_eq!(frame.unwrap().header().slot, 0);
    }
    let refused = step_on(&client, 1).unwrap_err().to_string();
    assert!(
        refused.contains("this lease has no such memory"),
        "{refused}"
    );
    Card::new(&client).holds(&step(&client, &[]).unwrap());
}

#[test]
fn commands_that_are_left_on_the_card_move_the_robot_as_commands_from_here() {
    let daemons = ["from-card", "from-here"].map(start);
    let [there, here] = daemons.each_ref().map(Daemon::attach);
    for client in [&there, &here] {
        reset(client);
    }
    let mut card = Card::new(&there);
    for n in 0..12 {
        let (target, force) = (targets(n), targets(100 + n));
        let left = card.leave("joint_target_q", &target) | card.leave("joint_f", &force);
        let host = [
            command("joint_target_q", &target),
            command("joint_f", &force),
        ];
        let [frame, expected] = [step_on(&there, left), step(&here, &host)].map(Result::unwrap);
        for (a, b) in frame.fields().zip(expected.fields()) {
            assert!(a.as_bytes() == b.as_bytes(), "step {n}: {}", a.name);
        }
        card.holds(&frame);
    }
    // a command holds; what lies in the memory is taken when a step asks for it
    card.leave("joint_target_q", &targets(500));
    let [frame, expected] = [step_on(&there, 0), step(&here, &[])].map(Result::unwrap);
    let q = |frame: &Frame| frame.field("joint_q").unwrap().as_bytes().to_vec();
    assert!(q(&frame) == q(&expected));
}

#[test]
fn what_is_wrong_on_the_card_is_refused_with_the_sentence_of_the_host() {
    let daemon = start("wrong-on-card");
    let client = daemon.attach();
    let before = reset(&client).field("joint_q").unwrap().as_bytes().to_vec();
    let mut card = Card::new(&client);
    let mut wrong = targets(0);
    wrong[30] = f32::NAN;
    let left = card.leave("joint_target_q", &wrong);
    let refused = step_on(&client, left).unwrap_err().to_string();
    let host = step(&client, &[command("joint_target_q", &wrong)]).unwrap_err();
    assert_eq!(refused, host.to_string());
    assert!(
        refused.contains("NaN in world 3 for `arm/fr3_joint4`"),
        "{refused}"
    );
    // given twice, and beside an array of the host that is wrong: nothing is set
    let on_device = OnDevice {
        ready: 1,
        commands: card.leave("joint_target_q", &targets(0)),
    };
    for other in ["joint_target_q", "joint_f"] {
        let commands = [command(other, &wrong)];
        let refused = client.step_on_device(&commands, on_device, &mut keep_waiting());
        let sentence = refused.unwrap_err().to_string();
        let expected = if other == "joint_f" {
            "NaN"
        } else {
            "given twice"
        };
        assert!(sentence.contains(expected), "{sentence}");
    }
    let unknown = step_on(&client, 1 << 40).unwrap_err().to_string();
    assert!(unknown.contains("no such memory"), "{unknown}");
    let frame = client.forward(&mut keep_waiting()).unwrap();
    assert!(frame.field("joint_q").unwrap().as_bytes() == before);
    card.holds(&step_on(&client, on_device.commands).unwrap());
}

#[test]
fn a_recorder_gets_the_commands_that_were_left_on_the_card() {
    let daemon = start("recorded-on-card");
    let (client, recorder) = (daemon.attach(), daemon.attach());
    reset(&client);
    let mut card = Card::new(&client);
    let mut journal = recorder.journal(&[], &mut keep_waiting()).unwrap();
    let mut next = || {
        let entry = journal.next(Duration::from_secs(20), &mut keep_waiting());
        entry.unwrap().expect("an entry")
    };
    // it begins with the state; until then steps are not recorded
    next();
    let values = targets(3);
    let left = card.leave("joint_target_q", &values);
    let expected: Vec<u8> = bytemuck::cast_slice(&values).to_vec();
    let is_there = |entry: &sim_protocol::JournalEntry| {
        let command: &[u8] = bytemuck::cast_slice(entry.command());
        command.windows(expected.len()).any(|part| part == expected)
    };
    step_on(&client, left).unwrap();
    assert!(is_there(&next()));
}

#[test]
fn the_cpu_is_refused_by_name_and_goes_on() {
    let daemon = Daemon::start("no-card", &["--worlds", "5"]);
    let client = daemon.attach();
    let refused = client.device_memory(&mut keep_waiting()).unwrap_err();
    let sentence = refused.to_string();
    assert!(matches!(refused, ProtocolError::NotShared { .. }));
    assert!(
        sentence.contains("on the CPU") && sentence.contains("device=\"gpu\""),
        "{sentence}"
    );
    let refused = step_on(&client, 0).unwrap_err().to_string();
    assert!(refused.contains("on the CPU"), "{refused}");
    step(&client, &[]).unwrap();
}

#[test]
fn visitors_that_say_nothing_or_nonsense_or_leave_disturb_nobody() {
    let daemon = start("bad-visitors");
    let client = daemon.attach();
    reset(&client);
    let session = client.description().session;
    let paths = DaemonPaths::new(None, &daemon.name).unwrap();
    let socket = format!("{}/{}/{session:016x}.socket", shared_memory(), paths.stem());
    let silent: Vec<_> = (0..8)
        .map(|_| UnixStream::connect(&socket).unwrap())
        .collect();
    for words in [
        &b"nonsense, and more of it"[..],
        &7777_u64.to_le_bytes(),
        b"abc",
    ] {
        UnixStream::connect(&socket)
            .unwrap()
            .write_all(words)
            .unwrap();
    }
    let card = Card::new(&client);
    card.holds(&step(&client, &[]).unwrap());
    drop(silent);
    // asked for again, it is other memory
    let again = Card::new(&client);
    let frame = step(&client, &[]).unwrap();
    again.holds(&frame);
    drop((card, again));
    step(&client, &[]).unwrap();
    client.shutdown(&mut keep_waiting()).unwrap();
    assert_eq!(daemon.leftovers(), Vec::<String>::new());
}
