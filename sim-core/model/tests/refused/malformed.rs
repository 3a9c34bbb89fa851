//! Every case of `tests/malformed` is refused with its message, word for word, fast and in little memory.

use std::collections::HashSet;
use std::path::Path;
use std::time::Duration;

use crate::cases::{Case, base, cases, cases_of};
use crate::measure::measure;
use sim_model::{Robot, UrdfOptions};

/// Memory for a file of a page [bytes]: XML, numbers and messages take some ten times its size.
const MEMORY_MAX: usize = 1 << 20;
/// Cases in `tests/malformed`: a lost file or a lost line is noticed here.
const CASES: usize = 215;

/// What differs from the message that is expected, after the case's name.
fn check(case: &Case) -> Result<(), String> {
    let name = &case.name;
    let folder =
        Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join(format!("{name}.urdf"));
    std::fs::write(&file, &case.bytes).unwrap();
    let reading = measure(|| Robot::from_urdf(&file, UrdfOptions::default()));
    std::fs::remove_file(&file).unwrap();
    std::fs::remove_dir(&folder).unwrap();

    let message = match reading.result {
        Ok(_) => "it is accepted".to_owned(),
        Err(error) => error
            .to_string()
            .replace(&format!("{}/", folder.display()), ""),
    };
    if message != case.message {
        return Err(format!(
            "{name}\n  found    {message}\n  expected {}",
            case.message
        ));
    }
    if reading.time > Duration::from_secs(1) || reading.memory > MEMORY_MAX {
        return Err(format!(
            "{name} takes {:?} and {} bytes",
            reading.time, reading.memory
        ));
    }
    Ok(())
}

#[test]
fn every_malformed_file_is_refused_with_its_message() {
    let wrong: Vec<String> = cases()
        .iter()
        .filter_map(|case| check(case).err())
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_case_is_lost() {
    let cases = cases();
    let names: HashSet<&str> = cases.iter().map(|case| case.name.as_str()).collect();
    assert_eq!(names.len(), cases.len(), "two cases share a name");
    assert_eq!(cases.len(), CASES);
}

#[test]
fn a_wrong_message_and_an_accepted_file_fail_with_the_name_of_the_case() {
    let text = "== mass_light\n-      <mass value=\"1\"/>\n+      <mass value=\"-1\"/>\nerror: it is too light\n\
                == mass_fine\n-      <mass value=\"1\"/>\n+      <mass value=\"2\"/>\nerror: it is too heavy\n";
    let [light, fine] = &cases_of(text, &base())[..] else {
        panic!("two cases")
    };
    let failure = check(light).unwrap_err();
    assert!(
        failure.starts_with("mass_light\n") && failure.contains("which is negative"),
        "{failure}"
    );
    let failure = check(fine).unwrap_err();
    assert!(
        failure.starts_with("mass_fine\n") && failure.contains("it is accepted"),
        "{failure}"
    );
}

#[test]
fn the_base_of_the_cases_is_accepted() {
    Robot::from_urdf_text(&base(), "base.urdf", UrdfOptions::default()).unwrap();
}

#[test]
fn every_message_names_its_file_and_the_cure() {
    for Case { name, message, .. } in cases() {
        assert!(
            message.starts_with(&format!("{name}.urdf:")),
            "{name}: {message}"
        );
        // what is wrong, then the cure, if not both in one
        let has_cure = message.contains("; ") || message.contains(" must be ");
        assert!(has_cure, "{name}: {message}");
        assert!(message.len() < 600, "{name}: {} bytes", message.len());
    }
}
