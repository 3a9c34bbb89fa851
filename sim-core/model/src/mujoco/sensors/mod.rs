//! Sensors of a model. Those that are not supported are named; a model runs without them.

mod cameras;
mod contacts;
mod distances;
mod kinds;
mod objects;
mod ranges;

use super::format::ModelFile;
use super::frame;
use super::frames::on_links;
use super::names::names;
use super::options::has_flag;
use super::rays;
use super::tendons::{Tendons, moving};
use crate::description::{OnLink, Robot, Sense, Sensor, SensorParts};
use crate::error::ModelError;
use crate::pose::Pose;
use cameras::Cameras;
use ranges::RayKind;

/// Adds the sensors. `robot` has its joints, constraints and actuators.
///
/// # Errors
/// A file that lacks arrays, or whose arrays point beyond each other.
pub(super) fn add_sensors(file: &ModelFile, robot: &mut Robot) -> Result<(), ModelError> {
    let count = file.rows("sensor_type");
    if !file.has("sensor_type") || count == 0 {
        return Ok(());
    }
    let reader = Reader::read(file, robot, count)?;
    let names = names(file, "sensor", count)?;
    let firsts = file.integers("sensor_adr", count)?;
    let sizes = file.integers("sensor_dim", count)?;
    let cutoffs = file.reals("sensor_cutoff", count)?;
    let datatypes = file.kinds("sensor_datatype", count)?;
    let scalars = usize::try_from(file.integer("nsensordata")?).unwrap_or(0);
    let mut parts = SensorParts {
        scalars,
        ..SensorParts::default()
    };
    let is_off = has_flag(file, "mjDSBL_SENSOR")?;
    for (k, name) in names.into_iter().enumerate() {
        let place = usize::try_from(firsts[k])
            .ok()
            .zip(usize::try_from(sizes[k]).ok());
        let place = place.map(|(first, size)| first..first.saturating_add(size));
        let place = place.filter(|place| place.end <= scalars);
        let place = place.ok_or_else(|| file.fault(format!("has no data for sensor `{name}`")))?;
        let sense = match reader.sense(k)? {
            // they stay 0
            Ok(_) if is_off => None,
            Ok(sense) => Some(sense),
            Err(what) => {
                parts
                    .refused
                    .push(format!("sensor `{name}`: no support for {what}"));
                None
            }
        };
        if sense
            .as_ref()
            .is_some_and(|sense: &Sense| sense.scalars() != place.len())
        {
            let has = place.len();
            return Err(file.fault(format!(
                "has {has} numbers for sensor `{name}`, which is not its size"
            )));
        }
        let is_two_sided = datatypes[k] == "mjDATATYPE_REAL";
        let is_real = is_two_sided || datatypes[k] == "mjDATATYPE_POSITIVE";
        // MuJoCo bounds neither sensors of contacts nor points of geoms
        let unbounded = ["mjSENS_CONTACT", "mjSENS_GEOMFROMTO"];
        let is_bounded = is_real && !unbounded.contains(&reader.kinds[k].as_str());
        parts.all.push(Sensor {
            name,
            place,
            sense,
            cutoff: (is_bounded && cutoffs[k] > 0.0).then_some((cutoffs[k], is_two_sided)),
        });
    }
    reader.add_ray_parts(&mut parts)?;
    if let Some(precompiled) = &mut robot.precompiled {
        precompiled.sensors = parts;
    }
    Ok(())
}

/// Arrays of sensors, and what they are about.
struct Reader<'a> {
    file: &'a ModelFile,
    robot: &'a Robot,
    kinds: Vec<String>,
    objects: [Vec<String>; 2],
    ids: [Vec<i64>; 2],
    late: Vec<bool>,
    joints: Vec<usize>,
    tendons: Tendons,
    bodies: Vec<Pose>,
    geoms: Vec<OnLink>,
    sites: Vec<OnLink>,
    is_visible: Vec<bool>,
    /// Of each geom, what a ray meets.
    rays: Vec<RayKind>,
    site_kinds: Vec<String>,
    site_sizes: Vec<[f64; 3]>,
    cameras: Cameras,
}

/// What a sensor measures, or what is not supported.
type Sensed = Result<Result<Sense, String>, ModelError>;

impl<'a> Reader<'a> {
    fn read(file: &'a ModelFile, robot: &'a Robot, count: usize) -> Result<Self, ModelError> {
        let bodies = robot.links.len();
        let centers = file.vectors::<3>("body_ipos", bodies)?;
        let turns = file.vectors::<4>("body_iquat", bodies)?;
        let inertial = centers.into_iter().zip(turns);
        let geoms = on_links(file, "geom", bodies)?;
        let mut late = vec![false; count];
        for (array, width) in [("sensor_delay", 1), ("sensor_interval", 2)] {
            if file.has(array) {
                let all = file.reals(array, count * width)?;
                for (is_late, values) in late.iter_mut().zip(all.chunks_exact(width)) {
                    *is_late |= values[0] > 0.0;
                }
            }
        }
        Ok(Reader {
            kinds: file.kinds("sensor_type", count)?,
            objects: [
                file.kinds("sensor_objtype", count)?,
                file.kinds("sensor_reftype", count)?,
            ],
            ids: [
                file.integers("sensor_objid", count)?,
                file.integers("sensor_refid", count)?,
            ],
            late,
            joints: moving(robot, file.rows("jnt_type"), file)?,
            tendons: Tendons::read(file, robot)?,
            bodies: inertial.map(|(pos, quat)| frame(pos, quat)).collect(),
            rays: ranges::rays(file, &geoms)?,
            geoms,
            sites: on_links(file, "site", bodies)?,
            is_visible: rays::visible(file)?,
            site_kinds: file.kinds("site_type", file.rows("site_bodyid"))?,
            site_sizes: file.vectors("site_size", file.rows("site_bodyid"))?,
            cameras: Cameras::read(file, bodies)?,
            file,
            robot,
        })
    }
}
