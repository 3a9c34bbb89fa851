//! Sensors of contacts.

use super::{Reader, Sensed};
use crate::description::{Reduction, Sense, Touching, ZoneKind, ZonePart};
use crate::error::ModelError;

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
        // a sum of forces has no velocity: MuJoCo compiles no such sensor
        if reduction > 2 && shows >> SHOWN[0] != 0 {
            return Err(self.fault(k));
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
}
