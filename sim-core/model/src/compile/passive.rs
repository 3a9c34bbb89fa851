//! Passive forces of MuJoCo's robots: springs, free joints, the medium, compensation of gravity.

use super::bodies::{BodyBuilder, columns};
use super::carrier::Carrier;
use super::masses::massless;
use crate::description::{Compensator, Description, Joint, JointExtras, Precompiled, Robot};
use crate::joint_kind::JointKind;
use sim_physics::constants::actuators::Actuator;
use sim_physics::constants::options::Integrator;
use sim_physics::constants::params::Param;
use sim_physics::constants::passive::{Compensation, Drag};
use sim_physics::constants::springs::{PoseSpring, Spring};
use sim_physics::constants::{Constants, Motion};
use std::ops::Range;

impl BodyBuilder {
    /// What acts on a joint by itself. `dofs` are its own.
    pub(super) fn add_passive(&mut self, joint: &Joint, extras: &JointExtras, dofs: Range<usize>) {
        let body = self.dofs[dofs.start].body;
        let has_pose = matches!(joint.kind, JointKind::Ball | JointKind::Free);
        if extras.stiffness != 0.0 && has_pose {
            self.springs.poses.push(PoseSpring {
                body,
                stiffness: extras.stiffness,
                position: extras.spring_pose.pos,
                quat: extras.spring_pose.quat,
            });
        } else if extras.stiffness != 0.0 {
            self.springs.joints.push(Spring {
                dof: dofs.start,
                stiffness: extras.stiffness,
                rest: extras.spring_ref,
            });
        }
        if joint.kind == JointKind::Free {
            self.free_joints.push(body);
        }
        match extras.compensator {
            Compensator::Passive => self.compensation.passive_dofs.extend(dofs),
            Compensator::Actuators => self.compensation.actuated_dofs.extend(dofs),
            Compensator::Nothing => {}
        }
    }

    /// What the medium does to links.
    pub(super) fn add_drags(&mut self, parts: &Precompiled, carriers: &[Carrier]) {
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
        parts: &Precompiled,
        carriers: &[Carrier],
    ) {
        let Some(compensations) = &parts.compensations else {
            return;
        };
        let first = self.frames.len() - robot.links.len();
        // frames are in the order of links
        for (place, link) in robot.link_order().into_iter().enumerate() {
            let mut compensations = compensations.iter();
            let share = compensations.find(|(compensated, _)| *compensated == link);
            // where shares vary, any link may be held
            let share = share.map(|&(_, share)| share);
            let share = share.or_else(|| self.any_link_is_held.then_some(0.0));
            let (Some(share), Some(body)) = (share, carriers[link].body) else {
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
        let body_dofs = &dofs[bodies[body].dofs()];
        varies
            || body_dofs
                .iter()
                .any(|dof| dof.armature != 0.0 || dof.damping != 0.0)
    });
    let of_free_joint = |dof: &usize| m.free_joints.contains(&dofs[*dof].body);
    m.diagonal_dofs = (0..dofs.len()).filter(|dof| !of_free_joint(dof)).collect();
    if m.compensation.links.is_empty() {
        m.compensation.passive_dofs.clear();
        m.compensation.actuated_dofs.clear();
    }
}

/// Finds what an implicit step treats apart: actuators with damping, and free bodies that carry nothing.
pub(super) fn add_implicit(m: &mut Constants<f64>, scene: &Description) {
    let varies = [Param::ActuatorGain, Param::ActuatorBias];
    let varies = varies.iter().any(|param| scene.params.contains(param));
    let actuators = &m.actuators.all;
    let damped = (0..actuators.len()).filter(|&k| {
        let Actuator {
            gain,
            bias,
            muscle_gain,
            ..
        } = &actuators[k];
        varies || gain[2] != 0.0 || bias[2] != 0.0 || muscle_gain.is_some()
    });
    m.actuators.damped = damped.collect();
    if m.integrator != Integrator::ImplicitFast {
        return;
    }
    let damped = m.actuators.damped.iter().map(|&k| &m.actuators.all[k]);
    let turning = damped.flat_map(|actuator| &actuator.turning);
    let mut driven: Vec<usize> = turning.flat_map(|length| length.dofs.clone()).collect();
    let dampers = m.springs.tendons.iter();
    let damped = dampers.filter(|tendon| tendon.damping != 0.0 || tendon.armature != 0.0);
    let spatial = damped.filter_map(|tendon| tendon.length.tendon);
    driven.extend(spatial.flat_map(|tendon| m.tendons[tendon].dofs.clone()));
    let is_solved = |body: &usize| {
        m.free_joints.contains(body)
            || m.drags.iter().any(|drag| drag.body == *body)
            || driven.iter().any(|&dof| m.dofs[dof].body == *body)
    };
    let is_alone = |body: &usize| m.bodies.iter().all(|other| other.parent != Some(*body));
    let free = (0..m.bodies.len()).filter(|&body| m.bodies[body].motion == Motion::Free);
    let (solved, others) = free.filter(is_alone).partition(is_solved);
    (m.solved_bodies, m.gyroscopic_bodies) = (solved, others);
}
