//! What sensors are about: frames, joints, tendons, actuators and limits.

use super::Reader;
use crate::description::{
    AimPart, ConstraintLaw, EyePart, Length, LimitPart, Measure, OnLink, Sense,
};
use crate::error::ModelError;
use crate::pose::Pose;

impl Reader<'_> {
    /// The frame of a sensor (0), or that it is seen from (1).
    pub(super) fn eye(
        &self,
        k: usize,
        which: usize,
    ) -> Result<Result<EyePart, String>, ModelError> {
        let id = self.ids[which][k];
        let place = |frames: &[OnLink]| {
            let frame = usize::try_from(id).ok().and_then(|id| frames.get(id));
            frame.copied().ok_or_else(|| self.fault(k))
        };
        let body = |is_inertial: bool| {
            let link = usize::try_from(id)
                .ok()
                .filter(|&id| id < self.bodies.len());
            let link = link.ok_or_else(|| self.fault(k))?;
            Ok::<OnLink, ModelError>(OnLink {
                link,
                pose: match is_inertial {
                    true => self.bodies[link],
                    false => Pose::identity(),
                },
                is_inertial,
            })
        };
        let on = match self.objects[which][k].as_str() {
            "mjOBJ_BODY" => body(true)?,
            "mjOBJ_XBODY" => body(false)?,
            "mjOBJ_GEOM" => place(&self.geoms)?,
            "mjOBJ_SITE" => place(&self.sites)?,
            "mjOBJ_CAMERA" => {
                place(&self.cameras.places)?;
                return self.cameras.eye(self.file, id as usize);
            }
            other => return Ok(Err(other.to_owned())),
        };
        Ok(Ok(EyePart {
            on,
            aim: AimPart::Fixed,
        }))
    }

    pub(super) fn fault(&self, k: usize) -> ModelError {
        self.file.fault(format!("has no object for sensor {k}"))
    }

    /// The object of a sensor (0), or its reference (1), as an index below `end`.
    pub(super) fn index(&self, k: usize, which: usize, end: usize) -> Result<usize, ModelError> {
        let id = usize::try_from(self.ids[which][k]).ok();
        id.filter(|&id| id < end).ok_or_else(|| self.fault(k))
    }

    pub(super) fn site(&self, k: usize) -> Result<OnLink, ModelError> {
        Ok(self.sites[self.index(k, 0, self.sites.len())?])
    }

    /// A joint among the robot's.
    pub(super) fn joint(&self, k: usize) -> Result<usize, ModelError> {
        Ok(self.joints[self.index(k, 0, self.joints.len())?])
    }

    pub(super) fn scalar_joint(&self, k: usize) -> Result<usize, ModelError> {
        let joint = self.joint(k)?;
        match self.robot.joints[joint].dofs.len() {
            1 => Ok(joint),
            _ => Err(self.fault(k)),
        }
    }

    pub(super) fn actuator(&self, k: usize) -> Result<usize, ModelError> {
        self.index(k, 0, self.file.rows("actuator_trntype"))
    }

    /// The length of a tendon.
    pub(super) fn tendon(&self, k: usize) -> Result<&Length, ModelError> {
        self.tendons.length(self.file, self.ids[0][k])
    }

    pub(super) fn actuators_of_tendon(&self, k: usize) -> Result<Vec<usize>, ModelError> {
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

    pub(super) fn joint_limit(&self, k: usize, part: LimitPart) -> Result<Sense, ModelError> {
        let joint = self.joint(k)?;
        if self.robot.joints[joint].dofs.len() == 1 {
            return Ok(Sense::JointLimit(joint, part));
        }
        let angle = Measure::Angle { joint };
        Ok(Sense::ConstraintLimit(
            self.limit(|measure| *measure == angle),
            part,
        ))
    }

    pub(super) fn tendon_limit(&self, k: usize, part: LimitPart) -> Result<Sense, ModelError> {
        let length = self.tendon(k)?;
        // several tendons may have the same terms: limits are in the order of tendons
        let is_own = |measure: &Measure| match measure {
            Measure::Lengths { first, .. } => first == length,
            _ => false,
        };
        Ok(Sense::ConstraintLimit(self.limit(is_own), part))
    }

    /// The constraint that is a limit of this measure.
    pub(super) fn limit(&self, is_own: impl Fn(&Measure) -> bool) -> Option<usize> {
        let parts = self.robot.precompiled.as_ref()?;
        parts.constraints.iter().position(|constraint| {
            matches!(constraint.law, ConstraintLaw::Range { .. }) && is_own(&constraint.measure)
        })
    }
}
