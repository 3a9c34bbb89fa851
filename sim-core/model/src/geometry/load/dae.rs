//! COLLADA: every geometry that the visual scene shows, where its nodes put it, in metres.
//!
//! `<unit meter>` and, where it is asked for, `<up_axis>` are applied as the COLLADA 1.4.1 and 1.5 specifications have them
//! (absent: 1 m, y up), as Blender does; a turn is noted. In a URDF file the axes stay as they are, as in RViz: exporters
//! write `Y_UP` into files that are z up. Curves, lines and points are no surface and
//! are passed over; skins are taken as they lie in the file. A geometry names its materials by symbols, which each instance
//! binds.

use std::collections::HashMap;
use std::path::Path;
use std::rc::Rc;

use roxmltree::{Document, Node, NodeId, ParsingOptions};

use super::super::vector::unit;
use super::dae_material::Materials;
use super::dae_mesh;
use super::dae_xml::{ById, Named, numbers, referred};
use super::scene::Affine;
use super::text::text_of;
use super::{Limits, RawMesh};

/// Elements and texts of a file: coordinates are one text each, so real files have some thousands.
const NODES_MAX: u32 = 1_000_000;
/// Deepest nesting of scene nodes.
const DEPTH_MAX: usize = 100;
/// Most scene nodes visited, instances counted each time: a few that refer to one another can stand for billions.
const VISITS_MAX: usize = 10_000;

pub(super) fn read(bytes: &[u8], folder: &Path, limits: Limits) -> Result<RawMesh, String> {
    let text = text_of(bytes)?;
    let options = ParsingOptions {
        allow_dtd: false,
        nodes_limit: NODES_MAX,
        ..ParsingOptions::default()
    };
    let document = Document::parse_with_options(&text, options)
        .map_err(|error| format!("broken XML: {error}; export it again"))?;
    let root = document.root_element();
    if root.tag_name().name() != "COLLADA" {
        return Err(format!(
            "its outermost element is <{}>, not <COLLADA>",
            root.tag_name().name()
        ));
    }
    let by_id = document
        .descendants()
        .filter_map(|node| Some((node.attribute("id")?, node)))
        .collect();
    let mut scene = Scene {
        by_id,
        limits,
        mesh: RawMesh::default(),
        materials: limits.looks.then(|| Materials::new(root, folder)),
        read: HashMap::new(),
        visits: 0,
    };
    let frame = scene.frame(root)?;
    match visual_scene(root, &scene.by_id) {
        Some(visual) => scene.children(visual, frame, 0)?,
        None => {
            for geometry in root
                .descendants()
                .filter(|node| node.has_tag_name_of("geometry"))
            {
                scene.geometry(geometry, frame, None)?;
            }
        }
    }
    if scene.materials.is_some_and(|materials| materials.broken) {
        scene.mesh.notes.push(
            "names materials that are broken or not there, and is shown without them".to_owned(),
        );
    }
    Ok(scene.mesh)
}

/// The scene that the file shows: the one it names, else its first.
fn visual_scene<'a, 'input>(
    root: Node<'a, 'input>,
    by_id: &ById<'a, 'input>,
) -> Option<Node<'a, 'input>> {
    let named = root
        .child("scene")
        .and_then(|scene| scene.child("instance_visual_scene"))
        .and_then(|instance| {
            by_id
                .get(instance.attribute("url")?.strip_prefix('#')?)
                .copied()
        });
    named.or_else(|| root.child("library_visual_scenes")?.child("visual_scene"))
}

struct Scene<'a, 'input> {
    by_id: ById<'a, 'input>,
    limits: Limits,
    mesh: RawMesh,
    /// Only where looks are wanted.
    materials: Option<Materials<'a, 'input>>,
    /// Geometries that were shown before, and the symbols of their materials.
    read: HashMap<NodeId, Rc<(RawMesh, Vec<String>)>>,
    visits: usize,
}

impl<'a, 'input> Scene<'a, 'input> {
    /// From the file's units to metres, and from its axes to z up where that is wanted.
    fn frame(&mut self, root: Node) -> Result<Affine, String> {
        let asset = root.child("asset");
        let unit = asset.and_then(|asset| asset.child("unit"));
        let meter = match unit.and_then(|unit| unit.attribute("meter")) {
            None => 1.0,
            // some exporters write numbers as their country does
            Some(text) => text.trim().replace(',', ".").parse().unwrap_or(f64::NAN),
        };
        if !(meter > 0.0 && meter.is_finite()) {
            return Err(
                "<unit meter> is no positive number; write how many metres a unit has".to_owned(),
            );
        }
        let axis = asset.and_then(|asset| asset.child("up_axis"));
        let axis = axis.and_then(|axis| axis.text()).map_or("Y_UP", str::trim);
        let metres = Affine::scaling([meter; 3]);
        let (axis, turn) = match axis {
            "Y_UP" => ("Y_UP", Affine::Y_UP),
            "X_UP" => ("X_UP", Affine::X_UP),
            other if other == "Z_UP" || !self.limits.collada_up_axis => return Ok(metres),
            other => {
                return Err(format!(
                    "<up_axis> is `{other}`; it must be X_UP, Y_UP or Z_UP"
                ));
            }
        };
        if !self.limits.collada_up_axis {
            self.mesh.ignored_up_axis = Some(axis);
            return Ok(metres);
        }
        self.mesh.notes.push(format!(
            "is turned from {axis} to z up, as its file says; in a URDF file it would not be"
        ));
        Ok(turn.after(metres))
    }

