//! The triangles of one COLLADA geometry, with texture coordinates and vertex colours.

use std::collections::HashMap;
use std::rc::Rc;

use roxmltree::{Node, NodeId};

use super::color::{color_of, mean};
use super::dae_xml::{ById, Named, numbers, referred};
use super::raw::{fan, separate, strip};
use super::{Limits, RawMesh, Run};

/// The triangles of a `<geometry>` in its own frame, none where it is no mesh, and which symbol each of its runs gives its
/// material: what that is, each instance says.
pub(super) fn read<'a, 'input>(
    geometry: Node<'a, 'input>,
    by_id: &ById<'a, 'input>,
    limits: Limits,
) -> Result<(RawMesh, Vec<String>), String> {
    let mut reader = Geometry {
        by_id,
        limits,
        mesh: RawMesh::default(),
        symbols: Vec::new(),
        points: HashMap::new(),
        rows: HashMap::new(),
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
    Ok((reader.mesh, reader.symbols))
}

struct Geometry<'b, 'a, 'input> {
    by_id: &'b ById<'a, 'input>,
    limits: Limits,
    mesh: RawMesh,
    /// Of the material of each run.
    symbols: Vec<String>,
    /// Index of the first point of a source, and how many it has.
    points: HashMap<NodeId, (u32, usize)>,
    /// Sources of texture coordinates and colours; parts share them.
    rows: HashMap<NodeId, Rc<Rows>>,
}

/// Numbers of a source.
struct Rows {
    values: Vec<f64>,
    /// Numbers in each row.
    stride: usize,
}

/// What of a part's lists stands for one of its inputs.
struct Channel {
    /// Which number of each corner's.
    offset: usize,
    rows: Rc<Rows>,
}

impl Channel {
    /// The row of a corner, its index looked up among those of the list.
    fn row(&self, corner: &[u32]) -> Option<&[f64]> {
        let index = *corner.get(self.offset)? as usize;
        let first = index.checked_mul(self.rows.stride)?;
        self.rows.values.get(first..)?.get(..self.rows.stride)
    }
}

impl<'a, 'input> Geometry<'_, 'a, 'input> {
    /// Triangles or polygons that share their vertices' list.
    fn part(&mut self, part: Node<'a, 'input>) -> Result<(), String> {
        let inputs: Vec<Node> = part
            .children()
            .filter(|node| node.has_tag_name_of("input"))
            .collect();
        let stride = inputs
            .iter()
            .map(offset)
            .max()
            .map_or(1, |last| usize::from(last) + 1);
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
        let [uv, color] = if self.limits.looks {
            ["TEXCOORD", "COLOR"].map(|semantic| self.channel(&inputs, list, semantic))
        } else {
            [None, None]
        };
        let mut run = Run {
            first: self.mesh.triangles.len(),
            ..Run::default()
        };

        let lists = part
            .children()
            .filter(|node| node.has_tag_name_of("p") || node.has_tag_name_of("ph"));
        let mut counts = numbers::<usize>(part.child("vcount"))?.into_iter();
        for list in lists {
            // a polygon with holes has its outline in <p> within <ph>
            let list = list.child("p").unwrap_or(list);
            let indices = numbers::<u32>(Some(list))?;
            if !indices.len().is_multiple_of(stride) {
                let given = indices.len();
                return Err(format!(
                    "a <p> has {given} indices, {stride} a corner; it was cut short, export it again"
                ));
            }
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
            let places = places(part.tag_name().name(), corners.len(), &mut counts)?;
            self.mesh.extend(&corners, &places);
            self.limits.triangles(self.mesh.triangles.len())?;
            let corner = |at: usize| indices.get(at * stride..).unwrap_or_default();
            if let Some(uv) = &uv {
                let row = |at| uv.row(corner(at))?.first_chunk::<2>();
                run.uv.extend(places.iter().map_while(|places| {
                    let [a, b, c] = places.map(row);
                    Some([a?, b?, c?].map(|uv| uv.map(|part| part as f32)))
                }));
            }
            if let Some(color) = &color {
                let parts = |at| {
                    let row = color.row(corner(at))?;
                    let [r, g, b] = *row.first_chunk()?;
                    Some([r, g, b, row.get(3).copied().unwrap_or(1.0)])
                };
                run.colors.extend(places.iter().map_while(|places| {
                    let [a, b, c] = places.map(parts);
                    Some(color_of(mean([a?, b?, c?])))
                }));
            }
        }
        run.count = self.mesh.triangles.len() - run.first;
        if self.limits.looks && run.count > 0 {
            // what only some triangles have is left out
            if run.uv.len() != run.count {
                run.uv.clear();
            }
            if run.colors.len() != run.count {
                run.colors.clear();
            }
            let symbol = part.attribute("material").unwrap_or_default();
            self.symbols.push(symbol.to_owned());
            self.mesh.runs.push(run);
        }
        Ok(())
    }

    /// An input of a part, or of its `<vertices>`; `None` where it has none that can be read.
    fn channel(
        &mut self,
        inputs: &[Node<'a, 'input>],
        vertices: Node<'a, 'input>,
        semantic: &str,
    ) -> Option<Channel> {
        let of_corner = inputs
            .iter()
            .find(|input| input.attribute("semantic") == Some(semantic));
        let input = of_corner.copied().or_else(|| {
            vertices.children().find(|node| {
                node.has_tag_name_of("input") && node.attribute("semantic") == Some(semantic)
            })
        })?;
        let holder = of_corner.or_else(|| {
            inputs
                .iter()
                .find(|input| input.attribute("semantic") == Some("VERTEX"))
        })?;
        let source = referred(self.by_id, input, "source").ok()?;
        let rows = match self.rows.get(&source.id()) {
            Some(rows) => rows.clone(),
            None => {
                let default = if semantic == "COLOR" { 3 } else { 2 };
                let (values, stride, _) = self.source(source, default).ok()?;
                let rows = Rc::new(Rows { values, stride });
                self.rows.insert(source.id(), rows.clone());
                rows
            }
        };
        Some(Channel {
            offset: usize::from(offset(holder)),
            rows,
        })
    }

    /// Points of a `<source>`, its numbers as its `<accessor>` steps through them: index of the first, and how many.
    fn points(&mut self, source: Node<'a, 'input>) -> Result<(u32, usize), String> {
        // parts share their points, so these are read once
        if let Some(&known) = self.points.get(&source.id()) {
            return Ok(known);
        }
        let (values, stride, count) = self.source(source, 3)?;
        if stride < 3 {
            return Err(format!(
                "positions come in steps of {stride} numbers, not 3; export it again"
            ));
        }
        let columns = columns(source, stride);
        let mut points: Vec<[f64; 3]> = values
            .chunks(stride)
            .filter_map(|point| {
                let [x, y, z] = columns.map(|column| point.get(column).copied());
                Some([x?, y?, z?])
            })
            .collect();
        if let Some(count) = count {
            if count > points.len() {
                let present = points.len();
                return Err(format!(
                    "an <accessor> tells of {count} points, there are {present}; export it again"
                ));
            }
            points.truncate(count);
        }
        let place = (self.mesh.vertices.len() as u32, points.len());
        self.mesh.vertices.append(&mut points);
        self.points.insert(source.id(), place);
        Ok(place)
    }

    /// Numbers of a `<source>` from its first row on, how many a row has, and how many rows its `<accessor>` tells of.
    fn source(
        &self,
        source: Node<'a, 'input>,
        default_stride: usize,
    ) -> Result<(Vec<f64>, usize, Option<usize>), String> {
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
        let stride = number("stride").unwrap_or(default_stride);
        let mut values = numbers::<f64>(Some(array))?;
        values.drain(..number("offset").unwrap_or(0).min(values.len()));
        Ok((values, stride, number("count")))
    }
}

