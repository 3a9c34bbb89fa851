//! Constraint rows of a model: equalities, dry friction and limits, with softness from the mass at the reference pose.

use crate::softness::Softness;
use sim_physics::constants::{
    Constants, Equality, FAR, Friction, Impedance, Limit, Motion, SOLREF_DEFAULT, Soft,
};

/// MuJoCo's default `solimp` (0.9, 0.95, 0.001, 0.5, 2).
pub(super) const IMPEDANCE: Impedance<f64> = Impedance {
    d_min: 0.9,
    d_max: 0.95,
    inverse_width: 1.0 / 0.001,
    midpoint: 0.5,
    power: 2.0,
};

/// What the rows need of a dof's joint; mimic leaders already as dof numbers.
#[derive(Clone, Copy, Default)]
pub(super) struct DofJoint {
    pub range: Option<[f64; 2]>,
    /// Stiffness and damping of the limits in force space, Newton's `limit_ke`, `limit_kd`.
    pub limit_gains: [f64; 2],
    pub friction: f64,
    pub mimic: Option<(usize, f64, f64)>,
    pub soft: Option<SoftJoint>,
}

/// Softness of the rows of a joint from MuJoCo.
#[derive(Clone, Copy)]
pub(super) struct SoftJoint {
    pub limit: Softness,
    pub margin: f64,
    pub friction: Softness,
    pub safe_references: bool,
}

/// What of rows differs from world to world.
#[derive(Clone, Copy)]
pub(super) struct VaryingRows {
    /// Dry friction.
    pub friction: bool,
    /// Ends of ranges.
    pub limits: bool,
}

/// Constraint rows in MuJoCo's order.
pub(super) fn add_rows(
    constants: &mut Constants<f64>,
    joints: &[DofJoint],
    inverse_weight: &[f64],
    varying: VaryingRows,
) {
    let dt = constants.dt;
    for (dof, joint) in joints.iter().enumerate() {
        let weight = inverse_weight[dof];
        if let Some((leader, multiplier, offset)) = joint.mimic {
            let soft = soft(SOLREF_DEFAULT, weight + inverse_weight[leader], dt);
            constants.equalities.push(Equality {
                follower: dof,
                leader,
                multiplier,
                offset,
                soft,
            });
        }
        let moves_freely = constants.bodies[constants.dofs[dof].body].motion == Motion::Free;
        if (joint.friction > 0.0 || varying.friction) && !moves_freely {
            let soft = match joint.soft {
                Some(soft_joint) => {
                    own_soft(&soft_joint.friction, weight, dt, soft_joint.safe_references)
                }
                None => soft(SOLREF_DEFAULT, weight, dt),
            };
            // a friction row has no position: its impedance is d_min, its reference -b v
            let d_min = soft.impedance.d_min;
            let regularizer = (1.0 - d_min) / d_min * weight;
            constants.frictions.push(Friction {
                dof,
                loss: joint.friction,
                damping: soft.damping,
                weight: 1.0 / regularizer,
                regularizer,
                zone: regularizer * joint.friction,
            });
        }
        if let (Some([lower, upper]), Some(soft_joint)) = (joint.range, joint.soft) {
            let soft = own_soft(&soft_joint.limit, weight, dt, soft_joint.safe_references);
            let (lower, upper) = (lower + soft_joint.margin, upper - soft_joint.margin);
            // where both sides may act at once, in some world, each has a row of its own
            let may_meet = varying.limits && soft_joint.margin > 0.0;
            let sides = match lower < upper && !may_meet {
                true => vec![[lower, upper]],
                false => vec![[lower, FAR], [-FAR, upper]],
            };
            let rows = sides.into_iter().map(|[lower, upper]| Limit {
                dof,
                lower,
                upper,
                margin: soft_joint.margin,
                soft,
            });
            constants.limits.extend(rows);
        } else if let Some([lower, upper]) = joint.range {
            constants.limits.push(Limit {
                dof,
                lower,
                upper,
                margin: 0.0,
                soft: limit_soft(joint.limit_gains, weight, dt),
            });
        }
    }
}

/// Softness as a model from MuJoCo has it.
pub(super) fn own_soft(
    softness: &Softness,
    inverse_weight: f64,
    dt: f64,
    is_safe: bool,
) -> Soft<f64> {
    let (stiffness, damping) = softness.reference(dt, is_safe);
    Soft {
        stiffness,
        damping,
        inverse_weight,
        impedance: softness.impedance(),
    }
}

/// MuJoCo's stiffness and damping from (time constant, damping ratio), `refsafe` on.
fn soft(solref: [f64; 2], inverse_weight: f64, dt: f64) -> Soft<f64> {
    let d_max = IMPEDANCE.d_max;
    let time_constant = solref[0].max(2.0 * dt);
    let natural = time_constant * solref[1] * d_max;
    Soft {
        stiffness: 1.0 / (natural * natural),
        damping: 2.0 / (d_max * time_constant),
        inverse_weight,
        impedance: IMPEDANCE,
    }
}

/// Softness of a limit with these gains in force space, as Newton's exporter gives it to MuJoCo: where it is not clamped to
/// two steps, `solreflimit` is (-ke f, -kd f).
fn limit_soft([ke, kd]: [f64; 2], inverse_weight: f64, dt: f64) -> Soft<f64> {
    let d_max = IMPEDANCE.d_max;
    let f = inverse_weight * (1.0 - d_max);
    if ke == 0.0 || kd == 0.0 {
        // which have no time constant
        return Soft {
            stiffness: ke * f / (d_max * d_max),
            damping: kd * f / d_max,
            inverse_weight,
            impedance: IMPEDANCE,
        };
    }
    let solref = [2.0 / (kd * f), 0.5 * kd * f * (1.0 / (ke * f)).sqrt()];
    soft(solref, inverse_weight, dt)
}

/// Damping of a contact's friction rows from Newton's `kf`, for bodies of this inverse weight: MuJoCo's from
/// `solreffriction` = (2 / (kf w ((1 - dmax)/impratio + dmax)), 1), as Newton's exporter sets it.
pub(super) fn contact_damping(kf: f64, inverse_weight: f64, impratio: f64, dt: f64) -> f64 {
    let d_max = IMPEDANCE.d_max;
    let rate = kf * inverse_weight * ((1.0 - d_max) / impratio + d_max);
    2.0 / (d_max * (2.0 / rate).max(2.0 * dt))
}
