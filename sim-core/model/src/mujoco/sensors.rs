//! Sensors of a model. Those that are not supported are named; a model runs without them.

use super::format::ModelFile;
use super::frame;
use super::frames::on_links;
use super::names::names;
use super::options::has_flag;
use super::tendons::{Tendons, moving};
use crate::description::{
    ConstraintLaw, FramePart, LimitPart, Measure, OnLink, Reduction, Robot, Sense, Sensor,
    SensorParts, SubtreePart, Touching, ZoneKind, ZonePart,
};
use crate::error::ModelError;
use crate::pose::Pose;

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
        let is_two_sided = datatypes[k] == "mjDATATYPE_REAL";
        let is_bounded = is_two_sided || datatypes[k] == "mjDATATYPE_POSITIVE";
        parts.all.push(Sensor {
            name,
            place,
            sense,
            cutoff: (is_bounded && cutoffs[k] > 0.0).then_some((cutoffs[k], is_two_sided)),
        });
    }
    if let Some(own) = &mut robot.mujoco {
        own.sensors = parts;
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
    site_kinds: Vec<String>,
    site_sizes: Vec<[f64; 3]>,
    cameras: Vec<OnLink>,
    camera_modes: Vec<String>,
}

/// What a sensor measures, or what is not supported.
type Sensed = Result<Result<Sense, String>, ModelError>;

