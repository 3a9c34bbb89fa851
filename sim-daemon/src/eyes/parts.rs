//! What there is to see: parts of a scene as the renderer takes them.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sim_model::geometry::{TriMesh, VisualMesh};
use sim_model::{Look as SceneLook, Sees, Shape};
use sim_render::{Look, Paint, Part};

use super::paint;
use crate::config::{Looks, PartKind, SeenPart};

/// Names of what labels stand for: the bodies of the model in their order, then parts of the world.
pub(super) struct Segments {
    pub(super) names: Vec<String>,
    bodies: usize,
}

impl Segments {
    pub(super) fn new(bodies: &[String]) -> Segments {
        Segments {
            names: bodies.to_vec(),
            bodies: bodies.len(),
        }
    }

    fn body(&self, name: &str) -> Option<usize> {
        self.names[..self.bodies]
            .iter()
            .position(|body| body == name)
    }

    /// The place of a part of the world.
    fn of_world(&mut self, name: &str) -> usize {
        let others = self.names[self.bodies..].iter();
        let place = others.clone().position(|other| other == name);
        place.map_or_else(
            || {
                self.names.push(name.to_owned());
                self.names.len() - 1
            },
            |place| self.bodies + place,
        )
    }
}

/// The parts of a scene that a camera sees, with what cannot be seen, a sentence each. They are chosen as viewers do: visuals
/// where a link has some that can be read, else its collision shapes. Sites are no things, and are not seen.
pub(super) fn seen(looks: &Looks, segments: &mut Segments, sees: Sees) -> (Vec<Part>, Vec<String>) {
    let mut reader = Reader::default();
    let chosen = match sees {
        Sees::Visuals => visuals(&looks.parts, &mut reader),
        Sees::Collisions => {
            let touches = |part: &&SeenPart| matches!(part.kind, PartKind::Collision { .. });
            looks.parts.iter().filter(touches).collect()
        }
    };
    let mut parts = Vec::new();
    for part in chosen {
        let place = |body: &String| segments.body(body).expect("links are bodies of the model");
        let body = part.body.as_ref().map(place);
        let label = body.unwrap_or_else(|| segments.of_world(&part.name));
        let painted = reader.looks(part, body);
        parts.extend(painted.into_iter().map(|(look, paint)| Part {
            body,
            pose: part.pose,
            look,
            label: label as i32,
            paint,
        }));
    }
    (parts, reader.notes)
}

/// What viewers show.
fn visuals<'a>(parts: &'a [SeenPart], reader: &mut Reader) -> Vec<&'a SeenPart> {
    let is_visual = |part: &&SeenPart| part.kind == PartKind::Visual;
    let (readable, lost): (Vec<_>, Vec<_>) = parts
        .iter()
        .filter(is_visual)
        .partition(|part| reader.can_read(part));
    let link = |part: &'a SeenPart| (&part.robot, &part.body);
    let lost: HashSet<_> = lost.into_iter().map(link).collect();
    let whole = |part: &&'a SeenPart| !lost.contains(&link(part));
    let clad: HashSet<_> = readable
        .iter()
        .filter(|part| whole(part))
        .map(|part| &part.robot)
        .collect();
    let dressed: HashSet<_> = parts
        .iter()
        .filter(is_visual)
        .map(|part| &part.robot)
        .collect();
    let stands_in = |part: &&'a SeenPart| match part.kind {
        PartKind::Collision { added } => {
            added || lost.contains(&link(part)) || !dressed.contains(&part.robot)
        }
        PartKind::Bone => !clad.contains(&part.robot),
        PartKind::Visual | PartKind::Site => false,
    };
    let others = parts.iter().filter(stands_in);
    others
        .chain(readable.iter().copied().filter(whole))
        .collect()
}

/// Reads mesh files, each once.
#[derive(Default)]
struct Reader {
    files: HashMap<(PathBuf, bool), Option<Arc<VisualMesh>>>,
    notes: Vec<String>,
}

impl Reader {
    /// Whether what a visual looks like is there; else there is a note.
    fn can_read(&mut self, part: &SeenPart) -> bool {
        match &part.look {
            SceneLook::Nothing { problem } => {
                self.note(part, problem);
                false
            }
            SceneLook::File {
                path,
                collada_up_axis,
                ..
            } => self.file(part, path, *collada_up_axis).is_some(),
            _ => true,
        }
    }

