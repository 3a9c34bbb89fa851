//! A register of problems, one per lane, each at its own iteration.
//!
//! An attempt at a problem begins from a start that the host writes into the inbox, and ends when its errors are within the
//! tolerances, when it makes no progress, or after its last iteration. The host reads ended attempts from the outbox, and gives
//! their lanes others.

use crate::measure::{Normal, Target, normal_equations, place};
use crate::step::{self, Solve, quat_at};
use crate::tables::Tables;
use sim_physics::arrays::Block;
use sim_physics::lane::{Lane, Real};
use sim_physics::math::quat;
use sim_physics::math::vec3::{Mat3, Vec3};

// Found by the iterations that 10,000 random poses of the FR3 take in the mean, restarts counted. They matter little: half or
// twice of each costs a tenth more.
/// μ at the start of an attempt [–].
const DAMPING_START: f64 = 0.1;
/// Factor of μ after a step that lowered the cost [–].
const DAMPING_FALLS: f64 = 0.7;
/// Factor of μ after another step [–].
const DAMPING_RISES: f64 = 4.0;
/// Bounds of μ [–].
const DAMPING: [f64; 2] = [5e-2, 1e6];
/// A cost below this share of the one at the last progress is progress [–].
const PROGRESS: f64 = 0.6;
/// An attempt without progress for more than these iterations is given up.
const PATIENCE: f64 = 4.0;
/// λ is at least this share of the largest entry of H, in double and in single precision: the system stays definite [–].
const DAMPING_SHARE: [f64; 2] = [1e-9, 1e-6];
/// λ is at most μ times this share of the largest entry of H [–].
const COST_SHARE: f64 = 3.0;
/// A step shorter than this ends the search for the posture [rad or m].
const STEP_MIN: f64 = 1e-3;

/// Limits of an attempt.
#[derive(Clone, Copy)]
pub struct Limits {
    /// Most iterations.
    pub iterations: usize,
    /// Position [m] and rotation [rad] that count as reached.
    pub tolerance: [f64; 2],
}

/// What the host exchanges with the lanes: rows of a number per lane.
pub struct Rows<R> {
    numbers: Vec<R>,
    width: usize,
}

impl<R: Real> Rows<R> {
    fn new(rows: usize, width: usize) -> Rows<R> {
        Rows {
            numbers: vec![R::default(); rows * width],
            width,
        }
    }

    /// The numbers of a row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> &[R] {
        &self.numbers[row * self.width..(row + 1) * self.width]
    }

    /// The same, to be written.
    #[inline(always)]
    pub fn row_mut(&mut self, row: usize) -> &mut [R] {
        &mut self.numbers[row * self.width..(row + 1) * self.width]
    }
}

/// Row 0 of the inbox for an attempt that keeps near its posture.
pub const POSED: f64 = 1.0;
/// Row 0 of the inbox for an attempt without a posture.
pub const FREE: f64 = 2.0;

/// Numbers of a target in the inbox: position, then axes by columns.
pub const TARGET: usize = 12;

/// A register of problems.
pub struct Lanes<F: Lane> {
    block: Block<F, F>,
    slopes: Vec<F>,
    targets: Vec<Target<F>>,
    /// Reference of the posture, by coordinate.
    posture: Vec<F>,
    normal: Normal<F>,
    solve: Solve<F>,
    /// The best state of the attempt, and its normal equations.
    kept: Vec<F>,
    hessian: Vec<F>,
    gradient: Vec<F>,
    cost: F,
    worst: F,
    /// μ
    damping: F,
    /// Iterations of the attempt.
    age: F,
    /// Cost at the last progress, and iterations since then.
    mark: F,
    since: F,
    /// 1 while the posture counts.
    is_posed: F,
    /// Row 0 is [`POSED`] or [`FREE`] for lanes with a new attempt; then starts, references, targets.
    pub inbox: Rows<F::Real>,
    /// Is there a new attempt in it?
    pub has_mail: bool,
    /// Row 0 is the cost of an ended attempt, row 1 its worst error; then its state.
    pub outbox: Rows<F::Real>,
    limits: Limits,
}

