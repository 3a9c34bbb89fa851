//! Recordings made without a daemon: cut, damaged, forged.

use std::path::{Path, PathBuf};

use proptest::prelude::*;
use sim_engine::simulation::{Options, Simulation};
use sim_physics::arrays::Field;
use sim_protocol::digest::{digest, digests_of};
use sim_protocol::{Dtype, Op, Table};

use super::blocks::{self, Blocks, Next};
use super::records::{self, Record, RecordedCommand};
use super::replay::{End, open};
use crate::cli::Replay;
use crate::config;
use crate::error::DaemonError;
use crate::export::{self, RunInfo};
use crate::eyes::Images;

mod earlier;
mod gaps;

const WORLDS: usize = 3;
const DOFS: usize = 9;
const FRAMES: usize = 12;

/// A recording as its blocks.
#[derive(Clone)]
struct Recording {
    /// Records of each block, which are frames from the third on.
    blocks: Vec<Vec<u64>>,
}

/// The table of a command with torques.
fn torques() -> Table {
    Table::lay_out([("joint_f".to_owned(), Dtype::F32, vec![WORLDS, DOFS], 0)])
}

/// Frames of the arm, each under torques of its own and with `joint_q` observed.
fn record() -> Recording {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/assets");
    let text = "dt = 0.002\nsubsteps = 2\n[[robot]]\nname = \"arm\"\nurdf = \"fr3/fr3_franka_hand.urdf\"\n";
    let scene = config::parse(text, "of the test").unwrap();
    let description = scene.describe(&assets).unwrap();
    let model = description.compile().unwrap();
    let options = Options {
        worlds: WORLDS,
        threads: Some(1),
        fields: vec![Field::JointQ, Field::JointQd],
        ..Options::default()
    };
    let mut simulation = Simulation::new(model, &options).unwrap();
    let images = Images::none(simulation.layout());
    let info = RunInfo {
        scene: &description,
        scene_text: scene.to_toml(),
        scene_folder: assets.to_str().unwrap().to_owned(),
        device: String::new(),
        threads: 1,
        frames_held: 1,
        watch_worlds: 1,
        images: &images,
    };
    let announced = export::description(simulation.model(), &options, simulation.layout(), info);
    let head = serde_json::json!({ "daemon": announced, "observed": ["joint_q"] }).to_string();
    let (mut first, mut state) = (Vec::new(), Vec::new());
    Record::Head(head.as_bytes()).write(&mut first);
    Record::State(&simulation.snapshot()).write(&mut state);
    let mut blocks = vec![first, state];
    let frame = export::frame_table(simulation.layout(), &images);
    let mut arena = vec![0; simulation.layout().bytes / 8];
    let mut digests = vec![0; digests_of(&frame)];
    let table = torques();
    for index in 0..FRAMES {
        let mut words = vec![0; table.total_bytes() / 8];
        words[..table.words().len()].copy_from_slice(table.words());
        let first = table.rows()[0].offset / 4;
        let numbers: &mut [f32] = bytemuck::cast_slice_mut(&mut words);
        let numbers = &mut numbers[first..][..WORLDS * DOFS];
        for (place, number) in numbers.iter_mut().enumerate() {
            *number = (index * 7 + place) as f32 / 10.0;
        }
        let numbers = sim_engine::backend::Values::F32(numbers);
        simulation.command(Field::JointF, 0..DOFS, numbers).unwrap();
        simulation.step(&mut arena);
        digest(&frame, &arena, &mut digests);
        let row = frame.row("joint_q").unwrap();
        let from = (row.offset - Table::head_bytes(frame.rows().len())) / 8;
        let mut block = Vec::new();
        Record::Command(RecordedCommand {
            op: Op::Step as u32,
            rows: 1,
            words: &words,
            digests: &digests,
            observed: &arena[from..][..row.bytes.next_multiple_of(64) / 8],
        })
        .write(&mut block);
        blocks.push(block);
    }
    Recording { blocks }
}

impl Recording {
    /// The file, and where each of its blocks ends.
    fn bytes(&self) -> (Vec<u8>, Vec<usize>) {
        let (mut bytes, mut block) = (blocks::head().to_vec(), Vec::new());
        let ends = self.blocks.iter().map(|records| {
            blocks::pack(records, &mut block);
            bytes.extend(&block);
            bytes.len()
        });
        let ends = ends.collect();
        (bytes, ends)
    }

    /// The words that follow the head of the record of frame `index`: those of its command, digests and arrays.
    fn frame(&mut self, index: usize) -> &mut [u64] {
        &mut self.blocks[2 + index][6..]
    }

    fn replay(&self, test: &str) -> Result<(u64, End), DaemonError> {
        replay(test, &self.bytes().0)
    }
}

