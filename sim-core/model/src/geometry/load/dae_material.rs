//! The materials of a COLLADA file: diffuse colour, its image, and opacity.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use roxmltree::Node;

use super::super::visual::Image;
use super::color::color_of;
use super::dae_xml::{Named, numbers};
use super::raw::{Material, Texture};

/// Elements that materials refer to by their `id`; ids of other elements may be the same.
const KINDS: [&str; 3] = ["material", "effect", "image"];

/// Materials of a file, read when they are met first.
pub(super) struct Materials<'a, 'input> {
    folder: PathBuf,
    by_kind_and_id: HashMap<(&'static str, &'a str), Node<'a, 'input>>,
    /// By the id of a `<material>`; `None` where it is broken or not there.
    read: HashMap<&'a str, Option<Material>>,
    /// Whether some material is broken or not there.
    pub broken: bool,
}

impl<'a, 'input> Materials<'a, 'input> {
    pub fn new(root: Node<'a, 'input>, folder: &Path) -> Materials<'a, 'input> {
        let elements = root.descendants().filter_map(|node| {
            let kind = KINDS.into_iter().find(|kind| node.has_tag_name_of(kind))?;
            Some(((kind, node.attribute("id")?), node))
        });
        Materials {
            folder: folder.to_owned(),
            by_kind_and_id: elements.collect(),
            read: HashMap::new(),
            broken: false,
        }
    }

    /// The materials that an instance of a geometry binds, by their symbols.
    pub fn bound(&mut self, instance: Node<'a, 'input>) -> HashMap<&'a str, Material> {
        let common = instance
            .child("bind_material")
            .and_then(|bind| bind.child("technique_common"));
        let mut bound = HashMap::new();
        for node in common.into_iter().flat_map(|common| common.children()) {
            if !node.has_tag_name_of("instance_material") {
                continue;
            }
            let target = node.attribute("target").unwrap_or_default();
            let id = target.strip_prefix('#').unwrap_or_default();
            let bound_material = match self.read.get(id) {
                Some(known) => known.clone(),
                None => {
                    let material = self.material(id);
                    self.broken |= material.is_none();
                    self.read.insert(id, material.clone());
                    material
                }
            };
            if let (Some(symbol), Some(material)) = (node.attribute("symbol"), bound_material) {
                bound.insert(symbol, material);
            }
        }
        bound
    }

    /// A `<material>` by way of its effect; `None` where something of it is broken or not there.
    fn material(&self, id: &str) -> Option<Material> {
        let material = self.by_kind_and_id.get(&("material", id))?;
        let url = material.child("instance_effect")?.attribute("url")?;
        let effect = self
            .by_kind_and_id
            .get(&("effect", url.strip_prefix('#')?))?;
        let profile = effect.child("profile_COMMON")?;
        let technique = profile.child("technique")?;
        let shader = ["phong", "lambert", "blinn", "constant"]
            .into_iter()
            .find_map(|name| technique.child(name))?;
        let scope = Scope {
            materials: self,
            levels: [technique, profile],
        };
        let opacity = opacity(&scope, shader).unwrap_or(1.0);
        Some(match scope.value(shader, "diffuse")? {
            Value::Nothing => Material::default(),
            Value::Color([r, g, b, _]) => Material {
                color: Some(color_of([r, g, b, opacity])),
                texture: None,
            },
            Value::Image(image) => Material {
                color: None,
                texture: Some(Texture {
                    image: Rc::new(Image::File(image)),
                    tint: [255; 4],
                }),
            },
        })
    }
}

/// What a shader says of a property.
enum Value {
    Nothing,
    Color([f64; 4]),
    Image(PathBuf),
}

/// Where the parameters of an effect are looked for.
struct Scope<'b, 'a, 'input> {
    materials: &'b Materials<'a, 'input>,
    levels: [Node<'a, 'input>; 2],
}

impl<'a, 'input> Scope<'_, 'a, 'input> {
    /// A `<newparam>` by its `sid`.
    fn parameter(&self, sid: &str) -> Option<Node<'a, 'input>> {
        let all = self.levels.iter().flat_map(|level| level.children());
        all.filter(|node| node.has_tag_name_of("newparam"))
            .find(|node| node.attribute("sid") == Some(sid))
    }

    /// A property of a shader; `None` where it is broken.
    fn value(&self, shader: Node<'a, 'input>, name: &str) -> Option<Value> {
        let Some(property) = shader.child(name) else {
            return Some(Value::Nothing);
        };
        let value = property.children().find(Node::is_element)?;
        match value.tag_name().name() {
            "color" => color(value).map(Value::Color),
            "texture" => self.image(value.attribute("texture")?).map(Value::Image),
            "param" => {
                let parameter = self.parameter(value.attribute("ref").unwrap_or_default());
                let number = parameter.and_then(|node| {
                    ["float3", "float4"]
                        .into_iter()
                        .find_map(|name| node.child(name))
                });
                number.map_or(Some(Value::Nothing), |number| {
                    color(number).map(Value::Color)
                })
            }
            _ => Some(Value::Nothing),
        }
    }

    /// The file of a texture: by its sampler and surface, or named at once, as some exporters do.
    fn image(&self, sampler: &str) -> Option<PathBuf> {
        let id = match self.parameter(sampler) {
            None => sampler,
            Some(parameter) => {
                let sampler = parameter.child("sampler2D")?;
                match sampler.child("instance_image") {
                    // COLLADA 1.5
                    Some(image) => image.attribute("url")?.strip_prefix('#')?,
                    None => {
                        let surface = sampler.child("source")?.text()?.trim();
                        let surface = self.parameter(surface)?.child("surface")?;
                        surface.child("init_from")?.text()?.trim()
                    }
                }
            }
        };
        let image = self.materials.by_kind_and_id.get(&("image", id))?;
        let from = image.child("init_from")?;
        let name = from.child("ref").unwrap_or(from).text()?.trim();
        let name = name.strip_prefix("file://").unwrap_or(name);
        (!name.is_empty()).then(|| self.materials.folder.join(name.replace('\\', "/")))
    }
}

/// Red, green, blue and opacity; what is left out is 0, and opaque.
fn color(node: Node) -> Option<[f64; 4]> {
    let numbers = numbers::<f64>(Some(node)).ok()?;
    let part = |at: usize, default| numbers.get(at).copied().unwrap_or(default);
    Some([part(0, 0.0), part(1, 0.0), part(2, 0.0), part(3, 1.0)])
}

/// What `<transparent>` and `<transparency>` leave; `None` for what would be invisible, an exporter's slip.
fn opacity<'a, 'input>(scope: &Scope<'_, 'a, 'input>, shader: Node<'a, 'input>) -> Option<f64> {
    let Some(Value::Color([r, g, b, a])) = scope.value(shader, "transparent") else {
        return None;
    };
    let rgb_zero = shader.child("transparent")?.attribute("opaque") == Some("RGB_ZERO");
    let share = shader
        .child("transparency")
        .and_then(|node| node.child("float"))
        .and_then(|node| node.text()?.trim().parse::<f64>().ok());
    let opacity = if rgb_zero {
        1.0 - share.unwrap_or(0.0) * (r + g + b) / 3.0
    } else {
        share.unwrap_or(1.0) * a
    };
    (opacity > 0.0 && opacity <= 1.0).then_some(opacity)
}
