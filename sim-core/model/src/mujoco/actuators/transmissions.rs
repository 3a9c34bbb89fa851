//! What actuators of a model act on: joints, tendons, sites, contacts of bodies.

use crate::description::{ActuatorLength, JointKind, Length, Robot};
use crate::error::ModelError;
use crate::mujoco::format::ModelFile;
use crate::mujoco::frame;
use crate::mujoco::tendons::{Tendons, moving};
use crate::pose::Pose;

/// Arrays of transmissions.
pub(super) struct Transmissions<'a> {
    file: &'a ModelFile,
    kinds: Vec<String>,
    targets: Vec<[i64; 2]>,
    gears: Vec<[f64; 6]>,
    /// Kind and number of dofs of each of MuJoCo's joints, and its place among the robot's.
    joints: Vec<(JointKind, usize, usize)>,
    tendons: Tendons,
    /// Link and frame of each site.
    sites: Vec<(usize, Pose)>,
    /// How many links there are.
    links: usize,
    /// Lengths of the rods of slider-cranks; empty where a file has none [m].
    rods: Vec<f64>,
}

impl<'a> Transmissions<'a> {
    pub(super) fn read(
        file: &'a ModelFile,
        robot: &Robot,
        count: usize,
    ) -> Result<Transmissions<'a>, ModelError> {
        let joints = moving(robot, file.rows("jnt_type"), file)?.into_iter();
        let joints = joints.map(|place| {
            let joint = &robot.joints[place];
            (joint.kind, joint.dofs.len(), place)
        });
        let sites = file.rows("site_bodyid");
        let bodies = file.indices("site_bodyid", sites, robot.links.len())?;
        let places = file.vectors::<3>("site_pos", sites)?;
        let turns = file.vectors::<4>("site_quat", sites)?;
        let frames = places.into_iter().zip(turns);
        let sites = bodies.into_iter().zip(frames).map(|(body, (pos, quat))| {
            let body = body.ok_or_else(|| file.fault("has a site without a body".to_owned()))?;
            Ok((body, frame(pos, quat)))
        });
        let kinds = file.kinds("actuator_trntype", count)?;
        Ok(Transmissions {
            targets: file.vectors_of_integers::<2>("actuator_trnid", count)?,
            gears: file.vectors::<6>("actuator_gear", count)?,
            joints: joints.collect(),
            tendons: Tendons::read(file, robot)?,
            links: robot.links.len(),
            sites: sites.collect::<Result<_, ModelError>>()?,
            rods: match kinds.iter().any(|kind| kind == "mjTRN_SLIDERCRANK") {
                true => file.reals("actuator_cranklength", count)?,
                false => Vec::new(),
            },
            kinds,
            file,
        })
    }

    fn site(&self, index: i64) -> Option<&(usize, Pose)> {
        self.sites.get(usize::try_from(index).ok()?)
    }

    /// What actuator `k` acts on.
    pub(super) fn length(&self, k: usize) -> Result<ActuatorLength, ModelError> {
        let gear = self.gears[k];
        let [target, other] = self.targets[k];
        let fault = || {
            let fault = format!("has no target for actuator {k}");
            self.file.fault(fault)
        };
        let place = usize::try_from(target).map_err(|_| fault())?;
        let kind = self.kinds[k].as_str();
        let in_parent = kind == "mjTRN_JOINTINPARENT";
        match kind {
            "mjTRN_TENDON" => Ok(match self.tendons.length(self.file, target)? {
                Length::Joints(terms) => {
                    let terms = terms.iter();
                    let terms = terms.map(|&(joint, coefficient)| (joint, coefficient * gear[0]));
                    ActuatorLength::Joints(terms.collect())
                }
                &Length::Spatial(tendon) => ActuatorLength::Tendon {
                    tendon,
                    gear: gear[0],
                },
            }),
            "mjTRN_BODY" => match place < self.links {
                true => Ok(ActuatorLength::Contacts { link: place }),
                false => Err(fault()),
            },
            "mjTRN_SLIDERCRANK" => Ok(ActuatorLength::SliderCrank {
                crank: self.sites.get(place).cloned().ok_or_else(fault)?,
                slider: self.site(other).cloned().ok_or_else(fault)?,
                rod: *self.rods.get(k).ok_or_else(fault)?,
                gear: gear[0],
            }),
            "mjTRN_SITE" => Ok(ActuatorLength::Site {
                site: self.sites.get(place).cloned().ok_or_else(fault)?,
                reference: match other < 0 {
                    true => None,
                    false => Some(self.site(other).cloned().ok_or_else(fault)?),
                },
                gear,
            }),
            _ => {
                let &(kind, dofs, joint) = self.joints.get(place).ok_or_else(fault)?;
                Ok(match (kind, dofs) {
                    (JointKind::Ball, _) => ActuatorLength::Ball {
                        joint,
                        gear: [gear[0], gear[1], gear[2]],
                        in_parent,
                    },
                    (JointKind::Free, _) => ActuatorLength::Free {
                        joint,
                        gear,
                        in_parent,
                    },
                    _ => ActuatorLength::Joints(vec![(joint, gear[0])]),
                })
            }
        }
    }
}
