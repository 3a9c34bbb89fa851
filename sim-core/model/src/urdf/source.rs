//! The text of a URDF file, made fit for an XML parser that takes the standard at its word.
//!
//! Robots are written by hand, by exporters and for parsers that forgive: an XML declaration below a comment, `--` inside a
//! comment, a prefix that nobody declared, a NUL at the end, Latin-1 in a name of an author. None of it changes what the file
//! says, so it is mended here, without moving a line. What would cost the parser time or memory out of proportion is refused.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read as _;
use std::ops::Range;
use std::path::Path;

use crate::error::ModelError;

/// Largest file [bytes]: published robots have some hundred kilobytes.
const FILE_MAX: usize = 16 << 20;
/// Tags and comments in a file: a robot of a thousand links has some thirty thousand.
const TAGS_MAX: usize = 250_000;
/// Attributes in a file, counted by their equals signs.
const ATTRIBUTES_MAX: usize = 300_000;
/// Attributes of one element: the parser compares each with each.
const ATTRIBUTES_OF_ONE_MAX: usize = 64;
/// Declarations of namespaces: the parser hands each down to all elements within.
const NAMESPACES_MAX: usize = 64;
/// Prefixes that are declared here because the file does not: CAD exporters leave one or two.
const UNDECLARED_MAX: usize = 16;

/// The text of a file.
///
/// # Errors
/// What cannot be read, is no file, too large, empty, or in an encoding of several bytes a character.
pub(super) fn read(path: &Path, notes: &mut Vec<String>) -> Result<String, ModelError> {
    let metadata = std::fs::metadata(path).map_err(|error| fault(path, error.to_string()))?;
    // a pipe or a device may never end
    if !metadata.is_file() {
        return Err(fault(path, "it is not a file".to_owned()));
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|error| fault(path, error.to_string()))?;
    file.take(FILE_MAX as u64 + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| fault(path, error.to_string()))?;
    too_large(path, bytes.len())?;
    decode(bytes, path, notes)
}

fn fault(path: &Path, reason: String) -> ModelError {
    ModelError::File {
        path: path.to_owned(),
        reason,
    }
}

fn limit(path: &Path, what: &'static str, limit: String) -> ModelError {
    ModelError::TooLarge {
        path: path.to_owned(),
        what,
        limit,
    }
}

fn too_large(path: &Path, bytes: usize) -> Result<(), ModelError> {
    if bytes > FILE_MAX {
        let most = format!("{} MiB", FILE_MAX >> 20);
        return Err(limit(path, "the size of the file", most));
    }
    Ok(())
}

/// UTF-8, or else Latin-1: outside of names and comments URDF is ASCII, so it hardly matters which of the old sets it was.
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

/// The same text as an XML parser wants it, every line where it was.
///
/// # Errors
/// Document types, which can expand without bound; too many elements or attributes; what is no XML at all.
pub(super) fn prepare<'a>(
    text: &'a str,
    path: &Path,
    notes: &mut Vec<String>,
) -> Result<Cow<'a, str>, ModelError> {
    too_large(path, text.len())?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
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
    if text.starts_with("version https://git-lfs") {
        let reason = "this is a pointer to a file in Git LFS, not the file; run `git lfs pull`";
        return Err(refuse(0, reason.to_owned()));
    }
    let markup = Markup::of(text);
    if let Some(at) = markup.document_type {
        let reason = if starts_with(&text[at..], "<!doctype html") {
            "this is a web page, not a URDF file; download the raw file"
        } else {
            "<!DOCTYPE> is refused, since entities can expand without bound; delete it, and write out what its entities stand for"
        };
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
        edits.sort_by_key(|range| range.start);
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

fn starts_with(text: &str, ascii: &str) -> bool {
    text.get(..ascii.len())
        .is_some_and(|start| start.eq_ignore_ascii_case(ascii))
}

/// What a walk from one `<` to the next finds. It is right for well-formed XML; of the rest the parser complains.
#[derive(Default)]
struct Markup<'a> {
    document_type: Option<usize>,
    /// XML declarations after the first byte.
    late_declarations: Vec<usize>,
    /// XML declarations, and comments with `--`: they mean nothing, and the parser refuses them.
    blank: Vec<Range<usize>>,
    /// Where the name of the outermost element ends.
    root_name_end: usize,
    tags: usize,
    attributes: usize,
    namespaces: usize,
    /// An element with too many attributes.
    flood: Option<usize>,
    used: BTreeSet<&'a str>,
    declared: BTreeSet<&'a str>,
}

