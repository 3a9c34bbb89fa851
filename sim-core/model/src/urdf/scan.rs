//! What a URDF file says and what it leaves out, before urdf-rs reads the values.
//!
//! urdf-rs gives 0 for an absent `effort` and passes over unknown tags. So the XML is walked along a table of what URDF
//! knows: presence is kept, the unknown is noted, a bad value is refused with its line, and only what the table knows is
//! handed on as text. The walk is as deep as the table, however deep a file nests.

use std::collections::{BTreeSet, HashMap};
use std::fmt::Write as _;
use std::path::Path;

use roxmltree::{Document, Node};

use super::table::{Attribute, Count, GEOMETRY, Need, ORIGIN, PLACES, ROBOT, Tag};
use super::value;
pub(super) use super::xml::{children, has};
use super::xml::{describe, escape, name_of, prefix_of, same, short};
use crate::error::ModelError;

/// Notes on ignored things: more than a person reads.
const IGNORED_MAX: usize = 200;
/// Most elements in a warning.
const LISTED_MAX: usize = 8;
/// Most links and most joints of a robot: reading them stays below a second.
const LINKS_MAX: usize = 4096;
/// Most collisions and most visuals of a robot, for the same reason.
const SHAPES_MAX: usize = 10_000;

/// What the walk found.
pub(super) struct Scan<'a, 'input> {
    path: &'a Path,
    document: &'a Document<'input>,
    /// `<link>` elements in file order.
    pub links: Vec<Node<'a, 'input>>,
    /// `<joint>` elements in file order.
    pub joints: Vec<Node<'a, 'input>>,
    /// Number of `<collision>` elements.
    collisions: usize,
    /// Number of `<visual>` elements.
    visuals: usize,
    /// The elements and attributes that URDF knows, as XML for urdf-rs.
    pub text: String,
    /// Whether `quat_xyzw` counts: from URDF 1.1 on.
    has_quaternions: bool,
    /// Names of the macros of xacro that the file defines.
    macros: BTreeSet<&'a str>,
    /// Whether there are elements of xacro.
    has_xacro: bool,
    /// Elements that call a macro that is not defined.
    undefined: BTreeSet<String>,
    ignored: Vec<Ignored>,
    ignored_at: HashMap<String, usize>,
    /// How often something was ignored that no longer got a note of its own.
    ignored_more: usize,
}

