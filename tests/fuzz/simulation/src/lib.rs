//! Readers of the daemon, each as a function of any bytes, as in the package above.

#[path = "../../src/files.rs"]
mod files;

use std::cell::RefCell;

use sim_daemon::config::{self, SceneFile};
use sim_daemon::outside::{self, Worlds};

/// A reader of any bytes.
pub type Reader = fn(&[u8]);

/// Each reader by the name of its fuzz target, which is that of its corpus, too.
pub const READERS: [(&str, Reader); 6] = [
    ("scene", scene),
    ("recording", recording),
    ("command_applied", command_applied),
    ("snapshot", snapshot),
    ("ik", ik),
    ("rollout", rollout),
];

/// The robot of all scenes.
const ROBOT: &[u8] = include_bytes!("../../../../py-client/python/tightloop/assets/cartpole.urdf");
/// A scene of that robot, and of a cube above the ground.
const SCENE: &str = include_str!("../../corpus/scene/cube.toml");
/// Bytes of a snapshot before those that its checksum covers, and where the checksum is.
const COVERED: usize = 16;
const CHECKSUM: std::ops::Range<usize> = 12..16;
/// Where a snapshot names its model.
const MODEL: std::ops::Range<usize> = 16..24;

thread_local! {
    static WORLDS: RefCell<Worlds> = {
        let path = files::file("robot.urdf", ROBOT);
        let folder = path.parent().expect("it is in a folder");
        RefCell::new(Worlds::new(SCENE, folder))
    };
}

fn with_worlds(act: impl FnOnce(&mut Worlds)) {
    WORLDS.with_borrow_mut(act);
}

/// A scene as TOML, or as JSON where it begins with a brace. What is read compiles or is refused, and can be saved.
pub fn scene(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let read = match text.starts_with('{') {
        true => SceneFile::from_json(text),
        false => config::parse(text, "scene.toml"),
    };
    let Ok(scene) = read else { return };
    let saved = config::parse(&scene.to_toml(), "saved.toml");
    saved.expect("what was read is read again");
    let path = files::file("robot.urdf", ROBOT);
    let folder = path.parent().expect("it is in a folder");
    if let Ok(description) = scene.describe(folder) {
        let _ = description.compile();
    }
}

/// A recording: a file, and a block of these records.
pub fn recording(bytes: &[u8]) {
    let _ = outside::recording(bytes);
    let words = bytes.as_chunks::<8>().0.iter();
    let records: Vec<u64> = words.map(|&word| u64::from_le_bytes(word)).collect();
    let _ = outside::recording(&outside::recording_of(&records));
}

/// A command that two worlds carry out: operation, number of rows, then the sample.
pub fn command_applied(bytes: &[u8]) {
    let &[op, rows, ref sample @ ..] = bytes else {
        return;
    };
    let words = sample.as_chunks::<8>().0.iter();
    let payload: Vec<u64> = words.map(|&word| u64::from_le_bytes(word)).collect();
    with_worlds(|worlds| {
        let _ = worlds.command(op.into(), rows.into(), &payload);
    });
}

/// A snapshot: the bytes, and the bytes with the checksum and the model that the worlds have.
pub fn snapshot(bytes: &[u8]) {
    with_worlds(|worlds| {
        let _ = worlds.restore(bytes);
        let mut mended = bytes.to_vec();
        if mended.len() > MODEL.end {
            mended[MODEL].copy_from_slice(&worlds.snapshot()[MODEL]);
            let checksum = crc32fast::hash(&mended[COVERED..]);
            mended[CHECKSUM].copy_from_slice(&checksum.to_le_bytes());
            let _ = worlds.restore(&mended);
        }
    });
}

/// The file of a question: JSON up to a byte 0, then the numbers of its arrays.
fn question(bytes: &[u8]) -> std::path::PathBuf {
    let end = bytes.iter().position(|&byte| byte == 0);
    let end = end.unwrap_or(bytes.len());
    let numbers = bytes.get(end + 1..).unwrap_or_default();
    let length = (end as u64).to_le_bytes();
    files::file("question", &[&length, &bytes[..end], numbers].concat())
}

/// A question of inverse kinematics.
pub fn ik(bytes: &[u8]) {
    let path = question(bytes);
    with_worlds(|worlds| {
        let _ = worlds.ik(&path);
    });
}

/// The question of a rollout, up to its first step.
pub fn rollout(bytes: &[u8]) {
    let path = question(bytes);
    with_worlds(|worlds| {
        let _ = worlds.rollout(&path);
    });
}
