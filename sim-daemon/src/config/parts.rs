//! What a scene looks like: the shapes that touch, as physics has them, and the visuals of its robots' files.

use std::collections::HashMap;
use std::path::Path;

use serde_json::{Value, json};
use sim_model::geometry::{Hull, TriMesh, triangles};
use sim_model::{Description, Link, Look, Pose, Robot, Shape, Visual};

use super::error::ConfigError;
use super::scene::SceneFile;
use super::skeleton::skeleton;

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
    /// A part has `kind` (`collision`, `visual`, or `bone`: for a robot of which nothing else can be seen), `name`,
    /// `body` (`robot/link` as in the model's list; `null` is the world),
    /// `pos` and `quat` of its frame in that body's, `shape` (`plane`, `box`, `sphere`, `cylinder`, `capsule`, `mesh`; of
    /// visuals also `nothing`) and `mesh` (a place in the list of surfaces; `null` of a plane and of a visual's file).
    /// Collisions also have `added` (whether it is the scene's and not its robot file's) and `whole` (the surface of a mesh
    /// before it became hulls, else as `mesh`); visuals have `color` (red, green, blue and opacity, 0 to 1, or `null`),
    /// `texture` (a file or `null`), `file` with `scale` where it is one, and `problem` where it cannot be shown.
    ///
    /// # Errors
    /// As [`SceneFile::describe`].
    pub fn parts(&self, base_dir: &Path) -> Result<Parts, ConfigError> {
        let description = self.describe(base_dir)?;
        let mut drawing = Drawing::default();
        let mut names = description.shape_names().into_iter();
        for shape in &description.shapes {
            let name = names.next().unwrap_or_default();
            drawing.collision(None, &name, &shape.pose, &shape.shape, true);
        }
        for robot in &description.robots {
            for link in robot
                .link_order()
                .into_iter()
                .map(|link| &robot.links[link])
            {
                let body = format!("{}/{}", robot.name, link.name);
                let own = self.own_shapes(robot, link);
                for (index, collision) in link.collisions.iter().enumerate() {
                    let name = names.next().unwrap_or_default();
                    let (pose, shape) = (&collision.pose, &collision.shape);
                    drawing.collision(Some(&body), &name, pose, shape, index >= own);
                }
            }
        }
        self.visuals(&description, base_dir, &mut drawing);
        Ok(Parts {
            told: json!({ "parts": drawing.parts, "notes": drawing.notes }),
            meshes: drawing.meshes,
        })
    }

    /// How many of a link's shapes are its robot's file's; those of the scene come after them.
    fn own_shapes(&self, robot: &Robot, link: &Link) -> usize {
        if robot.urdf.is_none() {
            return 0;
        }
        let it = Some((robot.name.as_str(), link.name.as_str()));
        let added = self.shapes.iter().filter(|shape| shape.link() == it);
        link.collisions.len() - added.count()
    }

    fn visuals(&self, description: &Description, base_dir: &Path, drawing: &mut Drawing) {
        // robots from files come first, in the order of their tables
        for (table, robot) in self.robots.iter().zip(&description.robots) {
            let name = &robot.name;
            let packages = table.options(base_dir).package_dirs;
            match Robot::visuals(base_dir.join(&table.urdf), &packages) {
                Ok(found) => {
                    let notes = found.notes.into_iter();
                    drawing
                        .notes
                        .extend(notes.map(|note| format!("robot `{name}`: {note}")));
                    let mut counts = HashMap::new();
                    for visual in &found.visuals {
                        let count = counts.entry(visual.link.clone()).or_insert(0);
                        drawing.visual(name, visual, *count);
                        *count += 1;
                    }
                }
                Err(error) => drawing.notes.push(format!("robot `{name}`: {error}")),
            }
            if robot
                .links
                .iter()
                .all(|link| self.own_shapes(robot, link) == 0)
            {
                drawing.skeleton(robot);
            }
        }
    }
}

#[derive(Default)]
struct Drawing {
    parts: Vec<Value>,
    notes: Vec<String>,
    meshes: Vec<TriMesh>,
    /// Shapes with surfaces in the list, by their sizes or files; what differs in more is told apart by looking.
    places: HashMap<String, Vec<(Shape, usize)>>,
}

impl Drawing {
    fn collision(
        &mut self,
        body: Option<&str>,
        name: &str,
        pose: &Pose,
        shape: &Shape,
        added: bool,
    ) {
        let mesh = self.place(shape, false);
        let whole = self.place(shape, true);
        self.parts.push(json!({
            "kind": "collision",
            "name": name,
            "body": body,
            "pos": pose.pos,
            "quat": pose.quat,
            "shape": shape.kind(),
            "mesh": mesh,
            "whole": whole,
            "added": added,
        }));
    }

    /// Adds what stands for a robot that nothing else of its file shows.
    fn skeleton(&mut self, robot: &Robot) {
        for (place, (link, pose, shape)) in skeleton(robot).into_iter().enumerate() {
            let body = format!("{}/{}", robot.name, robot.links[link].name);
            let mesh = self.place(&shape, false);
            self.parts.push(json!({
                "kind": "bone",
                "name": format!("{body}/bone{place}"),
                "body": body,
                "pos": pose.pos,
                "quat": pose.quat,
                "shape": shape.kind(),
                "mesh": mesh,
            }));
        }
    }

    /// Adds a visual, the `index`th of its link.
    fn visual(&mut self, robot: &str, visual: &Visual, index: usize) {
        let body = format!("{robot}/{}", visual.link);
        let own = visual.name.clone().unwrap_or_else(|| index.to_string());
        let mut part = json!({
            "kind": "visual",
            "name": format!("{body}/{own}"),
            "body": body,
            "pos": visual.pose.pos,
            "quat": visual.pose.quat,
            "mesh": null,
            "color": visual.color,
            "texture": visual.texture.as_ref().map(|path| path.to_string_lossy()),
        });
        match &visual.look {
            Look::Shape(shape) => {
                part["shape"] = json!(shape.kind());
                part["mesh"] = json!(self.place(shape, false));
            }
            Look::File { path, scale } => {
                part["shape"] = json!("mesh");
                part["file"] = json!(path.to_string_lossy());
                part["scale"] = json!(scale);
            }
            Look::Nothing { problem } => {
                part["shape"] = json!("nothing");
                part["problem"] = json!(problem);
            }
        }
        self.parts.push(part);
    }

    /// Where a shape's surface stands in the list, shapes that are the same sharing one; none of a plane, which has no end.
    ///
    /// A mesh is its hulls, or what its file holds if it is to be whole.
    fn place(&mut self, shape: &Shape, whole: bool) -> Option<usize> {
        let key = match shape {
            Shape::Plane => return None,
            Shape::Mesh(mesh) => format!("{} {:?} {whole}", mesh.path.display(), mesh.scale),
            other => format!("{other:?}"),
        };
        let alike = self.places.entry(key).or_default();
        if let Some((_, place)) = alike.iter().find(|(other, _)| other == shape) {
            return Some(*place);
        }
        let surface = match shape {
            Shape::Mesh(mesh) if !whole => mesh.hulls.iter().fold(TriMesh::default(), with_hull),
            other => triangles(other),
        };
        let (surface, note) = surface.thinned();
        self.notes
            .extend(note.map(|note| format!("a collision mesh {note}")));
        let place = self.meshes.len();
        self.meshes.push(surface);
        alike.push((shape.clone(), place));
        Some(place)
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