/// Replays a file of these bytes.
fn replay(test: &str, bytes: &[u8]) -> Result<(u64, End), DaemonError> {
    let path = file(test);
    std::fs::write(&path, bytes).unwrap();
    let args = Replay {
        file: path.clone(),
        threads: Some(1),
        frames: None,
    };
    let mut frames = 0;
    let ended = open(&args).and_then(|mut replay| {
        let end = replay.go()?;
        frames = replay.frames;
        Ok(end)
    });
    std::fs::remove_file(path).unwrap();
    Ok((frames, ended?))
}

fn file(test: &str) -> PathBuf {
    std::env::temp_dir().join(format!("tightloop-{test}-{}.tlrec", std::process::id()))
}

/// Blocks that can be read, and how reading ends.
fn read(bytes: &[u8]) -> Result<(Vec<Vec<u64>>, Next), String> {
    let (mut blocks, mut whole_blocks, mut block) = (Blocks::open(bytes)?, Vec::new(), Vec::new());
    loop {
        match blocks.next(&mut block).unwrap() {
            Next::Block => whole_blocks.push(block.clone()),
            next => return Ok((whole_blocks, next)),
        }
    }
}

#[test]
fn a_file_cut_at_any_byte_has_its_whole_blocks() {
    let recording = record();
    let (bytes, ends) = recording.bytes();
    for length in 0..=bytes.len() {
        let Ok((blocks, next)) = read(&bytes[..length]) else {
            assert!(length < blocks::HEAD, "{length}");
            continue;
        };
        let whole = ends.iter().filter(|&&end| end <= length).count();
        assert_eq!(blocks, recording.blocks[..whole], "{length}");
        let is_between = length == blocks::HEAD || ends.contains(&length);
        assert_eq!(
            next,
            if is_between { Next::End } else { Next::Cut },
            "{length}"
        );
    }
}

#[test]
fn a_cut_recording_replays_to_its_last_whole_frame() {
    let (bytes, ends) = record().bytes();
    for (index, &end) in ends.iter().enumerate().skip(1) {
        for (length, frames, cut) in [
            (end - 1, index.saturating_sub(2), End::Cut),
            (end, index - 1, End::Recording(None)),
        ] {
            if length < ends[1] {
                continue;
            }
            let replayed = replay("cut", &bytes[..length]).unwrap();
            assert_eq!(replayed, (frames as u64, cut), "{length}");
        }
    }
}

#[test]
fn a_file_that_ends_before_its_state_is_reported() {
    let (bytes, ends) = record().bytes();
    let path = file("stateless");
    for length in [blocks::HEAD, ends[0], ends[1] - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        let args = Replay {
            file: path.clone(),
            threads: Some(1),
            frames: None,
        };
        let error = super::replay(&args).unwrap_err();
        assert!(
            error.to_string().contains("ends before the state"),
            "{error}"
        );
        assert_eq!(error.exit_code(), 2);
    }
    std::fs::remove_file(path).unwrap();
}

#[test]
fn a_changed_byte_is_found_wherever_it_is() {
    let recording = record();
    let (bytes, ends) = recording.bytes();
    for place in 0..bytes.len() {
        let mut bytes = bytes.clone();
        bytes[place] ^= 0x10;
        let Ok((blocks, next)) = read(&bytes) else {
            assert!(place < 12, "{place}");
            continue;
        };
        // the last four bytes of the head mean nothing
        if place < blocks::HEAD {
            continue;
        }
        let before = ends.iter().filter(|&&end| end <= place).count();
        assert_eq!(next, Next::Damaged, "{place}");
        assert_eq!(blocks, recording.blocks[..before], "{place}");
    }
}

#[test]
fn a_damaged_recording_is_replayed_up_to_there() {
    let (mut bytes, ends) = record().bytes();
    bytes[ends[6] + 20] ^= 1;
    assert_eq!(replay("damaged", &bytes).unwrap(), (5, End::Damaged));
}

#[test]
fn a_forged_command_is_reported_by_frame_world_and_field() {
    let mut recording = record();
    let place = torques().rows()[0].offset / 4 + DOFS + 2; // third dof of world 1
    let numbers: &mut [f32] = bytemuck::cast_slice_mut(recording.frame(5));
    numbers[place] += 0.25;
    let error = recording.replay("forged").unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("frame 5, of a step: world 1: `joint_q`["),
        "{message}"
    );
    assert!(
        message.contains("recorded is") && !message.contains("worlds differ"),
        "{message}"
    );
    assert_eq!(error.exit_code(), 1);
}

#[test]
fn a_forged_frame_is_reported_by_frame_world_and_field() {
    let digests = torques().total_bytes() / 8;
    let mut recording = record();
    // one digest per world of joint_q, then of joint_qd
    let numbers: &mut [u32] = bytemuck::cast_slice_mut(&mut recording.frame(3)[digests..]);
    numbers[WORLDS + 2] ^= 1;
    let message = recording.replay("digest").unwrap_err().to_string();
    assert!(
        message.contains("frame 3, of a step: world 2: `joint_qd` differs;"),
        "{message}"
    );
    // the last of the numbers of joint_q
    let mut recording = record();
    let frame = recording.frame(4);
    let padded = (WORLDS * DOFS * 4).next_multiple_of(64);
    let first = 8 * frame.len() - padded;
    let bytes: &mut [u8] = bytemuck::cast_slice_mut(frame);
    bytes[first + WORLDS * DOFS * 4 - 1] ^= 0x80;
    let message = recording.replay("observed").unwrap_err().to_string();
    assert!(
        message.contains("frame 4, of a step: world 2: `joint_q`[8] is "),
        "{message}"
    );
}

