//! What cameras see: the shapes of a scene, and where they are in a world.

use std::collections::HashMap;
use std::sync::Arc;

use sim_model::Pose;
use sim_model::geometry::vector::{Vector as Point, cross, dot, sub};
use sim_model::geometry::{HeightField, Shape, TriMesh};

use crate::field::Field;
use crate::light::KeyLight;
use crate::paint::{Coat, Color, Paint};
use crate::solids::Solid;
use crate::tree::{PartTree, Tree};
use crate::vector::{Frame, Vector};

/// Label of pixels where nothing is seen.
pub const NOTHING: i32 = -1;

/// Most solids at rest that are no tree: each is placed in each image.
const FEW: usize = 32;

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
    /// Its colours. There are no images on surfaces: of a texture, models keep the mean colour or the file.
    pub paint: Paint,
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
        coat: Coat,
    },
    /// Triangles, each with its label and its face.
    Triangles {
        tree: Tree,
        labels: Vec<i32>,
        faces: Vec<Face>,
        /// Colours of faces.
        tones: Vec<Color>,
    },
    Field {
        field: Field,
        label: i32,
    },
}

/// What light falls on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    /// Length 1.
    pub(crate) normal: Vector,
    pub(crate) tone: u32,
    /// Whether nothing of the body is in front of its plane, so that the body does not shade it.
    pub(crate) is_outer: bool,
}

/// Parts of all bodies, those of triangles joined per body, and the light on them.
#[derive(Debug)]
pub struct Scene {
    pub(crate) things: Vec<Thing>,
    pub(crate) light: KeyLight,
    /// The first of them that rest, which are many, are in a tree.
    pub(crate) resting: usize,
    pub(crate) tree: Option<PartTree>,
    bodies: usize,
}

impl Scene {
    /// The scene of these parts, in the light of films. Those whose [`Paint`] is transparent are left out.
    ///
    /// # Panics
    /// More than 2²⁴ parts.
    pub fn new(parts: &[Part]) -> Scene {
        let mut things = Vec::new();
        let mut meshes: Vec<Joined> = Vec::new();
        for part in parts.iter().filter(|part| part.paint.is_seen()) {
            match seen(part) {
                Seen::Solid(solid, coat) => things.push(Thing {
                    body: part.body,
                    frame: Frame::from(&part.pose),
                    surface: Surface::Solid {
                        solid,
                        label: part.label,
                        coat,
                    },
                }),
                Seen::Field(field) => {
                    let (field, center) = Field::new(field, &part.paint);
                    let center = Frame {
                        pos: [0.0, 0.0, center],
                        ..Frame::IDENTITY
                    };
                    things.push(Thing {
                        body: part.body,
                        frame: Frame::from(&part.pose).then(&center),
                        surface: Surface::Field {
                            field,
                            label: part.label,
                        },
                    });
                }
                Seen::Triangles(mesh) => {
                    let joined = meshes.iter().position(|other| other.body == part.body);
                    let joined = joined.unwrap_or_else(|| {
                        meshes.push(Joined {
                            body: part.body,
                            ..Joined::default()
                        });
                        meshes.len() - 1
                    });
                    meshes[joined].add(mesh, part);
                }
            }
        }
        things.extend(meshes.into_iter().map(Joined::thing));
        assert!(things.len() < 1 << 24, "tiles have their numbers as floats");
        // the order of others stays
        things.sort_by_key(|thing| thing.box_at_rest().is_none());
        let boxes: Vec<[Point; 2]> = things.iter().map_while(Thing::box_at_rest).collect();
        let resting = if boxes.len() > FEW { boxes.len() } else { 0 };
        let bodies = parts
            .iter()
            .filter_map(|part| part.body)
            .max()
            .map_or(0, |last| last + 1);
        let scene = Scene {
            things,
            light: KeyLight::default(),
            resting,
            tree: (resting > 0).then(|| PartTree::new(&boxes)),
            bodies,
        };
        scene.lit_by(KeyLight::default())
    }

    /// The same scene in another light.
    pub fn lit_by(mut self, light: KeyLight) -> Scene {
        self.light = light;
        let towards = light.axes.rot.map(|row| row[2]);
        for thing in self.things.iter_mut().filter(|thing| thing.body.is_none()) {
            if let Surface::Field { field, .. } = &mut thing.surface {
                field.open_to(thing.frame.turn_back(towards));
            }
        }
        self
    }

