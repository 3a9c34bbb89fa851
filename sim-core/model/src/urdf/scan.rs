//! One walk over the XML of a URDF file, along the table of what URDF knows.
//!
//! urdf-rs reads values: it gives 0 for an absent `effort` and ignores unknown tags. So the walk keeps which attributes are
//! present, notes what is unknown, refuses a bad value with its line, and hands on only what the table knows. It goes as
//! deep as the table, however deep a file nests.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use roxmltree::{Document, Node, NodeId};

use super::element::Element;
use super::ignored::Ignored;
use super::mistakes::{self, Mistakes};
use super::table::{Count, GEOMETRY, Kind, Need, PLACES, ROBOT, Tag};
use super::value;
use super::xacro::{Xacro, is_xacro};
pub(super) use super::xml::{children, has};
use super::xml::{describe, name_of, same, short};
use crate::error::ModelError;

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
    /// The `<robot>` with the elements and attributes that URDF knows.
    pub robot: Element<'a>,
    /// Whether `quat_xyzw` counts: from URDF 1.1 on.
    has_quaternions: bool,
    /// Roll, pitch and yaw [rad] of each `<origin>` that gives a quaternion instead.
    angles: HashMap<NodeId, [f64; 3]>,
    xacro: Xacro<'a>,
    ignored: Ignored,
    /// What was probably not meant.
    pub mistakes: Mistakes,
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
            robot: Element::empty(&ROBOT),
            has_quaternions: false,
            angles: HashMap::new(),
            xacro: Xacro::new(document),
            ignored: Ignored::default(),
            mistakes: Mistakes::default(),
        };
        if root.tag_name().name() != ROBOT.name {
            let cure = match root.tag_name().name() {
                "sdf" => "this is SDFormat; convert it to URDF first",
                "mujoco" | "mujocoinclude" => {
                    "this is MuJoCo's MJCF; read it with the Python package, by `Scene.from_mujoco` or its `tightloop`"
                }
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
        scan.robot = scan.walk(root, &ROBOT)?;
        if scan.links.is_empty() && scan.xacro.is_used() {
            let reason = "holds elements of xacro and no links; run `xacro` on the file that uses them and load what it prints";
            return Err(scan.fault(root, reason.to_owned()));
        }
        Ok(scan)
    }

    /// URDF 1.1 and 1.2 add to 1.0, which holds where no version is given.
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

    fn walk(
        &mut self,
        node: Node<'a, 'input>,
        tag: &'static Tag,
    ) -> Result<Element<'a>, ModelError> {
        self.count(node, tag)?;
        let mut element = Element::empty(tag);
        if tag.opaque {
            return Ok(element);
        }
        self.attributes(node, tag, &mut element)?;
        let mut first: Vec<Option<Node>> = vec![None; tag.children.len()];
        for child in node.children().filter(Node::is_element) {
            // a prefix makes it another vocabulary's element, such as xacro's
            let has_same_namespace = child.tag_name().namespace() == node.tag_name().namespace();
            let known = tag
                .children
                .iter()
                .position(|(known, _)| has_same_namespace && known.name == child.tag_name().name());
            let Some(place) = known else {
                self.unknown(node, child, has_same_namespace, tag)?;
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
                    let child = self.walk(child, known)?;
                    if !known.opaque {
                        element.children.push(child);
                    }
                }
            }
        }
        for ((known, count), seen) in tag.children.iter().zip(&first) {
            if *count == Count::One && seen.is_none() {
                let reason = format!("<{}> is missing; add it", known.name);
                return Err(self.fault(node, reason));
            }
        }
        if tag.name == GEOMETRY.name {
            self.shapes(node, first.iter().flatten().count())?;
        }
        Ok(element)
    }

    /// Keeps links and joints, and refuses a robot with too many parts.
    fn count(&mut self, node: Node<'a, 'input>, tag: &'static Tag) -> Result<(), ModelError> {
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
        match limits.iter().find(|(_, count, most)| count > most) {
            Some((what, _, most)) => Err(ModelError::TooLarge {
                path: self.path.to_owned(),
                what,
                limit: most.to_string(),
            }),
            None => Ok(()),
        }
    }

    /// Refuses a geometry that is not one shape.
    fn shapes(&self, node: Node, count: usize) -> Result<(), ModelError> {
        if count == 1 {
            return Ok(());
        }
        let cure = "give one <box>, <sphere>, <cylinder>, <capsule> or <mesh>";
        let unknown = node.children().find(Node::is_element);
        let reason = match unknown.filter(|_| count == 0) {
            Some(shape) => format!("<{}> is no shape that is known; {cure}", name_of(shape)),
            None => format!("{count} shapes; {cure}"),
        };
        Err(self.fault(node, reason))
    }

    /// Notes an element that URDF does not have here, or refuses it if the robot would lack something.
    fn unknown(
        &mut self,
        parent: Node<'a, 'input>,
        child: Node<'a, 'input>,
        has_same_namespace: bool,
        tag: &'static Tag,
    ) -> Result<(), ModelError> {
        let name = child.tag_name().name();
        if !has_same_namespace && is_xacro(child) {
            let left = self.xacro.leftover(child);
            let what = left.map_err(|reason| self.fault(child, reason))?;
            self.ignore(child, what);
            return Ok(());
        }
        if name == "include" && !has_same_namespace {
            let reason = "is not followed; write what it includes into this file";
            return Err(self.fault(child, reason.to_owned()));
        }
        let place = PLACES
            .iter()
            .find(|(known, _)| known.eq_ignore_ascii_case(name));
        let Some((known, place)) = place.filter(|_| has_same_namespace) else {
            let what = format!("<{}>", name_of(child));
            let absent = tag.children.iter().filter(|(known, count)| {
                *count == Count::Any || children(parent, known.name).next().is_none()
            });
            let absent: Vec<&str> = absent.map(|(known, _)| known.name).collect();
            if let Some(meant) =
                mistakes::meant(tag.name, name, &absent).filter(|_| has_same_namespace)
            {
                let (document, meant) = (self.document, format!("<{meant}>"));
                self.mistakes
                    .misspelt(&what, || line_of(document, child), &meant);
            }
            self.ignore(child, what);
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

    fn attributes(
        &mut self,
        node: Node<'a, 'input>,
        tag: &'static Tag,
        element: &mut Element<'a>,
    ) -> Result<(), ModelError> {
        for attribute in node.attributes() {
            let known = attribute.namespace().is_none()
                && tag
                    .attributes
                    .iter()
                    .any(|known| known.name == attribute.name());
            if !known {
                let name = short(attribute.name());
                let what = format!("attribute `{name}` of <{}>", tag.name);
                let absent = tag
                    .attributes
                    .iter()
                    .map(|known| known.name)
                    .filter(|known| !node.has_attribute(*known));
                let absent: Vec<&str> = absent.collect();
                let meant = mistakes::meant(tag.name, &name, &absent);
                if let Some(meant) = meant.filter(|_| attribute.namespace().is_none()) {
                    let (document, meant) = (self.document, format!("`{meant}`"));
                    self.mistakes
                        .misspelt(&what, || line_of(document, node), &meant);
                }
                self.ignore(node, what);
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
                    if known.kind == Kind::Angles {
                        let [roll, pitch, yaw, _] = value.numbers;
                        let document = self.document;
                        self.mistakes.angles([roll, pitch, yaw], || {
                            (describe(node), line_of(document, node))
                        });
                    }
                    if known.name == "quat_xyzw" {
                        self.quaternion(node, value.numbers)?;
                        continue;
                    }
                    value.text
                }
                (None, Need::Otherwise(value)) => Cow::Borrowed(value),
                (None, Need::Optional) => continue,
                (None, Need::Required) => {
                    let end = if tag.children.is_empty() { "/" } else { "" };
                    let (name, tag) = (known.name, tag.name);
                    let reason =
                        format!("attribute `{name}` is missing; write <{tag} {name}=\"…\"{end}>");
                    return Err(self.fault(node, reason));
                }
            };
            element.attributes.push((known.name, text));
        }
        Ok(())
    }

    /// Keeps the angles of an origin's quaternion; urdf-rs knows angles only.
    fn quaternion(&mut self, node: Node<'a, 'input>, quat: [f64; 4]) -> Result<(), ModelError> {
        if !self.has_quaternions {
            let what = "attribute `quat_xyzw` of <origin>, without version=\"1.1\" of <robot>,";
            self.ignore(node, what.to_owned());
            return Ok(());
        }
        if node.has_attribute("rpy") {
            let reason = "attributes `rpy` and `quat_xyzw` are both given; leave one";
            return Err(self.fault(node, reason.to_owned()));
        }
        let Some(angles) = value::rpy_of_quat(quat) else {
            let reason = "attribute `quat_xyzw` is zero; give x, y, z, w of length 1";
            return Err(self.fault(node, reason.to_owned()));
        };
        self.angles.insert(node.id(), angles);
        Ok(())
    }

    /// Roll, pitch and yaw [rad] of the quaternion in an element's origin, if it gives one.
    pub fn angles(&self, node: Node) -> Option<[f64; 3]> {
        if self.angles.is_empty() {
            return None;
        }
        let origin = children(node, "origin").next()?;
        self.angles.get(&origin.id()).copied()
    }

    /// Notes that something of this element has no effect; the same thing again is only counted.
    pub fn ignore(&mut self, node: Node<'a, 'input>, what: String) {
        self.ignored.add(what, node.range().start);
    }

    /// One sentence for each thing that was ignored, in the order in which it was met.
    pub fn notes(&self) -> Vec<String> {
        self.ignored.notes(self.document.input_text())
    }

    /// What of xacro changes the robot, and what was probably not meant.
    pub fn warnings(&self) -> Vec<String> {
        [self.xacro.warnings(), self.mistakes.warnings()].concat()
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
        line_of(self.document, node)
    }
}

/// The line of an element, counted from the start of the text.
fn line_of(document: &Document, node: Node) -> u32 {
    document.text_pos_at(node.range().start).row
}