impl<F: Lane> Lanes<F> {
    /// Idle lanes.
    pub fn new(t: &Tables<F::Real>, limits: Limits) -> Lanes<F> {
        let (zero, coords) = (F::c(0.0), t.constants.coords);
        let normal = Normal::new(t);
        let target = Target {
            position: Vec3::zero(),
            axes: Mat3::zero(),
        };
        Lanes {
            block: t.block(),
            slopes: vec![zero; t.followers.len()],
            targets: vec![target; t.reaches.len()],
            posture: vec![zero; if t.has_posture { coords } else { 0 }],
            solve: Solve::new(t),
            kept: vec![zero; coords],
            hessian: normal.hessian.clone(),
            gradient: normal.gradient.clone(),
            normal,
            cost: zero,
            worst: zero,
            damping: zero,
            age: zero,
            mark: zero,
            since: zero,
            is_posed: zero,
            inbox: Rows::new(1 + 2 * t.coords.len() + TARGET * t.reaches.len(), F::WIDTH),
            has_mail: false,
            outbox: Rows::new(2 + t.coords.len(), F::WIDTH),
            limits,
        }
    }

    /// One iteration of every lane. Returns the lanes whose attempt has ended as bits, those without one included.
    #[inline(always)]
    pub fn iterate(&mut self, t: &Tables<F::Real>) -> u32 {
        if self.has_mail {
            self.take_mail(t);
        }
        let (zero, one) = (F::c(0.0), F::c(1.0));
        place(t, &mut self.block, &mut self.slopes);
        let scales = self.limits.tolerance.map(|x| F::c(1.0 / (x * x)));
        normal_equations(
            t,
            &self.block,
            &self.slopes,
            &self.targets,
            scales,
            &mut self.normal,
        );
        if t.has_posture {
            self.add_posture(t);
        }
        let n = &self.normal;
        let is_better = n.cost.lt(self.cost);
        let factor = F::select(is_better, F::c(DAMPING_FALLS), F::c(DAMPING_RISES));
        let [least, most] = DAMPING.map(F::c);
        self.damping = (self.damping * factor).max(least).min(most);
        self.cost = F::select(is_better, n.cost, self.cost);
        self.worst = F::select(is_better, n.worst, self.worst);
        for (kept, new) in self.hessian.iter_mut().zip(&n.hessian) {
            *kept = F::select(is_better, *new, *kept);
        }
        for (kept, new) in self.gradient.iter_mut().zip(&n.gradient) {
            *kept = F::select(is_better, *new, *kept);
        }
        for &c in &t.coords {
            self.kept[c] = F::select(is_better, self.block.joint_q[c], self.kept[c]);
        }
        self.age = self.age + one;
        let advances = self.cost.lt(self.mark * F::c(PROGRESS));
        self.mark = F::select(advances, self.cost, self.mark);
        self.since = F::select(advances, zero, self.since + one);
        let limit = F::c(self.limits.iterations as f64 - 0.5);
        let is_last = limit.lt(self.age);
        let is_stuck = F::c(PATIENCE).lt(self.since);
        let is_met = self.worst.lt(one);
        let is_posed = F::c(0.5).lt(self.is_posed);
        let ended = is_last | ((is_stuck | is_met) & !is_posed);
        let bits = F::bits(ended);
        if bits != 0 {
            self.write_outbox(t);
        }
        let mut largest = zero;
        for &diagonal in &t.diagonal {
            largest = largest.max(self.hessian[diagonal]);
        }
        let share = DAMPING_SHARE[usize::from(!F::Real::DOUBLE)];
        // E is no measure of H where a slide is far from its target
        let error = self.cost.min(largest * F::c(COST_SHARE));
        let lambda = self.damping.fma(error, largest * F::c(share));
        step::find(
            t,
            &self.kept,
            &self.hessian,
            &self.gradient,
            lambda,
            &mut self.solve,
        );
        step::moved(t, &self.kept, &self.solve.delta, &mut self.block.joint_q);
        if t.has_posture {
            self.end_posture(is_better, is_stuck);
        }
        bits
    }