impl<'a> Markup<'a> {
    fn of(text: &'a str) -> Markup<'a> {
        let bytes = text.as_bytes();
        let count = |byte| bytes.iter().filter(|&&other| other == byte).count();
        let mut markup = Markup {
            tags: count(b'<'),
            attributes: count(b'='),
            declared: BTreeSet::from(["xml", "xmlns"]),
            ..Markup::default()
        };
        let mut at = 0;
        while let Some(open) = text[at..].find('<').map(|offset| at + offset) {
            let rest = &text[open..];
            // where the mark stands, and where it ends; the parser tells of what never ends
            let find = |mark: &str, from: usize| {
                let inside = rest[from..].find(mark).map(|offset| open + from + offset);
                inside.map_or((text.len(), text.len()), |at| (at, at + mark.len()))
            };
            at = if rest.starts_with("<!--") {
                let (last, end) = find("-->", 4);
                let inside = &text[open + 4..last];
                if inside.contains("--") || inside.ends_with('-') {
                    markup.blank.push(open + 4..last);
                }
                end
            } else if rest.starts_with("<![CDATA[") {
                find("]]>", 9).1
            } else if rest.starts_with("<?") {
                let (_, end) = find("?>", 2);
                if rest.starts_with("<?xml") && rest[5..].starts_with([' ', '\t', '\r', '\n', '?'])
                {
                    if open > 0 {
                        markup.late_declarations.push(open);
                    }
                    markup.blank.push(open..end);
                }
                end
            } else if starts_with(rest, "<!doctype") {
                markup.document_type = markup.document_type.or(Some(open));
                open + 9
            } else {
                markup.tag(text, open)
            };
        }
        markup
    }

    /// Goes through a tag that opens there; returns where it ends.
    fn tag(&mut self, text: &'a str, open: usize) -> usize {
        let bytes = text.as_bytes();
        let closes = bytes.get(open + 1) == Some(&b'/');
        let name = open + 1 + usize::from(closes);
        let mut word = name;
        let mut attributes = 0;
        let mut at = name;
        while at < bytes.len() {
            match bytes[at] {
                quote @ (b'"' | b'\'') => {
                    let inside = &bytes[at + 1..];
                    let length = inside.iter().position(|&byte| byte == quote);
                    at += length.unwrap_or(inside.len()) + 1;
                    word = at + 1;
                }
                // a `<` here is a fault, of which the parser tells
                b'>' | b'<' => break,
                byte if byte == b'=' || byte == b'/' || byte.is_ascii_whitespace() => {
                    if byte == b'=' {
                        attributes += 1;
                    }
                    self.word(text, word..at, word == name);
                    word = at + 1;
                }
                _ => {}
            }
            at += 1;
        }
        let at = at.min(bytes.len());
        self.word(text, word.min(at)..at, word == name);
        if attributes > ATTRIBUTES_OF_ONE_MAX {
            self.flood = self.flood.or(Some(open));
        }
        at.max(open + 1)
    }

    /// Notes the prefix of a name; of attributes, what it declares.
    fn word(&mut self, text: &'a str, range: Range<usize>, is_tag: bool) {
        let word = &text[range.clone()];
        if is_tag && self.root_name_end == 0 {
            self.root_name_end = range.end;
        }
        if !is_tag && word.starts_with("xmlns") {
            self.namespaces += 1;
        }
        let Some((prefix, local)) = word.split_once(':') else {
            return;
        };
        let is_name = |part: &str| {
            part.len() < 64
                && part.starts_with(|c: char| c.is_alphabetic() || c == '_')
                && part
                    .chars()
                    .all(|c| c.is_alphanumeric() || "_-.".contains(c))
        };
        if prefix == "xmlns" {
            self.declared.insert(local);
        } else if is_name(prefix) && is_name(local) && self.used.len() < UNDECLARED_MAX {
            self.used.insert(prefix);
        }
    }
}
