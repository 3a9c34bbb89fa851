//! What a scene looks like, part by part: the shapes that touch, as physics has them, and the visuals of its robots' and
//! models' files.

mod skeleton;
mod told;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use sim_model::{Description, Link, Look, ModelError, Pose, Robot, Shape, Visual, Visuals};

use super::scene::SceneFile;
use skeleton::skeleton;
pub use told::Parts;
pub(crate) use told::hull_sides;

/// What a part is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PartKind {
    /// A shape that touches; of the scene if it was `added`, else of its robot's file.
    Collision { added: bool },
    /// What a robot's file shows.
    Visual,
    /// A site of a MuJoCo model, beside whatever its body shows.
    Site,
    /// It stands for a robot of which nothing else can be seen.
    Bone,
}

/// A part of what a scene looks like.
#[derive(Clone, Debug)]
pub(crate) struct SeenPart {
    pub(crate) kind: PartKind,
    /// `shape`, or `robot/link/part`.
    pub(crate) name: String,
    /// Its robot; none of what the scene has itself.
    pub(crate) robot: Option<String>,
    /// `robot/link` as in the model's list; none in the world, and in the world of a MuJoCo model.
    pub(crate) body: Option<String>,
    /// Its frame in the body's.
    pub(crate) pose: Pose,
    pub(crate) look: Look,
    /// Red, green, blue and opacity that its file gives, from 0 to 1 [–].
    pub(crate) color: Option<[f64; 4]>,
    /// The image that its file gives.
    pub(crate) texture: Option<PathBuf>,
}

/// All parts, and what was left out, a sentence each.
#[derive(Default)]
pub(crate) struct Looks {
    pub(crate) parts: Vec<SeenPart>,
    pub(crate) notes: Vec<String>,
}

impl SceneFile {
    /// What the scene of this description looks like: collisions in the order of the model's shapes, then each robot's visuals,
    /// sites and skeleton; paths as in [`SceneFile::describe`].
    pub(crate) fn looks(&self, description: &Description, base_dir: &Path) -> Looks {
        let mut looks = Looks::default();
        let mut names = description.shape_names().into_iter();
        for shape in &description.shapes {
            let name = names.next().unwrap_or_default();
            looks.collision(&Place::world(), name, &shape.pose, &shape.shape, true);
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
                    looks.collision(&place, name, pose, shape, index >= own_shapes);
                }
            }
        }
        // robots from files come first, in the order of their tables, then models
        let (robots, models) = description.robots.split_at(self.robots.len());
        for (table, robot) in self.robots.iter().zip(robots) {
            let visuals = Robot::visuals(base_dir.join(&table.urdf), &table.options(base_dir));
            self.robot_looks(robot, visuals, &mut looks);
        }
        for (table, robot) in self.mujoco.iter().zip(models) {
            let visuals = Robot::mujoco_visuals(base_dir.join(&table.model));
            self.robot_looks(robot, visuals, &mut looks);
        }
        looks
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

    fn robot_looks(&self, robot: &Robot, visuals: Result<Visuals, ModelError>, looks: &mut Looks) {
        let name = &robot.name;
        match visuals {
            Ok(visuals) => {
                let notes = visuals.notes.into_iter();
                looks
                    .notes
                    .extend(notes.map(|note| format!("robot `{name}`: {note}")));
                let mut counts = HashMap::new();
                for visual in visuals.visuals {
                    let count = counts.entry(visual.link.clone()).or_insert(0);
                    looks.visual(PartKind::Visual, robot, visual, *count);
                    *count += 1;
                }
                for (index, site) in visuals.sites.into_iter().enumerate() {
                    looks.visual(PartKind::Site, robot, site, index);
                }
            }
            Err(error) => looks.notes.push(format!("robot `{name}`: {error}")),
        }
        let mut links = robot.links.iter();
        if links.all(|link| self.own_shapes(robot, link) == 0) {
            looks.skeleton(robot);
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
    fn part(&self, kind: PartKind, name: String, pose: &Pose, look: Look) -> SeenPart {
        SeenPart {
            kind,
            name,
            robot: self.robot.clone(),
            body: self.body.clone(),
            pose: self.frame.mul(pose),
            look,
            color: None,
            texture: None,
        }
    }
}

impl Looks {
    fn collision(&mut self, place: &Place, name: String, pose: &Pose, shape: &Shape, added: bool) {
        let kind = PartKind::Collision { added };
        let look = Look::Shape(shape.clone());
        self.parts.push(place.part(kind, name, pose, look));
    }

    /// Adds what stands for a robot that nothing else of its file shows.
    fn skeleton(&mut self, robot: &Robot) {
        for (count, (link, pose, shape)) in skeleton(robot).into_iter().enumerate() {
            let link = &robot.links[link].name;
            let name = format!("{}/{link}/bone{count}", robot.name);
            let place = Place::on_link(robot, link);
            let part = place.part(PartKind::Bone, name, &pose, Look::Shape(shape));
            self.parts.push(part);
        }
    }

    /// Adds a visual of a kind, whose name is a number where its file has none.
    fn visual(&mut self, kind: PartKind, robot: &Robot, visual: Visual, index: usize) {
        let label = visual.name.unwrap_or_else(|| index.to_string());
        let name = format!("{}/{}/{label}", robot.name, visual.link);
        let place = Place::on_link(robot, &visual.link);
        self.parts.push(SeenPart {
            color: visual.color,
            texture: visual.texture,
            ..place.part(kind, name, &visual.pose, visual.look)
        });
    }
}
