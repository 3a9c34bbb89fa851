//! Elements of a COLLADA file: by name, by reference, and the numbers in them.

use std::collections::HashMap;

use roxmltree::Node;

/// Elements by their name alone: the namespace tells the version only.
pub(super) trait Named<'a, 'input> {
    fn has_tag_name_of(&self, name: &str) -> bool;
    fn child(&self, name: &str) -> Option<Node<'a, 'input>>;
}

impl<'a, 'input> Named<'a, 'input> for Node<'a, 'input> {
    fn has_tag_name_of(&self, name: &str) -> bool {
        self.is_element() && self.tag_name().name() == name
    }

    fn child(&self, name: &str) -> Option<Node<'a, 'input>> {
        self.children().find(|child| child.has_tag_name_of(name))
    }
}

/// Elements by their `id`.
pub(super) type ById<'a, 'input> = HashMap<&'a str, Node<'a, 'input>>;

/// What an element's `url` or `source` refers to.
pub(super) fn referred<'a, 'input>(
    by_id: &ById<'a, 'input>,
    node: Node,
    attribute: &str,
) -> Result<Node<'a, 'input>, String> {
    let url = node.attribute(attribute).unwrap_or_default();
    let element = url.strip_prefix('#').and_then(|id| by_id.get(id));
    element.copied().ok_or_else(|| {
        let name = node.tag_name().name();
        format!("<{name} {attribute}=\"{url}\"> refers to nothing in the file; export it again")
    })
}

/// The numbers in an element's text; none where there is no element.
pub(super) fn numbers<T: std::str::FromStr>(node: Option<Node>) -> Result<Vec<T>, String> {
    let Some(node) = node else {
        return Ok(Vec::new());
    };
    // comments part a text into several
    let texts = node.children().filter_map(|part| match part.is_text() {
        true => part.text(),
        false => None,
    });
    texts
        .flat_map(str::split_ascii_whitespace)
        .map(|word| {
            word.parse().map_err(|_| {
                let name = node.tag_name().name();
                let word: String = word.chars().take(40).collect();
                format!("`{word}` in <{name}> is no number of its kind; export it again")
            })
        })
        .collect()
}
