//! The triangles of one COLLADA geometry.

use std::collections::HashMap;

use roxmltree::{Node, NodeId};

use super::{Limits, RawMesh};

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
    let found = url.strip_prefix('#').and_then(|id| by_id.get(id));
    found.copied().ok_or_else(|| {
        let name = node.tag_name().name();
        format!("<{name} {attribute}=\"{url}\"> refers to nothing in the file; export it again")
    })
}

/// The triangles of a `<geometry>`, in its own frame; none where it is no mesh.
pub(super) fn read<'a, 'input>(
    geometry: Node<'a, 'input>,
    by_id: &ById<'a, 'input>,
    limits: Limits,
) -> Result<RawMesh, String> {
    let mut reader = Geometry {
        by_id,
        limits,
        mesh: RawMesh::default(),
        sources: HashMap::new(),
    };
    let parts = geometry
        .child("mesh")
        .into_iter()
        .flat_map(|mesh| mesh.children());
    for part in parts.filter(Node::is_element) {
        let kind = part.tag_name().name();
        if matches!(
            kind,
            "triangles" | "polylist" | "polygons" | "tristrips" | "trifans"
        ) {
            reader.part(part)?;
        }
    }
    Ok(reader.mesh)
}

struct Geometry<'b, 'a, 'input> {
    by_id: &'b ById<'a, 'input>,
    limits: Limits,
    mesh: RawMesh,
    /// Index of the first point of a source, and how many it has.
    sources: HashMap<NodeId, (u32, usize)>,
}

impl<'a, 'input> Geometry<'_, 'a, 'input> {
    /// Triangles or polygons that share their vertices' list.
    fn part(&mut self, part: Node<'a, 'input>) -> Result<(), String> {
        let inputs: Vec<Node> = part
            .children()
            .filter(|node| node.has_tag_name_of("input"))
            .collect();
        let offset = |input: &Node| {
            input
                .attribute("offset")
                .and_then(|text| text.trim().parse().ok())
                .unwrap_or(0)
        };
        let stride = inputs
            .iter()
            .map(&offset)
            .max()
            .map_or(1, |last: u16| usize::from(last) + 1);
        let Some(vertices) = inputs
            .iter()
            .find(|input| input.attribute("semantic") == Some("VERTEX"))
        else {
            return Ok(()); // nothing to show
        };
        let vertex_offset = usize::from(offset(vertices));
        let list = referred(self.by_id, *vertices, "source")?;
        let positions = list
            .children()
            .find(|node| {
                node.has_tag_name_of("input") && node.attribute("semantic") == Some("POSITION")
            })
            .ok_or("<vertices> is without POSITION; export it again")?;
        let source = referred(self.by_id, positions, "source")?;
        let (first, known) = self.points(source)?;

        let lists = part
            .children()
            .filter(|node| node.has_tag_name_of("p") || node.has_tag_name_of("ph"));
        let mut counts = numbers::<usize>(part.child("vcount"))?.into_iter();
        for list in lists {
            // a polygon with holes has its outline in <p> within <ph>
            let list = list.child("p").unwrap_or(list);
            let indices = numbers::<u32>(Some(list))?;
            let corners: Vec<u32> = indices
                .iter()
                .skip(vertex_offset)
                .step_by(stride)
                .copied()
                .collect();
            if let Some(wrong) = corners.iter().find(|&&corner| corner as usize >= known) {
                return Err(format!(
                    "an index in <p> is {wrong}, but there are {known} vertices; export it again"
                ));
            }
            let corners: Vec<u32> = corners.into_iter().map(|corner| first + corner).collect();
            self.polygons(part.tag_name().name(), &corners, &mut counts)?;
            self.limits.triangles(self.mesh.triangles.len())?;
        }
        Ok(())
    }

    /// The polygons of one list of corners; `counts` are the corners of each, for a `<polylist>`.
    fn polygons(
        &mut self,
        kind: &str,
        corners: &[u32],
        counts: &mut impl Iterator<Item = usize>,
    ) -> Result<(), String> {
        match kind {
            "triangles" => corners
                .chunks_exact(3)
                .for_each(|corners| self.mesh.polygon(corners)),
            "polylist" => {
                let mut rest = corners;
                for count in counts {
                    let Some((polygon, after)) = rest.split_at_checked(count) else {
                        return Err(
                            "<vcount> asks for more corners than <p> has; export it again"
                                .to_owned(),
                        );
                    };
                    self.mesh.polygon(polygon);
                    rest = after;
                }
            }
            "tristrips" => self.mesh.strip(corners),
            _ => self.mesh.polygon(corners), // polygons, and fans around their first corner
        }
        Ok(())
    }

    /// Points of a `<source>`, its numbers as its `<accessor>` steps through them: index of the first, and how many.
    fn points(&mut self, source: Node<'a, 'input>) -> Result<(u32, usize), String> {
        // parts share their points, so these are read once
        if let Some(&known) = self.sources.get(&source.id()) {
            return Ok(known);
        }
        let accessor = source
            .child("technique_common")
            .and_then(|common| common.child("accessor"));
        let array = match accessor {
            Some(accessor) => referred(self.by_id, accessor, "source")?,
            None => source
                .child("float_array")
                .ok_or("a <source> is without <float_array>; export it again")?,
        };
        let number = |name: &str| {
            accessor.and_then(|accessor| accessor.attribute(name)?.trim().parse::<usize>().ok())
        };
        let (start, stride) = (number("offset").unwrap_or(0), number("stride").unwrap_or(3));
        if stride < 3 {
            return Err(format!(
                "positions come in steps of {stride} numbers, not 3; export it again"
            ));
        }
        let values = numbers::<f64>(Some(array))?;
        let mut points: Vec<[f64; 3]> = values
            .get(start..)
            .unwrap_or_default()
            .chunks(stride)
            .filter_map(|point| point.first_chunk().copied())
            .collect();
        if let Some(count) = number("count") {
            if count > points.len() {
                let found = points.len();
                return Err(format!(
                    "an <accessor> tells of {count} points, there are {found}; export it again"
                ));
            }
            points.truncate(count);
        }
        let place = (self.mesh.vertices.len() as u32, points.len());
        self.mesh.vertices.append(&mut points);
        self.sources.insert(source.id(), place);
        Ok(place)
    }
}

/// The numbers in an element's text; none where there is no element.
pub(super) fn numbers<T: std::str::FromStr>(node: Option<Node>) -> Result<Vec<T>, String> {
    let Some(node) = node else {
        return Ok(Vec::new());
    };
    let text = node.text().unwrap_or_default();
    text.split_ascii_whitespace()
        .map(|word| {
            word.parse().map_err(|_| {
                let name = node.tag_name().name();
                let word: String = word.chars().take(40).collect();
                format!("`{word}` in <{name}> is no number of its kind; export it again")
            })
        })
        .collect()
}