    /// The label of a thing that a pixel sees.
    #[inline(always)]
    pub(crate) fn label(&self, thing: usize, triangle: u32) -> i32 {
        match &self.things[thing].surface {
            Surface::Solid { label, .. } | Surface::Field { label, .. } => *label,
            Surface::Triangles { labels, .. } => labels[triangle as usize],
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
    triangles: Vec<[Point; 3]>,
    labels: Vec<i32>,
    tones: Vec<Color>,
    /// Where they are in that list, by their bits.
    places: HashMap<[u32; 3], usize>,
    /// Of each triangle, its tone.
    chosen: Vec<u32>,
}

impl Joined {
    fn add(&mut self, mesh: &TriMesh, part: &Part) {
        let tone = part.paint.toned(1.0);
        let place = *self
            .places
            .entry(tone.map(f32::to_bits))
            .or_insert_with(|| {
                self.tones.push(tone);
                self.tones.len() - 1
            });
        let corners = mesh
            .triangles
            .iter()
            .map(|&triangle| mesh.corners(triangle));
        self.triangles
            .extend(corners.map(|corners| corners.map(|corner| part.pose.transform(corner))));
        self.chosen.resize(self.triangles.len(), place as u32);
        self.labels.resize(self.triangles.len(), part.label);
    }

    fn thing(self) -> Thing {
        let (tree, center) = Tree::new(&self.triangles);
        let frame = Frame {
            pos: center,
            ..Frame::IDENTITY
        };
        let outer = tree.outer(&self.triangles, center);
        let faces = self.triangles.iter().zip(&self.chosen).zip(outer);
        Thing {
            body: self.body,
            frame,
            surface: Surface::Triangles {
                tree,
                labels: self.labels,
                faces: faces
                    .map(|((corners, &tone), is_outer)| Face {
                        normal: normal(corners),
                        tone,
                        is_outer,
                    })
                    .collect(),
                tones: self.tones,
            },
        }
    }
}

/// The normal of a triangle [–]; not a number where it has no area, and is not seen.
fn normal([a, b, c]: &[Point; 3]) -> Vector {
    let normal = cross(sub(*b, *a), sub(*c, *a));
    let length = dot(normal, normal).sqrt();
    normal.map(|part| (part / length) as f32)
}

impl Thing {
    /// The box in the world around a solid that does not move; none of others, and where it has no end [m].
    fn box_at_rest(&self) -> Option<[Point; 2]> {
        let is_solid = matches!(self.surface, Surface::Solid { .. });
        let half = self.half();
        if self.body.is_some() || !is_solid || half.iter().any(|x| x.is_infinite()) {
            return None;
        }
        let reach = self.frame.rot.map(|row| {
            let products = [0, 1, 2].map(|k| f64::from(row[k].abs()) * f64::from(half[k]));
            products.iter().sum::<f64>()
        });
        let pos = self.frame.pos.map(f64::from);
        Some([sub(pos, reach), [0, 1, 2].map(|k| pos[k] + reach[k])])
    }

    /// Half edges of the box around it, whose centre is the origin of its frame [m].
    pub(crate) fn half(&self) -> Vector {
        match &self.surface {
            Surface::Solid { solid, .. } => solid.half(),
            Surface::Triangles { tree, .. } => tree.half,
            Surface::Field { field, .. } => field.half,
        }
    }
}

enum Seen<'a> {
    Solid(Solid, Coat),
    Triangles(&'a TriMesh),
    Field(&'a HeightField),
}

fn seen(part: &Part) -> Seen<'_> {
    let single = |x: f64| x as f32;
    let plane =
        |half: [f64; 2]| Seen::Solid(Solid::Plane(half.map(single)), part.paint.on_plane(half));
    let solid = match &part.look {
        Look::Triangles(mesh) => return Seen::Triangles(mesh),
        Look::Sheet(half) => return plane(*half),
        Look::Shape(shape) => match shape {
            Shape::Plane => return plane([f64::INFINITY; 2]),
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
            Shape::Mesh(mesh) => return Seen::Triangles(&mesh.triangles),
            Shape::HeightField(field) => return Seen::Field(field),
        },
    };
    Seen::Solid(solid, part.paint.on_solid())
}

impl From<&Pose> for Frame {
    fn from(pose: &Pose) -> Frame {
        Frame::new(pose.pos.map(|x| x as f32), pose.quat.map(|x| x as f32))
    }
}
