//! Actuators of MuJoCo models, by the dofs of the scene.

use super::carrier::Carrier;
use super::contacts::clusters::path;
use super::sites::mounted;
use super::tendons::Lengths;
use crate::description::{
    self, ActuatorActivation, ActuatorDelay, ActuatorLength, Interpolation, Precompiled,
};
use crate::pose::Pose;
use sim_physics::constants::Body;
use sim_physics::constants::actuators::{
    Activation, ActivationRate, Actuator, Actuators, Adhesion, ControlDelay, LengthKind, Sites,
    SliderCrank, TendonBound, TurningLength,
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
    let delay = actuator
        .delay
        .map(|described| delay(&described, to, scene.dt));
    to.all.push(Actuator {
        terms,
        turning,
        activation,
        delay,
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

/// The weights of earlier controls, after the delays before it.
fn delay(described: &ActuatorDelay, before: &Actuators<f64>, dt: f64) -> ControlDelay<f64> {
    // how old what acts is at the start, in the middle and at the end of a step [steps]
    let ages = [0.0, 0.5, 1.0].map(|moment| described.seconds / dt - moment);
    let shares = ages.map(|age| shares(described, age));
    let steps = shares.iter().flatten().map(|(age, _)| *age).max();
    let steps = steps.expect("a control acts");
    ControlDelay {
        place: before.delays().count(),
        first: before.kept_controls(),
        steps,
        weights: shares.map(|shares| {
            let mut weights = vec![0.0; steps];
            for (age, share) in shares {
                weights[age - 1] += share;
            }
            weights
        }),
    }
}

/// How near an age is to a whole number of steps that it counts as [steps].
const WHOLE: f64 = 1e-9;

/// What acts after `age` steps: controls of a number of steps ago, each with its share (MuJoCo: `mj_readCtrl`).
fn shares(described: &ActuatorDelay, age: f64) -> Vec<(usize, f64)> {
    let oldest = described.samples;
    let nearest = age.round().clamp(1.0, oldest as f64);
    // at a control, or beyond the first or the last one
    if age <= 1.0 || age >= oldest as f64 || (age - nearest).abs() < WHOLE {
        return vec![(nearest as usize, 1.0)];
    }
    // between two controls, and how far from the earlier one [steps]
    let (earlier, later) = (age.ceil() as usize, age.ceil() as usize - 1);
    let x = age.ceil() - age;
    match described.interpolation {
        Interpolation::Hold => vec![(earlier, 1.0)],
        Interpolation::Line => vec![(earlier, 1.0 - x), (later, x)],
        Interpolation::Spline => {
            // Hermite's polynomials of the values and of the slopes
            let (square, cube) = (x * x, x * x * x);
            let value = 3.0 * square - 2.0 * cube;
            let slopes = [cube - 2.0 * square + x, cube - square];
            let mut shares = vec![(earlier, 1.0 - value), (later, value)];
            // half the difference of the neighbours, where both are kept
            if earlier < oldest {
                shares.extend([(later, slopes[0] / 2.0), (earlier + 1, -slopes[0] / 2.0)]);
            }
            if later > 1 {
                shares.extend([(later - 1, slopes[1] / 2.0), (earlier, -slopes[1] / 2.0)]);
            }
            shares
        }
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
