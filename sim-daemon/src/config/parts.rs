//! What a scene looks like: the shapes that touch, as physics has them, and the visuals of its robots' and models' files.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};
use sim_model::geometry::{Hull, TriMesh, triangles};
use sim_model::{Description, Link, Look, ModelError, Pose, Robot, Shape, Visual, Visuals};

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
        let mut drawing = Drawing::default();
        let mut names = description.shape_names().into_iter();
        for shape in &description.shapes {
            let name = names.next().unwrap_or_default();
            drawing.collision(&Place::world(), &name, &shape.pose, &shape.shape, true);
        }
        for robot in &description.robots {
            for link in robot
                .link_order()
                .into_iter()
                .map(|link| &robot.links[link])
            {
                let place = Place::on_link(robot, &link.name);
                let own_shapes = self.own_shapes(robot, link);
                for (index, collision) in link.collisions.iter().enumerate() {
                    let name = names.next().unwrap_or_default();
                    let (pose, shape) = (&collision.pose, &collision.shape);
                    drawing.collision(&place, &name, pose, shape, index >= own_shapes);
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
        if robot.urdf.is_none() && robot.precompiled.is_none() {
            return 0;
        }
        let place = Some((robot.name.as_str(), link.name.as_str()));
        let added = self.shapes.iter().filter(|shape| shape.link() == place);
        link.collisions.len() - added.count()
    }

    fn visuals(&self, description: &Description, base_dir: &Path, drawing: &mut Drawing) {
        // robots from files come first, in the order of their tables, then models
        let (robots, models) = description.robots.split_at(self.robots.len());
        for (table, robot) in self.robots.iter().zip(robots) {
            let visuals = Robot::visuals(base_dir.join(&table.urdf), &table.options(base_dir));
            self.robot_visuals(robot, visuals, drawing);
        }
        for (table, robot) in self.mujoco.iter().zip(models) {
            let visuals = Robot::mujoco_visuals(base_dir.join(&table.model));
            self.robot_visuals(robot, visuals, drawing);
        }
    }

    fn robot_visuals(
        &self,
        robot: &Robot,
        visuals: Result<Visuals, ModelError>,
        drawing: &mut Drawing,
    ) {
        let name = &robot.name;
        match visuals {
            Ok(visuals) => {
                let notes = visuals.notes.into_iter();
                drawing
                    .notes
                    .extend(notes.map(|note| format!("robot `{name}`: {note}")));
                let mut counts = HashMap::new();
                for visual in &visuals.visuals {
                    let count = counts.entry(visual.link.clone()).or_insert(0);
                    drawing.visual("visual", robot, visual, *count);
                    *count += 1;
                }
                for (index, site) in visuals.sites.iter().enumerate() {
                    drawing.visual("site", robot, site, index);
                }
            }
            Err(error) => drawing.notes.push(format!("robot `{name}`: {error}")),
        }
        let mut links = robot.links.iter();
        if links.all(|link| self.own_shapes(robot, link) == 0) {
            drawing.skeleton(robot);
        }
    }
}

/// Where a part is: its robot, its body, and that body's frame where the world stands for it.
struct Place {
    robot: Option<String>,
    body: Option<String>,
    frame: Pose,
}

impl Place {
    fn world() -> Place {
        Place {
            robot: None,
            body: None,
            frame: Pose::identity(),
        }
    }

    /// A link of a robot. The world of a MuJoCo model, its first link, is the world.
    fn on_link(robot: &Robot, link: &str) -> Place {
        let is_world = robot.precompiled.is_some() && robot.links[0].name == link;
        Place {
            robot: Some(robot.name.clone()),
            body: (!is_world).then(|| format!("{}/{link}", robot.name)),
            frame: match is_world {
                true => robot.pose,
                false => Pose::identity(),
            },
        }
    }

    /// A part of this kind, with its frame in the body's.
    fn part(&self, kind: &str, name: &str, pose: &Pose) -> Value {
        let pose = self.frame.mul(pose);
        json!({
            "kind": kind,
            "name": name,
            "robot": self.robot,
            "body": self.body,
            "pos": pose.pos,
            "quat": pose.quat,
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
    fn collision(&mut self, place: &Place, name: &str, pose: &Pose, shape: &Shape, added: bool) {
        let mut part = place.part("collision", name, pose);
        part["shape"] = json!(shape.kind());
        part["squares"] = squares(shape);
        part["mesh"] = json!(self.place(shape, false));
        part["whole"] = json!(self.place(shape, true));
        part["added"] = json!(added);
        self.parts.push(part);
    }

    /// Adds what stands for a robot that nothing else of its file shows.
    fn skeleton(&mut self, robot: &Robot) {
        for (count, (link, pose, shape)) in skeleton(robot).into_iter().enumerate() {
            let link = &robot.links[link].name;
            let name = format!("{}/{link}/bone{count}", robot.name);
            let mut part = Place::on_link(robot, link).part("bone", &name, &pose);
            part["shape"] = json!(shape.kind());
            part["mesh"] = json!(self.place(&shape, false));
            self.parts.push(part);
        }
    }

    /// Adds a visual of a kind, whose name is a number where its file has none.
    fn visual(&mut self, kind: &str, robot: &Robot, visual: &Visual, index: usize) {
        let label = visual.name.clone().unwrap_or_else(|| index.to_string());
        let name = format!("{}/{}/{label}", robot.name, visual.link);
        let mut part = Place::on_link(robot, &visual.link).part(kind, &name, &visual.pose);
        part["mesh"] = Value::Null;
        part["color"] = json!(visual.color);
        let texture = visual.texture.as_ref();
        part["texture"] = json!(texture.map(|path| path.to_string_lossy()));
        match &visual.look {
            Look::Shape(shape) => {
                part["shape"] = json!(shape.kind());
                part["squares"] = squares(shape);
                part["mesh"] = json!(self.place(shape, false));
            }
            Look::Sheet { half_extents } => {
                part["shape"] = json!(Shape::Plane.kind());
                part["half_extents"] = json!(half_extents);
            }
            Look::Triangles { kind, surface } => {
                part["shape"] = json!(kind);
                part["mesh"] = json!(self.shared(surface));
            }
            Look::File {
                path,
                scale,
                collada_up_axis,
            } => {
                part["shape"] = json!("mesh");
                part["collada_up_axis"] = json!(collada_up_axis);
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
