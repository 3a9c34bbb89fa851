//! The cases of `tests/malformed`: files that are refused, each with its message. `README.md` there gives the format.

use std::path::{Path, PathBuf};

/// A file that the reader refuses.
pub struct Case {
    /// Names the file, too: `name.urdf`.
    pub name: String,
    /// What the file holds.
    pub bytes: Vec<u8>,
    /// The whole message, word for word.
    pub message: String,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/malformed")
}

/// The robot that most cases differ from in a line or two.
pub fn base() -> String {
    std::fs::read_to_string(folder().join("base.urdf")).unwrap()
}

/// All cases, in the order of files and lines.
pub fn cases() -> Vec<Case> {
    let entries = std::fs::read_dir(folder()).unwrap();
    let mut files: Vec<PathBuf> = entries
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "txt"))
        .collect();
    files.sort();
    let base = base();
    let read = |file| cases_of(&std::fs::read_to_string(file).unwrap(), &base);
    files.into_iter().flat_map(read).collect()
}

/// The cases of one file.
pub fn cases_of(text: &str, base: &str) -> Vec<Case> {
    let mut cases = Vec::new();
    let mut open: Option<(&str, Vec<&str>)> = None;
    for line in text.lines() {
        if let Some(name) = line.strip_prefix("== ") {
            assert!(open.is_none(), "{name}: the case before has no `error:`");
            open = Some((name, Vec::new()));
        } else if let Some(message) = line.strip_prefix("error: ") {
            let (name, lines) = open.take().expect("an `error:` ends a case");
            cases.push(Case {
                name: name.to_owned(),
                bytes: bytes(name, &lines, base),
                message: message.to_owned(),
            });
        } else if let Some((_, lines)) = &mut open {
            lines.push(line);
        } else {
            let is_comment = line.is_empty() || line.starts_with('#');
            assert!(is_comment, "`{line}` belongs to no case");
        }
    }
    assert!(open.is_none(), "the last case has no `error:`");
    cases
}

fn bytes(name: &str, lines: &[&str], base: &str) -> Vec<u8> {
    if let [line] = lines
        && let Some(encoding) = line.strip_prefix("encoded as ")
    {
        return encoded(base, encoding);
    }
    let mut bytes = Vec::new();
    if lines.iter().all(|line| line.starts_with('|')) {
        for line in lines {
            unescape(&line[1..], &mut bytes);
        }
        return bytes;
    }
    let mut rest = base;
    for line in lines {
        let (sign, line) = line.split_at(1);
        if sign == "+" {
            unescape(line, &mut bytes);
            continue;
        }
        let whole = format!("{line}\n");
        let (before, after) = rest
            .split_once(&whole)
            .unwrap_or_else(|| panic!("{name}: `{line}` is no line of the base that follows"));
        bytes.extend(before.bytes());
        match sign {
            "-" => {}
            " " => bytes.extend(whole.bytes()),
            sign => panic!("{name}: `{sign}` begins no line of a case"),
        }
        rest = after;
    }
    bytes.extend(rest.bytes());
    bytes
}

fn encoded(text: &str, encoding: &str) -> Vec<u8> {
    let utf_16 = || text.encode_utf16().flat_map(u16::to_le_bytes);
    match encoding {
        "UTF-16" => utf_16().collect(),
        "UTF-16 with a byte order mark" => [0xff, 0xfe].into_iter().chain(utf_16()).collect(),
        "UTF-32" => text
            .chars()
            .flat_map(|c| u32::from(c).to_be_bytes())
            .collect(),
        other => panic!("encoding `{other}` is unknown"),
    }
}

/// Appends a line with its line break: `\x00` is a byte, `\\` a backslash, `\{9 a}` nine times `a`, and a backslash at
/// the end leaves the line break out.
fn unescape(line: &str, bytes: &mut Vec<u8>) {
    let mut rest = line;
    while let Some((before, after)) = rest.split_once('\\') {
        bytes.extend(before.bytes());
        rest = match after.as_bytes() {
            [] => return,
            [b'\\', ..] => {
                bytes.push(b'\\');
                &after[1..]
            }
            [b'x', ..] => {
                let byte = u8::from_str_radix(&after[1..3], 16);
                bytes.push(byte.unwrap_or_else(|_| panic!("`{line}`: two hex digits follow \\x")));
                &after[3..]
            }
            [b'{', ..] => {
                let (repeated, after) = after[1..].split_once('}').expect(line);
                let (times, what) = repeated.split_once(' ').expect(line);
                bytes.extend(what.repeat(times.parse().expect(line)).bytes());
                after
            }
            _ => panic!("`{line}`: unknown escape"),
        };
    }
    bytes.extend(rest.bytes());
    bytes.push(b'\n');
}
