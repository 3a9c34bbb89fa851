//! What a model looks like: the geoms that MuJoCo's viewer shows, whole meshes, in the colours of their materials.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::fields::height_field;
use super::format::ModelFile;
use super::frames::on_links;
use super::geoms::primitive;
use super::meshes::Meshes;
use super::names::names;
use crate::description::Robot;
use crate::error::ModelError;
use crate::geometry::{Shape, TriMesh};
use crate::visual::{Look, Visual, Visuals};

/// Groups of geoms that MuJoCo's viewer shows at first: those below.
const GROUPS_SHOWN: i64 = 3;
/// `rgba` of a geom that has no colour of its own; it then has its material's [–].
const NO_COLOR: [f64; 4] = [0.5, 0.5, 0.5, 1.0];
/// Geoms that are not shown: their kinds, and what they are called.
const LEFT_OUT: [(&str, &str); 1] = [("mjGEOM_SDF", "signed distance field")];

impl Robot {
    /// Reads what the links of a model that MuJoCo compiled look like; nothing where the file has no looks.
    ///
    /// Of a link, the geoms in groups 0 to 2 are shown; those in other groups if there is no such geom.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn mujoco_visuals(path: impl AsRef<Path>) -> Result<Visuals, ModelError> {
        let file = ModelFile::read(path.as_ref())?;
        if !file.has("geom_group") || !file.has("mat_texture_mean") {
            let note =
                "its file has no visual geoms, so what touches is shown; save the scene again";
            return Ok(Visuals {
                visuals: Vec::new(),
                notes: vec![note.to_owned()],
            });
        }
        visuals(&file)
    }
}

fn visuals(file: &ModelFile) -> Result<Visuals, ModelError> {
    let count = file.rows("geom_type");
    let links = names(file, "body", file.rows("body_parentid"))?;
    let geom_names = names(file, "geom", count)?;
    let kinds = file.kinds("geom_type", count)?;
    let places = on_links(file, "geom", links.len())?;
    let groups = file.integers("geom_group", count)?;
    let colors = colors(file, count)?;
    let mut notes = Vec::new();
    for geom in 0..count {
        let left_out = LEFT_OUT.iter().find(|(kind, _)| *kind == kinds[geom]);
        notes.extend(left_out.map(|(_, what)| {
            let name = &geom_names[geom];
            format!("geom `{name}`: no support for a {what}; it is not shown")
        }));
    }
    let is_seen = |geom: usize| {
        let left_out = LEFT_OUT.iter().any(|(kind, _)| *kind == kinds[geom]);
        !left_out && colors[geom][3] > 0.0
    };
    let is_shown = |geom: usize| is_seen(geom) && groups[geom] < GROUPS_SHOWN;
    let mut dressed = vec![false; links.len()];
    for geom in (0..count).filter(|&geom| is_shown(geom)) {
        dressed[places[geom].link] = true;
    }
    let mut surfaces = Surfaces::read(file, count)?;
    let mut visuals = Vec::new();
    for geom in (0..count).filter(|&geom| is_seen(geom)) {
        let link = places[geom].link;
        if dressed[link] && !is_shown(geom) {
            continue;
        }
        visuals.push(Visual {
            link: links[link].clone(),
            name: Some(geom_names[geom].clone()),
            pose: places[geom].pose,
            look: surfaces.look(&kinds[geom], geom)?,
            color: Some(colors[geom].map(|part| part.clamp(0.0, 1.0))),
            texture: None,
        });
    }
    Ok(Visuals { visuals, notes })
}

/// Red, green, blue and opacity of each geom, as MuJoCo draws it under white light, with the mean of its texture.
fn colors(file: &ModelFile, count: usize) -> Result<Vec<[f64; 4]>, ModelError> {
    let materials = file.rows("mat_rgba");
    let of_materials = file.vectors::<4>("mat_rgba", materials)?;
    let textures = file.vectors::<3>("mat_texture_mean", materials)?;
    let chosen = file.indices("geom_matid", count, materials)?;
    let rgba = file.vectors::<4>("geom_rgba", count)?;
    let all = rgba.into_iter().zip(chosen).map(|(rgba, material)| {
        let Some(material) = material else {
            return rgba;
        };
        let [red, green, blue, opacity] = match rgba == NO_COLOR {
            true => of_materials[material],
            false => rgba,
        };
        let texture = textures[material];
        [
            red * texture[0],
            green * texture[1],
            blue * texture[2],
            opacity,
        ]
    });
    Ok(all.collect())
}

/// Geometry of geoms. Geoms with the same mesh share its triangles.
struct Surfaces<'a> {
    file: &'a ModelFile,
    sizes: Vec<[f64; 3]>,
    chosen: Vec<i64>,
    meshes: Meshes<'a>,
    known: HashMap<i64, Arc<TriMesh>>,
}

impl<'a> Surfaces<'a> {
    fn read(file: &'a ModelFile, count: usize) -> Result<Surfaces<'a>, ModelError> {
        Ok(Surfaces {
            file,
            sizes: file.vectors("geom_size", count)?,
            chosen: file.integers("geom_dataid", count)?,
            meshes: Meshes::read(file)?,
            known: HashMap::new(),
        })
    }

    fn look(&mut self, kind: &str, geom: usize) -> Result<Look, ModelError> {
        let size = self.sizes[geom];
        if let Some(shape) = primitive(kind, size) {
            return Ok(Look::Shape(shape));
        }
        Ok(match kind {
            "mjGEOM_PLANE" => Look::Sheet {
                // MuJoCo has 0 where a plane has no end
                half_extents: [size[0], size[1]].map(|half| match half > 0.0 {
                    true => half,
                    false => f64::INFINITY,
                }),
            },
            "mjGEOM_HFIELD" => {
                let field = height_field(self.file, self.chosen[geom])?;
                Look::Shape(Shape::HeightField(Arc::new(field)))
            }
            "mjGEOM_MESH" => {
                let mesh = self.chosen[geom];
                if !self.known.contains_key(&mesh) {
                    let surface = Arc::new(self.meshes.triangles(mesh)?);
                    self.known.insert(mesh, surface);
                }
                Look::Triangles {
                    kind: "mesh",
                    surface: self.known[&mesh].clone(),
                }
            }
            other => {
                let fault = format!("has geoms of the unknown kind {other}");
                return Err(self.file.fault(fault));
            }
        })
    }
}
