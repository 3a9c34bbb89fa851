//! What the links of a URDF file look like.
//!
//! Looks have no part in the physics: they are in no `Robot` and in no hash, and are read by those who draw. So nothing here
//! refuses a file that physics takes; what cannot be shown says why. A `<material>` with a colour or texture of its own holds
//! where it stands; one with a name only stands for the first of that name, those of the robot before those of its links.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use roxmltree::Node;

use super::mesh::{self, Found};
use super::options::UrdfOptions;
use super::scan::{Scan, children};
use super::table::{Attribute, GEOMETRY, Need, ORIGIN, Tag};
use super::xml::short;
use super::{source, value, xml};
use crate::description::{Robot, Shape};
use crate::error::ModelError;
use crate::pose::Pose;
use crate::visual::{Look, Visual, Visuals};

impl Robot {
    /// Reads what the links of a URDF file look like; files are looked for and turned as those of collisions are.
    ///
    /// # Errors
    /// What is wrong with the file apart from its visuals.
    pub fn visuals(path: impl AsRef<Path>, options: &UrdfOptions) -> Result<Visuals, ModelError> {
        let path = path.as_ref();
        let mut notes = Vec::new();
        let text = source::read(path, &mut notes)?;
        let text = source::prepare(&text, path, &mut notes)?;
        let document = xml::parse(&text, path)?;
        let scan = Scan::new(&document, path)?;
        let mut looks = Looks {
            folder: path.parent().unwrap_or(Path::new("")),
            package_dirs: &options.package_dirs,
            collada_up_axis: options.meshes.collada_up_axis,
            quaternions: scan.has_quaternions(),
            named: HashMap::new(),
            // what else there is to say of the file, the robot says
            notes: Vec::new(),
        };
        for material in children(scan.root(), "material") {
            looks.define(material);
        }
        for visual in scan.links.iter().flat_map(|link| children(*link, "visual")) {
            for material in children(visual, "material") {
                looks.define(material);
            }
        }
        let mut all = Vec::new();
        for link in &scan.links {
            let name = link.attribute("name").unwrap_or_default();
            for visual in children(*link, "visual") {
                all.push(looks.visual(name, visual));
            }
        }
        // a material is read once for its name and once for each visual that holds it
        looks.notes.sort();
        looks.notes.dedup();
        Ok(Visuals {
            visuals: all,
            notes: looks.notes,
            ..Visuals::default()
        })
    }
}

/// Colour and image.
#[derive(Clone, Default)]
struct Material {
    color: Option<[f64; 4]>,
    texture: Option<PathBuf>,
}

struct Looks<'a> {
    folder: &'a Path,
    package_dirs: &'a [PathBuf],
    collada_up_axis: bool,
    /// Whether `quat_xyzw` counts.
    quaternions: bool,
    named: HashMap<String, Material>,
    notes: Vec<String>,
}