    fn children(
        &mut self,
        parent: Node<'a, 'input>,
        frame: Affine,
        depth: usize,
    ) -> Result<(), String> {
        self.visits += 1;
        if depth > DEPTH_MAX || self.visits > VISITS_MAX {
            return Err(format!(
                "its nodes nest deeper than {DEPTH_MAX}, or stand for more than {VISITS_MAX}; simplify the scene"
            ));
        }
        let mut frame = frame;
        for node in parent.children().filter(Node::is_element) {
            match node.tag_name().name() {
                "matrix" | "translate" | "rotate" | "scale" => {
                    frame = frame.after(transform(node)?)
                }
                name @ ("lookat" | "skew") => {
                    return Err(format!(
                        "<{name}> of a node is not read; bake it into a <matrix>"
                    ));
                }
                "node" => self.children(node, frame, depth + 1)?,
                "instance_node" => {
                    let target = referred(&self.by_id, node, "url")?;
                    self.children(target, frame, depth + 1)?;
                }
                "instance_geometry" => {
                    let target = referred(&self.by_id, node, "url")?;
                    self.geometry(target, frame, Some(node))?;
                }
                "instance_controller" => {
                    let controller = referred(&self.by_id, node, "url")?;
                    if let Some(skin) = controller.child("skin") {
                        let bind = skin.child("bind_shape_matrix").map(transform).transpose()?;
                        let target = referred(&self.by_id, skin, "source")?;
                        let frame = frame.after(bind.unwrap_or(Affine::IDENTITY));
                        self.geometry(target, frame, Some(node))?;
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// Shows a geometry, which is read when it is met first, in the materials of an instance.
    fn geometry(
        &mut self,
        geometry: Node<'a, 'input>,
        frame: Affine,
        instance: Option<Node<'a, 'input>>,
    ) -> Result<(), String> {
        let part = match self.read.get(&geometry.id()) {
            Some(part) => part.clone(),
            None => {
                let part = Rc::new(dae_mesh::read(geometry, &self.by_id, self.limits)?);
                self.read.insert(geometry.id(), part.clone());
                part
            }
        };
        let (part, symbols) = &*part;
        let before = self.mesh.runs.len();
        self.mesh.place(part, &frame, self.limits)?;
        if let (Some(materials), Some(instance)) = (&mut self.materials, instance) {
            let bound = materials.bound(instance);
            for (run, symbol) in self.mesh.runs[before..].iter_mut().zip(symbols) {
                if let Some(material) = bound.get(symbol.as_str()) {
                    run.material = material.clone();
                    run.colors.clear();
                }
            }
        }
        for run in &mut self.mesh.runs[before..] {
            if run.material.texture.is_none() {
                run.uv.clear();
            }
        }
        Ok(())
    }
}

/// How far exporters in `f32` round entries of a matrix [–].
const ROUNDED: f64 = 1e-6;

/// One of a node's transformations.
fn transform(node: Node) -> Result<Affine, String> {
    let values = numbers::<f64>(Some(node))?;
    let map = match (node.tag_name().name(), &values[..]) {
        ("translate", &[x, y, z]) => Affine::translation([x, y, z]),
        ("scale", &[x, y, z]) => Affine::scaling([x, y, z]),
        ("rotate", &[x, y, z, degrees]) => rotation(unit([x, y, z]), degrees.to_radians()),
        ("matrix" | "bind_shape_matrix", values) if values.len() == 16 => {
            let row = |row: usize| [0, 1, 2, 3].map(|column| values[4 * row + column]);
            let last = row(3).into_iter().zip([0.0, 0.0, 0.0, 1.0]);
            let errors = last.map(|(value, affine): (f64, f64)| (value - affine).abs());
            if errors.fold(0.0, f64::max) > ROUNDED {
                return Err(format!(
                    "the last row of a <matrix> is {:?}; it must be 0 0 0 1, export it again",
                    row(3)
                ));
            }
            Affine([row(0), row(1), row(2)])
        }
        (name, values) => {
            return Err(format!(
                "<{name}> of a node has {} numbers; export it again",
                values.len()
            ));
        }
    };
    Ok(map)
}

/// Rodrigues' formula, R = 1 + sin θ K + (1 − cos θ) K² for a unit axis.
fn rotation([x, y, z]: [f64; 3], angle: f64) -> Affine {
    let (s, c) = libm::sincos(angle);
    let t = 1.0 - c;
    Affine::rotation([
        [c + t * x * x, t * x * y - s * z, t * x * z + s * y],
        [t * x * y + s * z, c + t * y * y, t * y * z - s * x],
        [t * x * z - s * y, t * y * z + s * x, c + t * z * z],
    ])
}
