//! Shapes of a scene file: static ones, and those of bodies and links.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sim_model::geometry::{HeightField, MeshOptions};
use sim_model::{Collision, Pose, Shape, Surface};

use super::error::ConfigError;
use super::number::Number;
use super::pose::{no_rotation, pose};
use super::surface::given;

/// A shape, static or of a body or link; which sizes it has depends on its type.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeTable {
    /// Its name; left out, a static shape is named after its type.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its type.
    #[serde(rename = "type")]
    pub kind: ShapeName,
    /// Half of each edge of a box [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_extents: Option<[Number; 3]>,
    /// Radii of an ellipsoid along its axes [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radii: Option<[Number; 3]>,
    /// Radius of a sphere, cylinder or capsule [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<Number>,
    /// Half of the height of a cylinder, or of that between the half spheres of a capsule [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub half_height: Option<Number>,
    /// Mesh file, or elevations of a height field as numpy.save writes them, rows along x [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<PathBuf>,
    /// Factor on each axis of a mesh file; left out, 1 [–].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<[Number; 3]>,
    /// Most vertices of a mesh's convex hull, 8 to 1024; left out, 64.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_hull_vertices: Option<usize>,
    /// Lengths of a height field along x and y [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<[Number; 2]>,
    /// Thickness of a height field below its lowest elevation; left out, 1 [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<Number>,
    /// Whether a concave mesh becomes several convex hulls; left out, it becomes one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub convex_decomposition: Option<bool>,
    /// Name of the body that bears it, or `robot/link`; left out, it is static.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// Density of a body's shape [kg/m³]; left out, that of water. A static shape has none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<Number>,
    /// Coefficient of sliding friction; left out, 1 [–].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mu: Option<Number>,
    /// Contact stiffness, as Newton's shape `ke`; left out, 2500.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ke: Option<Number>,
    /// Contact damping, as Newton's shape `kd`; left out, 100.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kd: Option<Number>,
    /// Friction damping, as Newton's shape `kf`; left out, 1000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kf: Option<Number>,
    /// Distance at which contact forces begin; left out, 0 [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub margin: Option<Number>,
    /// How much farther out contacts are listed, without a force; left out, 0 [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gap: Option<Number>,
    /// Directions in which a contact acts: 1 along the normal, 3 with sliding friction; left out, 3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub condim: Option<usize>,
    /// Newton's collision group: 0 touches nothing, a positive one itself and the negative ones, a negative one all but
    /// itself; left out, 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<i32>,
    /// Position in the world, or in the body's frame [m].
    #[serde(default)]
    pub pos: [Number; 3],
    /// Orientation in the world, or in the body's frame, unit quaternion (x, y, z, w) [–].
    #[serde(default = "no_rotation")]
    pub quat: [Number; 4],
}

/// Type of a shape, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ShapeName {
    /// The plane z = 0 of its frame, without end.
    Plane,
    /// A cuboid.
    Box,
    /// A ball.
    Sphere,
    /// A cylinder along its z.
    Cylinder,
    /// A capsule along its z.
    Capsule,
    /// An ellipsoid.
    Ellipsoid,
    /// Triangles of a file, of which the convex hull touches.
    Mesh,
    /// What lies below a grid of elevations.
    Hfield,
}

impl ShapeTable {
    /// Its name, or its place in the list, for messages.
    fn called(&self, index: usize) -> String {
        self.name.clone().unwrap_or_else(|| format!("#{index}"))
    }

    /// The robot and the link that bear it.
    pub(super) fn link(&self) -> Option<(&str, &str)> {
        self.body.as_deref().and_then(|body| body.split_once('/'))
    }

    /// Refuses a bearer that is none of these `bodies` nor a link, what a plane cannot be part of, and the density of what bears no mass.
    pub(super) fn check_body(&self, index: usize, bodies: &[&str]) -> Result<(), ConfigError> {
        let reason = match (&self.body, self.density) {
            (None, Some(_)) => {
                "a static shape has no density; leave it out, or name its body".to_owned()
            }
            (Some(_), _) if self.kind == ShapeName::Plane => {
                "a plane has no end and thus no mass, so it has no body; leave `body` out, or make it a box".to_owned()
            }
            (Some(_), _) if self.kind == ShapeName::Hfield => {
                "a height field is static, so it has no body; leave `body` out, or make it a mesh".to_owned()
            }
            (Some(_), Some(_)) if self.link().is_some() => {
                "a link has the mass that its robot's file gives it, so its shape has no density; leave it out".to_owned()
            }
            (Some(body), _)
                if self.link().is_none() && !bodies.contains(&body.as_str()) =>
            {
                format!(
                    "its body `{body}` is none of the scene's [[body]] tables; a robot's link is `robot/link`"
                )
            }
            _ => return Ok(()),
        };
        let shape = self.called(index);
        Err(ConfigError::Shape { shape, reason })
    }

