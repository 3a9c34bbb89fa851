//! Sensors of accelerations, forces, limits and energies.

use super::{has, put};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::sensors::{LimitPart, SensorKind};
use crate::constants::ties::{Measure, Tie, TieLaw};
use crate::lane::{Cx, Num, Real};
use crate::math::quat;
use crate::math::spatial::{ANGULAR, Spatial};
use crate::math::vec3::Vec3;
use crate::step::constraints::joint_rows::range;
use crate::step::lengths::length;
use crate::step::outputs::sites::reference;
use crate::step::outputs::sites::{position, to_local};
use crate::step::outputs::subtrees::root_center;
use crate::step::tree::inverse_dynamics::{point_acceleration, proper_accelerations};
use crate::step::tree::kinematics::read_quat;
use crate::step::{BlockOf, ConstantsOf, Stage, gravity, masses};

/// Sensors of accelerations.
pub struct Accelerations;

impl Stage for Accelerations {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::JointQdd,
        A::Params,
        A::Rotation,
        A::Velocity,
        A::Sensordata,
    ];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        has(m, |kind| matches!(kind, SensorKind::Acceleration(_)))
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        // accelerations less gravity of all bodies, to `force`
        proper_accelerations(cx, m, b);
        let w = &mut b.work;
        for sensor in &m.sensors.all {
            let SensorKind::Acceleration(acceleration_sensor) = &sensor.kind else {
                continue;
            };
            // a(b) + α × s + ω × (ω × s), with s from the origin of the body
            let Spatial([linear, angular]) = match acceleration_sensor.of.body {
                Some(body) => {
                    let arm = w.rotation[body] * Vec3::constant(acceleration_sensor.of.position);
                    let at = point_acceleration(w.force[body], w.velocity[body][ANGULAR], arm);
                    Spatial([at, w.force[body][ANGULAR]])
                }
                // as in MuJoCo, what stands still does not feel gravity
                None => Spatial::zero(),
            };
            // the part that is asked for, in world axes or in those of the frame
            let mut vector = if acceleration_sensor.is_angular {
                angular
            } else {
                linear
            };
            if acceleration_sensor.is_local {
                vector = to_local(w, &acceleration_sensor.of, vector);
            }
            put(&mut w.sensordata, sensor, &vector.0);
        }
    }
}

/// Sensors of forces between bodies and their parents.
pub struct Wrenches;

impl Stage for Wrenches {
    const READS: &'static [A] = &[
        A::Rotation,
        A::Origin,
        A::Reference,
        A::SubtreeCenter,
        A::CfrcInt,
        A::Sensordata,
    ];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        has(m, |kind| matches!(kind, SensorKind::Wrench(_)))
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for sensor in &m.sensors.all {
            let SensorKind::Wrench(wrench_sensor) = &sensor.kind else {
                continue;
            };
            // the wrench (N, F) from parent to body, with N about the centre of mass of the tree
            let [x, y, z, u, v, w] = b.work.cfrc_int[wrench_sensor.body];
            let (torque, force) = (Vec3([x, y, z]), Vec3([u, v, w]));
            // the torque about the site
            let body = &m.outputs.bodies[wrench_sensor.body];
            // arm of the site from there: the torque about the site is N - r × F
            let arm = position(&b.work, &wrench_sensor.site) - root_center(m, b, body);
            let vector = if wrench_sensor.is_torque {
                torque - arm.cross(force)
            } else {
                force
            };
            let local = to_local(&b.work, &wrench_sensor.site, vector);
            put(&mut b.work.sensordata, sensor, &local.0);
        }
    }
}

/// Sensors of actuator forces and of limits.
pub struct Forces;

impl Stage for Forces {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::Params,
        A::TenLength,
        A::ActuatorForce,
        A::QfrcActuator,
        A::EfcD,
        A::EfcForce,
        A::LimitSide,
        A::RowJacobian,
        A::Sensordata,
    ];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        use SensorKind::*;
        has(m, |kind| {
            matches!(
                kind,
                ActuatorForces(_) | DofActuatorForce(_) | DofLimit(..) | TieLimit(..)
            )
        })
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for sensor in &m.sensors.all {
            let scalar = match &sensor.kind {
                // one actuator, or the sum over those of a tendon
                SensorKind::ActuatorForces(actuators) => {
                    let mut sum = C::F::c(0.0);
                    for &actuator in actuators {
                        sum = sum + b.work.actuator_force[actuator];
                    }
                    sum
                }
                // a model without actuators has no array of their forces
                SensorKind::DofActuatorForce(dof) => match b.work.qfrc_actuator.get(*dof) {
                    Some(force) => *force,
                    None => C::F::c(0.0),
                },
                SensorKind::DofLimit(dof, part) => dof_limit(cx, m, b, *dof, *part),
                SensorKind::TieLimit(ties, part) => tie_limit(cx, m, b, ties, *part),
                _ => continue,
            };
            put(&mut b.work.sensordata, sensor, &[scalar]);
        }
    }
}

