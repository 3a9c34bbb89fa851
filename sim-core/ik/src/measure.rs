//! Errors of frames, and the normal equations of their squares.
//!
//! ```text
//! e = p - t          J = v + ω × p                    position, world axes
//! e = log(R Tᵀ)      J = ω                            rotation vector, world axes
//! H = Σ Jᵀ W J       g = Σ Jᵀ W e        E = ½ Σ eᵀ W e
//! ```
//!
//! A target on a body moves with it: its dofs count with the other sign. J of the rotation vector leaves out a factor that is 1
//! along e, so that the gradient of a uniformly weighted error is exact.

use crate::rotation;
use crate::tables::{LengthTable, ReachTable, Tables, Weight};
use sim_physics::arrays::{Block, Workspace};
use sim_physics::lane::memory::Cpu;
use sim_physics::lane::{Lane, Num};
use sim_physics::math::spatial::Spatial;
use sim_physics::math::vec3::{Mat3, Vec3};
use sim_physics::step::outputs::sites;
use sim_physics::step::tree::kinematics::{place_bases, place_body};

/// The target of a frame in each lane.
#[derive(Clone, Copy)]
pub struct Target<F> {
    /// Position, from the base of a robot that is fixed to the world [m].
    pub position: Vec3<F>,
    /// Axes by columns.
    pub axes: Mat3<F>,
}

/// What a frame is off its target.
pub struct Apart<F> {
    /// Position error, world axes [m].
    pub position: Vec3<F>,
    /// Rotation vector from the target, world axes [rad].
    pub turn: Vec3<F>,
    /// The frame's origin, from the reference point of its robot [m].
    point: Vec3<F>,
    /// The same from that of what the target is measured from [m].
    point_of_other: Vec3<F>,
    /// Axes of what the target is measured from; none for the world's.
    other: Option<Mat3<F>>,
    /// Axes of the target in the world.
    target: Mat3<F>,
}

/// The normal equations at a state, and what they are summed in.
pub struct Normal<F> {
    /// H, packed by the plan's pattern.
    pub hessian: Vec<F>,
    /// g, by variable.
    pub gradient: Vec<F>,
    /// E
    pub cost: F,
    /// Largest error of any frame as a multiple of its tolerance, squared.
    pub worst: F,
    /// Jacobian of a frame, weighted, by its variables.
    columns: Vec<[F; 6]>,
}

impl<F: Lane> Normal<F> {
    /// Zeros for a plan.
    pub fn new(t: &Tables<F::Real>) -> Normal<F> {
        let zero = F::c(0.0);
        let widest = t.reaches.iter().map(|reach| reach.variables.len()).max();
        let longest = t.lengths.iter().map(|length| length.variables.len()).max();
        Normal {
            hessian: vec![zero; t.pattern.len()],
            gradient: vec![zero; t.coord_of.len()],
            cost: zero,
            worst: zero,
            columns: vec![[zero; 6]; widest.max(longest).unwrap_or(0)],
        }
    }
}

/// Places the bodies of a plan, and finds the slopes of what follows.
#[inline(always)]
pub fn place<F: Lane>(t: &Tables<F::Real>, block: &mut Block<F, F>, slopes: &mut [F]) {
    follow(t, &mut block.joint_q, slopes);
    let m = &t.constants;
    let cx = &mut Cpu::new(&mut [], &m.contacts.tables);
    place_bases(m, block);
    for &body in &t.bodies {
        place_body(cx, m, block, body);
    }
}

/// Moves joints that follow others to where they belong, and finds their slopes over their variables.
#[inline(always)]
fn follow<F: Lane>(t: &Tables<F::Real>, joint_q: &mut [F], slopes: &mut [F]) {
    for (k, follower) in t.followers.iter().enumerate() {
        let leader = follower.leader.map_or(F::c(0.0), |coord| joint_q[coord]);
        let x = F::k(follower.scale) * leader - F::k(follower.offset);
        let (value, slope) = polynomial(&follower.polynomial, x);
        joint_q[follower.coord] = value;
        let slope = slope * F::k(follower.scale);
        slopes[k] = match follower.leader_slope {
            Some(leader) => slope * slopes[leader],
            None => slope,
        };
    }
}

