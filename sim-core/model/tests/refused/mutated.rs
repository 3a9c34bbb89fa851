//! Good descriptions, damaged at random: read or refused, never a panic, never long.

use crate::measure::{MEMORY_MAX, measure};
use proptest::prelude::*;
use sim_model::{Description, Robot, UrdfOptions};
use std::time::Duration;

/// A robot with every element and attribute of URDF.
const EVERYTHING: &str = include_str!("everything.urdf");

/// Runs of each property; `TIGHTLOOP_FUZZ` raises it.
fn config() -> ProptestConfig {
    let cases = std::env::var("TIGHTLOOP_FUZZ")
        .ok()
        .map(|cases| cases.parse().expect("TIGHTLOOP_FUZZ is a number of cases"));
    ProptestConfig {
        cases: cases.unwrap_or(512),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

fn lesson() -> String {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../examples/assets/fr3/fr3_franka_hand.urdf"
    );
    std::fs::read_to_string(path).unwrap()
}

/// Values that parsers stumble over.
fn values() -> impl Strategy<Value = String> {
    prop_oneof![
        prop::sample::select(vec![
            "",
            " ",
            "0",
            "-0",
            "-1",
            "1e-320",
            "1e300",
            "-1e300",
            "1e400",
            "nan",
            "inf",
            "-inf",
            "0 0 0",
            "1 1",
            "1 2 3 4",
            "1,5",
            "0x1p3",
            "${x}",
            "$(arg x)",
            "base",
            "arm",
            "elbow",
            "../..",
            "package://../x",
            "fixed",
            "floating",
            "planar",
            "spherical",
            "1.2",
            "\u{0663}",
            "&amp;",
            "&#10;",
            "&#xD800;",
            "&x;",
            "<",
            "]]>",
            "--",
        ])
        .prop_map(str::to_owned),
        "[ -~]{0,8}",
        any::<f64>().prop_map(|value| value.to_string()),
    ]
}

/// One thing done to a text.
#[derive(Clone, Debug)]
enum Damage {
    /// Bytes cut out, and others put in.
    Patch(prop::sample::Index, usize, String),
    /// The value of an attribute replaced.
    Value(prop::sample::Index, String),
    /// A tag left out.
    Drop(prop::sample::Index),
    /// A tag said again somewhere else.
    Copy(prop::sample::Index, prop::sample::Index),
    /// Two tags exchanged.
    Swap(prop::sample::Index, prop::sample::Index),
}

fn damages() -> impl Strategy<Value = Vec<Damage>> {
    let index = any::<prop::sample::Index>;
    let any_damage = prop_oneof![
        2 => (index(), 0..60_usize, "[ -~\\n\u{0}\u{e9}]{0,12}").prop_map(|(a, n, p)| Damage::Patch(a, n, p)),
        4 => (index(), values()).prop_map(|(a, v)| Damage::Value(a, v)),
        2 => index().prop_map(Damage::Drop),
        2 => (index(), index()).prop_map(|(a, b)| Damage::Copy(a, b)),
        1 => (index(), index()).prop_map(|(a, b)| Damage::Swap(a, b)),
    ];
    prop::collection::vec(any_damage, 1..4)
}

/// The text in pieces: tags, and what is between them.
fn pieces(text: &str) -> Vec<String> {
    let mut pieces = Vec::new();
    for part in text.split_inclusive('>') {
        let at = part.find('<').unwrap_or(part.len());
        pieces.push(part[..at].to_owned());
        pieces.push(part[at..].to_owned());
    }
    pieces
}

fn damage(text: &str, damages: &[Damage]) -> String {
    let mut text = text.to_owned();
    for damage in damages {
        let mut pieces = pieces(&text);
        let tags = pieces.len() / 2;
        if tags == 0 {
            return text;
        }
        let tag = |index: &prop::sample::Index| 2 * index.index(tags) + 1;
        match damage {
            Damage::Patch(start, length, patch) => {
                let characters: Vec<char> = text.chars().collect();
                let start = start.index(characters.len());
                let end = (start + length).min(characters.len());
                let mut mended: String = characters[..start].iter().collect();
                mended.push_str(patch);
                mended.extend(&characters[end..]);
                text = mended;
                continue;
            }
            Damage::Value(at, value) => {
                let mut quoted: Vec<String> = text.split('"').map(str::to_owned).collect();
                let values = quoted.len() / 2;
                if values > 0 {
                    quoted[2 * at.index(values) + 1] = value.clone();
                }
                text = quoted.join("\"");
                continue;
            }
            Damage::Drop(at) => drop(pieces.remove(tag(at))),
            Damage::Copy(from, to) => {
                let copy = pieces[tag(from)].clone();
                pieces.insert(tag(to), copy);
            }
            Damage::Swap(first, other) => pieces.swap(tag(first), tag(other)),
        }
        text = pieces.concat();
    }
    text
}

/// Read or refused in time; what is read compiles or says why not, and is the same when read again.
fn check(text: &str, floating: bool) -> Result<(), TestCaseError> {
    let options = || UrdfOptions {
        floating,
        ..UrdfOptions::default()
    };
    let reading = measure(|| Robot::from_urdf_text(text, "robot.urdf", options()));
    prop_assert!(reading.time < Duration::from_secs(1), "{:?}", reading.time);
    prop_assert!(reading.memory < MEMORY_MAX, "{} bytes", reading.memory);
    match reading.result {
        Ok(robot) => {
            prop_assert!(robot.validate().is_ok());
            let again = Robot::from_urdf_text(text, "robot.urdf", options());
            prop_assert_eq!(again.as_ref(), Ok(&robot));
            let mut scene = Description::new(1.0 / 480.0, 1);
            scene.robots.push(robot);
            if let Err(error) = scene.compile() {
                // a scene may give the robot another name than the file's
                let message = error.to_string();
                let is_of_the_scene = message.contains("q = 0") || message.contains("robot name");
                prop_assert!(is_of_the_scene, "{}", message);
            }
        }
        Err(error) => {
            let message = error.to_string();
            prop_assert!(message.starts_with("robot.urdf:"), "{}", message);
            prop_assert!(
                message.contains("; ") && !message.contains('\n'),
                "{}",
                message
            );
            prop_assert!(message.len() < 4096, "{}", message);
        }
    }
    Ok(())
}

#[test]
fn undamaged_descriptions_are_read() {
    for text in [EVERYTHING, &lesson()] {
        assert_eq!(pieces(text).concat(), text);
        let path = concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../examples/assets/fr3/fr3_franka_hand.urdf"
        );
        Robot::from_urdf_text(text, path, UrdfOptions::default()).unwrap();
    }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn a_damaged_description_is_read_or_refused(damages in damages(), floating in any::<bool>()) {
        check(&damage(EVERYTHING, &damages), floating)?;
    }

    #[test]
    fn a_damaged_lesson_is_read_or_refused(damages in damages(), floating in any::<bool>()) {
        check(&damage(&lesson(), &damages), floating)?;
    }

    #[test]
    fn random_text_is_refused(text in "[<>/=\"' a-z&;!?\\[\\]-]{0,80}") {
        check(&text, false)?;
    }

    #[test]
    fn random_bytes_in_a_file_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..80)) {
        let path = std::env::temp_dir().join(format!("tightloop-refused-{}.urdf", std::process::id()));
        std::fs::write(&path, &bytes).unwrap();
        let reading = measure(|| Robot::from_urdf(&path, UrdfOptions::default()));
        std::fs::remove_file(&path).unwrap();
        prop_assert!(reading.result.is_err());
        prop_assert!(reading.time < Duration::from_secs(1), "{:?}", reading.time);
    }
}