/// A property of the first row that acts of the limit of a dof.
#[inline(always)]
fn dof_limit<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    dof: usize,
    part: LimitPart,
) -> C::F {
    // from last to first: the first row that acts in a world is selected last and stays
    let mut value = C::F::c(0.0);
    // rows of limits follow those of equalities and frictions
    let first = m.equalities.len() + m.frictions.len();
    for (k, limit) in m.limits.iter().enumerate().rev() {
        if limit.dof != dof {
            continue;
        }
        let side = b.work.limit_side[k];
        // distance to the nearer bound, its rate of change, or the force of the row
        let property = match part {
            LimitPart::Position => {
                let q = cx.get(&b.joint_q[m.dofs[dof].coord]);
                let [lower, upper] = range(m, &b.params, limit);
                (q - lower).min(upper - q)
            }
            LimitPart::Velocity => side * cx.get(&b.joint_qd[dof]),
            LimitPart::Force => cx.get(&b.efc_force[first + k]),
        };
        // a row without weight does not act in this world
        let acts = C::F::c(0.0).lt(cx.get(&b.efc_weight[first + k]));
        value = C::F::select(acts, property, value);
    }
    value
}

/// A property of the first of some ties that acts.
#[inline(always)]
fn tie_limit<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    ties: &[usize],
    part: LimitPart,
) -> C::F {
    // from last to first, as for dofs
    let mut value = C::F::c(0.0);
    for &tie in ties.iter().rev() {
        let row = m.joint_rows() + rows_before(&m.ties[..tie]);
        let tie = &m.ties[tie];
        // as for dofs; the rate is J q̇ of the first row
        let property = match part {
            LimitPart::Position => {
                let position = measured(cx, m, b, tie);
                match tie.law {
                    TieLaw::Range([lower, upper]) => {
                        (position - C::F::k(lower)).min(C::F::k(upper) - position)
                    }
                    _ => position,
                }
            }
            LimitPart::Velocity => {
                let mut velocity = C::F::c(0.0);
                for (entry, &dof) in b.work.row_jacobian[tie.jacobian(0)].iter().zip(&tie.dofs) {
                    velocity = entry.fma(cx.get(&b.joint_qd[dof]), velocity);
                }
                velocity
            }
            LimitPart::Force => cx.get(&b.efc_force[row]),
        };
        let acts = C::F::c(0.0).lt(cx.get(&b.efc_weight[row]));
        value = C::F::select(acts, property, value);
    }
    value
}

/// What a tie with one row measures.
#[inline(always)]
fn measured<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    tie: &Tie<<C::F as Num>::Real>,
) -> C::F {
    match &tie.measure {
        Measure::Lengths(lengths) => length(cx, m, b, &lengths.first) - C::F::k(lengths.offsets[0]),
        Measure::Angle(coord, _) => {
            // |log q|: the angle by which the ball has rotated
            let turn = quat::log(read_quat(cx, &b.joint_q, *coord));
            turn.dot(turn).sqrt()
        }
        Measure::Free(_) | Measure::Frames(_) => C::F::c(0.0),
    }
}

fn rows_before<R>(ties: &[Tie<R>]) -> usize {
    ties.iter().map(|tie| tie.rows).sum()
}

/// Sensors of energies.
pub struct Energies;

impl Stage for Energies {
    const READS: &'static [A] = &[
        A::Params,
        A::Reference,
        A::KineticEnergy,
        A::PotentialEnergy,
        A::Sensordata,
    ];
    const WRITES: &'static [A] = &[A::Sensordata];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        use SensorKind::*;
        has(m, |kind| matches!(kind, KineticEnergy | PotentialEnergy(_)))
    }

    #[inline(always)]
    fn run<C: Cx>(_cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        for sensor in &m.sensors.all {
            let energy = match &sensor.kind {
                SensorKind::KineticEnergy => b.work.kinetic_energy[0],
                // the array leaves out static bodies, MuJoCo does not: their first moment is fixed unless masses vary
                SensorKind::PotentialEnergy(moment) => {
                    let gravity = gravity(m, &b.params);
                    let moment = match masses::vary(m) {
                        true => static_moment::<C>(m, b),
                        false => Vec3::constant(*moment),
                    };
                    b.work.potential_energy[0] - gravity.dot(moment)
                }
                _ => continue,
            };
            put(&mut b.work.sensordata, sensor, &[energy]);
        }
    }
}

/// First moment of what stands still in all models [kg·m].
#[inline(always)]
fn static_moment<C: Cx>(m: &ConstantsOf<C>, b: &BlockOf<C>) -> Vec3<C::F> {
    let mut sum = Vec3::zero();
    let bodies = m.outputs.bodies.iter();
    for body in bodies.filter(|body| body.frame.body.is_none()) {
        let mass = masses::mass(m, &b.params, body.link, body.mass);
        let center = masses::position(m, b, body) + reference(&b.work, &body.inertial);
        sum = center.scale_add(mass, sum);
    }
    sum
}
