//! What a model looks like: the geoms and sites that MuJoCo's viewer shows, whole meshes, in the
//! colours of their materials.

mod cameras;

pub use cameras::MujocoCamera;

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use crate::description::{OnLink, Robot};
use crate::error::ModelError;
use crate::geometry::{Shape, TriMesh};
use crate::mujoco::fields::height_field;
use crate::mujoco::format::ModelFile;
use crate::mujoco::frame;
use crate::mujoco::frames::on_links;
use crate::mujoco::geoms::primitive;
use crate::mujoco::meshes::Meshes;
use crate::mujoco::names::names;
use crate::visual::{Look, Visual, Visuals};

/// Groups of geoms and of sites that MuJoCo's viewer shows at first: those below.
const GROUPS_SHOWN: i64 = 3;
/// `rgba` of a geom or site that has no colour of its own; it then has its material's [–].
const NO_COLOR: [f64; 4] = [0.5, 0.5, 0.5, 1.0];
/// Geoms that are not shown: their kinds, and what they are called.
const LEFT_OUT: [(&str, &str); 1] = [("mjGEOM_SDF", "signed distance field")];

impl Robot {
    /// Reads what the links of a model that MuJoCo compiled look like; nothing where the file has no looks.
    ///
    /// Of a link, the geoms in groups 0 to 2 are shown; those in other groups if there is no such geom.
    /// Sites are shown in groups 0 to 2 alone. A file of an older version has no looks of sites.
    ///
    /// # Errors
    /// What is wrong with the file.
    pub fn mujoco_visuals(path: impl AsRef<Path>) -> Result<Visuals, ModelError> {
        let file = ModelFile::read(path.as_ref())?;
        if !file.has("geom_group") || !file.has("mat_texture_mean") {
            let note =
                "its file has no visual geoms, so what touches is shown; save the scene again";
            return Ok(Visuals {
                notes: vec![note.to_owned()],
                ..Visuals::default()
            });
        }
        visuals(&file)
    }
}

fn visuals(file: &ModelFile) -> Result<Visuals, ModelError> {
    let links = names(file, "body", file.rows("body_parentid"))?;
    let mut surfaces = Surfaces::read(file)?;
    let geoms = Elements::read(file, "geom", links.len())?;
    let mut dressed = vec![false; links.len()];
    for geom in (0..geoms.names.len()).filter(|&geom| geoms.is_shown(geom)) {
        dressed[geoms.places[geom].link] = true;
    }
    let mut visuals = Vec::new();
    for geom in (0..geoms.names.len()).filter(|&geom| geoms.is_seen(geom)) {
        if geoms.is_shown(geom) || !dressed[geoms.places[geom].link] {
            visuals.push(geoms.visual(geom, &links, &mut surfaces)?);
        }
    }
    let mut notes = geoms.notes();
    let mut sites_shown = Vec::new();
    if file.has("site_group") {
        let mut sites = Elements::read(file, "site", links.len())?;
        sites.move_meshes(file)?;
        for site in (0..sites.names.len()).filter(|&site| sites.is_shown(site)) {
            sites_shown.push(sites.visual(site, &links, &mut surfaces)?);
        }
        notes.extend(sites.notes());
    }
    Ok(Visuals {
        visuals,
        sites: sites_shown,
        notes,
    })
}

/// All geoms or all sites of a model, by their numbers.
struct Elements {
    /// `geom` or `site`.
    kind: &'static str,
    names: Vec<String>,
    /// What they are, in MuJoCo's words.
    shapes: Vec<String>,
    places: Vec<OnLink>,
    groups: Vec<i64>,
    /// Red, green, blue and opacity. `(elements, 4)` [–]
    colors: Vec<[f64; 4]>,
    /// `(elements, 3)` [m]
    sizes: Vec<[f64; 3]>,
    /// Their meshes or height fields.
    chosen: Vec<i64>,
}

impl Elements {
    fn read(file: &ModelFile, kind: &'static str, bodies: usize) -> Result<Elements, ModelError> {
        let array = |what: &str| format!("{kind}_{what}");
        let count = file.rows(&array("type"));
        Ok(Elements {
            kind,
            names: names(file, kind, count)?,
            shapes: file.kinds(&array("type"), count)?,
            places: on_links(file, kind, bodies)?,
            groups: file.integers(&array("group"), count)?,
            colors: colors(file, kind, count)?,
            sizes: file.vectors(&array("size"), count)?,
            // sites of older versions of MuJoCo are no meshes
            chosen: file.integers_or(&array("dataid"), count, -1)?,
        })
    }

