//! What a scene looks like, as clients draw it: an object for each part, and the surfaces that these name.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};
use sim_model::geometry::{Hull, TriMesh, triangles};
use sim_model::{Look, Shape};

use super::{PartKind, SeenPart};
use crate::config::error::ConfigError;
use crate::config::scene::SceneFile;

/// What there is to draw.
pub struct Parts {
    /// An object with lists `parts` and `notes`; see [`SceneFile::parts`].
    pub told: Value,
    /// Surfaces that the parts name by their places, each in the part's frame.
    pub meshes: Vec<TriMesh>,
}

impl SceneFile {
    /// What the scene looks like; paths as in [`SceneFile::describe`].
    ///
    /// A part has `kind` (`collision`, `visual`, `site`: a visual beside whatever its body shows, or
    /// `bone`: for a robot of which nothing else can be seen), `name`,
    /// `robot` (`null` for what the scene has itself), `body` (`robot/link` as in the model's list; `null` is the world, and
    /// the world of a MuJoCo model), `pos` and `quat` of its frame in that body's, `shape` (`plane`, `box`, `sphere`,
    /// `cylinder`, `capsule`, `ellipsoid`, `mesh`, `hfield`; of visuals also `nothing`) and `mesh` (a place in the list
    /// of surfaces; `null` of a plane and of a visual's file). A height field has `squares`, the lengths of its squares
    /// along x and y. A visual that is a plane has `half_extents`, `null` where it has no end. Collisions also have `added`
    /// (whether it is the scene's and not its robot file's) and `whole` (the surface of a mesh before it became hulls, else
    /// as `mesh`); visuals have `color` (red, green, blue and opacity, 0 to 1, or `null`), `texture` (a file or `null`),
    /// `file` with `scale` and `collada_up_axis` where it is one, and `problem` where it cannot be shown.
    ///
    /// # Errors
    /// As [`SceneFile::describe`].
    pub fn parts(&self, base_dir: &Path) -> Result<Parts, ConfigError> {
        let description = self.describe(base_dir)?;
        let looks = self.looks(&description, base_dir);
        let mut drawing = Drawing {
            notes: looks.notes,
            ..Drawing::default()
        };
        looks.parts.iter().for_each(|part| drawing.add_part(part));
        Ok(Parts {
            told: json!({ "parts": drawing.parts, "notes": drawing.notes }),
            meshes: drawing.meshes,
        })
    }
}

#[derive(Default)]
struct Drawing {
    parts: Vec<Value>,
    notes: Vec<String>,
    meshes: Vec<TriMesh>,
    /// Shapes with surfaces in the list, by their sizes or files; what differs in more is compared as a whole.
    places: HashMap<String, Vec<(Shape, usize)>>,
    /// Triangles with surfaces in the list.
    shared: Vec<(Arc<TriMesh>, usize)>,
}

impl Drawing {
    fn add_part(&mut self, part: &SeenPart) {
        let kind = match part.kind {
            PartKind::Collision { .. } => "collision",
            PartKind::Visual => "visual",
            PartKind::Site => "site",
            PartKind::Bone => "bone",
        };
        let mut told = json!({
            "kind": kind,
            "name": part.name,
            "robot": part.robot,
            "body": part.body,
            "pos": part.pose.pos,
            "quat": part.pose.quat,
            "mesh": null,
        });
        if let PartKind::Visual | PartKind::Site = part.kind {
            told["color"] = json!(part.color);
            let texture = part.texture.as_ref();
            told["texture"] = json!(texture.map(|path| path.to_string_lossy()));
        }
        match &part.look {
            Look::Shape(shape) => {
                told["shape"] = json!(shape.kind());
                told["squares"] = squares(shape);
                told["mesh"] = json!(self.place(shape, false));
                if let PartKind::Collision { added } = part.kind {
                    told["whole"] = json!(self.place(shape, true));
                    told["added"] = json!(added);
                }
            }
            Look::Sheet { half_extents } => {
                told["shape"] = json!(Shape::Plane.kind());
                told["half_extents"] = json!(half_extents);
            }
            Look::Triangles { kind, surface } => {
                told["shape"] = json!(kind);
                told["mesh"] = json!(self.shared(surface));
            }
            Look::File {
                path,
                scale,
                collada_up_axis,
            } => {
                told["shape"] = json!("mesh");
                told["collada_up_axis"] = json!(collada_up_axis);
                told["file"] = json!(path.to_string_lossy());
                told["scale"] = json!(scale);
            }
            Look::Nothing { problem } => {
                told["shape"] = json!("nothing");
                told["problem"] = json!(problem);
            }
        }
        self.parts.push(told);
    }

