//! A step of Levenberg and Marquardt within bounds.
//!
//! ```text
//! (H + λ) δ = -g      λ = μ E + ε
//! ```
//!
//! λ falls with the error E (Sugihara, "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE
//! Transactions on Robotics 27, 2011). A variable at a bound that g pushes against stays there. Where a step would leave the
//! bounds, the variables that leave go to their bounds, and the others are solved for again.

use crate::tables::{Tables, Turning};
use sim_physics::constants::Motion;
use sim_physics::lane::{Lane, Num};
use sim_physics::math::factor::solve;
use sim_physics::math::quat::{self, Quat};
use sim_physics::math::vec3::Vec3;

/// What a step is solved in.
pub struct Solve<F> {
    /// H + λ, and its factor.
    system: Vec<F>,
    /// δ, by variable [rad or m].
    pub delta: Vec<F>,
    /// 1 for variables that may move, 0 for those that stay.
    free: Vec<F>,
    /// What those that stay move by, at once [rad or m].
    fixed: Vec<F>,
}

impl<F: Lane> Solve<F> {
    /// Zeros for a plan.
    pub fn new(t: &Tables<F::Real>) -> Solve<F> {
        let zeros = vec![F::c(0.0); t.coord_of.len()];
        Solve {
            system: vec![F::c(0.0); t.pattern.len()],
            delta: zeros.clone(),
            free: zeros.clone(),
            fixed: zeros,
        }
    }
}

/// δ of a state with these normal equations.
#[inline(always)]
pub fn find<F: Lane>(
    t: &Tables<F::Real>,
    joint_q: &[F],
    hessian: &[F],
    gradient: &[F],
    damping: F,
    s: &mut Solve<F>,
) {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    for (v, coord) in t.coord_of.iter().enumerate() {
        s.fixed[v] = zero;
        s.free[v] = one;
        if let Some(coord) = *coord {
            let q = joint_q[coord];
            let [lower, upper] = t.bounds[v].map(F::k);
            let g = gradient[v];
            let stays = (!lower.lt(q) & zero.lt(g)) | (!q.lt(upper) & g.lt(zero));
            s.free[v] = F::select(stays, zero, one);
        }
    }
    // once more where a step leaves; without such a lane the result would be the same
    for _ in 0..2 {
        solve_free(t, hessian, gradient, damping, s);
        if !F::any(stop_at_bounds(t, joint_q, s)) {
            break;
        }
    }
}

/// Makes variables that leave their bounds stop there. Returns the lanes that have any.
#[inline(always)]
fn stop_at_bounds<F: Lane>(t: &Tables<F::Real>, joint_q: &[F], s: &mut Solve<F>) -> F::Mask {
    let zero = F::c(0.0);
    let mut leaves_any = !F::all();
    for (v, coord) in t.coord_of.iter().enumerate() {
        if let Some(coord) = *coord {
            let q = joint_q[coord];
            let [lower, upper] = t.bounds[v].map(F::k);
            let (low, high) = (lower - q, upper - q);
            let leaves = s.delta[v].lt(low) | high.lt(s.delta[v]);
            let at = s.delta[v].max(low).min(high);
            s.fixed[v] = F::select(leaves, at, s.fixed[v]);
            s.free[v] = F::select(leaves, zero, s.free[v]);
            leaves_any = leaves_any | leaves;
        }
    }
    leaves_any
}

/// δ of the variables that may move, given that of the others.
#[inline(always)]
fn solve_free<F: Lane>(
    t: &Tables<F::Real>,
    hessian: &[F],
    gradient: &[F],
    damping: F,
    s: &mut Solve<F>,
) {
    let one = F::c(1.0);
    // the factorisation reads zeros of the pattern too, where an overflow of an earlier attempt may have left NaN
    s.system.fill(F::c(0.0));
    for v in 0..t.coord_of.len() {
        s.delta[v] = -gradient[v];
    }
    for v in 0..t.coord_of.len() {
        let free = s.free[v];
        for &(place, other) in &t.rows[v] {
            let h = hessian[place];
            s.delta[v] = h.fnma(s.fixed[other], s.delta[v]);
            s.delta[other] = h.fnma(s.fixed[v], s.delta[other]);
            s.system[place] = h * (free * s.free[other]);
        }
        let diagonal = t.diagonal[v];
        // 1 for those that stay
        s.system[diagonal] = free.fma(hessian[diagonal] + damping, one - free);
    }
    for v in 0..t.coord_of.len() {
        s.delta[v] = s.free[v].fma(s.delta[v], s.fixed[v]);
    }
    solve(&t.pattern, &mut s.system, &mut s.delta);
}

/// Writes the state after a step to `to`.
#[inline(always)]
pub fn moved<F: Lane>(t: &Tables<F::Real>, from: &[F], delta: &[F], to: &mut [F]) {
    for (v, coord) in t.coord_of.iter().enumerate() {
        if let Some(coord) = *coord {
            let [lower, upper] = t.bounds[v].map(F::k);
            to[coord] = (from[coord] + delta[v]).max(lower).min(upper);
        }
    }
    for turning in &t.turning {
        match turning.motion {
            Motion::Ball => turn_ball(turning, from, delta, to),
            _ => move_free(turning, from, delta, to),
        }
    }
}

