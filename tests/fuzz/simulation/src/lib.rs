//! Readers of the daemon, each as a function of any bytes, as in the package above.

#[path = "../../src/files.rs"]
mod files;

use std::cell::RefCell;
use std::path::PathBuf;

use sim_daemon::config::{self, SceneFile};
use sim_daemon::outside::{self, Worlds};

/// A reader of any bytes.
pub type Reader = fn(&[u8]);

/// Each reader by the name of its fuzz target, which is that of its corpus, too.
pub const READERS: [(&str, Reader); 7] = [
    ("scene", scene),
    ("recording", recording),
    ("replay", replay),
    ("command_applied", command_applied),
    ("snapshot", snapshot),
    ("ik", ik),
    ("rollout", rollout),
];

/// The robot of all scenes.
const ROBOT: &[u8] = include_bytes!("../../../../py-client/python/tightloop/assets/cartpole.urdf");
/// A scene of that robot, and of a cube above the ground, whose parameters differ per world.
const SCENE: &str = concat!(
    r#"params = ["gravity", "body_mass_scale", "joint_armature", "joint_target_ke", "shape_mu", "command_delay", "#,
    r#""joint_f_noise", "body_f", "body_inertia", "body_com"]"#,
    "\n",
    include_str!("../../corpus/scene/cube.toml")
);
/// Bytes of a snapshot before those that its checksum covers, and where the checksum is.
const COVERED: usize = 16;
const CHECKSUM: std::ops::Range<usize> = 12..16;
/// Kinds of records of a recording.
const HEAD: u64 = 1;
const STATE: u64 = 2;
const COMMAND: u64 = 3;
const GAP: u64 = 4;
const END: u64 = 5;
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

/// Appends a record of a recording: its kind, then words.
fn put_record(records: &mut Vec<u64>, kind: u64, words: &[u64]) {
    records.extend([kind, words.len() as u64]);
    records.extend(words);
}

/// As [`put_record`], with bytes.
fn put_bytes(records: &mut Vec<u64>, kind: u64, bytes: &[u8]) {
    let padded: Vec<u8> = [bytes, &[0; 7]].concat();
    let padded = padded.as_chunks::<8>().0.iter();
    let padded = padded.map(|&word| u64::from_le_bytes(word));
    let words: Vec<u64> = [bytes.len() as u64].into_iter().chain(padded).collect();
    put_record(records, kind, &words);
}

/// The head of a recording of these worlds, with changes; it comes from no accelerator.
fn head(worlds: &Worlds, changes: &[u8]) -> String {
    let mut daemon = serde_json::to_value(worlds.description()).expect("it is plain data");
    if let Ok(serde_json::Value::Object(changes)) = serde_json::from_slice(changes) {
        for (name, value) in changes {
            daemon[name] = value;
        }
    }
    daemon["adapter"] = "".into();
    serde_json::json!({ "daemon": daemon, "observed": ["joint_q"] }).to_string()
}

/// A recording that is run again. First a JSON object of what its head has else, up to a byte 0. The next byte says whether it
/// is compared or shown, and whether the state follows. Then five bytes each begin a record: its kind, an operation, numbers of
/// rows, digests and words. The words come last.
pub fn replay(bytes: &[u8]) {
    let end = bytes.iter().position(|&byte| byte == 0);
    let (changes, rest) = bytes.split_at(end.unwrap_or(bytes.len()));
    let [_, flags, rest @ ..] = rest else {
        return;
    };
    let mut records = Vec::new();
    with_worlds(|worlds| {
        put_bytes(&mut records, HEAD, head(worlds, changes).as_bytes());
        if flags & 2 == 0 {
            put_bytes(&mut records, STATE, worlds.snapshot());
        }
        let mut rest = rest;
        while let [kind, op, rows, digests, count, after @ ..] = rest {
            let (words, after) = after.split_at(after.len().min(8 * usize::from(*count)));
            rest = after;
            let words = words.as_chunks::<8>().0.iter();
            let words: Vec<u64> = words.map(|&word| u64::from_le_bytes(word)).collect();
            match kind % 8 {
                0..=2 => {
                    let operation = u64::from(*op) | u64::from(*rows) << 32;
                    let head = [operation, words.len() as u64, u64::from(*digests), 0];
                    let zeros = vec![0; usize::from(*digests).div_ceil(2)];
                    put_record(&mut records, COMMAND, &[&head[..], &words, &zeros].concat());
                }
                3 => put_record(&mut records, GAP, &words),
                4 => put_bytes(&mut records, STATE, worlds.snapshot()),
                5 => put_bytes(&mut records, STATE, after),
                6 => put_bytes(&mut records, END, b"end"),
                _ => put_record(&mut records, u64::from(*op), &words),
            }
        }
    });
    let file = outside::recording_of(&records);
    let path: PathBuf = files::file("replayed.tlrec", &file);
    let _ = match flags & 1 == 0 {
        true => outside::replay(&path).map(|_| ()),
        false => outside::playback(&path).map(|_| ()),
    };
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

/// A snapshot: the bytes; the bytes with the checksum and the model that the worlds have; the worlds' own with changed bits, each
/// byte being the changes of one.
pub fn snapshot(bytes: &[u8]) {
    let sum = |snapshot: &mut [u8]| {
        let checksum = crc32fast::hash(&snapshot[COVERED..]);
        snapshot[CHECKSUM].copy_from_slice(&checksum.to_le_bytes());
    };
    with_worlds(|worlds| {
        let _ = worlds.restore(bytes);
        let mut mended = bytes.to_vec();
        if mended.len() > MODEL.end {
            mended[MODEL].copy_from_slice(&worlds.snapshot()[MODEL]);
            sum(&mut mended);
            let _ = worlds.restore(&mended);
        }
        let mut changed = worlds.snapshot().to_vec();
        let covered = changed[MODEL.end..].iter_mut();
        covered
            .zip(bytes)
            .for_each(|(byte, change)| *byte ^= change);
        sum(&mut changed);
        let _ = worlds.restore(&changed);
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

/// The question of a rollout, with its first frames.
pub fn rollout(bytes: &[u8]) {
    let path = question(bytes);
    with_worlds(|worlds| {
        let _ = worlds.rollout(&path);
    });
}
