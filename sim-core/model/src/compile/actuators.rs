//! Actuators of MuJoCo models, by the dofs of the scene.

use super::carrier::Carrier;
use super::contacts::clusters::path;
use super::sites::mounted;
use super::tendons::Lengths;
use crate::description::{self, ActuatorActivation, ActuatorLength, Precompiled};
use crate::pose::Pose;
use sim_physics::constants::Body;
use sim_physics::constants::actuators::{
    Activation, ActivationRate, Actuator, Actuators, Adhesion, LengthKind, Sites, SliderCrank,
    TendonBound, TurningLength,
};
use sim_physics::constants::lengths::Term;
use sim_physics::constants::site::Mount;

/// What an actuator refers to.
pub(super) struct Scene<'a> {
    /// Dofs and tendons of the robot.
    pub lengths: Lengths<'a>,
    /// An entry for each of its links.
    pub carriers: &'a [Carrier],
    pub bodies: &'a [Body<f64>],
    /// Its first body among those of MuJoCo models.
    pub first_body: usize,
    pub dt: f64,
}

/// Adds an actuator to those before it.
pub(super) fn add(to: &mut Actuators<f64>, actuator: &description::Actuator, scene: &Scene<'_>) {
    if let ActuatorLength::Contacts { link } = actuator.length {
        to.adhesions.push(Adhesion {
            actuator: to.all.len(),
            body: scene.first_body + link,
        });
    }
    let (terms, turning) = length(&actuator.length, scene, moments(to));
    let activation = actuator.activation.map(|described| {
        let place = to.activations;
        to.activations += 1;
        activation(&described, place, scene.dt)
    });
    to.all.push(Actuator {
        terms,
        turning,
        activation,
        ctrl_range: actuator.ctrl_range,
        force_range: actuator.force_range,
        gain: actuator.gain,
        bias: actuator.bias,
        muscle_gain: actuator.muscle_gain.clone(),
        muscle_bias: actuator.muscle_bias.clone(),
        motor: actuator.motor.clone(),
    });
}

/// Adds bounds along tendons of a robot, whose actuators are not there yet.
pub(super) fn add_tendon_bounds(to: &mut Actuators<f64>, parts: &Precompiled) {
    let first = to.all.len();
    for (actuators, range) in &parts.tendon_bounds {
        to.tendon_bounds.push(TendonBound {
            actuators: actuators.iter().map(|k| first + k).collect(),
            range: *range,
        });
    }
}

/// Moments of the actuators so far.
fn moments(of: &Actuators<f64>) -> usize {
    let turning = of
        .all
        .iter()
        .filter_map(|actuator| actuator.turning.as_ref());
    turning.map(|length| length.dofs.len()).sum()
}

fn activation(activation: &ActuatorActivation, place: usize, dt: f64) -> Activation<f64> {
    Activation {
        place,
        rate: activation.rate,
        reach: match activation.rate {
            // ȧ T (1 - exp(-h/T))
            ActivationRate::Filter(time) if activation.exact => -time * (-dt / time).exp_m1(),
            ActivationRate::Current(time) => -time * (-dt / time).exp_m1(),
            _ => dt,
        },
        range: activation.range,
        early: activation.early,
    }
}

type Length = (Vec<Term<f64>>, Option<TurningLength<f64>>);

fn length(length: &ActuatorLength, scene: &Scene<'_>, first: usize) -> Length {
    let turning = |kind, gear, dofs| TurningLength {
        kind,
        gear,
        dofs,
        first,
    };
    // forces of free joints are in the axes of the model's world, which is link 0
    let placed = |v: [f64; 3]| scene.carriers[0].pose.rotate(v);
    let turning = match length {
        ActuatorLength::Joints(joints) => return (scene.lengths.terms(joints), None),
        ActuatorLength::Ball {
            joint,
            gear: [x, y, z],
            in_parent,
        } => {
            let body = &scene.bodies[body_of(scene, *joint)];
            let kind = LengthKind::Ball {
                coord: body.coord,
                in_parent: *in_parent,
            };
            turning(kind, [*x, *y, *z, 0.0, 0.0, 0.0], body.dofs().collect())
        }
        ActuatorLength::Free {
            joint,
            gear: [x, y, z, u, v, w],
            in_parent,
        } => {
            let body = body_of(scene, *joint);
            let [x, y, z] = placed([*x, *y, *z]);
            let [u, v, w] = match in_parent {
                true => placed([*u, *v, *w]),
                false => [*u, *v, *w],
            };
            let kind = LengthKind::Free {
                body,
                in_parent: *in_parent,
            };
            let dofs = scene.bodies[body].dofs().collect();
            turning(kind, [x, y, z, u, v, w], dofs)
        }
        &ActuatorLength::Tendon { tendon, gear } => {
            let tendon = scene.lengths.first_tendon + tendon;
            let dofs = scene.lengths.tendons[tendon].dofs.clone();
            let kind = LengthKind::Tendon(tendon);
            turning(kind, [gear, 0.0, 0.0, 0.0, 0.0, 0.0], dofs)
        }
        ActuatorLength::SliderCrank {
            slider,
            crank,
            rod,
            gear,
        } => {
            let (slider, crank) = (scene.mount(slider), scene.mount(crank));
            let dofs = dofs_between(scene, slider.body, crank.body);
            let kind = LengthKind::SliderCrank(SliderCrank {
                slider,
                crank,
                rod: *rod,
            });
            turning(kind, [*gear, 0.0, 0.0, 0.0, 0.0, 0.0], dofs)
        }
        ActuatorLength::Site {
            site,
            reference,
            gear,
        } => {
            let (site, reference) = (
                scene.mount(site),
                reference.as_ref().map(|r| scene.mount(r)),
            );
            let other = reference.as_ref().and_then(|mount| mount.body);
            let dofs = dofs_between(scene, site.body, other);
            turning(LengthKind::Site(Sites { site, reference }), *gear, dofs)
        }
        // these have moments once contacts are known
        ActuatorLength::Contacts { .. } => return (Vec::new(), None),
    };
    (Vec::new(), Some(turning))
}

impl Scene<'_> {
    /// A site by its link and its frame there.
    fn mount(&self, (link, pose): &(usize, Pose)) -> Mount<f64> {
        let carrier = &self.carriers[*link];
        mounted(carrier.body, Some(carrier.tree), &carrier.pose.mul(pose))
    }
}

/// The dofs that move one body against another, rising.
fn dofs_between(scene: &Scene<'_>, body: Option<usize>, other: Option<usize>) -> Vec<usize> {
    let moved = |body: Option<usize>| {
        let dofs = body.map(|body| path(scene.bodies, body));
        dofs.into_iter().flatten().collect::<Vec<_>>()
    };
    let (first, second) = (moved(body), moved(other));
    let mut dofs: Vec<usize> = first.iter().chain(&second).copied().collect();
    dofs.retain(|dof| first.contains(dof) != second.contains(dof));
    dofs.sort_unstable();
    dofs
}

/// The body that a joint moves.
fn body_of(scene: &Scene<'_>, joint: usize) -> usize {
    let dof = scene.lengths.dof_of[joint];
    let body = scene
        .bodies
        .iter()
        .position(|body| body.dofs().contains(&dof));
    body.expect("every dof has a body")
}
