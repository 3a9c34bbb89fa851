//! The shapes of a scene: adding them, their order and names, and pairs that never touch.

use std::collections::{BTreeSet, HashSet};
use std::path::Path;

use super::robot::{Collision, Link, Robot};
use super::scene::{Description, StaticShape};
use crate::error::{ModelError, first_few};
use crate::geometry::{MeshOptions, Shape};
use crate::pose::Pose;
use crate::value_checks as checks;

impl Description {
    /// Adds a static shape; an empty name becomes the first free one of `shape`, `shape_2`, …
    pub fn add_shape(&mut self, name: &str, shape: Shape, pose: Pose) -> &mut StaticShape {
        let name = if name.is_empty() {
            self.free_shape_name(shape.kind())
        } else {
            name.to_owned()
        };
        self.shapes.push(StaticShape::new(&name, shape, pose));
        self.shapes.last_mut().expect("a shape was just added")
    }

    /// Adds a static box with these half edges [m].
    pub fn add_box(&mut self, name: &str, half_extents: [f64; 3], pose: Pose) -> &mut StaticShape {
        self.add_shape(name, Shape::Box { half_extents }, pose)
    }

    /// Adds a level ground at this height [m]; an empty name becomes the first free one of `ground`, `ground_2`, …
    pub fn add_ground(&mut self, name: &str, z: f64) -> &mut StaticShape {
        let name = if name.is_empty() {
            self.free_shape_name("ground")
        } else {
            name.to_owned()
        };
        self.add_shape(&name, Shape::Plane, Pose::at([0.0, 0.0, z]))
    }

    /// Adds a static mesh from a file; names as in [`Description::add_shape`], `scale` [–] as in [`Shape::mesh`].
    ///
    /// # Errors
    /// Why the file cannot be used, by its path, with the cure; the scene is then unchanged.
    pub fn add_mesh(
        &mut self,
        name: &str,
        path: &Path,
        scale: [f64; 3],
        options: &MeshOptions,
        pose: Pose,
    ) -> Result<&mut StaticShape, ModelError> {
        let shape = Shape::mesh(path, scale, options)?;
        Ok(self.add_shape(name, shape, pose))
    }

    /// Adds a shape to a link of a robot. It weighs nothing: the link keeps the mass that its file gives it.
    ///
    /// # Errors
    /// A robot or link that is not there, or a name that another shape of the link has; the scene is then unchanged.
    pub fn add_link_shape(
        &mut self,
        robot: &str,
        link: &str,
        shape: Collision,
    ) -> Result<&mut Collision, ModelError> {
        let unknown = |owner: &str, what, name: &str, known: Vec<&str>| ModelError::UnknownName {
            owner: owner.to_owned(),
            what,
            name: name.to_owned(),
            known: first_few(&known),
        };
        let Some(place) = self.robots.iter().position(|other| other.name == robot) else {
            let known = self.robots.iter().map(|robot| robot.name.as_str());
            return Err(unknown("scene", "robot", robot, known.collect()));
        };
        let owner = format!("robot `{robot}`");
        let Robot { links, notes, .. } = &mut self.robots[place];
        let Some(place) = links.iter().position(|other| other.name == link) else {
            let known = links.iter().map(|link| link.name.as_str());
            return Err(unknown(&owner, "link", link, known.collect()));
        };
        let collisions = &mut links[place].collisions;
        let taken = |name: &String| {
            let mut names = collisions.iter().filter_map(|other| other.name.as_ref());
            names.any(|other| other == name)
        };
        if let Some(name) = shape.name.as_ref().filter(|name| taken(name)) {
            return Err(ModelError::DuplicateName {
                owner: format!("{owner}: link `{link}`"),
                what: "shape",
                name: name.clone(),
            });
        }
        notes.extend(
            shape
                .shape
                .notes()
                .map(|note| format!("link `{link}`: {note}")),
        );
        collisions.push(shape);
        Ok(collisions.last_mut().expect("a shape was just added"))
    }

