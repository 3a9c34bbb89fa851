//! Constraints of MuJoCo models whose Jacobians are found at run time.

use super::carrier::Carrier;
use super::constraint_rows::own_soft;
use super::contacts::clusters::path;
use super::sites::mounted;
use super::tendons::Lengths;
use crate::description::{Constraint, ConstraintLaw, Measure};
use sim_physics::constants::ties::{self, Frames, Tie, TieLaw};
use sim_physics::constants::{Body, Constants, FAR, Motion};

/// Smallest inverse weight of a row (MuJoCo: `mjMINVAL`).
const WEIGHT_MIN: f64 = 1e-15;
/// Inverse weight of rotations of what cannot turn. Their rows have no Jacobian; stiff ones would only lose the cost of the
/// others in rounding.
const WITHOUT_EFFECT: f64 = 1e30;

/// A constraint by the dofs of the model.
pub(super) struct DofConstraint {
    pub measure: ties::Measure<f64>,
    pub dofs: Vec<usize>,
    pub constraint: Constraint,
    /// Place of the robot's first equality among all.
    pub first_equality: usize,
    pub safe_references: bool,
}

impl DofConstraint {
    /// `lengths` has the dofs and tendons of the robot, `carriers` an entry for each of its links. `first_body` is the
    /// first of its bodies among those of MuJoCo models, and `first_equality` of its equalities.
    pub fn new(
        constraint: &Constraint,
        lengths: &Lengths<'_>,
        carriers: &[Carrier],
        bodies: &[Body<f64>],
        first_body: usize,
        first_equality: usize,
        safe_references: bool,
    ) -> DofConstraint {
        let body_of = |dof: usize| {
            let body = bodies.iter().position(|body| body.dofs().contains(&dof));
            body.expect("every dof has a body")
        };
        let dof_of = lengths.dof_of;
        let (measure, mut dofs): (_, Vec<usize>) = match &constraint.measure {
            Measure::Lengths {
                first,
                second,
                offsets,
                polynomial,
                referred,
            } => {
                let measured = ties::Lengths {
                    first: lengths.length(first),
                    second: lengths.length(second),
                    offsets: *offsets,
                    polynomial: *polynomial,
                    referred: referred.map(|joint| joint.map(|joint| dof_of[joint])),
                };
                let mut dofs = lengths.dofs(&measured.first);
                dofs.extend(lengths.dofs(&measured.second));
                (ties::Measure::Lengths(measured), dofs)
            }
            Measure::Angle { joint } => {
                let body = &bodies[body_of(dof_of[*joint])];
                let measure = ties::Measure::Angle(body.coord, body.dof);
                (measure, body.dofs().collect())
            }
            Measure::Free { joint } => {
                let body = body_of(dof_of[*joint]);
                (ties::Measure::Free(body), bodies[body].dofs().collect())
            }
            Measure::Frames {
                links,
                poses,
                torque_scale,
            } => {
                let mount = |k: usize| {
                    let carrier = &carriers[links[k]];
                    mounted(
                        carrier.body,
                        Some(carrier.tree),
                        &carrier.pose.mul(&poses[k]),
                    )
                };
                let (first, second) = (mount(0), mount(1));
                let moved = [&first, &second].map(|mount| mount.body);
                let dofs = moved.into_iter().flatten();
                let dofs = dofs.flat_map(|body| path(bodies, body)).collect();
                let frames = Frames {
                    first,
                    second,
                    torque_scale: *torque_scale,
                    bodies: links.map(|link| first_body + link),
                };
                (ties::Measure::Frames(frames), dofs)
            }
        };
        dofs.sort_unstable();
        dofs.dedup();
        DofConstraint {
            measure,
            dofs,
            constraint: constraint.clone(),
            first_equality,
            safe_references,
        }
    }

    /// Pairs of dofs that it couples.
    pub fn couplings(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        let rising = self.dofs.iter().enumerate();
        rising.flat_map(|(i, &dof)| self.dofs[..i].iter().map(move |&other| (dof, other)))
    }
}

/// Adds the rows of constraints, after those of joints, and returns the constraint of each tie.
pub(super) fn add_ties(constants: &mut Constants<f64>, all: Vec<DofConstraint>) -> Vec<usize> {
    let mut first = 0;
    let mut constraint_of_tie = Vec::new();
    for (index, dof_constraint) in all.into_iter().enumerate() {
        let DofConstraint {
            measure,
            dofs,
            constraint,
            first_equality,
            safe_references,
        } = dof_constraint;
        // as MuJoCo, which leaves out constraints without a Jacobian
        if dofs.is_empty() {
            continue;
        }
        let rows = match &measure {
            ties::Measure::Lengths(_) | ties::Measure::Angle(..) => 1,
            ties::Measure::Free(body) => {
                debug_assert_eq!(constants.bodies[*body].motion, Motion::Free);
                6
            }
            ties::Measure::Frames(frames) if frames.torque_scale.is_some() => 6,
            ties::Measure::Frames(_) => 3,
        };
        let mut turning = dofs.iter().map(|&dof| {
            let mut bodies = constants.bodies.iter();
            let body = bodies.find(|body| body.dofs().contains(&dof));
            body.is_some_and(|body| body.motion != Motion::Prismatic)
        });
        let [along, mut about] = constraint
            .inverse_weight
            .map(|weight| weight.max(WEIGHT_MIN));
        if !turning.any(|turns| turns) {
            about = WITHOUT_EFFECT;
        }
        let soft = own_soft(&constraint.softness, along, constants.dt, safe_references);
        let law = match constraint.law {
            ConstraintLaw::Equality(place) => TieLaw::Equality(first_equality + place),
            ConstraintLaw::Friction(loss) => TieLaw::Friction(loss),
            ConstraintLaw::Range { bounds, margin } => {
                TieLaw::Range([bounds[0] + margin, bounds[1] - margin])
            }
        };
        // where both bounds may act at once, each has a row of its own
        let laws = match law {
            TieLaw::Range([lower, upper]) if lower >= upper => {
                vec![TieLaw::Range([lower, FAR]), TieLaw::Range([-FAR, upper])]
            }
            law => vec![law],
        };
        let places: Vec<usize> = dofs
            .iter()
            .enumerate()
            .flat_map(|(i, &dof)| dofs[..=i].iter().map(move |&other| (dof, other)))
            .map(|(dof, other)| constants.pattern.at(dof, other))
            .collect();
        for law in laws {
            let ties = &mut constants.ties;
            let number = ties.len();
            constraint_of_tie.push(index);
            ties.push(Tie {
                measure: measure.clone(),
                law,
                soft,
                turning_weight: about,
                rows,
                dofs: dofs.clone(),
                first,
                places: places.clone(),
            });
            first += rows * dofs.len();
            let tie_of_row = &mut constants.tie_of_row;
            tie_of_row.extend(std::iter::repeat_n(number, rows));
        }
    }
    constraint_of_tie
}
