//! What sensors are of: frames of interest, and sums of contact forces.

use super::checks::{count, in_range, name, unique};
use super::compile::Carrier;
use super::description::{ContactSensor, Description};
use super::error::{ModelError, first_few};
use super::frozen::SensedShapes;
use super::paths::path;
use super::pose::Pose;
use super::shapes;
use super::validate::pose;
use sim_physics::constants::Body;
use sim_physics::constants::site::{Column, Mount, Site};

/// Largest delay of commands [control frames].
const DELAY_FRAMES_MAX: usize = 1000;
/// Least and most damping of an inverse Jacobian [m and rad alike]: its square stays within `f32`, and so does what it is added to.
const DAMPING: std::ops::RangeInclusive<f64> = 1e-6..=1e6;
/// Control frames of delay that there is room for where nothing is said.
const DELAY_FRAMES: usize = 4;

/// What carries a frame: the world, or a link, by the numbers of its robot and of the link in it.
type Bearer = Option<(usize, usize)>;

impl Description {
    pub(super) fn validate_sensors(&self) -> Result<(), ModelError> {
        let sites = self.sites.iter().map(|site| site.name.as_str());
        unique("scene", "site", sites).map_err(|(_, error)| error)?;
        for site in &self.sites {
            name("site", &site.name)?;
            let what = format!("site `{}`", site.name);
            pose(&what, &site.pose)?;
            self.bearer(&what, site.body.as_deref())?;
            self.frame(&what, site.relative_to.as_deref())?;
            in_range(
                &format!("{what}: damping"),
                site.damping,
                DAMPING.contains(&site.damping),
                "it must be between 1e-6 and 1e6",
            )?;
        }
        let sensors = self.contact_sensors.iter();
        let names = sensors.clone().map(|sensor| sensor.name.as_str());
        unique("scene", "contact sensor", names).map_err(|(_, error)| error)?;
        let shapes = self.shape_names();
        for sensor in sensors {
            name("contact sensor", &sensor.name)?;
            sensed(sensor, &shapes)?;
        }
        if let Some(most) = self.command_delay_max {
            let rule = "it must be between 1 and 1000 control frames of substeps";
            count(
                "command_delay_max",
                most,
                DELAY_FRAMES_MAX * self.substeps,
                rule,
            )?;
        }
        Ok(())
    }

    /// Largest delay of commands that a world may have [substeps].
    pub(super) fn delay_max(&self) -> usize {
        self.command_delay_max
            .unwrap_or(DELAY_FRAMES * self.substeps)
    }

    /// The link of a name, `body` or `robot/link`.
    fn bearer(&self, what: &str, body: Option<&str>) -> Result<Bearer, ModelError> {
        let Some(body) = body else { return Ok(None) };
        let names = self.robots.iter().enumerate().flat_map(|(r, robot)| {
            robot.links.iter().enumerate().map(move |(l, link)| {
                let name = match robot.is_body() {
                    true => robot.name.clone(),
                    false => format!("{}/{}", robot.name, link.name),
                };
                (name, (r, l))
            })
        });
        let names: Vec<_> = names.collect();
        match names.iter().find(|(name, _)| name == body) {
            Some((_, link)) => Ok(Some(*link)),
            None => Err(ModelError::UnknownName {
                owner: what.to_owned(),
                what: "body or link",
                name: body.to_owned(),
                known: first_few(&names.into_iter().map(|(name, _)| name).collect::<Vec<_>>()),
            }),
        }
    }

    /// What carries a frame that is named by a site, body or link, and how it lies there.
    fn frame(&self, what: &str, frame: Option<&str>) -> Result<(Bearer, Pose), ModelError> {
        let site = self
            .sites
            .iter()
            .find(|site| Some(site.name.as_str()) == frame);
        match site {
            Some(site) => Ok((self.bearer(what, site.body.as_deref())?, site.pose)),
            None => Ok((self.bearer(what, frame)?, Pose::identity())),
        }
    }

    /// The sites as the text reads them; `carriers` are of each link of each robot, `bodies` those that move.
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
            let own = mount(self.bearer(&what, site.body.as_deref())?, &site.pose);
            let relative_to = match site.relative_to.as_deref() {
                None => None,
                other => {
                    let (bearer, pose) = self.frame(&what, other)?;
                    Some(mount(bearer, &pose))
                }
            };
            let other = relative_to.as_ref().and_then(|other| other.body);
            Ok(Site {
                columns: columns(bodies, own.body, other),
                mount: own,
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
fn columns(bodies: &[Body<f64>], own: Option<usize>, other: Option<usize>) -> Vec<Column> {
    let [own, other] =
        [own, other].map(|body| body.map_or_else(Vec::new, |body| path(bodies, body)));
    let alone = |dofs: &[usize], without: &[usize], is_of_other| {
        let alone = dofs.iter().copied().filter(|dof| !without.contains(dof));
        alone
            .map(|dof| Column { dof, is_of_other })
            .collect::<Vec<_>>()
    };
    let mut columns = alone(&own, &other, false);
    columns.extend(alone(&other, &own, true));
    columns.sort_by_key(|column| column.dof);
    columns
}

fn mounted(body: Option<usize>, tree: Option<usize>, pose: &Pose) -> Mount<f64> {
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
        let named = shapes::named(&what, name, names)?;
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