    /// Where triangles that visuals share stand in the list.
    fn shared(&mut self, surface: &Arc<TriMesh>) -> usize {
        let mut known = self.shared.iter();
        if let Some((_, place)) = known.find(|(other, _)| Arc::ptr_eq(other, surface)) {
            return *place;
        }
        let place = self.add((**surface).clone(), "visual");
        self.shared.push((surface.clone(), place));
        place
    }

    /// Adds a surface, thinned if it is large.
    fn add(&mut self, surface: TriMesh, what: &str) -> usize {
        let (surface, note) = surface.thinned();
        self.notes
            .extend(note.map(|note| format!("a {what} mesh {note}")));
        self.meshes.push(surface);
        self.meshes.len() - 1
    }

    /// Where a shape's surface stands in the list, shapes that are the same sharing one; none of a plane, which has no end.
    ///
    /// A mesh is its hulls, or what its file holds if it is to be whole.
    fn place(&mut self, shape: &Shape, whole: bool) -> Option<usize> {
        let key = match shape {
            Shape::Plane => return None,
            Shape::Mesh(mesh) => format!("{} {:?} {whole}", mesh.path.display(), mesh.scale),
            Shape::HeightField(field) => format!("{} {:?}", field.path.display(), field.half),
            other => format!("{other:?}"),
        };
        let mut alike = self.places.get(&key).into_iter().flatten();
        if let Some((_, place)) = alike.find(|(other, _)| other == shape) {
            return Some(*place);
        }
        let place = match shape {
            Shape::Mesh(mesh) if !whole => {
                let hulls = mesh.hulls.iter().fold(TriMesh::default(), with_hull);
                self.add(hulls, "collision")
            }
            Shape::HeightField(field) => {
                let (surface, note) = field.shown();
                let note = note.map(|note| format!("a height field {note}"));
                self.notes.extend(note);
                self.meshes.push(surface);
                self.meshes.len() - 1
            }
            other => self.add(triangles(other), "collision"),
        };
        let alike = self.places.entry(key).or_default();
        alike.push((shape.clone(), place));
        Some(place)
    }
}

/// Lengths of the squares of a height field along x and y [m], `null` of other shapes.
fn squares(shape: &Shape) -> Value {
    match shape {
        Shape::HeightField(field) => json!(field.squares()),
        _ => Value::Null,
    }
}

fn with_hull(mut mesh: TriMesh, hull: &Hull) -> TriMesh {
    let first = mesh.vertices.len() as u32;
    let sides = hull_sides(hull);
    mesh.vertices.extend(sides.vertices);
    let sides = sides.triangles.into_iter();
    mesh.triangles
        .extend(sides.map(|side| side.map(|corner| first + corner)));
    mesh
}

/// The sides of a hull as triangles.
pub(crate) fn hull_sides(hull: &Hull) -> TriMesh {
    let sides = hull.faces.iter().flat_map(|face| {
        let fan = face.corners.windows(2).skip(1);
        fan.map(|edge| [face.corners[0], edge[0], edge[1]])
    });
    TriMesh {
        vertices: hull.vertices.clone(),
        triangles: sides.collect(),
    }
}
