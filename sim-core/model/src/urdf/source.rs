//! The text of a URDF file, made fit for a strict XML parser.
//!
//! Published files have an XML declaration below a comment, `--` inside a comment, a prefix that nobody declared, a NUL at
//! the end, or Latin-1 in an author's name. None of it changes the robot, so it is mended here, and every line stays in its
//! place. What would cost the parser too much time or memory is refused.

use std::borrow::Cow;
use std::path::Path;

use super::markup::{ATTRIBUTES_OF_ONE_MAX, Markup, starts_with};
use crate::contents;
use crate::error::ModelError;
use crate::files::{self, FileError};

/// Largest file [bytes]: published robots have some hundred kilobytes.
const FILE_MAX: usize = 16 << 20;
/// Tags and comments in a file: a robot of a thousand links has some thirty thousand.
const TAGS_MAX: usize = 250_000;
/// Attributes in a file, counted by their equals signs.
const ATTRIBUTES_MAX: usize = 300_000;
/// Declarations of namespaces: the parser hands each down to all elements within.
const NAMESPACES_MAX: usize = 64;
/// What is said of other texts, such as JSON.
const NO_XML: &str = "this is no XML; a URDF file begins with `<`, and holds one <robot>";

/// The text of a file.
///
/// # Errors
/// A path that is no file or cannot be read, and a file that is too large or in UTF-16 or UTF-32.
pub(super) fn read(path: &Path, notes: &mut Vec<String>) -> Result<String, ModelError> {
    let bytes = files::read(path, FILE_MAX as u64).map_err(|error| match error {
        FileError::TooLarge { .. } => size_limit(path),
        error => error.at_path(path),
    })?;
    if let Some(other) = contents::neither_robot_nor_mesh(&bytes) {
        return Err(ModelError::Xml {
            path: path.to_owned(),
            line: 1,
            column: 1,
            reason: other.to_owned(),
        });
    }
    decode(bytes, path, notes)
}

fn limit(path: &Path, what: &'static str, limit: String) -> ModelError {
    ModelError::TooLarge {
        path: path.to_owned(),
        what,
        limit,
    }
}

fn size_limit(path: &Path) -> ModelError {
    let most = format!("{} MiB", FILE_MAX >> 20);
    limit(path, "the size of the file", most)
}

/// UTF-8, or else Latin-1. Outside of names and comments URDF is ASCII, so other old encodings read almost the same.
fn decode(bytes: Vec<u8>, path: &Path, notes: &mut Vec<String>) -> Result<String, ModelError> {
    if matches!(
        bytes[..],
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] | [b'<', 0, ..] | [0, b'<', ..] | [0, 0, ..]
    ) {
        return Err(ModelError::Xml {
            path: path.to_owned(),
            line: 1,
            column: 1,
            reason: "this is UTF-16 or UTF-32 text; save it as UTF-8".to_owned(),
        });
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok(text),
        Err(error) => {
            let valid = error.utf8_error().valid_up_to();
            let bytes = error.into_bytes();
            let line = 1 + newlines(&bytes[..valid]);
            notes.push(format!(
                "bytes that are not UTF-8 are read as Latin-1 (first in line {line})"
            ));
            Ok(bytes.into_iter().map(char::from).collect())
        }
    }
}

fn newlines(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&byte| byte == b'\n').count()
}

/// The same text, fit for the XML parser, with every line in its place.
///
/// # Errors
/// Document types, which can expand without bound; too many elements or attributes; text that is no XML.
pub(super) fn prepare<'a>(
    text: &'a str,
    path: &Path,
    notes: &mut Vec<String>,
) -> Result<Cow<'a, str>, ModelError> {
    if text.len() > FILE_MAX {
        return Err(size_limit(path));
    }
    let text = text.trim_start_matches(['\u{feff}', '\u{200b}', '\u{2060}']);
    let text = text.trim_end_matches(|c: char| c == '\0' || c.is_ascii_whitespace());
    let refuse = |at: usize, reason: String| ModelError::Xml {
        path: path.to_owned(),
        line: 1 + newlines(&text.as_bytes()[..at]) as u32,
        column: 1 + text[..at].chars().rev().take_while(|&c| c != '\n').count() as u32,
        reason,
    };
    if text.trim_start().is_empty() {
        return Err(refuse(
            0,
            "the file is empty; a URDF file holds one <robot>".to_owned(),
        ));
    }
    if let Some(other) = contents::neither_robot_nor_mesh(text.as_bytes()) {
        return Err(refuse(0, other.to_owned()));
    }
    if !text.trim_start().starts_with('<') {
        return Err(refuse(0, NO_XML.to_owned()));
    }
    let markup = Markup::from_text(text);
    if let Some(at) = markup.document_type {
        if starts_with(&text[at..], "<!doctype html") {
            return Err(refuse(at, contents::WEB_PAGE.to_owned()));
        }
        let reason = "<!DOCTYPE> is refused, since entities can expand without bound; delete it, and write out what its entities stand for";
        return Err(refuse(at, reason.to_owned()));
    }
    if markup.tags > TAGS_MAX {
        let most = TAGS_MAX.to_string();
        return Err(limit(path, "the number of XML tags", most));
    }
    if markup.attributes > ATTRIBUTES_MAX {
        let most = ATTRIBUTES_MAX.to_string();
        return Err(limit(path, "the number of XML attributes", most));
    }
    if let Some(at) = markup.flood {
        let reason =
            format!("an element has more than {ATTRIBUTES_OF_ONE_MAX} attributes; delete some");
        return Err(refuse(at, reason));
    }
    if markup.namespaces > NAMESPACES_MAX {
        let most = NAMESPACES_MAX.to_string();
        return Err(limit(path, "the number of namespaces", most));
    }
    if let Some(&at) = markup.late_declarations.first() {
        let line = 1 + newlines(&text.as_bytes()[..at]);
        notes.push(format!(
            "the XML declaration is not at the start of the file and is ignored (line {line})"
        ));
    }
    let undeclared: Vec<&str> = markup.used.difference(&markup.declared).copied().collect();
    for prefix in &undeclared {
        notes.push(format!("the XML prefix `{prefix}` is not declared"));
    }
    let declarations: String = undeclared
        .iter()
        .map(|prefix| format!(" xmlns:{prefix}=\"undeclared:{prefix}\""))
        .collect();
    let mut edits = markup.blank;
    if !declarations.is_empty() {
        edits.push(markup.root_name_end..markup.root_name_end);
        // the name of a broken tag may end where an XML declaration begins: that one comes after what is added
        edits.sort_by_key(|range| (range.start, range.end));
    }
    if edits.is_empty() {
        return Ok(Cow::Borrowed(text));
    }
    let mut mended = String::with_capacity(text.len() + declarations.len());
    let mut from = 0;
    for range in edits {
        mended.push_str(&text[from..range.start]);
        from = range.end;
        let gone = &text[range];
        match gone {
            "" => mended.push_str(&declarations),
            gone => mended.extend(gone.chars().map(|c| if c == '\n' { '\n' } else { ' ' })),
        }
    }
    mended.push_str(&text[from..]);
    Ok(Cow::Owned(mended))
}
