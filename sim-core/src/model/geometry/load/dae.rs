//! COLLADA: every geometry that the visual scene shows, where its nodes put it, in metres and turned to z up.
//!
//! `<unit meter>` and `<up_axis>` are applied as the COLLADA 1.4.1 and 1.5 specifications have them (absent: 1 m, y up), as
//! Bullet and Blender do; RViz leaves the axes as they are, so a turn is noted. Curves, lines and points are no surface and
//! are passed over; skins are taken as they lie in the file.

use std::collections::HashMap;

use roxmltree::{Document, Node, ParsingOptions};

use super::super::vector::unit;
use super::scene::Affine;
use super::{Limits, RawMesh};

/// Elements and texts of a file: coordinates are one text each, so real files have some thousands.
const NODES_MAX: u32 = 1_000_000;
/// Deepest nesting of scene nodes.
const DEPTH_MAX: usize = 100;
/// Most scene nodes visited, instances counted each time: a few that refer to one another can stand for billions.
const VISITS_MAX: usize = 100_000;

pub(super) fn read(bytes: &[u8], limits: Limits) -> Result<RawMesh, String> {
    let text = String::from_utf8_lossy(bytes);
    let text = text.trim_start_matches('\u{feff}');
    let options = ParsingOptions {
        allow_dtd: false,
        nodes_limit: NODES_MAX,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(text, options)
        .map_err(|error| format!("broken XML: {error}; export it again"))?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(format!(
            "its outermost element is <{}>, not <COLLADA>",
            root.tag_name().name()
        ));
    }
    let by_id = document
        .descendants()
        .filter_map(|node| Some((node.attribute("id")?, node)))
        .collect();
    let mut scene = Scene {
        by_id,
        limits,
        mesh: RawMesh::default(),
        visits: 0,
    };
    let frame = scene.frame(root)?;
    match visual_scene(root, &scene.by_id) {
        Some(visual) => scene.children(visual, frame, 0)?,
        None => {
            for geometry in root
                .descendants()
                .filter(|node| node.has_tag_name_of("geometry"))
            {
                scene.geometry(geometry, frame)?;
            }
        }
    }
    Ok(scene.mesh)
}

/// Elements by their name alone: the namespace tells the version only.
trait Named<'a, 'input> {
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

type ById<'a, 'input> = HashMap<&'a str, Node<'a, 'input>>;

/// The scene that the file shows: the one it names, else its first.
fn visual_scene<'a, 'input>(
    root: Node<'a, 'input>,
    by_id: &ById<'a, 'input>,
) -> Option<Node<'a, 'input>> {
    let named = root
        .child("scene")
        .and_then(|scene| scene.child("instance_visual_scene"))
        .and_then(|instance| {
            by_id
                .get(instance.attribute("url")?.strip_prefix('#')?)
                .copied()
        });
    named.or_else(|| root.child("library_visual_scenes")?.child("visual_scene"))
}

struct Scene<'a, 'input> {
    by_id: ById<'a, 'input>,
    limits: Limits,
    mesh: RawMesh,
    visits: usize,
}

impl<'a, 'input> Scene<'a, 'input> {
    /// From the file's units and axes to metres and z up.
    fn frame(&mut self, root: Node) -> Result<Affine, String> {
        let asset = root.child("asset");
        let unit = asset.and_then(|asset| asset.child("unit"));
        let meter = match unit.and_then(|unit| unit.attribute("meter")) {
            None => 1.0,
            // some exporters write numbers as their country does
            Some(text) => text.trim().replace(',', ".").parse().unwrap_or(f64::NAN),
        };
        if !(meter > 0.0 && meter.is_finite()) {
            return Err(
                "<unit meter> is no positive number; write how many metres a unit has".to_owned(),
            );
        }
        let axis = asset.and_then(|asset| asset.child("up_axis"));
        let axis = axis.and_then(|axis| axis.text()).map_or("Y_UP", str::trim);
        let turn = match axis {
            "Z_UP" => return Ok(Affine::scaling([meter; 3])),
            "Y_UP" => Affine::Y_UP,
            "X_UP" => Affine::X_UP,
            other => {
                return Err(format!(
                    "<up_axis> is `{other}`; it must be X_UP, Y_UP or Z_UP"
                ));
            }
        };
        self.mesh.notes.push(format!(
            "is turned from {axis} to z up, as its file says; RViz leaves such files unturned"
        ));
        Ok(turn.after(Affine::scaling([meter; 3])))
    }

    /// What an element's `url` or `source` refers to.
    fn referred(&self, node: Node, attribute: &str) -> Result<Node<'a, 'input>, String> {
        let url = node.attribute(attribute).unwrap_or_default();
        let found = url.strip_prefix('#').and_then(|id| self.by_id.get(id));
        found.copied().ok_or_else(|| {
            let name = node.tag_name().name();
            format!("<{name} {attribute}=\"{url}\"> refers to nothing in the file; export it again")
        })
    }