impl Looks<'_> {
    /// Keeps a material under its name, unless an earlier one has it.
    fn define(&mut self, node: Node) {
        let Some(name) = node.attribute("name").filter(|name| !name.is_empty()) else {
            return;
        };
        if self.named.contains_key(name) {
            return;
        }
        if let Some(material) = self.material(node) {
            self.named.insert(name.to_owned(), material);
        }
    }

    /// What a `<material>` says itself, if anything.
    fn material(&mut self, node: Node) -> Option<Material> {
        let color = children(node, "color").find_map(|color| color.attribute("rgba"));
        let texture = children(node, "texture").find_map(|texture| texture.attribute("filename"));
        if color.is_none() && texture.is_none() {
            return None;
        }
        let mut material = Material::default();
        if let Some(text) = color {
            material.color = rgba(text);
            if material.color.is_none() {
                let text = short(text);
                self.notes.push(format!(
                    "colour \"{text}\" of a material is not four numbers and is ignored"
                ));
            }
        }
        if let Some(uri) = texture.filter(|uri| !uri.is_empty()) {
            match self.find(uri) {
                Ok(path) => material.texture = Some(path),
                Err(problem) => self.notes.push(format!("texture {problem}")),
            }
        }
        Some(material)
    }

    fn visual(&mut self, link: &str, node: Node) -> Visual {
        let material = children(node, "material").next();
        let material = material.and_then(|material| {
            let name = material.attribute("name").unwrap_or_default();
            self.material(material)
                .or_else(|| self.named.get(name).cloned())
        });
        let Material { color, texture } = material.unwrap_or_default();
        let (pose, look) = match self
            .pose(node)
            .and_then(|pose| Ok((pose, self.look(node)?)))
        {
            Ok(both) => both,
            Err(problem) => (Pose::identity(), Look::Nothing { problem }),
        };
        Visual {
            link: link.to_owned(),
            name: node
                .attribute("name")
                .filter(|name| !name.trim().is_empty())
                .map(short),
            pose,
            look,
            color,
            texture,
        }
    }

    fn pose(&self, node: Node) -> Result<Pose, String> {
        let Some(origin) = children(node, ORIGIN.name).next() else {
            return Ok(Pose::identity());
        };
        let vector =
            |name| Ok::<_, String>(numbers::<3>(&ORIGIN, origin, name)?.unwrap_or([0.0; 3]));
        let (pos, mut rpy) = (vector("xyz")?, vector("rpy")?);
        if self.quaternions
            && let Some(quat) = numbers::<4>(&ORIGIN, origin, "quat_xyzw")?
        {
            rpy = value::rpy_of_quat(quat)
                .ok_or("attribute `quat_xyzw` is zero; give x, y, z, w of length 1")?;
        }
        Ok(Pose::from_rpy(pos, rpy))
    }

    fn look(&self, node: Node) -> Result<Look, String> {
        let cure = "give one <box>, <sphere>, <cylinder>, <capsule> or <mesh> in one <geometry>";
        let geometry = children(node, GEOMETRY.name).next();
        let known = geometry.and_then(|geometry| {
            let mut tags = GEOMETRY.children.iter().map(|(tag, _)| *tag);
            tags.find_map(|tag| Some((children(geometry, tag.name).next()?, tag)))
        });
        let Some((shape, tag)) = known else {
            return Err(format!("it has no shape that is known; {cure}"));
        };
        let size = |name| number(tag, shape, name);
        let half = |name| size(name).map(|length| 0.5 * length);
        Ok(Look::Shape(match tag.name {
            "box" => Shape::Box {
                half_extents: required(tag, shape, "size")?.map(|edge| 0.5 * edge),
            },
            "sphere" => Shape::Sphere {
                radius: size("radius")?,
            },
            "cylinder" => Shape::Cylinder {
                radius: size("radius")?,
                half_height: half("length")?,
            },
            "capsule" => Shape::Capsule {
                radius: size("radius")?,
                half_height: half("length")?,
            },
            _ => {
                let uri = shape.attribute("filename").unwrap_or_default();
                let scale = numbers(tag, shape, "scale")?.unwrap_or([1.0; 3]);
                if scale.contains(&0.0) {
                    return Err(format!(
                        "attribute `scale` is {scale:?}; no factor must be 0"
                    ));
                }
                let path = self
                    .find(uri)
                    .map_err(|problem| format!("mesh {problem}"))?;
                return Ok(Look::File {
                    path,
                    scale,
                    collada_up_axis: self.collada_up_axis,
                });
            }
        }))
    }

    /// The file that a path leads to, or why there is none.
    fn find(&self, uri: &str) -> Result<PathBuf, String> {
        match mesh::resolve(uri, self.folder, self.package_dirs) {
            Found::File(path) | Found::Renamed { path, .. } => Ok(path),
            Found::Missing(_) => Err(format!("`{}` is missing", short(uri))),
            Found::Refused(rule) => Err(format!("`{}`: {rule}", short(uri))),
        }
    }
}

/// Four numbers, or three where opacity is left out, brought between 0 and 1.
fn rgba(text: &str) -> Option<[f64; 4]> {
    let parts = text.split(|c: char| c.is_whitespace() || c == ',');
    let parts = parts.filter(|part| !part.is_empty());
    let parts: Vec<f64> = parts.map(|part| part.parse().ok()).collect::<Option<_>>()?;
    let color = match parts[..] {
        [r, g, b] => [r, g, b, 1.0],
        [r, g, b, a] => [r, g, b, a],
        _ => return None,
    };
    color
        .iter()
        .all(|part| part.is_finite())
        .then_some(color.map(|part| part.clamp(0.0, 1.0)))
}

/// The numbers of an attribute, checked as the table says; `None` where it is absent.
fn numbers<const N: usize>(tag: &Tag, node: Node, name: &str) -> Result<Option<[f64; N]>, String> {
    let is_it = |attribute: &&Attribute| attribute.name == name;
    let attribute = tag.attributes.iter().find(is_it);
    let attribute = attribute.expect("the table has every attribute that is read");
    let Some(text) = node.attribute(name) else {
        return match attribute.need {
            Need::Required => Err(format!("attribute `{name}` of <{}> is missing", tag.name)),
            _ => Ok(None),
        };
    };
    let text = value::read(attribute, text)?.text;
    let mut parts = text.split(' ').filter_map(|part| part.parse().ok());
    Ok(Some(std::array::from_fn(|_| parts.next().unwrap_or(0.0))))
}

fn required<const N: usize>(tag: &Tag, node: Node, name: &str) -> Result<[f64; N], String> {
    let missing = || format!("attribute `{name}` of <{}> is missing", tag.name);
    numbers(tag, node, name)?.ok_or_else(missing)
}

fn number(tag: &Tag, node: Node, name: &str) -> Result<f64, String> {
    required::<1>(tag, node, name).map(|[number]| number)
}
