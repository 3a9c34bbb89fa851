//! Where attempts start: at the start that a caller gives, then at random states within the limits.

use crate::plan::Plan;
use crate::random::Draws;
use sim_model::Model;
use sim_physics::constants::Motion;
use std::f64::consts::PI;

/// Ranges past this are no ranges to draw from: the draws are near the start [rad or m].
const RANGE_MAX: f64 = 8.0 * PI;
/// How far from the start a slide without a range is drawn [m].
const SLIDE: f64 = 1.0;

/// Puts a state within its limits, its quaternions to length 1, and joints that follow others to where they belong.
pub fn tidy(model: &Model, plan: &Plan, q: &mut [f64]) {
    let m = model.constants();
    for (dof, &[lower, upper]) in m.dofs.iter().zip(&plan.ranges) {
        if m.bodies[dof.body].motion.coords() == 1 {
            q[dof.coord] = q[dof.coord].clamp(lower, upper);
        }
    }
    for c in m.quaternions() {
        let norm = q[c..c + 4].iter().map(|x| x * x).sum::<f64>().sqrt();
        q[c..c + 4].iter_mut().for_each(|x| *x /= norm);
    }
    for &(c, most) in &plan.turns {
        shorten(&mut q[c..c + 4], most);
    }
    for relation in &plan.relations {
        let coord = |dof: usize| m.dofs[dof].coord;
        let leader = relation.leader.map_or(0.0, |leader| q[coord(leader)]);
        q[coord(relation.follower)] = relation.position(leader);
    }
}

/// Turns a quaternion back to a largest angle [rad].
fn shorten(q: &mut [f64], most: f64) {
    let [x, y, z, w] = [q[0], q[1], q[2], q[3]];
    let sine = (x * x + y * y + z * z).sqrt();
    let angle = 2.0 * sine.atan2(w.abs());
    if angle > most {
        let scale = (0.5 * most).sin() / sine * if w < 0.0 { -1.0 } else { 1.0 };
        q.copy_from_slice(&[x * scale, y * scale, z * scale, (0.5 * most).cos()]);
    }
}

/// Replaces the variables of a start by random ones. Free bodies keep their positions.
pub fn draw(model: &Model, plan: &Plan, draws: &mut Draws, q: &mut [f64]) {
    for joint in &plan.joints {
        let c = joint.coord;
        match joint.motion {
            Motion::Revolute | Motion::Prismatic => {
                let reach = if joint.motion == Motion::Revolute {
                    PI
                } else {
                    SLIDE
                };
                q[c] = draws.between(range(plan.bounds[joint.variable], q[c], reach));
            }
            Motion::Ball => q[c..c + 4].copy_from_slice(&draws.rotation()),
            Motion::Free => q[c + 3..c + 7].copy_from_slice(&draws.rotation()),
            Motion::Mocap => {}
        }
    }
    tidy(model, plan, q);
}

/// What a coordinate is drawn from.
fn range([lower, upper]: [f64; 2], start: f64, reach: f64) -> [f64; 2] {
    if upper - lower <= RANGE_MAX {
        return [lower, upper];
    }
    [(start - reach).max(lower), (start + reach).min(upper)]
}