#[test]
fn nonsense_is_refused_with_its_reason() {
    let good = record();
    let says = |recording: &Recording, words: &str| {
        let error = recording.replay("nonsense").unwrap_err();
        assert!(
            error.to_string().contains(words),
            "{words} is not in: {error}"
        );
        assert_eq!(error.exit_code(), 2, "{error}");
    };
    let with = |block: usize, word: usize, value: u64| {
        let mut recording = good.clone();
        recording.blocks[block][word] = value;
        recording
    };
    says(&with(2, 0, 77), "a record makes no sense");
    says(&with(2, 1, u64::MAX), "a record makes no sense");
    says(&with(2, 3, u64::MAX), "a record makes no sense");
    says(
        &with(2, 2, 99 | 1 << 32),
        "frame 0: a command that was carried out is refused: unknown operation 99",
    );
    says(&with(2, 2, 1 | 9 << 32), "is refused");
    says(&with(1, 5, 0), "the snapshot is damaged");
    let mut recording = good.clone();
    recording.blocks.remove(1);
    says(&recording, "out of order");
    let mut recording = good.clone();
    recording.blocks.remove(0);
    says(&recording, "out of order");
    for (bytes, words) in [
        (&b""[..], "is no recording"),
        (b"[[robot]]\nname = \"arm\"\n", "is no recording"),
        (
            b"tlrec\r\n\x1a\x09\0\0\0\0\0\0\0",
            "is of format 9, this release reads format 1",
        ),
    ] {
        let error = replay("format", bytes).unwrap_err();
        assert!(error.to_string().contains(words), "{error}");
    }
}

#[test]
fn more_worlds_than_the_file_can_hold_are_refused_before_memory_is_taken() {
    let mut recording = record();
    let mut rest = recording.blocks[0].as_slice();
    let Some(Record::Head(json)) = records::read(&mut rest) else {
        panic!("a recording begins with its head");
    };
    let mut head: serde_json::Value = serde_json::from_slice(json).unwrap();
    head["daemon"]["worlds"] = 100_000_000.into();
    let mut forged = Vec::new();
    Record::Head(head.to_string().as_bytes()).write(&mut forged);
    recording.blocks[0] = forged;
    let error = recording.replay("claims").unwrap_err();
    let said = error.to_string();
    assert!(
        said.contains("has 100000000 worlds in its head, more than its"),
        "{said}"
    );
    assert_eq!(error.exit_code(), 2);
}

#[test]
fn columns_that_the_head_claims_take_no_memory() {
    let mut recording = record();
    let mut rest = recording.blocks[0].as_slice();
    let Some(Record::Head(json)) = records::read(&mut rest) else {
        panic!("a recording begins with its head");
    };
    let mut head: serde_json::Value = serde_json::from_slice(json).unwrap();
    head["daemon"]["commands"][0]["columns"] = (1_u64 << 40).into();
    let mut forged = Vec::new();
    Record::Head(head.to_string().as_bytes()).write(&mut forged);
    recording.blocks[0] = forged;
    let frames = FRAMES as u64;
    assert_eq!(
        recording.replay("columns").unwrap(),
        (frames, End::Recording(None))
    );
}

#[test]
fn what_is_no_file_is_refused_and_not_waited_for() {
    let pipe = file("pipe");
    let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
    rustix::fs::mknodat(rustix::fs::CWD, &pipe, rustix::fs::FileType::Fifo, mode, 0).unwrap();
    for path in [&pipe, Path::new("/dev/zero"), Path::new("/tmp")] {
        let args = Replay {
            file: path.to_owned(),
            threads: Some(1),
            frames: None,
        };
        let error = super::replay(&args).unwrap_err();
        assert!(error.to_string().contains("is no file"), "{error}");
        assert_eq!(error.exit_code(), 2);
    }
    std::fs::remove_file(pipe).unwrap();
}

proptest! {
    #[test]
    fn any_words_are_records_or_are_not(words in proptest::collection::vec(0..12_u64, 0..64)) {
        let mut rest = words.as_slice();
        while let Some(record) = records::read(&mut rest) {
            prop_assert!(record.words() <= words.len());
            if rest.is_empty() {
                break;
            }
        }
    }

    #[test]
    fn any_bytes_behind_a_head_are_blocks_or_are_not(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
        let file = [&blocks::head()[..], &bytes].concat();
        let (blocks, next) = read(&file).unwrap();
        prop_assert!(blocks.is_empty());
        prop_assert!(bytes.is_empty() == (next == Next::End));
    }
}
