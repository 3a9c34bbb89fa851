//! Sensors of how two geoms are apart.

use super::ranges::RayKind;
use super::{Reader, Sensed};
use crate::description::{DistancePart, Sense, ZoneKind};
use crate::error::ModelError;

/// Most pairs of geoms of two bodies, since code for each is recorded.
const PAIRS_MAX: usize = 64;

impl Reader<'_> {
    /// How the two objects of a sensor are apart, each a geom or a body with its geoms.
    pub(super) fn distance(&self, k: usize, part: DistancePart) -> Sensed {
        let (first, second) = (self.geoms_of(k, 0)?, self.geoms_of(k, 1)?);
        // other kinds have no closed form
        let is_known = |geom: &usize| {
            use ZoneKind::{Capsule, Sphere};
            matches!(
                self.rays[*geom],
                RayKind::Plane | RayKind::Solid(Sphere | Capsule)
            )
        };
        if !first.iter().chain(&second).all(is_known) {
            let what = "distances of other geoms than planes, spheres and capsules";
            return Ok(Err(what.to_owned()));
        }
        let is_plane = |geom: &usize| matches!(self.rays[*geom], RayKind::Plane);
        if first.iter().any(is_plane) && second.iter().any(is_plane) {
            return Ok(Err("distances between planes".to_owned()));
        }
        if first.len() * second.len() > PAIRS_MAX {
            return Ok(Err(format!("more than {PAIRS_MAX} pairs of geoms")));
        }
        let pairs = first.iter();
        let pairs = pairs.flat_map(|&one| second.iter().map(move |&other| [one, other]));
        let count = self.kinds.len();
        Ok(Ok(Sense::Distance {
            pairs: pairs.collect(),
            limit: self.file.reals("sensor_cutoff", count)?[k],
            part,
        }))
    }

    /// A geom, or the geoms of a body, that is the first (0) or the second (1) object of a sensor.
    fn geoms_of(&self, k: usize, which: usize) -> Result<Vec<usize>, ModelError> {
        if self.objects[which][k] == "mjOBJ_GEOM" {
            return Ok(vec![self.index(k, which, self.geoms.len())?]);
        }
        let link = self.index(k, which, self.bodies.len())?;
        let geoms = self.geoms.iter().enumerate();
        let on_link = geoms.filter(|(_, geom)| geom.link == link);
        Ok(on_link.map(|(geom, _)| geom).collect())
    }
}
