//! Geoms of a model as rays meet them: also those that touch nothing, and meshes by their triangles.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::path::Path;
use std::sync::Arc;

use super::fields::height_field;
use super::format::ModelFile;
use super::frames::on_links;
use super::meshes::Meshes;
use super::names::names;
use crate::error::ModelError;
use crate::geometry::{RayShape, TriangleTree};
use crate::ray_scene::{RayGeom, RayScene};

impl RayScene {
    /// Adds the geoms of a model that MuJoCo compiled. In the scene it has a name, and `first_body` is its world.
    ///
    /// # Errors
    /// A file that cannot be read, or that lacks what rays need.
    pub fn add_mujoco(
        &mut self,
        path: impl AsRef<Path>,
        name: &str,
        first_body: usize,
    ) -> Result<(), ModelError> {
        let file = ModelFile::read(path.as_ref())?;
        let count = file.rows("geom_type");
        let all_names = names(&file, "geom", count)?;
        let kinds = file.kinds("geom_type", count)?;
        let sizes = file.vectors::<3>("geom_size", count)?;
        let bodies = file.rows("body_weldid");
        let welds = file.indices("body_weldid", bodies, bodies)?;
        let places = on_links(&file, "geom", bodies)?;
        let visible = visible(&file)?;
        let groups = match file.has("geom_group") {
            true => Some(file.integers("geom_group", count)?),
            false => None,
        };
        let meshes = Meshes::read(&file)?;
        let mut trees: HashMap<i64, Arc<TriangleTree>> = HashMap::new();
        let mut tree = |mesh: i64| -> Result<Arc<TriangleTree>, ModelError> {
            Ok(match trees.entry(mesh) {
                Entry::Occupied(known) => known.get().clone(),
                Entry::Vacant(new) => {
                    let made = Arc::new(TriangleTree::new(&meshes.triangles(mesh)?));
                    new.insert(made).clone()
                }
            })
        };
        let own_meshes = file.integers("geom_dataid", count)?;
        for geom in 0..count {
            let [a, b, c] = sizes[geom];
            let shape = match kinds[geom].as_str() {
                "mjGEOM_PLANE" => Some(RayShape::Plane([a, b])),
                "mjGEOM_SPHERE" => Some(RayShape::Sphere(a)),
                "mjGEOM_CAPSULE" => Some(RayShape::Capsule(a, b)),
                "mjGEOM_ELLIPSOID" => Some(RayShape::Ellipsoid([a, b, c])),
                "mjGEOM_CYLINDER" => Some(RayShape::Cylinder(a, b)),
                "mjGEOM_BOX" => Some(RayShape::Box([a, b, c])),
                "mjGEOM_HFIELD" => {
                    let field = height_field(&file, own_meshes[geom])?;
                    let tree = TriangleTree::new(&field.ray_surface());
                    Some(RayShape::Mesh(Arc::new(tree)))
                }
                "mjGEOM_MESH" => Some(RayShape::Mesh(tree(own_meshes[geom])?)),
                _ => None,
            };
            self.geoms.push(RayGeom {
                name: format!("{name}/{}", all_names[geom]),
                kind: kinds[geom].clone(),
                shape,
                body: first_body + places[geom].link,
                pose: places[geom].pose,
                group: groups.as_ref().map(|groups| groups[geom]),
                is_static: welds[places[geom].link] == Some(0),
                is_visible: visible[geom],
            });
        }
        Ok(())
    }
}

/// Which geoms are seen: the opacity of a material comes before that of a geom.
pub(super) fn visible(file: &ModelFile) -> Result<Vec<bool>, ModelError> {
    let count = file.rows("geom_type");
    let colors = file.vectors::<4>("geom_rgba", count)?;
    let materials = file.rows("mat_rgba");
    let of_materials = file.vectors::<4>("mat_rgba", materials)?;
    let materials = file.indices("geom_matid", count, materials)?;
    let both = colors.iter().zip(materials);
    let color = both.map(|(rgba, material)| material.map_or(rgba, |place| &of_materials[place]));
    Ok(color.map(|color| color[3] != 0.0).collect())
}
