//! Passive forces of MuJoCo's robots: springs, free joints, the medium, compensation of gravity.

use super::bodies::{BodyBuilder, columns};
use super::carrier::Carrier;
use super::masses::massless;
use crate::description::{Compensator, Description, Joint, MujocoJoint, MujocoParts, Robot};
use crate::joint_kind::JointKind;
use sim_physics::constants::Constants;
use sim_physics::constants::params::Param;
use sim_physics::constants::passive::{Compensation, Drag};
use sim_physics::constants::springs::{PoseSpring, Spring};
use std::ops::Range;

impl BodyBuilder {
    /// What acts on a joint by itself. `dofs` are its own.
    pub(super) fn add_passive(&mut self, joint: &Joint, own: &MujocoJoint, dofs: Range<usize>) {
        let body = self.dofs[dofs.start].body;
        let has_pose = matches!(joint.kind, JointKind::Ball | JointKind::Free);
        if own.stiffness != 0.0 && has_pose {
            self.springs.poses.push(PoseSpring {
                body,
                stiffness: own.stiffness,
                position: own.spring_pose.pos,
                quat: own.spring_pose.quat,
            });
        } else if own.stiffness != 0.0 {
            self.springs.joints.push(Spring {
                dof: dofs.start,
                stiffness: own.stiffness,
                rest: own.spring_ref,
            });
        }
        if joint.kind == JointKind::Free {
            self.free_joints.push(body);
        }
        match own.compensator {
            Compensator::Passive => self.compensation.passive_dofs.extend(dofs),
            Compensator::Actuators => self.compensation.actuated_dofs.extend(dofs),
            Compensator::Nothing => {}
        }
    }

    /// What the medium does to links.
    pub(super) fn add_drags(&mut self, parts: &MujocoParts, carriers: &[Carrier]) {
        for drag in &parts.drags {
            let carrier = &carriers[drag.link];
            let inertial = carrier.pose.mul(&drag.inertial);
            // what has no dofs of its own does not move in the medium
            let body = carrier
                .body
                .filter(|&body| !self.bodies[body].dofs().is_empty());
            if let Some(body) = body {
                self.drags.push(Drag {
                    body,
                    center: inertial.pos,
                    axes: columns(inertial.rotation()),
                    viscous: drag.viscous,
                    quadratic: drag.quadratic,
                    wind: drag.wind,
                });
            }
        }
    }

    /// Links that are held against gravity.
    pub(super) fn add_compensations(
        &mut self,
        robot: &Robot,
        parts: &MujocoParts,
        carriers: &[Carrier],
    ) {
        let first = self.frames.len() - robot.links.len();
        // frames are in the order of links
        for (place, link) in robot.link_order().into_iter().enumerate() {
            let share = parts.compensations.iter().find(|(own, _)| *own == link);
            let (Some(&(_, share)), Some(body)) = (share, carriers[link].body) else {
                continue;
            };
            // one without mass may be given some
            let inertial = robot.links[link].inertial;
            let inertial = inertial.unwrap_or_else(|| massless(robot, link));
            self.compensation.links.push(Compensation {
                body,
                link: first + place,
                mass: inertial.mass,
                share,
                center: carriers[link].pose.transform(inertial.pos),
            });
        }
    }
}

/// Keeps of the lists of passive parts what acts: free joints with armature or damping, and compensation where there is any.
pub(super) fn keep_acting(m: &mut Constants<f64>, scene: &Description) {
    let varies = [Param::JointArmature, Param::JointDamping];
    let varies = varies.iter().any(|param| scene.params.contains(param));
    let (bodies, dofs) = (&m.bodies, &m.dofs);
    m.free_joints.retain(|&body| {
        let own = &dofs[bodies[body].dofs()];
        varies
            || own
                .iter()
                .any(|dof| dof.armature != 0.0 || dof.damping != 0.0)
    });
    if m.compensation.links.is_empty() {
        m.compensation.passive_dofs.clear();
        m.compensation.actuated_dofs.clear();
    }
}