#[inline(always)]
pub fn quat_at<F: Num>(q: &[F], c: usize) -> Quat<F> {
    [q[c], q[c + 1], q[c + 2], q[c + 3]]
}

#[inline(always)]
fn vec_at<F: Num>(x: &[F], k: usize) -> Vec3<F> {
    Vec3([x[k], x[k + 1], x[k + 2]])
}

/// A ball, turned about its own axes, and back to its largest turn where it is beyond.
#[inline(always)]
fn turn_ball<F: Lane>(turning: &Turning<F::Real>, from: &[F], delta: &[F], to: &mut [F]) {
    let (c, one) = (turning.coord, F::c(1.0));
    let mut q = quat::turned(quat_at(from, c), vec_at(delta, turning.variable), one);
    if let Some(most) = turning.turn_max {
        let turn = quat::log(q);
        let angle = turn.dot(turn).sqrt();
        let is_beyond = F::k(most).lt(angle);
        let back = quat::exp(turn * F::select(is_beyond, F::k(most).div(angle), one));
        for i in 0..4 {
            q[i] = F::select(is_beyond, back[i], q[i]);
        }
    }
    to[c..c + 4].copy_from_slice(&q);
}

/// A free body: its centre of mass moves, and it turns about it, in world axes.
#[inline(always)]
fn move_free<F: Lane>(turning: &Turning<F::Real>, from: &[F], delta: &[F], to: &mut [F]) {
    let (c, v) = (turning.coord, turning.variable);
    let q = quat_at(from, c + 3);
    let rotation = quat::matrix(q);
    let center = Vec3::constant(turning.center);
    let spin = rotation.transpose_mul(vec_at(delta, v + 3));
    let q = quat::turned(q, spin, F::c(1.0));
    let arm = rotation * center - quat::matrix(q) * center;
    let position = (vec_at(from, c) + vec_at(delta, v)) + arm;
    to[c..c + 3].copy_from_slice(&*position);
    to[c + 3..c + 7].copy_from_slice(&q);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::frame;
    use crate::measure::{Normal, Target, normal_equations, place};
    use crate::plan::Plan;
    use crate::task::{Reach, Task};
    use sim_model::{Description, UrdfOptions};
    use sim_physics::arrays::Block;
    use std::path::Path;

    /// Step of a difference [rad or m].
    const STEP: f64 = 1e-6;

    #[test]
    fn the_gradient_is_that_of_the_cost_for_every_kind_of_joint() {
        let path = "sim-core/stages/recorded/tests/record_stages/every_joint.urdf";
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../..")
            .join(path);
        let options = UrdfOptions {
            name: Some("robot".to_owned()),
            floating: true,
            ..UrdfOptions::default()
        };
        let mut scene = Description::new(0.002, 1);
        scene.add_urdf(path, options).unwrap();
        let model = scene.compile().unwrap();
        let named = |name: &str| frame(&model, name).unwrap();
        let reach = |name: &str, other: Option<&str>| Reach {
            name: name.to_owned(),
            frame: named(name),
            relative_to: other.map(named),
            position_weight: [1.0, 2.0, 0.5],
            orientation_weight: [0.7; 3],
        };
        let task = Task {
            reaches: vec![
                reach("robot/camera", None),
                reach("robot/thumb", Some("robot/camera")),
                reach("robot/finger", None),
            ],
            moves: vec![true; model.dofs()],
            limits: false,
            posture_weight: vec![0.0; model.dofs()],
        };
        let plan = Plan::new(&model, &task).unwrap();
        let t = &Tables::<f64>::new(&model, &plan);
        let mut block: Block<f64, f64> = t.block();
        let mut q: Vec<f64> = (0..model.coords())
            .map(|c| (c as f64).sin() * 0.4)
            .collect();
        for c in t.constants.quaternions() {
            q[c..c + 4].copy_from_slice(&[0.5, -0.1, 0.7, 0.5]);
        }
        let target = Target {
            position: Vec3([0.2, -0.3, 0.4]),
            axes: sim_physics::math::quat::matrix([0.6, 0.0, 0.0, 0.8]),
        };
        let targets = [target; 3];
        let mut slopes = vec![0.0; t.followers.len()];
        assert!(!slopes.is_empty());
        let mut n = Normal::new(t);
        let mut evaluate = |delta: &[f64], n: &mut Normal<f64>| {
            block.joint_q.copy_from_slice(&q);
            moved(t, &q, delta, &mut block.joint_q);
            place(t, &mut block, &mut slopes);
            normal_equations(t, &block, &slopes, &targets, [1.0; 2], n);
        };
        let mut delta = vec![0.0; t.coord_of.len()];
        evaluate(&delta, &mut n);
        let gradient = n.gradient.clone();
        assert!(gradient.iter().all(|g| g.abs() > 1e-6), "{gradient:?}");
        for v in 0..delta.len() {
            let mut cost = |step: f64| {
                delta[v] = step;
                evaluate(&delta, &mut n);
                delta[v] = 0.0;
                n.cost
            };
            let difference = (cost(STEP) - cost(-STEP)) / (2.0 * STEP);
            // a third derivative of about 10, times the square of the step, and roundings of the cost over it
            assert!(
                (difference - gradient[v]).abs() < 1e-8,
                "variable {v}: {difference}, not {}",
                gradient[v]
            );
        }
    }
}