    /// Moves sites that are meshes to the frames of their vertices. Of geoms MuJoCo's compiler has done
    /// that.
    fn move_meshes(&mut self, file: &ModelFile) -> Result<(), ModelError> {
        if !file.has("mesh_pos") {
            return Ok(());
        }
        let count = file.rows("mesh_vertadr");
        let centers = file.vectors::<3>("mesh_pos", count)?;
        let turns = file.vectors::<4>("mesh_quat", count)?;
        for (site, on) in self.places.iter_mut().enumerate() {
            let mesh = usize::try_from(self.chosen[site]).ok();
            let mesh = mesh.filter(|&mesh| self.shapes[site] == "mjGEOM_MESH" && mesh < count);
            if let Some(mesh) = mesh {
                on.pose = on.pose.mul(&frame(centers[mesh], turns[mesh]));
            }
        }
        Ok(())
    }

    /// What an element is called that is not shown.
    fn left_out(&self, place: usize) -> Option<&'static str> {
        let mut all = LEFT_OUT.iter();
        let known = all.find(|(shape, _)| *shape == self.shapes[place]);
        known.map(|(_, what)| *what)
    }

    /// A sentence for each element that cannot be shown.
    fn notes(&self) -> Vec<String> {
        let all = self.names.iter().enumerate();
        let all = all.filter_map(|(place, name)| {
            let (kind, what) = (self.kind, self.left_out(place)?);
            Some(format!(
                "{kind} `{name}`: no support for a {what}; it is not shown"
            ))
        });
        all.collect()
    }

    /// Can it be seen, if its group is shown?
    fn is_seen(&self, place: usize) -> bool {
        self.left_out(place).is_none() && self.colors[place][3] > 0.0
    }

    fn is_shown(&self, place: usize) -> bool {
        self.is_seen(place) && self.groups[place] < GROUPS_SHOWN
    }

    fn visual(
        &self,
        place: usize,
        links: &[String],
        surfaces: &mut Surfaces<'_>,
    ) -> Result<Visual, ModelError> {
        let on = &self.places[place];
        let look = surfaces.look(&self.shapes[place], self.sizes[place], self.chosen[place])?;
        Ok(Visual {
            link: links[on.link].clone(),
            name: Some(self.names[place].clone()),
            pose: on.pose,
            look,
            color: Some(self.colors[place].map(|part| part.clamp(0.0, 1.0))),
            texture: None,
        })
    }
}

/// Red, green, blue and opacity of each geom or site, as MuJoCo draws it under white light, with the
/// mean of its texture.
fn colors(file: &ModelFile, kind: &str, count: usize) -> Result<Vec<[f64; 4]>, ModelError> {
    let materials = file.rows("mat_rgba");
    let of_materials = file.vectors::<4>("mat_rgba", materials)?;
    let textures = file.vectors::<3>("mat_texture_mean", materials)?;
    let chosen = file.indices(&format!("{kind}_matid"), count, materials)?;
    let rgba = file.vectors::<4>(&format!("{kind}_rgba"), count)?;
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

/// Geometry of geoms and sites. Those with the same mesh share its triangles.
struct Surfaces<'a> {
    file: &'a ModelFile,
    meshes: Meshes<'a>,
    known: HashMap<i64, Arc<TriMesh>>,
}

impl<'a> Surfaces<'a> {
    fn read(file: &'a ModelFile) -> Result<Surfaces<'a>, ModelError> {
        Ok(Surfaces {
            file,
            meshes: Meshes::read(file)?,
            known: HashMap::new(),
        })
    }

    /// The geometry of an element of a kind and size, and with its mesh or height field.
    fn look(&mut self, kind: &str, size: [f64; 3], chosen: i64) -> Result<Look, ModelError> {
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
                let field = height_field(self.file, chosen)?;
                Look::Shape(Shape::HeightField(Arc::new(field)))
            }
            "mjGEOM_MESH" => {
                if !self.known.contains_key(&chosen) {
                    let surface = Arc::new(self.meshes.triangles(chosen)?);
                    self.known.insert(chosen, surface);
                }
                Look::Triangles {
                    kind: "mesh",
                    surface: self.known[&chosen].clone(),
                }
            }
            other => {
                let fault = format!("has geoms or sites of the unknown kind {other}");
                return Err(self.file.fault(fault));
            }
        })
    }
}