struct Ignored {
    what: String,
    count: usize,
    /// From the start of the text [bytes].
    at: usize,
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
            collisions: 0,
            visuals: 0,
            text: String::new(),
            has_quaternions: false,
            macros: macros(document),
            has_xacro: false,
            undefined: BTreeSet::new(),
            ignored: Vec::new(),
            ignored_at: HashMap::new(),
            ignored_more: 0,
        };
        if root.tag_name().name() != ROBOT.name {
            let cure = match root.tag_name().name() {
                "sdf" => "this is SDFormat; convert it to URDF first",
                "mujoco" | "mujocoinclude" => "this is MuJoCo's MJCF; give the URDF file",
                "COLLADA" => "this is a COLLADA mesh; give the URDF file that names it",
                "launch" | "package" => "this is a file of ROS; give the URDF file",
                _ if is_xacro(root) => {
                    "is an element of xacro; run `xacro` on the file and load what it prints"
                }
                _ => {
                    "a URDF file holds one <robot>, and all else in it; write <robot name=\"…\"> around"
                }
            };
            return Err(scan.fault(root, cure.to_owned()));
        }
        scan.version(root);
        scan.walk(root, &ROBOT)?;
        if scan.links.is_empty() && scan.has_xacro {
            let reason = "holds elements of xacro and no links; run `xacro` on the file that uses them and load what it prints";
            return Err(scan.fault(root, reason.to_owned()));
        }
        Ok(scan)
    }

    /// URDF 1.1 and 1.2 add to 1.0, which stands where no version is given.
    fn version(&mut self, root: Node<'a, 'input>) {
        let Some(version) = root.attribute("version").map(str::trim) else {
            return;
        };
        self.has_quaternions = matches!(version, "1.1" | "1.2");
        if !matches!(version, "1" | "1.0" | "1.1" | "1.2") {
            let version = short(version);
            self.ignore(root, format!("unknown version `{version}` of URDF"));
        }
    }

    fn walk(&mut self, node: Node<'a, 'input>, tag: &'static Tag) -> Result<(), ModelError> {
        match tag.name {
            "link" => self.links.push(node),
            "joint" => self.joints.push(node),
            "collision" => self.collisions += 1,
            "visual" => self.visuals += 1,
            _ => {}
        }
        let limits = [
            ("the number of links", self.links.len(), LINKS_MAX),
            ("the number of joints", self.joints.len(), LINKS_MAX),
            ("the number of collisions", self.collisions, SHAPES_MAX),
            ("the number of visuals", self.visuals, SHAPES_MAX),
        ];
        if let Some((what, _, most)) = limits.iter().find(|(_, found, most)| found > most) {
            return Err(ModelError::TooLarge {
                path: self.path.to_owned(),
                what,
                limit: most.to_string(),
            });
        }
        if tag.opaque {
            return Ok(());
        }
        self.text.push('<');
        self.text.push_str(tag.name);
        self.attributes(node, tag)?;
        self.text.push('>');
        let mut first: Vec<Option<Node>> = vec![None; tag.children.len()];
        for child in node.children().filter(Node::is_element) {
            // a prefix makes it another vocabulary's element, such as xacro's
            let own = child.tag_name().namespace() == node.tag_name().namespace();
            let known = tag
                .children
                .iter()
                .position(|(known, _)| own && known.name == child.tag_name().name());
            let Some(place) = known else {
                self.unknown(node, child, own)?;
                continue;
            };
            let (known, count) = tag.children[place];
            match first[place] {
                Some(earlier) if count != Count::Any => {
                    if !same(earlier, child) {
                        let (name, line) = (known.name, self.line(earlier));
                        let reason =
                            format!("another <{name}> stands in line {line}; leave one of the two");
                        return Err(self.fault(child, reason));
                    }
                    self.ignore(child, format!("second <{}>, the same again,", known.name));
                }
                _ => {
                    first[place] = Some(child);
                    self.walk(child, known)?;
                }
            }
        }
        for ((known, count), found) in tag.children.iter().zip(&first) {
            if *count == Count::One && found.is_none() {
                let reason = format!("<{}> is missing; add it", known.name);
                return Err(self.fault(node, reason));
            }
        }
        if tag.name == GEOMETRY.name {
            self.shapes(node, first.iter().flatten().count())?;
        }
        let _ = write!(self.text, "</{}>", tag.name);
        Ok(())
    }

    /// Refuses a geometry that is not one shape.
    fn shapes(&self, node: Node, found: usize) -> Result<(), ModelError> {
        if found == 1 {
            return Ok(());
        }
        let cure = "give one <box>, <sphere>, <cylinder>, <capsule> or <mesh>";
        let unknown = node.children().find(Node::is_element);
        let reason = match unknown.filter(|_| found == 0) {
            Some(shape) => format!("<{}> is no shape that is known; {cure}", name_of(shape)),
            None => format!("{found} shapes; {cure}"),
        };
        Err(self.fault(node, reason))
    }

    /// Notes an element that URDF does not have here, or refuses it if the robot would lack something.
    fn unknown(
        &mut self,
        parent: Node<'a, 'input>,
        child: Node<'a, 'input>,
        own: bool,
    ) -> Result<(), ModelError> {
        let name = child.tag_name().name();
        if !own && is_xacro(child) {
            return self.leftover(child);
        }
        let place = PLACES
            .iter()
            .find(|(known, _)| known.eq_ignore_ascii_case(name));
        let Some((known, place)) = place.filter(|_| own) else {
            self.ignore(child, format!("<{}>", name_of(child)));
            return Ok(());
        };
        let parent = name_of(parent);
        Err(self.fault(
            child,
            match *known == name {
                true => format!("has no place in <{parent}>; move it into {place}"),
                false => format!("is not an element of URDF; write <{known}>"),
            },
        ))
    }

    /// Notes an element of xacro that does nothing, or refuses one in whose place xacro would have put something.
    fn leftover(&mut self, node: Node<'a, 'input>) -> Result<(), ModelError> {
        self.has_xacro = true;
        let name = node.tag_name().name();
        let is_definition = matches!(name, "property" | "macro" | "arg");
        let is_builtin = [
            "include",
            "if",
            "unless",
            "call",
            "insert_block",
            "element",
            "attribute",
        ]
        .contains(&name);
        if is_builtin || self.macros.contains(name) {
            let reason = "is left from xacro; run `xacro` on the file and load what it prints";
            return Err(self.fault(node, reason.to_owned()));
        }
        let called = name_of(node);
        self.ignore(node, format!("<{called}>"));
        // xacro itself could make nothing of it
        if !is_definition && self.undefined.len() < LISTED_MAX {
            self.undefined.insert(called);
        }
        Ok(())
    }

    /// One warning of all macros that are called but nowhere defined.
    pub fn warnings(&self) -> Vec<String> {
        if self.undefined.is_empty() {
            return Vec::new();
        }
        let names: Vec<String> = self
            .undefined
            .iter()
            .map(|name| format!("<{name}>"))
            .collect();
        vec![format!(
            "macros of xacro are called but nowhere defined, so what they would make is missing: {}; delete the calls, or \
             expand the file with xacro where their definitions are",
            names.join(", ")
        )]
    }

    fn attributes(&mut self, node: Node<'a, 'input>, tag: &'static Tag) -> Result<(), ModelError> {
        for attribute in node.attributes() {
            let known = attribute.namespace().is_none()
                && tag
                    .attributes
                    .iter()
                    .any(|known| known.name == attribute.name());
            if !known {
                let name = short(attribute.name());
                self.ignore(node, format!("attribute `{name}` of <{}>", tag.name));
            }
        }
        for known in tag.attributes {
            let text = match (node.attribute(known.name), known.need) {
                (Some(value), _) => {
                    let value =
                        value::read(known, value).map_err(|reason| self.fault(node, reason))?;
                    if value.commas {
                        let name = known.name;
                        self.ignore(
                            node,
                            format!("comma in attribute `{name}` of <{}>", tag.name),
                        );
                    }
                    value.text
                }
                (None, Need::Otherwise(value)) => value.to_owned(),
                (None, Need::Optional) => continue,
                (None, Need::Required) => {
                    let end = if tag.children.is_empty() { "/" } else { "" };
                    let (name, tag) = (known.name, tag.name);
                    let reason =
                        format!("attribute `{name}` is missing; write <{tag} {name}=\"…\"{end}>");
                    return Err(self.fault(node, reason));
                }
            };
            match known.name {
                // the reader knows all versions that urdf-rs would tell apart
                "version" => {}
                "quat_xyzw" => self.quaternion(node, &text)?,
                _ => self.write(known, &text),
            }
        }
        Ok(())
    }

    fn write(&mut self, attribute: &Attribute, value: &str) {
        let _ = write!(self.text, " {}=\"", attribute.name);
        escape(value, &mut self.text);
        self.text.push('"');
    }

    /// Hands an origin's quaternion on as angles, right to rounding; urdf-rs' own are not near a pitch of 90°.
    fn quaternion(&mut self, node: Node<'a, 'input>, text: &str) -> Result<(), ModelError> {
        if !self.has_quaternions {
            let what = "attribute `quat_xyzw` of <origin>, without version=\"1.1\" of <robot>,";
            self.ignore(node, what.to_owned());
            return Ok(());
        }
        if node.has_attribute("rpy") {
            let reason = "attributes `rpy` and `quat_xyzw` are both given; leave one";
            return Err(self.fault(node, reason.to_owned()));
        }
        let mut numbers = text.split(' ').filter_map(|part| part.parse::<f64>().ok());
        let quat = std::array::from_fn(|_| numbers.next().unwrap_or(0.0));
        let Some([roll, pitch, yaw]) = value::rpy_of_quat(quat) else {
            let reason = "attribute `quat_xyzw` is zero; give x, y, z, w of length 1";
            return Err(self.fault(node, reason.to_owned()));
        };
        let rpy = ORIGIN.attributes.iter().find(|known| known.name == "rpy");
        let rpy = rpy.expect("an origin has rpy");
        self.write(rpy, &format!("{roll} {pitch} {yaw}"));
        Ok(())
    }

    /// Notes that something of this element has no effect; the same thing again is only counted.
    pub fn ignore(&mut self, node: Node<'a, 'input>, what: String) {
        if let Some(&index) = self.ignored_at.get(&what) {
            self.ignored[index].count += 1;
        } else if self.ignored.len() < IGNORED_MAX {
            self.ignored_at.insert(what.clone(), self.ignored.len());
            let at = node.range().start;
            self.ignored.push(Ignored { what, count: 1, at });
        } else {
            self.ignored_more += 1;
        }
    }

    /// One sentence for each thing that was ignored, in the order in which it was met.
    pub fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = Vec::new();
        let lines = self.lines(self.ignored.iter().map(|ignored| ignored.at).collect());
        for (Ignored { what, count, .. }, line) in self.ignored.iter().zip(lines) {
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

    /// The lines of these places, in one pass over the text.
    fn lines(&self, places: Vec<usize>) -> Vec<usize> {
        let text = self.document.input_text().as_bytes();
        let mut order: Vec<usize> = (0..places.len()).collect();
        order.sort_by_key(|&index| places[index]);
        let mut lines = vec![0; places.len()];
        let (mut line, mut from) = (1, 0);
        for index in order {
            let passed = &text[from..places[index]];
            line += passed.iter().filter(|&&byte| byte == b'\n').count();
            from = places[index];
            lines[index] = line;
        }
        lines
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

    /// An error about the robot, with the file and the line of the element that it is about.
    pub fn place(&self, node: Node, error: ModelError) -> ModelError {
        match error {
            error @ (ModelError::Urdf { .. } | ModelError::InFile { .. }) => error,
            error => ModelError::InFile {
                path: self.path.to_owned(),
                line: self.line(node),
                error: Box::new(error),
            },
        }
    }

    /// Whether `quat_xyzw` counts.
    pub fn has_quaternions(&self) -> bool {
        self.has_quaternions
    }

    /// The outermost element.
    pub fn root(&self) -> Node<'a, 'input> {
        self.document.root_element()
    }

    fn line(&self, node: Node) -> u32 {
        self.document.text_pos_at(node.range().start).row
    }
}

fn is_xacro(node: Node) -> bool {
    let namespace = node.tag_name().namespace().unwrap_or_default();
    prefix_of(node) == Some("xacro") || namespace.contains("xacro")
}

/// Names of the macros that a document defines.
fn macros<'a>(document: &'a Document) -> BTreeSet<&'a str> {
    let nodes = document.descendants();
    nodes
        .filter(|node| node.tag_name().name() == "macro" && is_xacro(*node))
        .filter_map(|node| node.attribute("name"))
        .collect()
}
