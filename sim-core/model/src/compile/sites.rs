//! Sites as the kernel source reads them, and the shapes that contact sensors are of.

use super::carrier::Carrier;
use super::contacts::clusters::path;
use crate::description::{Bearer, ContactSensor, Description, named};
use crate::error::ModelError;
use crate::model::SensedShapes;
use crate::pose::Pose;
use sim_physics::constants::Body;
use sim_physics::constants::site::{Column, Mount, Site};

impl Description {
    /// The sites as the kernel source reads them. `carriers` has an entry per robot and link, `bodies` one per moving body.
    pub(super) fn placed_sites(
        &self,
        carriers: &[Vec<Carrier>],
        bodies: &[Body<f64>],
    ) -> Result<Vec<Site<f64>>, ModelError> {
        let mount = |bearer: Bearer, pose: &Pose| match bearer {
            None => mounted(None, None, pose),
            Some((robot, link)) => {
                let carrier = &carriers[robot][link];
                mounted(carrier.body, Some(carrier.tree), &carrier.pose.mul(pose))
            }
        };
        let sites = self.sites.iter().map(|site| {
            let what = format!("site `{}`", site.name);
            let frame = mount(self.bearer(&what, site.body.as_deref())?, &site.pose);
            let relative_to = match site.relative_to.as_deref() {
                None => None,
                other => {
                    let (bearer, pose) = self.frame(&what, other)?;
                    Some(mount(bearer, &pose))
                }
            };
            let other = relative_to.as_ref().and_then(|other| other.body);
            Ok(Site {
                columns: columns(bodies, frame.body, other),
                mount: frame,
                relative_to,
                damping: site.damping,
            })
        });
        sites.collect()
    }

    /// What each contact sensor adds up.
    pub(super) fn sensed_shapes(&self) -> Result<Vec<SensedShapes>, ModelError> {
        let shapes = self.shape_names();
        let sensors = self.contact_sensors.iter();
        sensors.map(|sensor| sensed(sensor, &shapes)).collect()
    }
}

/// The dofs that move one of two bodies and not the other, rising.
fn columns(bodies: &[Body<f64>], bearer: Option<usize>, other: Option<usize>) -> Vec<Column> {
    let [bearer_dofs, other] =
        [bearer, other].map(|body| body.map_or_else(Vec::new, |body| path(bodies, body)));
    let alone = |dofs: &[usize], without: &[usize], is_of_other| {
        let alone = dofs.iter().copied().filter(|dof| !without.contains(dof));
        alone
            .map(|dof| Column { dof, is_of_other })
            .collect::<Vec<_>>()
    };
    let mut columns = alone(&bearer_dofs, &other, false);
    columns.extend(alone(&other, &bearer_dofs, true));
    columns.sort_by_key(|column| column.dof);
    columns
}

pub(super) fn mounted(body: Option<usize>, tree: Option<usize>, pose: &Pose) -> Mount<f64> {
    let pose = pose.normalized();
    let rows = pose.rotation();
    Mount {
        body,
        tree,
        position: pose.pos,
        quat: pose.quat,
        rotation: std::array::from_fn(|c| std::array::from_fn(|r| rows[r][c])),
    }
}

fn sensed(sensor: &ContactSensor, names: &[String]) -> Result<SensedShapes, ModelError> {
    let what = format!("contact sensor `{}`", sensor.name);
    let marked = |name: &str| {
        let mut marked = vec![false; names.len()];
        let named = named(&what, name, names)?;
        named.into_iter().for_each(|shape| marked[shape] = true);
        Ok(marked)
    };
    Ok(SensedShapes {
        name: sensor.name.clone(),
        of: marked(&sensor.of)?,
        against: match &sensor.against {
            Some(name) => marked(name)?,
            None => vec![true; names.len()],
        },
    })
}