    /// What a part looks like, a look for each of its colours.
    fn looks(&mut self, part: &SeenPart, body: Option<usize>) -> Vec<(Look, Paint)> {
        let paint = paint::of_part(part, body);
        if let (Some(texture), None) = (&part.texture, part.color) {
            let file = texture.display();
            self.notes.push(format!(
                "cameras see {} in grey: they do not read its texture {file}",
                part.name
            ));
        }
        let squares = Paint {
            squares: true,
            ..paint
        };
        let look = match &part.look {
            SceneLook::Shape(Shape::Plane) => {
                return vec![(Look::Shape(Shape::Plane), Paint::GROUND)];
            }
            SceneLook::Shape(shape @ Shape::HeightField(_)) => {
                return vec![(Look::Shape(shape.clone()), squares)];
            }
            SceneLook::Sheet { half_extents } => {
                return vec![(Look::Sheet(*half_extents), squares)];
            }
            SceneLook::Shape(shape) => Look::Shape(shape.clone()),
            SceneLook::Triangles { surface, .. } => Look::Triangles(surface.clone()),
            SceneLook::Nothing { .. } => return Vec::new(),
            SceneLook::File {
                path,
                scale,
                collada_up_axis,
            } => {
                let Some(mesh) = self.file(part, path, *collada_up_axis) else {
                    return Vec::new();
                };
                let paints = paint::of_file(part, &mesh);
                return by_paint(&scaled(&mesh, *scale), &paints);
            }
        };
        vec![(look, paint)]
    }

    /// A mesh file, unless it cannot be read.
    fn file(&mut self, part: &SeenPart, path: &Path, up_axis: bool) -> Option<Arc<VisualMesh>> {
        let key = (path.to_owned(), up_axis);
        if !self.files.contains_key(&key) {
            let read = VisualMesh::load(path, up_axis);
            let read = read.map_err(|error| self.note(part, &error.to_string()));
            let notes = read.iter().flat_map(|mesh| &mesh.notes);
            self.notes
                .extend(notes.map(|note| format!("visual mesh {}: it {note}", path.display())));
            self.files.insert(key.clone(), read.ok().map(Arc::new));
        }
        self.files[&key].clone()
    }

    fn note(&mut self, part: &SeenPart, problem: &str) {
        let note = format!(
            "cameras see the collision shapes of a link, if it has any, and not its visual {}: {problem}",
            part.name
        );
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }
}

/// The triangles of a mesh file in metres, with fronts that stay outside where a scale mirrors them.
fn scaled(mesh: &VisualMesh, scale: [f64; 3]) -> TriMesh {
    let vertices = mesh.vertices.iter();
    let is_mirrored = scale.iter().product::<f64>() < 0.0;
    let triangles = mesh.triangles.iter().map(|&[a, b, c]| match is_mirrored {
        true => [a, c, b],
        false => [a, b, c],
    });
    TriMesh {
        vertices: vertices
            .map(|vertex| [0, 1, 2].map(|k| f64::from(vertex[k]) * scale[k]))
            .collect(),
        triangles: triangles.collect(),
    }
}

/// The triangles of each paint.
fn by_paint(mesh: &TriMesh, paints: &[Paint]) -> Vec<(Look, Paint)> {
    let mut groups: Vec<(Paint, TriMesh)> = Vec::new();
    let mut places: HashMap<([u32; 4], bool), usize> = HashMap::new();
    for (&triangle, paint) in mesh.triangles.iter().zip(paints) {
        let key = (paint.color.map(f32::to_bits), paint.squares);
        let place = *places.entry(key).or_insert_with(|| {
            groups.push((*paint, TriMesh::default()));
            groups.len() - 1
        });
        let group = &mut groups[place].1;
        let first = group.vertices.len() as u32;
        group.vertices.extend(mesh.corners(triangle));
        group.triangles.push([first, first + 1, first + 2]);
    }
    let look = |(paint, mesh)| (Look::Triangles(Arc::new(mesh)), paint);
    groups.into_iter().map(look).collect()
}