/// p(x) and p'(x).
#[inline(always)]
fn polynomial<F: Num>(coefficients: &[F::Real; 5], x: F) -> (F, F) {
    let (mut value, mut slope) = (F::k(coefficients[4]), F::c(0.0));
    for k in 0..4 {
        slope = slope.fma(x, value);
        value = value.fma(x, F::k(coefficients[3 - k]));
    }
    (value, slope)
}

/// What a frame is off its target, in a block whose bodies are placed.
#[inline(always)]
pub fn apart<F: Lane>(
    reach: &ReachTable<F::Real>,
    w: &Workspace<F>,
    target: &Target<F>,
) -> Apart<F> {
    let (frame, other) = (&reach.frame, reach.relative_to.as_ref());
    let point = sites::position(w, frame);
    let mut deviation = Apart {
        position: point - target.position,
        turn: Vec3::zero(),
        point,
        point_of_other: point,
        other: None,
        target: target.axes,
    };
    if reach.moves_reference {
        // the two are near each other: their difference loses nothing
        deviation.position = point + (sites::reference(w, frame) - target.position);
    }
    if let Some(other) = other {
        if !reach.is_same_tree {
            let between = sites::reference(w, frame) - sites::reference(w, other);
            deviation.point_of_other = point + between;
        }
        let axes = sites::axes(w, other);
        let there = sites::position(w, other);
        deviation.position = (deviation.point_of_other - there) - axes * target.position;
        deviation.target = Mat3([
            axes * target.axes[0],
            axes * target.axes[1],
            axes * target.axes[2],
        ]);
        deviation.other = Some(axes);
    }
    if reach.rotation != Weight::None {
        deviation.turn = rotation::between(&sites::axes(w, frame), &deviation.target);
    }
    deviation
}

/// Squares of what counts of the errors of a frame: position [m²], rotation [rad²].
#[inline(always)]
pub fn squares<F: Lane>(reach: &ReachTable<F::Real>, deviation: &Apart<F>) -> [F; 2] {
    let zero = F::Real::default();
    let square = |weight: Weight<F::Real>, error: Vec3<F>, axes: Option<&Mat3<F>>| match weight {
        Weight::None => F::c(0.0),
        Weight::Uniform(_) => error.dot(error),
        Weight::Axes(weights) => {
            let local = axes.map_or(error, |axes| axes.transpose_mul(error));
            let mut sum = F::c(0.0);
            for i in 0..3 {
                if weights[i] > zero {
                    sum = local[i].fma(local[i], sum);
                }
            }
            sum
        }
    };
    [
        square(reach.position, deviation.position, deviation.other.as_ref()),
        square(reach.rotation, deviation.turn, Some(&deviation.target)),
    ]
}

/// The equality of two lengths: what is missing, and the slope p'.
#[inline(always)]
pub fn missing<F: Lane>(length: &LengthTable<F::Real>, joint_q: &[F]) -> (F, F) {
    let mut sums = [F::c(0.0); 2];
    for side in 0..2 {
        sums[side] = -F::k(length.offsets[side]);
        for term in &length.terms[side] {
            sums[side] = joint_q[term.coord].fma(F::k(term.coefficient), sums[side]);
        }
    }
    let (value, slope) = polynomial(&length.polynomial, sums[1]);
    (sums[0] - value, slope)
}

/// Writes the normal equations of all frames and lengths, in a block whose bodies are placed. `scales` are 1 over the squares
/// of the tolerances of positions and rotations.
#[inline(always)]
pub fn normal_equations<F: Lane>(
    t: &Tables<F::Real>,
    block: &Block<F, F>,
    slopes: &[F],
    targets: &[Target<F>],
    scales: [F; 2],
    n: &mut Normal<F>,
) {
    let zero = F::c(0.0);
    n.hessian.fill(zero);
    n.gradient.fill(zero);
    (n.cost, n.worst) = (zero, zero);
    for (reach, target) in t.reaches.iter().zip(targets) {
        let deviation = apart(reach, &block.work, target);
        let [position, turn] = squares(reach, &deviation);
        n.worst = n.worst.max((position * scales[0]).max(turn * scales[1]));
        add_reach(reach, &block.work, slopes, &deviation, n);
    }
    for length in &t.lengths {
        let (error, slope) = missing(length, &block.joint_q);
        n.worst = n.worst.max(error * error * scales[0]);
        add_length(length, slopes, error, slope, n);
    }
}

