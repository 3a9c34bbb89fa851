//! What sensors measure, by their types.

use super::{Reader, Sensed};
use crate::description::{
    AimPart, DistancePart, FramePart, Length, LimitPart, OnLink, Sense, SubtreePart,
};
use crate::error::ModelError;
use crate::mujoco::options::has_flag;
use crate::pose::Pose;

impl Reader<'_> {
    /// What sensor `k` measures.
    pub(super) fn sense(&self, k: usize) -> Sensed {
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
                of: Length::Joints(vec![(self.scalar_joint(k)?, 1.0)]),
                is_rate: kind == "JOINTVEL",
            },
            "TENDONPOS" | "TENDONVEL" => Sense::Length {
                of: self.tendon(k)?.clone(),
                is_rate: kind == "TENDONVEL",
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
            "TOUCH" | "CONTACT" | "INSIDESITE"
                if self.is_zone_of_mesh(k, usize::from(kind == "INSIDESITE"))? =>
            {
                return Ok(Err("sites of meshes".to_owned()));
            }
            "TOUCH" => Sense::Touch(self.zone(k, 0)?),
            "CONTACT" => return self.contact(k),
            "RANGEFINDER" => return self.range(k),
            "GEOMDIST" => return self.distance(k, DistancePart::Distance),
            "GEOMNORMAL" => return self.distance(k, DistancePart::Normal),
            "GEOMFROMTO" => return self.distance(k, DistancePart::Ends),
            "CAMPROJECTION" => return self.projection(k),
            "INSIDESITE" => return self.inside(k),
            "ACCELEROMETER" => {
                let of = self.site(k)?;
                match self.constant_acceleration(&of)? {
                    Some(vector) => Sense::Vector(of, vector),
                    None => Sense::Acceleration {
                        of,
                        is_angular: false,
                        is_local: true,
                    },
                }
            }
            _ => match (limit_part(kind), subtree_part(kind)) {
                (Some((part, false)), _) => self.joint_limit(k, part)?,
                (Some((part, true)), _) => self.tendon_limit(k, part)?,
                (_, Some(part)) => Sense::Subtree(self.index(k, 0, self.robot.links.len())?, part),
                _ => return self.frame_sense(k, kind),
            },
        };
        Ok(Ok(sense))
    }

    /// The acceleration that MuJoCo shows of what no force moves, in world axes [m/s²]; none where the step has it.
    ///
    /// Since 4.0, MuJoCo shows what an accelerometer at rest does. Before, it showed 0, also of mocap bodies.
    fn constant_acceleration(&self, of: &OnLink) -> Result<Option<[f64; 3]>, ModelError> {
        let Some(parts) = &self.robot.precompiled else {
            return Ok(None);
        };
        let root = parts.welds[of.link];
        Ok(match self.file.is_since([4, 0])? {
            true if root == 0 => {
                let is_off = has_flag(self.file, "mjDSBL_GRAVITY")?;
                let gravity = self.file.vectors::<3>("opt.gravity", 1)?[0];
                Some(gravity.map(|g| if is_off { 0.0 } else { -g }))
            }
            false if root != 0 && parts.mocaps.contains(&root) => Some([0.0; 3]),
            _ => None,
        })
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
        let eye = match self.eye(k, 0)? {
            Ok(eye) => eye,
            Err(what) => return Ok(Err(what)),
        };
        let of = eye.on;
        let Some(part) = part else {
            // only the place of a camera enters, which is its own unless it follows something
            if kind == "FRAMELINACC" && matches!(eye.aim, AimPart::Follows { .. }) {
                return Ok(Err("accelerations of cameras that track".to_owned()));
            }
            if kind == "FRAMELINACC"
                && let Some(vector) = self.constant_acceleration(&of)?
            {
                let world = OnLink {
                    link: 0,
                    pose: Pose::identity(),
                    is_inertial: false,
                };
                return Ok(Ok(Sense::Vector(world, vector)));
            }
            return Ok(Ok(Sense::Acceleration {
                of,
                is_angular: kind == "FRAMEANGACC",
                is_local: false,
            }));
        };
        let seen_from = match self.ids[1][k] >= 0 {
            true => match self.eye(k, 1)? {
                Ok(from) => Some(from),
                Err(what) => return Ok(Err(what)),
            },
            false => None,
        };
        let from = seen_from.map(|from| from.on);
        // MuJoCo shows the orientation of a camera as if nothing aimed it
        let mut eyes = seen_from.iter().chain([&eye]);
        if part != FramePart::Quat && eyes.any(|eye| eye.aim != AimPart::Fixed) {
            return Ok(Ok(Sense::Aimed {
                part,
                of: eye,
                from: seen_from,
            }));
        }
        Ok(Ok(Sense::Frame {
            part,
            of,
            from,
            is_local: false,
        }))
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
