//! XML as URDF uses it: syntax errors in plain words, children by name, and how messages name an element.

use std::path::Path;

use roxmltree::{Document, Error, Node, ParsingOptions};

use crate::error::ModelError;

/// Longest name or value that a message quotes whole [characters].
const QUOTED_MAX: usize = 80;

/// Parses a text that went through [`super::source::prepare`].
///
/// # Errors
/// Broken XML with line and column.
pub(super) fn parse<'a>(text: &'a str, path: &Path) -> Result<Document<'a>, ModelError> {
    // without a document type there are no entities, so nothing to expand a small file into a large one
    let options = ParsingOptions {
        allow_dtd: false,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(text, options).map_err(|error| {
        let place = error.pos();
        // roxmltree gives the start where it means the end
        let at_end = matches!(
            error,
            Error::UnclosedRootNode | Error::UnexpectedEndOfStream
        );
        let (line, column) = match at_end {
            true => (text.lines().count().max(1) as u32, 1),
            false => (place.row, place.col),
        };
        ModelError::Xml {
            path: path.to_owned(),
            line,
            column,
            reason: explain(&error),
        }
    })
}

/// What is wrong, and the cure.
fn explain(error: &Error) -> String {
    match error {
        Error::NoRootNode => "there is no element; a URDF file holds one <robot>".to_owned(),
        Error::UnclosedRootNode | Error::UnexpectedEndOfStream => {
            "the file ends before its elements do; it is cut short, or a closing tag is missing".to_owned()
        }
        Error::UnexpectedCloseTag(expected, actual, _) => {
            let (expected, actual) = (short(expected), short(actual));
            format!("</{actual}> comes where <{expected}> is still open; close <{expected}> before it")
        }
        Error::DuplicatedAttribute(name, _) => {
            format!("attribute `{}` is given twice; leave one", short(name))
        }
        Error::DuplicatedNamespace(name, _) => {
            format!("prefix `{}` is declared twice; leave one", short(name))
        }
        Error::UnknownNamespace(prefix, _) => {
            let prefix = short(prefix);
            format!("prefix `{prefix}` is not declared; add xmlns:{prefix}=\"…\" to <robot>")
        }
        Error::UnknownEntityReference(name, _) => {
            let name = short(name);
            format!("entity `&{name};` is unknown; write out what it stands for")
        }
        Error::MalformedEntityReference(_) => {
            "`&` begins nothing that XML knows; write &amp; for a bare one".to_owned()
        }
        Error::InvalidAttributeValue(_) => {
            "`<` in the value of an attribute; write &lt; for it, or close the quotes before it".to_owned()
        }
        Error::NonXmlChar(character, _) => {
            format!("character U+{:04X} cannot be in XML; delete it", u32::from(*character))
        }
        Error::UnknownToken(_) => {
            "this is outside of the outermost element; a URDF file holds one <robot> and nothing else".to_owned()
        }
        Error::InvalidName(_) => "a name is expected; mend what stands here".to_owned(),
        Error::InvalidChar(expected, actual, _) => {
            let (expected, actual) = (char::from(*expected), char::from(*actual).escape_debug());
            format!("`{expected}` is expected here, not `{actual}`; mend what stands here")
        }
        Error::InvalidChar2(expected, actual, _) => {
            let actual = char::from(*actual).escape_debug();
            format!("{expected} is expected here, not `{actual}`; mend what stands here")
        }
        error => {
            // roxmltree ends its messages with the place, which the caller states already
            let text = error.to_string();
            let text = text.strip_suffix(&format!(" at {}", error.pos())).unwrap_or(&text);
            format!("{text}; mend what stands here")
        }
    }
}

/// Child elements of this name in the same vocabulary.
pub(super) fn children<'a, 'input>(
    node: Node<'a, 'input>,
    name: &'static str,
) -> impl Iterator<Item = Node<'a, 'input>> {
    let namespace = node.tag_name().namespace();
    node.children().filter(move |child| {
        child.is_element()
            && child.tag_name().name() == name
            && child.tag_name().namespace() == namespace
    })
}

/// Whether an element has a child with this attribute.
pub(super) fn has(node: Node, child: &'static str, attribute: &str) -> bool {
    children(node, child).any(|child| child.has_attribute(attribute))
}

/// Whether two elements say the same: the same attributes, and nothing inside.
pub(super) fn same(first: Node, other: Node) -> bool {
    let attributes = |node: Node| -> Vec<(String, String)> {
        let mut all: Vec<_> = node
            .attributes()
            .map(|attribute| (attribute.name().to_owned(), attribute.value().to_owned()))
            .collect();
        all.sort();
        all
    };
    let is_leaf = |node: Node| !node.children().any(|child| child.is_element());
    is_leaf(first) && is_leaf(other) && attributes(first) == attributes(other)
}

/// Such as ``<limit> of joint `elbow` ``.
pub(super) fn describe(node: Node) -> String {
    let element = format!("<{}>", name_of(node));
    for ancestor in node.ancestors() {
        let kind = ancestor.tag_name().name();
        if let Some(name) = ancestor
            .attribute("name")
            .filter(|name| matches!(kind, "link" | "joint") && !name.is_empty())
        {
            let name = short(name);
            return if ancestor == node {
                format!("{element} `{name}`")
            } else {
                format!("{element} of {kind} `{name}`")
            };
        }
    }
    element
}

/// The element's name with the prefix it is written with.
pub(super) fn name_of(node: Node) -> String {
    let name = short(node.tag_name().name());
    match prefix_of(node) {
        Some(prefix) if !prefix.is_empty() => format!("{}:{name}", short(prefix)),
        _ => name,
    }
}

/// The prefix of an element's vocabulary.
pub(super) fn prefix_of<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    node.tag_name()
        .namespace()
        .and_then(|namespace| node.lookup_prefix(namespace))
}

/// A text from a file, made printable and cut to what a message can hold.
pub(super) fn short(text: &str) -> String {
    let (shown, more) = match text.char_indices().nth(QUOTED_MAX) {
        Some((end, _)) => (&text[..end], "…"),
        None => (text, ""),
    };
    let printable = |c: char| match c.is_control() {
        true => c.escape_debug().to_string(),
        false => c.to_string(),
    };
    shown.chars().map(printable).collect::<String>() + more
}