    fn children(
        &mut self,
        parent: Node<'a, 'input>,
        frame: Affine,
        depth: usize,
    ) -> Result<(), String> {
        self.visits += 1;
        if depth > DEPTH_MAX || self.visits > VISITS_MAX {
            return Err(format!(
                "its nodes nest deeper than {DEPTH_MAX}, or stand for more than {VISITS_MAX}; simplify the scene"
            ));
        }
        let mut frame = frame;
        for node in parent.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "matrix" | "translate" | "rotate" | "scale" => {
                    frame = frame.after(transform(node)?)
                }
                name @ ("lookat" | "skew") => {
                    return Err(format!(
                        "<{name}> of a node is not read; bake it into a <matrix>"
                    ));
                }
                "node" => self.children(node, frame, depth + 1)?,
                "instance_node" => {
                    let target = self.referred(node, "url")?;
                    self.children(target, frame, depth + 1)?;
                }
                "instance_geometry" => {
                    let target = self.referred(node, "url")?;
                    self.geometry(target, frame)?;
                }
                "instance_controller" => {
                    let controller = self.referred(node, "url")?;
                    if let Some(skin) = controller.child("skin") {
                        let bind = skin.child("bind_shape_matrix").map(transform).transpose()?;
                        let target = self.referred(skin, "source")?;
                        self.geometry(target, frame.after(bind.unwrap_or(Affine::IDENTITY)))?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn geometry(&mut self, geometry: Node<'a, 'input>, frame: Affine) -> Result<(), String> {
        let Some(mesh) = geometry.child("mesh") else {
            return Ok(());
        };
        for part in mesh.children().filter(Node::is_element) {
            let kind = part.tag_name().name();
            if matches!(
                kind,
                "triangles" | "polylist" | "polygons" | "tristrips" | "trifans"
            ) {
                self.part(part, frame)?;
            }
        }
        Ok(())
    }

    /// Triangles or polygons that share their vertices' list.
    fn part(&mut self, part: Node<'a, 'input>, frame: Affine) -> Result<(), String> {
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
        let list = self.referred(*vertices, "source")?;
        let positions = list
            .children()
            .find(|node| {
                node.has_tag_name_of("input") && node.attribute("semantic") == Some("POSITION")
            })
            .ok_or("<vertices> is without POSITION; export it again")?;
        let source = self.referred(positions, "source")?;
        let first = self.mesh.vertices.len() as u32;
        let points = self.points(source)?;
        let known = points.len();
        self.mesh
            .vertices
            .extend(points.into_iter().map(|point| frame.apply(point)));
        let before = self.mesh.triangles.len();

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
        if frame.mirrors() {
            for triangle in &mut self.mesh.triangles[before..] {
                triangle.swap(1, 2);
            }
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
            "tristrips" => {
                for (index, corners) in corners.windows(3).enumerate() {
                    // every other triangle of a strip runs the other way
                    let swap = index % 2;
                    self.mesh
                        .polygon(&[corners[0], corners[1 + swap], corners[2 - swap]]);
                }
            }
            _ => self.mesh.polygon(corners), // polygons, and fans around their first corner
        }
        Ok(())
    }

    /// Points of a `<source>`: its numbers as its `<accessor>` steps through them.
    fn points(&self, source: Node<'a, 'input>) -> Result<Vec<[f64; 3]>, String> {
        let accessor = source
            .child("technique_common")
            .and_then(|common| common.child("accessor"));
        let array = match accessor {
            Some(accessor) => self.referred(accessor, "source")?,
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
        Ok(points)
    }
}

/// One of a node's transformations.
fn transform(node: Node) -> Result<Affine, String> {
    let values = numbers::<f64>(Some(node))?;
    let map = match (node.tag_name().name(), &values[..]) {
        ("translate", &[x, y, z]) => Affine::translation([x, y, z]),
        ("scale", &[x, y, z]) => Affine::scaling([x, y, z]),
        ("rotate", &[x, y, z, degrees]) => rotation(unit([x, y, z]), degrees.to_radians()),
        ("matrix" | "bind_shape_matrix", values) if values.len() == 16 => {
            let row = |row: usize| [0, 1, 2, 3].map(|column| values[4 * row + column]);
            Affine([row(0), row(1), row(2)])
        }
        (name, values) => {
            return Err(format!(
                "<{name}> of a node has {} numbers; export it again",
                values.len()
            ));
        }
    };
    Ok(map)
}

/// Rodrigues' formula, R = 1 + sin θ K + (1 − cos θ) K² for a unit axis.
fn rotation([x, y, z]: [f64; 3], angle: f64) -> Affine {
    let (s, c) = angle.sin_cos();
    let t = 1.0 - c;
    Affine::rotation([
        [c + t * x * x, t * x * y - s * z, t * x * z + s * y],
        [t * x * y + s * z, c + t * y * y, t * y * z - s * x],
        [t * x * z - s * y, t * y * z + s * x, c + t * z * z],
    ])
}

/// The numbers in an element's text; none where there is no element.
fn numbers<T: std::str::FromStr>(node: Option<Node>) -> Result<Vec<T>, String> {
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
