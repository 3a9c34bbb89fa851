//! What cameras see: the shapes of a scene, and where they are in a world.

use std::borrow::Cow;
use std::sync::Arc;

use sim_model::Pose;
use sim_model::geometry::{Shape, TriMesh};

use crate::solids::Solid;
use crate::tree::Tree;
use crate::vector::{Frame, Vector};

/// Label of pixels where nothing is seen.
pub const NOTHING: i32 = -1;

/// What a part looks like.
#[derive(Clone, Debug)]
pub enum Look {
    /// A shape; of a mesh, its surface.
    Shape(Shape),
    /// Triangles, whose corners run counter-clockwise from their front.
    Triangles(Arc<TriMesh>),
    /// A part of the plane z = 0 of its frame, seen from above, with half edges [m].
    Sheet([f64; 2]),
}

/// A part of a body.
#[derive(Clone, Debug)]
pub struct Part {
    /// The body that carries it; none if it does not move.
    pub body: Option<usize>,
    /// Its frame in the body's.
    pub pose: Pose,
    /// What it looks like.
    pub look: Look,
    /// What segmentation calls it.
    pub label: i32,
}

/// What is seen at one place: a solid, or the triangles of a body.
#[derive(Debug)]
pub(crate) struct Thing {
    pub(crate) body: Option<usize>,
    /// Its frame in the body's.
    pub(crate) frame: Frame,
    pub(crate) surface: Surface,
}

#[derive(Debug)]
pub(crate) enum Surface {
    Solid {
        solid: Solid,
        label: i32,
    },
    /// Triangles, each with its label.
    Triangles {
        tree: Tree,
        labels: Vec<i32>,
    },
}

/// Parts of all bodies, those of triangles joined per body.
#[derive(Debug)]
pub struct Scene {
    pub(crate) things: Vec<Thing>,
    bodies: usize,
}

impl Scene {
    /// The scene of these parts.
    pub fn new(parts: &[Part]) -> Scene {
        let mut things = Vec::new();
        let mut meshes: Vec<Joined> = Vec::new();
        for part in parts {
            match seen(&part.look) {
                Seen::Solid(solid) => things.push(Thing {
                    body: part.body,
                    frame: frame(&part.pose),
                    surface: Surface::Solid {
                        solid,
                        label: part.label,
                    },
                }),
                Seen::Triangles(mesh) => {
                    let joined = meshes.iter().position(|other| other.body == part.body);
                    let joined = joined.unwrap_or_else(|| {
                        meshes.push(Joined {
                            body: part.body,
                            ..Joined::default()
                        });
                        meshes.len() - 1
                    });
                    meshes[joined].add(&mesh, &part.pose, part.label);
                }
            }
        }
        things.extend(meshes.into_iter().map(Joined::thing));
        let bodies = parts
            .iter()
            .filter_map(|part| part.body)
            .max()
            .map_or(0, |last| last + 1);
        Scene { things, bodies }
    }

    /// The label of what a pixel sees.
    #[inline(always)]
    pub(crate) fn label(&self, thing: u32, triangle: u32) -> i32 {
        match self.things.get(thing as usize).map(|thing| &thing.surface) {
            Some(Surface::Solid { label, .. }) => *label,
            Some(Surface::Triangles { labels, .. }) => labels[triangle as usize],
            None => NOTHING,
        }
    }

    /// Bodies whose frames an image needs.
    pub fn bodies(&self) -> usize {
        self.bodies
    }
}

/// Triangles of a body.
#[derive(Default)]
struct Joined {
    body: Option<usize>,
    triangles: Vec<[[f64; 3]; 3]>,
    labels: Vec<i32>,
}

impl Joined {
    fn add(&mut self, mesh: &TriMesh, pose: &Pose, label: i32) {
        let corners = mesh
            .triangles
            .iter()
            .map(|&triangle| mesh.corners(triangle));
        self.triangles
            .extend(corners.map(|corners| corners.map(|corner| pose.transform(corner))));
        self.labels.resize(self.triangles.len(), label);
    }

    fn thing(self) -> Thing {
        let (tree, center) = Tree::new(&self.triangles);
        let frame = Frame {
            pos: center,
            ..Frame::IDENTITY
        };
        Thing {
            body: self.body,
            frame,
            surface: Surface::Triangles {
                tree,
                labels: self.labels,
            },
        }
    }
}

impl Thing {
    /// Half edges of the box around it, whose centre is the origin of its frame [m].
    pub(crate) fn half(&self) -> Vector {
        match &self.surface {
            Surface::Solid { solid, .. } => solid.half(),
            Surface::Triangles { tree, .. } => tree.half,
        }
    }
}

enum Seen<'a> {
    Solid(Solid),
    Triangles(Cow<'a, TriMesh>),
}

fn seen(look: &Look) -> Seen<'_> {
    let single = |x: f64| x as f32;
    Seen::Solid(match look {
        Look::Triangles(mesh) => return Seen::Triangles(Cow::Borrowed(mesh)),
        Look::Sheet(half) => Solid::Plane(half.map(single)),
        Look::Shape(shape) => match shape {
            Shape::Plane => Solid::Plane([f32::INFINITY; 2]),
            Shape::Box { half_extents } => Solid::Box(half_extents.map(single)),
            Shape::Sphere { radius } => Solid::Ellipsoid([single(*radius); 3]),
            Shape::Ellipsoid { radii } => Solid::Ellipsoid(radii.map(single)),
            Shape::Cylinder {
                radius,
                half_height,
            } => Solid::Cylinder(single(*radius), single(*half_height)),
            Shape::Capsule {
                radius,
                half_height,
            } => Solid::Capsule(single(*radius), single(*half_height)),
            Shape::Mesh(mesh) => return Seen::Triangles(Cow::Borrowed(&mesh.triangles)),
            Shape::HeightField(field) => return Seen::Triangles(Cow::Owned(field.surface())),
        },
    })
}

fn frame(pose: &Pose) -> Frame {
    Frame::new(pose.pos.map(|x| x as f32), pose.quat.map(|x| x as f32))
}
