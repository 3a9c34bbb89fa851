//! Passive forces of MuJoCo's robots: springs, free joints, the medium, compensation of gravity.

use super::bodies::{BodyBuilder, columns};
use super::carrier::Carrier;
use super::masses::massless;
use super::tendons::plasticity;
use crate::description::{
    Compensator, Description, EllipsoidInFluid, Joint, JointExtras, Precompiled, Robot,
};
use crate::joint_kind::JointKind;
use crate::pose::Pose;
use sim_physics::constants::actuators::Actuator;
use sim_physics::constants::options::Integrator;
use sim_physics::constants::params::Param;
use sim_physics::constants::passive::{Compensation, Drag, FluidGeom};
use sim_physics::constants::springs::{PoseSpring, Spring};
use sim_physics::constants::{Constants, Motion};
use std::f64::consts::PI;
use std::ops::Range;

impl BodyBuilder {
    /// What acts on a joint by itself. `dofs` are its own.
    pub(super) fn add_passive(&mut self, joint: &Joint, extras: &JointExtras, dofs: Range<usize>) {
        let body = self.dofs[dofs.start].body;
        let has_pose = matches!(joint.kind, JointKind::Ball | JointKind::Free);
        for (dof, curve) in self.dofs[dofs.clone()]
            .iter_mut()
            .zip(extras.damping_curves)
        {
            dof.damping_curve = curve;
        }
        let plasticity = plasticity(extras.spring_yield, self.springs.plastic_rests());
        let has_spring = extras.stiffness != 0.0 || extras.stiffness_curve != [0.0; 2];
        if has_spring && has_pose {
            self.springs.poses.push(PoseSpring {
                body,
                stiffness: extras.stiffness,
                position: extras.spring_pose.pos,
                quat: extras.spring_pose.quat,
                curve: extras.stiffness_curve,
                plasticity,
            });
        } else if has_spring {
            self.springs.joints.push(Spring {
                dof: dofs.start,
                stiffness: extras.stiffness,
                rest: extras.spring_ref,
                curve: extras.stiffness_curve,
                plasticity,
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
            if let Some(body) = self.moving(carrier) {
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

    /// What the medium does to geoms.
    pub(super) fn add_fluid_geoms(&mut self, parts: &Precompiled, carriers: &[Carrier]) {
        for ellipsoid in &parts.ellipsoids_in_fluid {
            let carrier = &carriers[ellipsoid.link];
            if let Some(body) = self.moving(carrier) {
                let geom = fluid_geom(body, &carrier.pose.mul(&ellipsoid.pose), ellipsoid);
                self.fluid_geoms.push(geom);
            }
        }
    }

    /// The body of a link. What has no dofs of its own does not move in the medium.
    fn moving(&self, carrier: &Carrier) -> Option<usize> {
        let body = carrier.body;
        body.filter(|&body| !self.bodies[body].dofs().is_empty())
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

/// Constants of a geom in a medium (MuJoCo documentation, "Computation: fluid forces, ellipsoid model").
fn fluid_geom(body: usize, pose: &Pose, ellipsoid: &EllipsoidInFluid) -> FluidGeom<f64> {
    let radii = ellipsoid.semi_axes;
    let largest = |values: [f64; 3]| values.into_iter().fold(0.0, f64::max);
    // the two axes after each, and D(j) - D(k) of a diagonal matrix
    let others = |i: usize| (radii[(i + 1) % 3], radii[(i + 2) % 3]);
    let differences =
        |d: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| d[(i + 1) % 3] - d[(i + 2) % 3]) };
    let mut sorted = radii;
    sorted.sort_by(f64::total_cmp);
    let [_, middle, long] = sorted;
    // volume, the sphere of the same mean radius, and the largest area across a flow
    let volume = 4.0 / 3.0 * PI * radii.iter().product::<f64>();
    let diameter = 2.0 / 3.0 * radii.iter().sum::<f64>();
    let area = PI * long * middle;
    // squared areas across the axes, over π²
    let squares: [f64; 3] = std::array::from_fn(|i| (others(i).0 * others(i).1).powi(2));
    let square = largest(squares);
    let areas = squares.map(|x| if square > 0.0 { x / square } else { 0.0 });
    // drag about each axis: of the widest disc that turns there, and of a slender body
    let disc = |a: f64, b: f64| 8.0 / 15.0 * PI * a * b.powi(4);
    let [angular, slender] = [ellipsoid.angular_drag, ellipsoid.slender_drag];
    let turning: [f64; 3] = std::array::from_fn(|i| {
        let across = disc(radii[i], others(i).0.max(others(i).1));
        angular * across + slender * (disc(middle, long) - across)
    });
    let hardest = largest(turning.map(f64::abs));
    let shares = turning.map(|x| if hardest > 0.0 { x / hardest } else { 0.0 });
    // the share of these forces that acts
    let density = ellipsoid.interaction * ellipsoid.density;
    let viscosity = ellipsoid.interaction * ellipsoid.viscosity;
    let magnus = ellipsoid.magnus_lift * volume;
    FluidGeom {
        body,
        center: pose.pos,
        axes: columns(pose.rotation()),
        areas,
        area_differences: differences(areas),
        carried: ellipsoid.added_mass.map(|mass| density * (mass - magnus)),
        mass_differences: differences(ellipsoid.added_mass.map(|mass| density * mass)),
        moment_differences: differences(ellipsoid.added_moments.map(|moment| density * moment)),
        lift: density * ellipsoid.kutta_lift * PI * square.sqrt(),
        viscous: [
            viscosity * 3.0 * PI * diameter,
            viscosity * PI * diameter.powi(3),
        ],
        slender: density * slender * area,
        blunt: density * PI * square.sqrt() * (ellipsoid.blunt_drag - slender),
        turning: density * hardest,
        turning_shares: shares,
        wind: ellipsoid.wind,
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
                .any(|dof| [dof.armature, dof.damping] != [0.0; 2] || dof.damping_curve != [0.0; 2])
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
    let damped = dampers.filter(|tendon| {
        [tendon.damping, tendon.armature] != [0.0; 2] || tendon.damping_curve != [0.0; 2]
    });
    let spatial = damped.filter_map(|tendon| tendon.length.tendon);
    driven.extend(spatial.flat_map(|tendon| m.tendons[tendon].dofs.clone()));
    let is_solved = |body: &usize| {
        m.free_joints.contains(body)
            || m.drags.iter().any(|drag| drag.body == *body)
            || m.fluid_geoms.iter().any(|geom| geom.body == *body)
            || driven.iter().any(|&dof| m.dofs[dof].body == *body)
    };
    let is_alone = |body: &usize| m.bodies.iter().all(|other| other.parent != Some(*body));
    let free = (0..m.bodies.len()).filter(|&body| m.bodies[body].motion == Motion::Free);
    let (solved, others) = free.filter(is_alone).partition(is_solved);
    (m.solved_bodies, m.gyroscopic_bodies) = (solved, others);
}