    /// Begins the attempts that the host has put into the inbox.
    #[inline(always)]
    fn take_mail(&mut self, t: &Tables<F::Real>) {
        self.has_mail = false;
        let inbox = &self.inbox;
        let is_new = F::c(0.5).lt(F::load(inbox.row(0)));
        let mut row = 0;
        let mut next = |at: F| {
            row += 1;
            F::select(is_new, F::load(inbox.row(row)), at)
        };
        for &c in &t.coords {
            let q = next(self.block.joint_q[c]);
            self.block.joint_q[c] = q;
            // what an attempt keeps if its start overflows
            self.kept[c] = F::select(is_new, q, self.kept[c]);
        }
        for &c in &t.coords {
            let reference = next(self.posture.get(c).copied().unwrap_or(F::c(0.0)));
            if let Some(at) = self.posture.get_mut(c) {
                *at = reference;
            }
        }
        for target in &mut self.targets {
            for at in target.position.iter_mut() {
                *at = next(*at);
            }
            for at in target.axes.iter_mut().flat_map(|column| column.iter_mut()) {
                *at = next(*at);
            }
        }
        let (zero, one) = (F::c(0.0), F::c(1.0));
        let endless = F::c(f64::INFINITY);
        let is_posed = F::load(inbox.row(0)).lt(F::c(0.5 * (POSED + FREE)));
        let posed = match t.has_posture {
            true => F::select(is_posed, one, zero),
            false => zero,
        };
        for (state, start) in [
            (&mut self.cost, endless),
            (&mut self.worst, endless),
            (&mut self.mark, endless),
            (&mut self.damping, F::c(DAMPING_START / DAMPING_FALLS)),
            (&mut self.age, zero),
            (&mut self.since, zero),
            (&mut self.is_posed, posed),
        ] {
            *state = F::select(is_new, start, *state);
        }
        self.inbox.row_mut(0).fill(F::Real::default());
    }

    /// Shows the state of every lane to the host.
    #[inline(always)]
    fn write_outbox(&mut self, t: &Tables<F::Real>) {
        self.cost.store(self.outbox.row_mut(0));
        self.worst.store(self.outbox.row_mut(1));
        for (k, &c) in t.coords.iter().enumerate() {
            self.kept[c].store(self.outbox.row_mut(2 + k));
        }
    }

    /// Adds the distance from the posture to the normal equations, in lanes in which it counts.
    #[inline(always)]
    fn add_posture(&mut self, t: &Tables<F::Real>) {
        let n = &mut self.normal;
        let mut add = |v: usize, distance: F| {
            let weight = F::k(t.posture[v]) * self.is_posed;
            let place = t.diagonal[v];
            n.hessian[place] = n.hessian[place] + weight;
            n.gradient[v] = weight.fma(distance, n.gradient[v]);
            let half = weight * distance * F::c(0.5);
            n.cost = half.fma(distance, n.cost);
        };
        for (v, coord) in t.coord_of.iter().enumerate() {
            if let Some(c) = *coord {
                add(v, self.block.joint_q[c] - self.posture[c]);
            }
        }
        for turning in &t.turning {
            if turning.motion.coords() == 4 {
                let reference = quat_at(&self.posture, turning.coord);
                let q = quat_at(&self.block.joint_q, turning.coord);
                let turn = quat::log(quat::mul(quat::conjugate(reference), q));
                for i in 0..3 {
                    add(turning.variable + i, turn[i]);
                }
            }
        }
    }

    /// Leaves the posture where it has been found, so that what is left of the errors vanishes.
    #[inline(always)]
    fn end_posture(&mut self, is_better: F::Mask, is_stuck: F::Mask) {
        let mut longest = F::c(0.0);
        for delta in &self.solve.delta {
            longest = longest.max(delta.abs());
        }
        let half = F::c(0.5 * self.limits.iterations as f64);
        let is_found = (is_better & longest.lt(F::c(STEP_MIN))) | is_stuck | half.lt(self.age);
        let ends = is_found & F::c(0.5).lt(self.is_posed);
        let (zero, endless) = (F::c(0.0), F::c(f64::INFINITY));
        self.is_posed = F::select(ends, zero, self.is_posed);
        self.cost = F::select(ends, endless, self.cost);
        self.worst = F::select(ends, endless, self.worst);
        self.mark = F::select(ends, endless, self.mark);
        self.since = F::select(ends, zero, self.since);
    }
}