/// A vector along the axes of its weights, times them.
#[inline(always)]
fn weighted<F: Lane>(weight: Weight<F::Real>, vector: Vec3<F>, axes: Option<&Mat3<F>>) -> Vec3<F> {
    match weight {
        Weight::None => Vec3::zero(),
        Weight::Uniform(weight) => vector * F::k(weight),
        Weight::Axes([x, y, z]) => {
            let local = axes.map_or(vector, |axes| axes.transpose_mul(vector));
            Vec3([local[0] * F::k(x), local[1] * F::k(y), local[2] * F::k(z)])
        }
    }
}

/// Adds the errors of a frame.
#[inline(always)]
fn add_reach<F: Lane>(
    reach: &ReachTable<F::Real>,
    w: &Workspace<F>,
    slopes: &[F],
    deviation: &Apart<F>,
    n: &mut Normal<F>,
) {
    let has_position = reach.position != Weight::None;
    let has_rotation = reach.rotation != Weight::None;
    let (world, target) = (deviation.other.as_ref(), Some(&deviation.target));
    let rows = match (has_position, has_rotation) {
        (true, true) => 0..6,
        (true, false) => 0..3,
        _ => 3..6,
    };
    let mut error = [F::c(0.0); 6];
    error[..3].copy_from_slice(&*weighted(reach.position, deviation.position, world));
    error[3..].copy_from_slice(&*weighted(reach.rotation, deviation.turn, target));
    for entry in &reach.entries {
        let Spatial([linear, angular]) = w.motion[entry.dof];
        let (mut moved, mut turned) = (Vec3::zero(), Vec3::zero());
        if has_position {
            let point = match entry.is_of_other {
                true => deviation.point_of_other,
                false => deviation.point,
            };
            let velocity = angular.cross_add(point, linear);
            moved = weighted(reach.position, velocity, world);
        }
        if has_rotation {
            turned = weighted(reach.rotation, angular, target);
        }
        if entry.is_of_other {
            (moved, turned) = (-moved, -turned);
        }
        if let Some(slope) = entry.slope {
            (moved, turned) = (moved * slopes[slope], turned * slopes[slope]);
        }
        let column = &mut n.columns[entry.column];
        let twist = [
            moved[0], moved[1], moved[2], turned[0], turned[1], turned[2],
        ];
        for i in 0..6 {
            column[i] = if entry.is_first {
                twist[i]
            } else {
                column[i] + twist[i]
            };
        }
    }
    let mut square = F::c(0.0);
    for i in rows.clone() {
        square = error[i].fma(error[i], square);
    }
    n.cost = square.fma(F::c(0.5), n.cost);
    add_columns(&reach.variables, &reach.places, &error, rows, n);
}

/// Adds Jᵀ J and Jᵀ e of some columns.
#[inline(always)]
fn add_columns<F: Lane>(
    variables: &[usize],
    places: &[usize],
    error: &[F; 6],
    rows: std::ops::Range<usize>,
    n: &mut Normal<F>,
) {
    let mut place = 0;
    for (a, &variable) in variables.iter().enumerate() {
        let column = n.columns[a];
        for b in 0..a + 1 {
            let other = &n.columns[b];
            let mut sum = n.hessian[places[place]];
            for i in rows.clone() {
                sum = column[i].fma(other[i], sum);
            }
            n.hessian[places[place]] = sum;
            place += 1;
        }
        let mut sum = n.gradient[variable];
        for i in rows.clone() {
            sum = column[i].fma(error[i], sum);
        }
        n.gradient[variable] = sum;
    }
}

/// Adds the error of a length.
#[inline(always)]
fn add_length<F: Lane>(
    length: &LengthTable<F::Real>,
    slopes: &[F],
    error: F,
    slope: F,
    n: &mut Normal<F>,
) {
    let zero = F::c(0.0);
    for column in &mut n.columns[..length.variables.len()] {
        column[0] = zero;
    }
    for (side, factor) in [F::c(1.0), -slope].into_iter().enumerate() {
        for term in &length.terms[side] {
            let Some(column) = term.column else { continue };
            let mut entry = factor * F::k(term.coefficient);
            if let Some(slope) = term.slope {
                entry = entry * slopes[slope];
            }
            n.columns[column][0] = n.columns[column][0] + entry;
        }
    }
    n.cost = (error * error).fma(F::c(0.5), n.cost);
    let mut errors = [zero; 6];
    errors[0] = error;
    add_columns(&length.variables, &length.places, &errors, 0..1, n);
}
