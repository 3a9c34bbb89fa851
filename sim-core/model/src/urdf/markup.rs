//! A rough walk over the tags of a file, before the XML parser: it also works on files that the parser refuses.

use std::collections::BTreeSet;
use std::ops::Range;

/// Most attributes of one element: the parser compares each with each.
pub(super) const ATTRIBUTES_OF_ONE_MAX: usize = 64;
/// Most prefixes that the reader declares because the file does not. CAD exporters leave one or two.
const UNDECLARED_MAX: usize = 16;

/// Whether a text starts with these letters, in upper or lower case.
pub(super) fn starts_with(text: &str, ascii: &str) -> bool {
    text.get(..ascii.len())
        .is_some_and(|start| start.eq_ignore_ascii_case(ascii))
}

/// What a walk from one `<` to the next finds. It is exact for well-formed XML; the parser refuses the rest.
#[derive(Default)]
pub(super) struct Markup<'a> {
    pub document_type: Option<usize>,
    /// XML declarations after the first byte.
    pub late_declarations: Vec<usize>,
    /// XML declarations, and comments with `--`: they mean nothing, and the parser refuses them.
    pub blank: Vec<Range<usize>>,
    /// Where the name of the outermost element ends.
    pub root_name_end: usize,
    pub tags: usize,
    pub attributes: usize,
    pub namespaces: usize,
    /// An element with too many attributes.
    pub flood: Option<usize>,
    pub used: BTreeSet<&'a str>,
    pub declared: BTreeSet<&'a str>,
}

impl<'a> Markup<'a> {
    pub fn from_text(text: &'a str) -> Markup<'a> {
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
            // where the mark starts and ends; the parser refuses what never ends
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
                // the parser refuses a `<` here
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
