//! Elements of xacro that are left in a URDF file: some do nothing, others stand for parts that are missing.

use std::collections::BTreeSet;

use roxmltree::{Document, Node};

use super::xml::{name_of, prefix_of};

/// Most elements in a warning.
const LISTED_MAX: usize = 8;

/// What a file has of xacro.
pub(super) struct Xacro<'a> {
    /// Names of the macros that the file defines.
    macros: BTreeSet<&'a str>,
    /// Whether there are elements of xacro inside the robot.
    is_used: bool,
    /// Elements that call a macro that is not defined.
    undefined: BTreeSet<String>,
}

impl<'a> Xacro<'a> {
    /// Finds the macros that a document defines.
    pub fn new(document: &'a Document) -> Xacro<'a> {
        let nodes = document.descendants();
        let macros = nodes
            .filter(|node| node.tag_name().name() == "macro" && is_xacro(*node))
            .filter_map(|node| node.attribute("name"))
            .collect();
        Xacro {
            macros,
            is_used: false,
            undefined: BTreeSet::new(),
        }
    }

    /// Whether [`Xacro::leftover`] met an element.
    pub fn is_used(&self) -> bool {
        self.is_used
    }

    /// The name of an element of xacro that does nothing.
    ///
    /// # Errors
    /// The cure for an element in whose place xacro would put something.
    pub fn leftover(&mut self, node: Node) -> Result<String, String> {
        self.is_used = true;
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
            return Err(reason.to_owned());
        }
        let called = name_of(node);
        let what = format!("<{called}>");
        // xacro itself could not expand it
        if !is_definition && self.undefined.len() < LISTED_MAX {
            self.undefined.insert(called);
        }
        Ok(what)
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
}

/// Whether an element is of xacro's vocabulary.
pub(super) fn is_xacro(node: Node) -> bool {
    let namespace = node.tag_name().namespace().unwrap_or_default();
    prefix_of(node) == Some("xacro") || namespace.contains("xacro")
}
