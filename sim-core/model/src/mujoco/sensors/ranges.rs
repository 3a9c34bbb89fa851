//! Rangefinders, and what their rays meet.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use super::{Reader, Sensed};
use crate::description::{OnLink, RayPart, Sense, SensorParts, ZoneKind};
use crate::error::ModelError;
use crate::mujoco::fields::height_field;
use crate::mujoco::format::ModelFile;
use crate::mujoco::meshes::Meshes;

/// Parts of a ray that a rangefinder shows.
const SHOWN: u32 = 6;

/// A geom as rays meet it.
#[derive(Clone, Copy)]
pub(super) enum RayKind {
    Plane,
    Solid(ZoneKind),
    /// The triangles of a mesh, by its number.
    Mesh(i64),
    /// Those of a height field, by its number.
    Field(i64),
    /// What no ray is cast at.
    Other,
}

impl Reader<'_> {
    /// What a rangefinder shows. It sees all geoms but those of its body and invisible ones.
    pub(super) fn range(&self, k: usize) -> Sensed {
        if self.objects[0][k] != "mjOBJ_SITE" {
            return Ok(Err("rangefinders of cameras".to_owned()));
        }
        // files of older versions have distances alone
        let parameters = self.file.rows("sensor_intprm");
        let mut shown = 0;
        if parameters > 0 {
            let name = "sensor_intprm";
            let all = self.file.vectors_of_integers::<3>(name, parameters)?;
            shown = all.get(k).map_or(0, |[shown, ..]| *shown);
        }
        if shown >> SHOWN != 0 {
            return Ok(Err("other data of rangefinders".to_owned()));
        }
        let shown = if shown == 0 { 1 } else { shown };
        let site = self.site(k)?;
        let seen = (0..self.geoms.len()).filter(|&geom| self.geoms[geom].link != site.link);
        let geoms: Vec<usize> = seen.filter(|&geom| self.is_visible[geom]).collect();
        let is_other = |geom: &usize| matches!(self.rays[*geom], RayKind::Other);
        if geoms.iter().any(is_other) {
            return Ok(Err("rangefinders beside SDFs".to_owned()));
        }
        Ok(Ok(Sense::Range {
            site,
            geoms,
            shows: std::array::from_fn(|part| shown >> part & 1 == 1),
        }))
    }

    /// Gives sensors the geoms of the model, with the triangles of those that any of them sees.
    pub(super) fn add_ray_parts(&self, parts: &mut SensorParts) -> Result<(), ModelError> {
        let mut is_seen = vec![false; self.geoms.len()];
        for sensor in &parts.all {
            if let Some(Sense::Range { geoms, .. }) = &sensor.sense {
                geoms.iter().for_each(|&geom| is_seen[geom] = true);
            }
        }
        let mut seen = self.rays.iter().zip(&is_seen);
        let has_mesh = seen.any(|(kind, is_seen)| *is_seen && matches!(kind, RayKind::Mesh(_)));
        let meshes = has_mesh.then(|| Meshes::read(self.file)).transpose()?;
        let sizes = self.file.vectors::<3>("geom_size", self.geoms.len())?;
        // geoms share the triangles of a mesh
        let mut places: HashMap<(bool, i64), usize> = HashMap::new();
        for (geom, on) in self.geoms.iter().enumerate() {
            let kind = self.rays[geom];
            let mesh = match kind {
                RayKind::Mesh(mesh) | RayKind::Field(mesh) if is_seen[geom] => {
                    let is_field = matches!(kind, RayKind::Field(_));
                    Some(match places.entry((is_field, mesh)) {
                        Entry::Occupied(known) => *known.get(),
                        Entry::Vacant(new) => {
                            parts.meshes.push(match &meshes {
                                Some(meshes) if !is_field => meshes.triangles(mesh)?,
                                _ => height_field(self.file, mesh)?.ray_surface(),
                            });
                            *new.insert(parts.meshes.len() - 1)
                        }
                    })
                }
                _ => None,
            };
            // triangles have their size themselves
            let has_size = matches!(kind, RayKind::Plane | RayKind::Solid(_));
            parts.geoms.push(RayPart {
                on: *on,
                kind: match kind {
                    RayKind::Solid(kind) => Some(kind),
                    _ => None,
                },
                size: if has_size { sizes[geom] } else { [0.0; 3] },
                mesh,
            });
        }
        Ok(())
    }
}

/// What rays meet of each geom.
pub(super) fn rays(file: &ModelFile, geoms: &[OnLink]) -> Result<Vec<RayKind>, ModelError> {
    let kinds = file.kinds("geom_type", geoms.len())?;
    let numbers = file.integers("geom_dataid", geoms.len())?;
    let all = kinds.iter().zip(numbers);
    let all = all.map(|(kind, number)| match kind.as_str() {
        "mjGEOM_PLANE" => RayKind::Plane,
        "mjGEOM_SPHERE" => RayKind::Solid(ZoneKind::Sphere),
        "mjGEOM_CAPSULE" => RayKind::Solid(ZoneKind::Capsule),
        "mjGEOM_ELLIPSOID" => RayKind::Solid(ZoneKind::Ellipsoid),
        "mjGEOM_CYLINDER" => RayKind::Solid(ZoneKind::Cylinder),
        "mjGEOM_BOX" => RayKind::Solid(ZoneKind::Box),
        "mjGEOM_MESH" => RayKind::Mesh(number),
        "mjGEOM_HFIELD" => RayKind::Field(number),
        _ => RayKind::Other,
    });
    Ok(all.collect())
}
