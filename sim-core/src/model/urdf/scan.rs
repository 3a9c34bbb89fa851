//! What a URDF file says and what it leaves out, before urdf-rs reads the values.
//!
//! urdf-rs gives 0 for an absent `effort` and passes over unknown tags. So the XML is walked along a table of what URDF
//! knows: presence is kept, the unknown is noted, a bad number is refused with its line, and only what the table knows is
//! handed on as text. The walk is as deep as the table, however deep a file nests.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::path::Path;

use roxmltree::{Document, Node, ParsingOptions};

use super::super::error::ModelError;
use super::table::{Attribute, Count, GEOMETRY, Kind, Need, ROBOT, Tag};

/// Elements, texts and comments in a file: a robot of a thousand links has some twenty thousand.
const NODES_MAX: u32 = 1_000_000;
/// Notes on ignored things: more than a person reads.
const IGNORED_MAX: usize = 200;

/// A file's XML, well formed and within limits.
///
/// # Errors
/// Broken XML with line and column; entity definitions and too many nodes are refused.
pub(super) fn parse<'a>(text: &'a str, path: &Path) -> Result<Document<'a>, ModelError> {
    // without a document type there are no entities, so nothing to expand a small file into a large one
    let options = ParsingOptions {
        allow_dtd: false,
        nodes_limit: NODES_MAX,
        ..ParsingOptions::default()
    };
    Document::parse_with_options(text, options).map_err(|error| match error {
        roxmltree::Error::NodesLimitReached => ModelError::TooLarge {
            path: path.to_owned(),
            what: "the number of XML nodes",
            limit: NODES_MAX.to_string(),
        },
        roxmltree::Error::DtdDetected => ModelError::Xml {
            path: path.to_owned(),
            line: 1,
            column: 1,
            reason: "<!DOCTYPE> is refused, since entities can expand without bound; delete it"
                .to_owned(),
        },
        error => {
            let place = error.pos();
            // roxmltree ends its messages with the place, which this error states already
            let text = error.to_string();
            let reason = text
                .strip_suffix(&format!(" at {place}"))
                .unwrap_or(&text)
                .to_owned();
            ModelError::Xml {
                path: path.to_owned(),
                line: place.row,
                column: place.col,
                reason,
            }
        }
    })
}

/// What the walk found.
pub(super) struct Scan<'a, 'input> {
    path: &'a Path,
    document: &'a Document<'input>,
    /// `<link>` elements in file order.
    pub links: Vec<Node<'a, 'input>>,
    /// `<joint>` elements in file order.
    pub joints: Vec<Node<'a, 'input>>,
    /// The elements and attributes that URDF knows, as XML for urdf-rs.
    pub text: String,
    ignored: Vec<Ignored>,
    ignored_at: HashMap<String, usize>,
    /// How often something was ignored that no longer got a note of its own.
    ignored_more: usize,
}

struct Ignored {
    what: String,
    count: usize,
    line: u32,
}

impl<'a, 'input> Scan<'a, 'input> {
    /// Walks a document along the table.
    ///
    /// # Errors
    /// The first element or attribute that is missing, repeated or malformed, with its line.
    pub fn new(document: &'a Document<'input>, path: &'a Path) -> Result<Self, ModelError> {
        let root = document.root_element();
        let mut scan = Scan {
            path,
            document,
            links: Vec::new(),
            joints: Vec::new(),
            text: String::new(),
            ignored: Vec::new(),
            ignored_at: HashMap::new(),
            ignored_more: 0,
        };
        if root.tag_name().name() != ROBOT.name {
            return Err(scan.fault(
                root,
                "the outermost element of a URDF file is <robot>".to_owned(),
            ));
        }
        scan.walk(root, &ROBOT)?;
        Ok(scan)
    }

    fn walk(&mut self, node: Node<'a, 'input>, tag: &'static Tag) -> Result<(), ModelError> {
        if tag.opaque {
            return Ok(());
        }
        match tag.name {
            "link" => self.links.push(node),
            "joint" => self.joints.push(node),
            _ => {}
        }
        self.text.push('<');
        self.text.push_str(tag.name);
        self.attributes(node, tag)?;
        self.text.push('>');
        for child in node.children().filter(Node::is_element) {
            // a prefix makes it another vocabulary's element, such as xacro's
            let own = child.tag_name().namespace() == node.tag_name().namespace();
            let known = tag
                .children
                .iter()
                .find(|(known, _)| own && known.name == child.tag_name().name());
            match known {
                Some((known, _)) => self.walk(child, known)?,
                None => self.ignore(child, format!("<{}>", name_of(child))),
            }
        }
        self.count(node, tag)?;
        let _ = write!(self.text, "</{}>", tag.name);
        Ok(())
    }

    fn attributes(&mut self, node: Node<'a, 'input>, tag: &'static Tag) -> Result<(), ModelError> {
        for attribute in node.attributes() {
            let known = attribute.namespace().is_none()
                && tag
                    .attributes
                    .iter()
                    .any(|known| known.name == attribute.name());
            if !known {
                self.ignore(
                    node,
                    format!("attribute `{}` of <{}>", attribute.name(), tag.name),
                );
            }
        }
        for known in tag.attributes {
            let value = match (node.attribute(known.name), known.need) {
                (Some(value), _) => {
                    self.check(node, known, value)?;
                    value
                }
                (None, Need::Otherwise(value)) => value,
                (None, Need::Optional) => continue,
                (None, Need::Required) => {
                    return Err(self.fault(
                        node,
                        format!("attribute `{}` is missing; add it", known.name),
                    ));
                }
            };
            let _ = write!(self.text, " {}=\"", known.name);
            escape(value, &mut self.text);
            self.text.push('"');
        }
        Ok(())
    }