    /// Its frame.
    pub(super) fn pose(&self) -> Pose {
        pose(&self.pos, &self.quat)
    }

    /// What it is like where it touches.
    pub(super) fn surface(&self) -> Surface {
        let mut surface = Surface::default();
        given!(self).write(&mut surface);
        surface
    }

    /// It as a part of a body or link.
    pub(super) fn collision(
        &self,
        index: usize,
        base_dir: &Path,
    ) -> Result<Collision, ConfigError> {
        let shape = self.shape(index, base_dir)?;
        let mut collision = Collision::new(self.name.clone(), shape, self.pose());
        collision.surface = self.surface();
        Ok(collision)
    }

    /// Its geometry; `index` is its place in the list, from 0, and a relative path is looked for in `base_dir`.
    pub(super) fn shape(&self, index: usize, base_dir: &Path) -> Result<Shape, ConfigError> {
        let (kind, sizes): (_, &[&str]) = match self.kind {
            ShapeName::Plane => ("plane", &[]),
            ShapeName::Box => ("box", &["half_extents"]),
            ShapeName::Sphere => ("sphere", &["radius"]),
            ShapeName::Cylinder => ("cylinder", &["radius", "half_height"]),
            ShapeName::Capsule => ("capsule", &["radius", "half_height"]),
            ShapeName::Ellipsoid => ("ellipsoid", &["radii"]),
            ShapeName::Mesh => ("mesh", &["path"]),
            ShapeName::Hfield => ("hfield", &["path", "size"]),
        };
        let given = [
            ("half_extents", self.half_extents.is_some()),
            ("radii", self.radii.is_some()),
            ("radius", self.radius.is_some()),
            ("half_height", self.half_height.is_some()),
            ("path", self.path.is_some()),
            ("size", self.size.is_some()),
        ];
        let refuse = |reason| {
            let shape = self.called(index);
            Err(ConfigError::Shape { shape, reason })
        };
        for (size, given) in given {
            if given != sizes.contains(&size) {
                let needed = match sizes {
                    [] => "none of the sizes".to_owned(),
                    sizes => sizes.join(" and "),
                };
                return refuse(match given {
                    true => format!("a {kind} has no {size}; give {needed}"),
                    false => format!("{size} is missing; a {kind} needs {needed}"),
                });
            }
        }
        let of_mesh = [
            ("scale", self.scale.is_some()),
            ("max_hull_vertices", self.max_hull_vertices.is_some()),
            ("convex_decomposition", self.convex_decomposition.is_some()),
        ];
        for (entry, given) in of_mesh {
            if given && self.kind != ShapeName::Mesh {
                return refuse(format!("a {kind} has no {entry}; leave it out"));
            }
        }
        if self.base.is_some() && self.kind != ShapeName::Hfield {
            return refuse(format!("a {kind} has no base; leave it out"));
        }
        let path = || base_dir.join(self.path.as_deref().unwrap_or(Path::new("")));
        let radius = self.radius.unwrap_or_default().0;
        let half_height = self.half_height.unwrap_or_default().0;
        Ok(match self.kind {
            ShapeName::Plane => Shape::Plane,
            ShapeName::Box => Shape::Box {
                half_extents: self.half_extents.unwrap_or_default().map(|half| half.0),
            },
            ShapeName::Sphere => Shape::Sphere { radius },
            ShapeName::Cylinder => Shape::Cylinder {
                radius,
                half_height,
            },
            ShapeName::Capsule => Shape::Capsule {
                radius,
                half_height,
            },
            ShapeName::Ellipsoid => Shape::Ellipsoid {
                radii: self.radii.unwrap_or_default().map(|radius| radius.0),
            },
            ShapeName::Mesh => {
                let path = path();
                let scale = self
                    .scale
                    .map_or([1.0; 3], |scale| scale.map(|axis| axis.0));
                let defaults = MeshOptions::default();
                let options = MeshOptions {
                    max_hull_vertices: self.max_hull_vertices.unwrap_or(defaults.max_hull_vertices),
                    convex_decomposition: self.convex_decomposition.unwrap_or_default(),
                    ..defaults
                };
                return Shape::mesh(&path, scale, &options)
                    .or_else(|error| refuse(error.to_string()));
            }
            ShapeName::Hfield => {
                let size = self.size.unwrap_or_default().map(|length| length.0);
                let base = self.base.map_or(1.0, |base| base.0);
                return HeightField::load(&path(), size, base)
                    .map(|field| Shape::HeightField(Arc::new(field)))
                    .or_else(|error| refuse(error.to_string()));
            }
        })
    }
}
