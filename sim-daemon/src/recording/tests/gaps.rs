//! Recordings with a gap: what is replayed and played behind it.

use sim_physics::arrays::Field;

use super::super::records::Record;
use super::super::replay::{End, Gap, open};
use super::super::{Playback, Shows, replay as run};
use super::{FRAMES, Recording, file, record, torques};
use crate::cli::Replay;
use crate::eyes::FrameFields;

/// A recording whose frames from `first` to `last` are a gap, with the state behind it or without.
fn with_gap(first: usize, last: usize, has_state: bool) -> Recording {
    let mut recording = record();
    let state = state_before(&recording, last);
    let mut gap = Vec::new();
    Record::Gap((last - first) as u64).write(&mut gap);
    if has_state {
        Record::State(&state).write(&mut gap);
    }
    recording.blocks.splice(2 + first..2 + last, [gap]);
    recording
}

/// All worlds as they were before a frame.
fn state_before(recording: &Recording, frame: usize) -> Vec<u8> {
    let path = file("state");
    let mut start = recording.clone();
    start.blocks.truncate(2 + frame);
    std::fs::write(&path, start.bytes().0).unwrap();
    let args = Replay {
        file: path.clone(),
        threads: Some(1),
        frames: None,
    };
    let mut replay = open(&args).unwrap();
    replay.go().unwrap();
    std::fs::remove_file(&path).unwrap();
    replay.snapshot()
}

#[test]
fn replay_goes_on_behind_a_gap_and_names_the_steps_that_are_missing() {
    let path = file("gap");
    std::fs::write(&path, with_gap(3, 7, true).bytes().0).unwrap();
    let args = Replay {
        file: path.clone(),
        threads: Some(1),
        frames: None,
    };
    let mut replay = open(&args).unwrap();
    assert_eq!(replay.go().unwrap(), End::Recording(None));
    assert_eq!(replay.frames, FRAMES as u64 - 4);
    let gap = Gap {
        frames: 3,
        lost: 4,
        from: 3,
        to: Some(7),
    };
    assert_eq!(replay.gaps, [gap]);
    let error = run(&args).unwrap_err();
    std::fs::remove_file(path).unwrap();
    let said = error.to_string();
    assert!(said.contains("8 frames are equal, bit for bit"), "{said}");
    assert!(
        said.contains(
            "a gap after frame 3: 4 or more entries are missing, of world 0 the steps 4 to 7"
        ),
        "{said}"
    );
    assert_eq!(error.exit_code(), 1);
}

#[test]
fn a_forged_frame_behind_a_gap_is_reported() {
    let mut recording = with_gap(3, 7, true);
    let digests = torques().total_bytes() / 8;
    let numbers: &mut [u32] =
        bytemuck::cast_slice_mut(&mut recording.blocks[2 + 3 + 1][6..][digests..]);
    numbers[0] ^= 1;
    let error = recording.replay("behind").unwrap_err();
    assert!(error.to_string().contains("frame 3, of a step"), "{error}");
}

#[test]
fn a_gap_without_the_state_behind_it_ends_what_is_compared() {
    let path = file("stateless-gap");
    std::fs::write(&path, with_gap(3, 7, false).bytes().0).unwrap();
    let args = Replay {
        file: path.clone(),
        threads: Some(1),
        frames: None,
    };
    let error = run(&args).unwrap_err();
    std::fs::remove_file(path).unwrap();
    let said = error.to_string();
    assert!(
        said.contains("3 frames are equal") && said.contains("no state behind them"),
        "{said}"
    );
}

#[test]
fn a_playback_goes_on_behind_a_gap() {
    for (has_state, frames, end) in [
        (true, FRAMES - 4, "it ends here"),
        (false, 3, "4 or more frames are missing from here on"),
    ] {
        let path = file("played-gap");
        std::fs::write(&path, with_gap(3, 7, has_state).bytes().0).unwrap();
        let fields = FrameFields::from(&[Field::JointQ][..]);
        let mut playback = Playback::open(&path, &fields, Some(1)).unwrap();
        let mut played = 0;
        while playback.advance().unwrap().is_some() {
            played += 1;
        }
        std::fs::remove_file(path).unwrap();
        assert_eq!((played, playback.end()), (frames, Some(end)));
    }
}

#[test]
fn a_playback_with_starts_shows_the_states_that_no_command_made() {
    let path = file("played-starts");
    std::fs::write(&path, with_gap(3, 7, true).bytes().0).unwrap();
    let played = Playback::open(&path, &FrameFields::from(&[Field::JointQ][..]), Some(1)).unwrap();
    let mut playback = played.with_starts();
    let mut shown = Vec::new();
    while playback.advance().unwrap().is_some() {
        shown.push(playback.shows());
    }
    std::fs::remove_file(path).unwrap();
    let starts: Vec<usize> = (0..shown.len())
        .filter(|&frame| shown[frame] == Shows::Start)
        .collect();
    // three frames come before the gap
    assert_eq!(starts, [0, 4]);
    assert_eq!(shown.len(), FRAMES - 4 + starts.len());
}