    /// Refuses an attribute that is not what its kind asks for.
    fn check(&self, node: Node, attribute: &Attribute, value: &str) -> Result<(), ModelError> {
        let (numbers, shape) = match attribute.kind {
            Kind::Text if value.trim().is_empty() && attribute.need == Need::Required => {
                return Err(self.fault(
                    node,
                    format!("attribute `{}` is empty; fill it in", attribute.name),
                ));
            }
            Kind::Text => return Ok(()),
            Kind::Number | Kind::Limit => (1, "one number"),
            Kind::Vector(4) => (4, "four numbers separated by spaces"),
            Kind::Vector(numbers) => (numbers, "three numbers separated by spaces"),
        };
        let parsed: Vec<Option<f64>> = value
            .split_whitespace()
            .map(|part| part.parse().ok())
            .collect();
        let usable = |part: &Option<f64>| {
            part.is_some_and(|part| {
                part.is_finite() || attribute.kind == Kind::Limit && !part.is_nan()
            })
        };
        if parsed.len() == numbers && parsed.iter().all(usable) {
            return Ok(());
        }
        let cure = if value.contains("${") {
            "; expand the file with xacro first"
        } else {
            ""
        };
        let reason = format!(
            "attribute `{}` is \"{value}\", not {shape}, finite{cure}",
            attribute.name
        );
        Err(self.fault(node, reason))
    }

    /// Refuses children that are missing or repeated.
    fn count(&self, node: Node<'a, 'input>, tag: &'static Tag) -> Result<(), ModelError> {
        let mut found = 0;
        for (known, count) in tag.children {
            let times = children(node, known.name).count();
            found += times;
            if times > 1 && *count != Count::Any {
                return Err(self.fault(
                    node,
                    format!("<{}> comes {times} times; leave one", known.name),
                ));
            }
            if times == 0 && *count == Count::One {
                return Err(self.fault(node, format!("<{}> is missing; add it", known.name)));
            }
        }
        if tag.name == GEOMETRY.name && found != 1 {
            let reason = format!(
                "{found} shapes; give one <box>, <sphere>, <cylinder>, <capsule> or <mesh>"
            );
            return Err(self.fault(node, reason));
        }
        Ok(())
    }

    /// Notes that something of this element has no effect; the same thing again is only counted.
    pub fn ignore(&mut self, node: Node<'a, 'input>, what: String) {
        if let Some(&index) = self.ignored_at.get(&what) {
            self.ignored[index].count += 1;
        } else if self.ignored.len() < IGNORED_MAX {
            self.ignored_at.insert(what.clone(), self.ignored.len());
            let line = self.line(node);
            self.ignored.push(Ignored {
                what,
                count: 1,
                line,
            });
        } else {
            self.ignored_more += 1;
        }
    }

    /// One sentence for each thing that was ignored, in the order of the file.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = Vec::new();
        for Ignored { what, count, line } in &self.ignored {
            notes.push(match count {
                1 => format!("{what} is ignored (line {line})"),
                _ => format!("{what} is ignored ({count} times, first in line {line})"),
            });
        }
        if self.ignored_more > 0 {
            notes.push(format!(
                "{} further unknown elements and attributes are ignored",
                self.ignored_more
            ));
        }
        notes
    }

    /// An error about one element.
    pub fn fault(&self, node: Node, reason: String) -> ModelError {
        ModelError::Urdf {
            path: self.path.to_owned(),
            line: self.line(node),
            element: describe(node),
            reason,
        }
    }

    fn line(&self, node: Node) -> u32 {
        self.document.text_pos_at(node.range().start).row
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

/// Such as ``<limit> of joint `elbow` ``.
fn describe(node: Node) -> String {
    let own = format!("<{}>", name_of(node));
    for ancestor in node.ancestors() {
        let kind = ancestor.tag_name().name();
        if let Some(name) = ancestor
            .attribute("name")
            .filter(|_| kind == "link" || kind == "joint")
        {
            return if ancestor == node {
                format!("{own} `{name}`")
            } else {
                format!("{own} of {kind} `{name}`")
            };
        }
    }
    own
}

/// The element's name with the prefix it is written with.
fn name_of<'a>(node: Node<'a, '_>) -> String {
    let name = node.tag_name().name();
    let prefix = node
        .tag_name()
        .namespace()
        .and_then(|namespace| node.lookup_prefix(namespace));
    match prefix {
        Some(prefix) if !prefix.is_empty() => format!("{prefix}:{name}"),
        _ => name.to_owned(),
    }
}

fn escape(value: &str, text: &mut String) {
    for character in value.chars() {
        match character {
            '&' => text.push_str("&amp;"),
            '<' => text.push_str("&lt;"),
            '>' => text.push_str("&gt;"),
            '"' => text.push_str("&quot;"),
            '\'' => text.push_str("&apos;"),
            character => text.push(character),
        }
    }
}