    /// Names of all shapes: the static ones first, then those of each robot's links, links in body order
    /// ([`Robot::link_order`]).
    ///
    /// A static shape has its own name. A link's shape is `robot/link/shape`, a body's `body/shape`. A shape without a unique
    /// name in its link has its number there instead. A mesh is one shape, however many hulls it has.
    pub fn shape_names(&self) -> Vec<String> {
        let fixed = self.shapes.iter().map(|shape| shape.name.clone());
        let borne = self.robots.iter().flat_map(|robot| {
            let names = robot.shape_names().into_iter();
            names.map(|name| format!("{}/{name}", robot.name))
        });
        fixed.chain(borne).collect()
    }

    /// Pairs of shapes that `filters` keep from touching, as places in [`Description::shape_names`], the lower one first.
    ///
    /// # Errors
    /// A filter whose name is no shape's, link's, body's or robot's.
    pub fn filtered_pairs(&self) -> Result<BTreeSet<[usize; 2]>, ModelError> {
        let names = self.shape_names();
        let mut pairs = BTreeSet::new();
        for [first, second] in &self.filters {
            let shapes_named = |name| named("contact filter", name, &names);
            let (first, second) = (shapes_named(first)?, shapes_named(second)?);
            for &a in &first {
                for &b in second.iter().filter(|&&b| b != a) {
                    pairs.insert([a.min(b), a.max(b)]);
                }
            }
        }
        Ok(pairs)
    }

    pub(crate) fn validate_shape_names(&self) -> Result<(), ModelError> {
        let names = self.shape_names();
        checks::unique("scene", "shape", names.iter().map(String::as_str))
            .map_err(|(_, error)| error)?;
        self.filtered_pairs().map(drop)
    }

    fn free_shape_name(&self, kind: &str) -> String {
        (1..)
            .map(|count| {
                if count == 1 {
                    kind.to_owned()
                } else {
                    format!("{kind}_{count}")
                }
            })
            .find(|name| self.shapes.iter().all(|shape| shape.name != *name))
            .expect("there are more names than shapes")
    }
}

/// The shape of this name, or all those of the robot, body or link of this name; `owner` asks for it.
pub(crate) fn named(owner: &str, name: &str, names: &[String]) -> Result<Vec<usize>, ModelError> {
    if let Some(shape) = names.iter().position(|other| other == name) {
        return Ok(vec![shape]);
    }
    let of_name = |other: &String| {
        let rest = other.strip_prefix(name);
        rest.is_some_and(|rest| rest.starts_with('/'))
    };
    let shapes: Vec<usize> = (0..names.len()).filter(|&i| of_name(&names[i])).collect();
    if shapes.is_empty() {
        return Err(ModelError::UnknownName {
            owner: owner.to_owned(),
            what: "shape, or robot, link or body with shapes,",
            name: name.to_owned(),
            known: first_few(names),
        });
    }
    Ok(shapes)
}

impl Robot {
    /// Names of the shapes of its links, `link/shape`, links in body order; a body's are `shape`.
    pub fn shape_names(&self) -> Vec<String> {
        let mut names = Vec::new();
        for link in self.link_order().into_iter().map(|link| &self.links[link]) {
            names.extend(own_names(link).map(|name| match self.is_body() {
                // users do not see the link that a rigid body has inside
                true => name,
                false => format!("{}/{name}", link.name),
            }));
        }
        names
    }
}

/// Names of a link's shapes in the link. A shape without a unique name gets the first number from its place up that is
/// not taken.
fn own_names(link: &Link) -> impl Iterator<Item = String> {
    let mut taken = HashSet::new();
    let named: Vec<Option<&String>> = (link.collisions.iter())
        .map(|collision| {
            let name = collision.name.as_ref();
            name.filter(|name| checks::name("shape", name).is_ok() && taken.insert(*name))
        })
        .collect();
    let mut taken: HashSet<String> = taken.into_iter().cloned().collect();
    named.into_iter().enumerate().map(move |(index, name)| {
        name.cloned().unwrap_or_else(|| {
            let mut numbers = (index..).map(|number| number.to_string());
            let free = numbers.find(|number| taken.insert(number.clone()));
            free.expect("there are more numbers than names")
        })
    })
}