impl<'a> Reader<'a> {
    fn read(file: &'a ModelFile, robot: &'a Robot, count: usize) -> Result<Self, ModelError> {
        let bodies = robot.links.len();
        let centers = file.vectors::<3>("body_ipos", bodies)?;
        let turns = file.vectors::<4>("body_iquat", bodies)?;
        let inertial = centers.into_iter().zip(turns);
        let cameras = file.rows("cam_bodyid");
        let mut late = vec![false; count];
        for (array, width) in [("sensor_delay", 1), ("sensor_interval", 2)] {
            if file.has(array) {
                let all = file.reals(array, count * width)?;
                for (is_late, own) in late.iter_mut().zip(all.chunks_exact(width)) {
                    *is_late |= own[0] > 0.0;
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
            geoms: on_links(file, "geom", bodies)?,
            sites: on_links(file, "site", bodies)?,
            site_kinds: file.kinds("site_type", file.rows("site_bodyid"))?,
            site_sizes: file.vectors("site_size", file.rows("site_bodyid"))?,
            cameras: on_links(file, "cam", bodies)?,
            camera_modes: file.kinds("cam_mode", cameras)?,
            file,
            robot,
        })
    }

    /// What sensor `k` measures.
    fn sense(&self, k: usize) -> Sensed {
        if self.late[k] {
            return Ok(Err("a delay or an interval".to_owned()));
        }
        let kind = self.kinds[k].strip_prefix("mjSENS_").unwrap_or("");
        let sense = match kind {
            "MAGNETOMETER" => {
                let vector = self.file.vectors::<3>("opt.magnetic", 1)?[0];
                Sense::Vector(self.site(k)?, vector)
            }
            "JOINTPOS" | "JOINTVEL" => Sense::Length {
                terms: vec![(self.scalar_joint(k)?, 1.0)],
                is_rate: kind == "JOINTVEL",
            },
            "TENDONPOS" | "TENDONVEL" => match self.tendon(k)? {
                Some(terms) => Sense::Length {
                    terms: terms.to_vec(),
                    is_rate: kind == "TENDONVEL",
                },
                None => return Ok(Err("spatial tendons".to_owned())),
            },
            "ACTUATORPOS" | "ACTUATORVEL" => Sense::Actuator {
                actuator: self.actuator(k)?,
                is_rate: kind == "ACTUATORVEL",
            },
            "ACTUATORFRC" => Sense::ActuatorForces(vec![self.actuator(k)?]),
            "JOINTACTFRC" => Sense::JointActuatorForce(self.scalar_joint(k)?),
            "TENDONACTFRC" => Sense::ActuatorForces(self.actuators_of_tendon(k)?),
            "BALLQUAT" | "BALLANGVEL" => Sense::Ball {
                joint: self.joint(k)?,
                is_rate: kind == "BALLANGVEL",
            },
            "E_POTENTIAL" => Sense::PotentialEnergy,
            "E_KINETIC" => Sense::KineticEnergy,
            "CLOCK" => Sense::Clock,
            "FORCE" | "TORQUE" => Sense::Wrench {
                site: self.site(k)?,
                is_torque: kind == "TORQUE",
            },
            "VELOCIMETER" | "GYRO" => Sense::Frame {
                part: match kind {
                    "GYRO" => FramePart::Spin,
                    _ => FramePart::Velocity,
                },
                of: self.site(k)?,
                from: None,
                is_local: true,
            },
            "TOUCH" => Sense::Touch(self.zone(k)?),
            "CONTACT" => self.contact(k)?,
            "ACCELEROMETER" => Sense::Acceleration {
                of: self.site(k)?,
                is_angular: false,
                is_local: true,
            },
            _ => match (limit_part(kind), subtree_part(kind)) {
                (Some((part, false)), _) => self.joint_limit(k, part)?,
                (Some((part, true)), _) => self.tendon_limit(k, part)?,
                (_, Some(part)) => Sense::Subtree(self.index(k, self.robot.links.len())?, part),
                _ => return self.frame_sense(k, kind),
            },
        };
        Ok(Ok(sense))
    }

    /// Sensors of frames, by their name without its prefix.
    fn frame_sense(&self, k: usize, kind: &str) -> Sensed {
        let part = match kind {
            "FRAMEPOS" => Some(FramePart::Position),
            "FRAMEQUAT" => Some(FramePart::Quat),
            "FRAMEXAXIS" => Some(FramePart::Axis(0)),
            "FRAMEYAXIS" => Some(FramePart::Axis(1)),
            "FRAMEZAXIS" => Some(FramePart::Axis(2)),
            "FRAMELINVEL" => Some(FramePart::Velocity),
            "FRAMEANGVEL" => Some(FramePart::Spin),
            "FRAMELINACC" | "FRAMEANGACC" => None,
            other => return Ok(Err(other.to_lowercase())),
        };
        let of = match self.object(k, 0)? {
            Ok(of) => of,
            Err(what) => return Ok(Err(what)),
        };
        let Some(part) = part else {
            return Ok(Ok(Sense::Acceleration {
                of,
                is_angular: kind == "FRAMEANGACC",
                is_local: false,
            }));
        };
        let from = match self.ids[1][k] >= 0 {
            true => match self.object(k, 1)? {
                Ok(from) => Some(from),
                Err(what) => return Ok(Err(what)),
            },
            false => None,
        };
        Ok(Ok(Sense::Frame {
            part,
            of,
            from,
            is_local: false,
        }))
    }

    /// The frame of a sensor (0), or that it is seen from (1).
    fn object(&self, k: usize, which: usize) -> Result<Result<OnLink, String>, ModelError> {
        let id = self.ids[which][k];
        let place = |frames: &[OnLink]| {
            let own = usize::try_from(id).ok().and_then(|id| frames.get(id));
            own.copied().ok_or_else(|| self.fault(k))
        };
        let body = |pose: fn(&Reader<'_>, usize) -> Pose| {
            let link = usize::try_from(id)
                .ok()
                .filter(|&id| id < self.bodies.len());
            let link = link.ok_or_else(|| self.fault(k))?;
            Ok::<OnLink, ModelError>(OnLink {
                link,
                pose: pose(self, link),
            })
        };
        Ok(Ok(match self.objects[which][k].as_str() {
            "mjOBJ_BODY" => body(|reader, link| reader.bodies[link])?,
            "mjOBJ_XBODY" => body(|_, _| Pose::identity())?,
            "mjOBJ_GEOM" => place(&self.geoms)?,
            "mjOBJ_SITE" => place(&self.sites)?,
            "mjOBJ_CAMERA" => {
                let camera = place(&self.cameras)?;
                if self.camera_modes[id as usize] != "mjCAMLIGHT_FIXED" {
                    return Ok(Err("cameras that track or target".to_owned()));
                }
                camera
            }
            other => return Ok(Err(other.to_owned())),
        }))
    }

    fn fault(&self, k: usize) -> ModelError {
        self.file.fault(format!("has no object for sensor {k}"))
    }

    /// The object of a sensor as an index below `end`.
    fn index(&self, k: usize, end: usize) -> Result<usize, ModelError> {
        let id = usize::try_from(self.ids[0][k]).ok();
        id.filter(|&id| id < end).ok_or_else(|| self.fault(k))
    }

    fn site(&self, k: usize) -> Result<OnLink, ModelError> {
        Ok(self.sites[self.index(k, self.sites.len())?])
    }

    /// A joint among the robot's.
    fn joint(&self, k: usize) -> Result<usize, ModelError> {
        Ok(self.joints[self.index(k, self.joints.len())?])
    }

    fn scalar_joint(&self, k: usize) -> Result<usize, ModelError> {
        let joint = self.joint(k)?;
        match self.robot.joints[joint].dofs.len() {
            1 => Ok(joint),
            _ => Err(self.fault(k)),
        }
    }

    fn actuator(&self, k: usize) -> Result<usize, ModelError> {
        self.index(k, self.file.rows("actuator_trntype"))
    }

    /// The terms of a tendon; none of a spatial one.
    fn tendon(&self, k: usize) -> Result<Option<&[(usize, f64)]>, ModelError> {
        let tendon = self.index(k, self.tendons.terms.len())?;
        Ok(self.tendons.terms[tendon].as_deref())
    }

    fn actuators_of_tendon(&self, k: usize) -> Result<Vec<usize>, ModelError> {
        let count = self.file.rows("actuator_trntype");
        let kinds = self.file.kinds("actuator_trntype", count)?;
        let targets = self
            .file
            .vectors_of_integers::<2>("actuator_trnid", count)?;
        let all = (0..count).filter(|&actuator| {
            kinds[actuator] == "mjTRN_TENDON" && targets[actuator][0] == self.ids[0][k]
        });
        Ok(all.collect())
    }

    /// The zone of a sensor's site.
    fn zone(&self, k: usize) -> Result<ZonePart, ModelError> {
        let site = self.index(k, self.sites.len())?;
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

    /// Records of contacts: what they show is the first parameter, then come reduction and number.
    fn contact(&self, k: usize) -> Result<Sense, ModelError> {
        let parameters = self.file.rows("sensor_intprm");
        let [shows, reduction, records] = self
            .file
            .vectors_of_integers::<3>("sensor_intprm", parameters)?[k];
        let first = self.touching(k, 0)?;
        Ok(Sense::Contact {
            zone: match first {
                Touching::InZone => Some(self.zone(k)?),
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
        })
    }

    /// The first (0) or second (1) object of a sensor of contacts.
    fn touching(&self, k: usize, which: usize) -> Result<Touching, ModelError> {
        let id = usize::try_from(self.ids[which][k]).map_err(|_| self.fault(k));
        Ok(match self.objects[which][k].as_str() {
            "mjOBJ_SITE" => Touching::InZone,
            "mjOBJ_GEOM" => Touching::Geom(id?),
            "mjOBJ_BODY" => Touching::Link(id?),
            "mjOBJ_XBODY" => Touching::Subtree(id?),
            _ => Touching::Anything,
        })
    }

    fn joint_limit(&self, k: usize, part: LimitPart) -> Result<Sense, ModelError> {
        let joint = self.joint(k)?;
        if self.robot.joints[joint].dofs.len() == 1 {
            return Ok(Sense::JointLimit(joint, part));
        }
        let own = Measure::Angle { joint };
        Ok(Sense::ConstraintLimit(
            self.limit(|measure| *measure == own),
            part,
        ))
    }

    fn tendon_limit(&self, k: usize, part: LimitPart) -> Result<Sense, ModelError> {
        let terms = self.tendon(k)?;
        // several tendons may have the same terms: limits are in the order of tendons
        let is_own = |measure: &Measure| match measure {
            Measure::Lengths { first, .. } => terms == Some(&first[..]),
            _ => false,
        };
        Ok(Sense::ConstraintLimit(self.limit(is_own), part))
    }

    /// The constraint that is a limit of this measure.
    fn limit(&self, is_own: impl Fn(&Measure) -> bool) -> Option<usize> {
        let parts = self.robot.mujoco.as_ref()?;
        parts.constraints.iter().position(|constraint| {
            matches!(constraint.law, ConstraintLaw::Range { .. }) && is_own(&constraint.measure)
        })
    }
}

/// The property of a limit that a sensor measures, and whether it is that of a tendon.
fn limit_part(kind: &str) -> Option<(LimitPart, bool)> {
    let (rest, is_of_tendon) = match kind.strip_prefix("JOINTLIMIT") {
        Some(rest) => (rest, false),
        None => (kind.strip_prefix("TENDONLIMIT")?, true),
    };
    let part = match rest {
        "POS" => LimitPart::Position,
        "VEL" => LimitPart::Velocity,
        "FRC" => LimitPart::Force,
        _ => return None,
    };
    Some((part, is_of_tendon))
}

fn subtree_part(kind: &str) -> Option<SubtreePart> {
    match kind {
        "SUBTREECOM" => Some(SubtreePart::Center),
        "SUBTREELINVEL" => Some(SubtreePart::Velocity),
        "SUBTREEANGMOM" => Some(SubtreePart::AngularMomentum),
        _ => None,
    }
}