/// The places of x, y and z in a row: those of an accessor's parameters with a name, since it steps over the others.
fn columns(source: Node, stride: usize) -> [usize; 3] {
    let accessor = source
        .child("technique_common")
        .and_then(|common| common.child("accessor"));
    let params = accessor
        .into_iter()
        .flat_map(|accessor| accessor.children());
    let params = params.filter(|param| param.has_tag_name_of("param"));
    let mut named = params
        .enumerate()
        .filter(|(_, param)| param.attribute("name").is_some_and(|name| !name.is_empty()))
        .map(|(at, _)| at)
        .filter(|&at| at < stride);
    match [named.next(), named.next(), named.next()] {
        [Some(x), Some(y), Some(z)] => [x, y, z],
        _ => [0, 1, 2],
    }
}

/// Which number of each corner's is an input's index.
fn offset(input: &Node) -> u16 {
    let text = input.attribute("offset");
    text.and_then(|text| text.trim().parse().ok()).unwrap_or(0)
}

/// The triangles of one list of corners, as places in it; `counts` are the corners of each polygon of a `<polylist>`.
fn places(
    kind: &str,
    corners: usize,
    counts: &mut impl Iterator<Item = usize>,
) -> Result<Vec<[usize; 3]>, String> {
    Ok(match kind {
        "triangles" if !corners.is_multiple_of(3) => {
            return Err(format!(
                "a <p> of <triangles> has {corners} corners, 3 a triangle; it was cut short, export it again"
            ));
        }
        "triangles" => separate(corners).collect(),
        "polylist" => {
            let (mut places, mut first) = (Vec::new(), 0);
            for count in counts {
                if count > corners - first {
                    return Err(
                        "<vcount> asks for more corners than <p> has; export it again".to_owned(),
                    );
                }
                places.extend(fan(first, count));
                first += count;
            }
            if first < corners {
                let over = corners - first;
                return Err(format!(
                    "<vcount> leaves {over} corners of <p> over; export it again"
                ));
            }
            places
        }
        "tristrips" => strip(corners).collect(),
        _ => fan(0, corners).collect(), // polygons, and fans around their first corner
    })
}
