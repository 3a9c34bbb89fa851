//! Height scans as the kernel source reads them.

use super::carrier::Carrier;
use super::sites::mounted;
use crate::description::Description;
use crate::error::ModelError;
use crate::pose::Pose;
use sim_physics::constants::contact::{Contacts, Kind};
use sim_physics::constants::scan::HeightScan;

/// Least part of a normal along z of a plane that is ground and no wall [–].
const LEVEL: f64 = 1e-3;
/// Least part of the z axis of a height field along that of the world [–].
const UPRIGHT: f64 = 1.0 - 1e-12;

impl Description {
    /// The scans of the scene, which see all static planes and height fields. `carriers` has an entry per robot and link.
    pub(super) fn placed_scans(
        &self,
        carriers: &[Vec<Carrier>],
        contacts: &Contacts<f64>,
    ) -> Result<Vec<HeightScan<f64>>, ModelError> {
        let mut first = 0;
        let mut scans = Vec::new();
        for scan in &self.height_scans {
            let what = format!("height scan `{}`", scan.name);
            let pose = Pose::at(scan.pos);
            let mount = match self.bearer(&what, scan.body.as_deref())? {
                None => mounted(None, None, &pose),
                Some((robot, link)) => {
                    let carrier = &carriers[robot][link];
                    mounted(carrier.body, Some(carrier.tree), &carrier.pose.mul(&pose))
                }
            };
            let ground = ground(contacts, &what)?;
            scans.push(HeightScan {
                mount,
                counts: scan.counts,
                spacing: scan.spacing,
                reach: scan.reach,
                first,
                ground,
            });
            first += scan.counts[0] * scan.counts[1];
        }
        Ok(scans)
    }
}

/// The planes and height fields that a scan sees, and the rows of fields.
fn ground(contacts: &Contacts<f64>, what: &str) -> Result<Vec<(usize, usize)>, ModelError> {
    let mut fields = 0;
    let mut grounds = Vec::new();
    for (place, solid) in contacts.solids.iter().enumerate() {
        let up = solid.axes[2][2];
        match solid.kind {
            Kind::Field if up < UPRIGHT => {
                let reason =
                    "it cannot see a height field that is tilted; turn the field about z alone";
                return Err(ModelError::HeightField(what.to_owned(), reason.to_owned()));
            }
            Kind::Field => {
                grounds.push((place, fields));
                fields += 1;
            }
            Kind::Plane if solid.body.is_none() && up > LEVEL => grounds.push((place, 0)),
            _ => {}
        }
    }
    if grounds.is_empty() {
        let reason = "the scene has no plane or height field that anything touches; add one";
        return Err(ModelError::HeightField(what.to_owned(), reason.to_owned()));
    }
    Ok(grounds)
}
