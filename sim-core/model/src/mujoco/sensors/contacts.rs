//! Sensors of contacts and of rays.

use super::{Reader, Sensed};
use crate::description::{RayPart, Reduction, Sense, Touching, ZoneKind, ZonePart};
use crate::error::ModelError;
use crate::mujoco::format::ModelFile;
use crate::mujoco::frames::on_links;

/// Parts of a contact that a sensor shows besides velocities, and all parts.
const SHOWN: [u32; 2] = [7, 9];

impl Reader<'_> {
    /// The zone of the site that a sensor is of (0), or seen from (1).
    pub(super) fn zone(&self, k: usize, which: usize) -> Result<ZonePart, ModelError> {
        let site = self.index(k, which, self.sites.len())?;
        Ok(ZonePart {
            site: self.sites[site],
            kind: match self.site_kinds[site].as_str() {
                "mjGEOM_CAPSULE" => ZoneKind::Capsule,
                "mjGEOM_ELLIPSOID" => ZoneKind::Ellipsoid,
                "mjGEOM_CYLINDER" => ZoneKind::Cylinder,
                "mjGEOM_BOX" => ZoneKind::Box,
                _ => ZoneKind::Sphere,
            },
            size: self.site_sizes[site],
        })
    }

    /// Whether a sensor's site is a mesh, which newer versions of MuJoCo have.
    pub(super) fn is_zone_of_mesh(&self, k: usize, which: usize) -> Result<bool, ModelError> {
        if self.objects[which][k] != "mjOBJ_SITE" {
            return Ok(false);
        }
        let site = self.index(k, which, self.sites.len())?;
        Ok(self.site_kinds[site] == "mjGEOM_MESH")
    }

    /// Records of contacts: what they show is the first parameter, then come reduction and number.
    pub(super) fn contact(&self, k: usize) -> Sensed {
        let count = self.kinds.len();
        let [shows, reduction, records] =
            self.file.vectors_of_integers::<3>("sensor_intprm", count)?[k];
        // velocities, which newer versions of MuJoCo have, are the last known parts
        if shows >> SHOWN[1] != 0 {
            return Ok(Err("other data of contacts".to_owned()));
        }
        let first = self.touching(k, 0)?;
        Ok(Ok(Sense::Contact {
            zone: match first {
                Touching::InZone => Some(self.zone(k, 0)?),
                _ => None,
            },
            first,
            second: self.touching(k, 1)?,
            reduction: match reduction {
                0 => Reduction::First,
                1 => Reduction::LeastDistance,
                2 => Reduction::LargestForce,
                _ => Reduction::NetForce,
            },
            records: usize::try_from(records).unwrap_or(1),
            shows: std::array::from_fn(|part| shows >> part & 1 == 1),
            rates: std::array::from_fn(|part| shows >> (SHOWN[0] + part as u32) & 1 == 1),
        }))
    }

    /// The first (0) or second (1) object of a sensor of contacts.
    pub(super) fn touching(&self, k: usize, which: usize) -> Result<Touching, ModelError> {
        let id = usize::try_from(self.ids[which][k]).map_err(|_| self.fault(k));
        Ok(match self.objects[which][k].as_str() {
            "mjOBJ_SITE" => Touching::InZone,
            "mjOBJ_GEOM" => Touching::Geom(id?),
            "mjOBJ_BODY" => Touching::Link(id?),
            "mjOBJ_XBODY" => Touching::Subtree(id?),
            _ => Touching::Anything,
        })
    }

    /// The geoms that a rangefinder sees: all but those of its body and invisible ones.
    pub(super) fn range(&self, k: usize) -> Sensed {
        if self.shows_more_than_distance(k)? || self.objects[0][k] != "mjOBJ_SITE" {
            return Ok(Err("rangefinders that show more than a distance".to_owned()));
        }
        let site = self.site(k)?;
        let seen = (0..self.geoms.len()).filter(|&geom| self.geoms[geom].link != site.link);
        let seen: Vec<usize> = seen.filter(|&geom| self.is_visible[geom]).collect();
        if seen.iter().any(|&geom| self.rays[geom].is_none()) {
            return Ok(Err(
                "rangefinders beside meshes and height fields".to_owned()
            ));
        }
        Ok(Ok(Sense::Range(site, seen)))
    }

    /// The data of a rangefinder are the bits of its first parameter, of which the first is the distance.
    pub(super) fn shows_more_than_distance(&self, k: usize) -> Result<bool, ModelError> {
        let parameters = self.file.rows("sensor_intprm");
        if parameters == 0 {
            return Ok(false);
        }
        let all = self
            .file
            .vectors_of_integers::<3>("sensor_intprm", parameters)?;
        Ok(all.get(k).is_some_and(|[shows, ..]| *shows > 1))
    }
}

/// What rays meet of each geom.
pub(super) fn rays(file: &ModelFile, bodies: usize) -> Result<Vec<Option<RayPart>>, ModelError> {
    let geoms = on_links(file, "geom", bodies)?;
    let kinds = file.kinds("geom_type", geoms.len())?;
    let sizes = file.vectors::<3>("geom_size", geoms.len())?;
    let all = geoms.into_iter().zip(kinds).zip(sizes);
    let all = all.map(|((on, kind), size)| {
        let kind = match kind.as_str() {
            "mjGEOM_PLANE" => None,
            "mjGEOM_SPHERE" => Some(ZoneKind::Sphere),
            "mjGEOM_CAPSULE" => Some(ZoneKind::Capsule),
            "mjGEOM_ELLIPSOID" => Some(ZoneKind::Ellipsoid),
            "mjGEOM_CYLINDER" => Some(ZoneKind::Cylinder),
            "mjGEOM_BOX" => Some(ZoneKind::Box),
            _ => return None,
        };
        Some(RayPart { on, kind, size })
    });
    Ok(all.collect())
}
