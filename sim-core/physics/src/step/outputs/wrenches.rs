//! Accelerations of bodies of MuJoCo models, and the forces on them, for output (MuJoCo: `mj_rnePostConstraint`).
//!
//! ```text
//! cacc = (α, a + α × r + ω × (ω × r) - ω × v)     at c, the centre of mass of the body's tree; r from the body's origin
//! F = m a(x)       N = I α + ω × I ω + (x - c) × F                        x: the body's own centre of mass
//! cfrc_int(b) = (N, F) - cfrc_ext(b) + Σ cfrc_int(child)
//! cfrc_ext(b) = contacts + body_f ± forces of connects and welds          each with its torque about c
//! ```

use super::sites::{position, reference};
use super::subtrees::root_center;
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::{row, turning};
use crate::constants::outputs::OutputBody;
use crate::constants::params::Param;
use crate::constants::ties::{Frames, Measure};
use crate::each;
use crate::lane::{Cx, Num, Real, map};
use crate::math::spatial::{ANGULAR, Spatial};
use crate::math::vec3::{Mat3, Vec3, load_vec3};
use crate::step::constraints::contact_rows::{class_list, turning_scales};
use crate::step::constraints::tied_frames;
use crate::step::tree::inverse_dynamics::{point_acceleration, proper_accelerations};
use crate::step::{BlockOf, ConstantsOf, Stage, masses};

/// Accelerations of bodies, and forces on them.
pub struct Forces;

impl Stage for Forces {
    const READS: &'static [A] = &[
        A::JointQ,
        A::JointQd,
        A::JointQdd,
        A::Params,
        A::Rotation,
        A::Origin,
        A::Reference,
        A::Velocity,
        A::EfcForce,
        A::ContactForces,
        A::SubtreeCenter,
    ];
    const WRITES: &'static [A] = &[A::Cacc, A::CfrcInt, A::CfrcExt];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.outputs.bodies.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        let base = proper_accelerations(cx, m, b);
        let bodies = &m.outputs.bodies;
        // cacc of each body, and in `cfrc_int` the wrench (N, F) that its motion needs
        for (k, body) in bodies.iter().enumerate() {
            accelerate(m, b, k, body, base);
        }
        // cfrc_ext begins with the contacts, which their loops sum in cells
        contact_wrenches(cx, m, b);
        for (k, cfrc) in b.work.cfrc_ext.iter_mut().enumerate() {
            *cfrc = std::array::from_fn(|i| cx.get(&b.contact_wrench[6 * k + i]));
        }
        // body_f: a force at the centre of mass and a torque, per world; the world body of a model takes none
        if let Some(first) = m.varying.first(Param::BodyF) {
            for (k, body) in bodies
                .iter()
                .enumerate()
                .filter(|(k, body)| body.parent != *k)
            {
                let given = &b.params[first + 6 * body.link..first + 6 * body.link + 6];
                let force = Vec3([given[0], given[1], given[2]]);
                let torque = Vec3([given[3], given[4], given[5]]);
                let point = masses::position(m, b, body);
                add(m, b, k, point, force, torque);
            }
        }
        // connects and welds; `row` is the first constraint row of each tie
        let mut row = m.joint_rows();
        for tie in &m.ties {
            if let Measure::Frames(frames) = &tie.measure {
                tie_wrenches(cx, m, b, frames, row);
            }
            row += tie.rows;
        }
        let w = &mut b.work;
        // (N, F) - cfrc_ext(b); the world body needs no force of its own
        for k in 0..bodies.len() {
            w.cfrc_int[k] = match bodies[k].parent == k {
                true => [C::F::c(0.0); 6],
                false => std::array::from_fn(|i| w.cfrc_int[k][i] - w.cfrc_ext[k][i]),
            };
        }
        // + Σ cfrc_int(child), children before parents
        for (k, body) in bodies.iter().enumerate().rev() {
            if body.parent != k {
                let wrench = w.cfrc_int[k];
                for (sum, x) in w.cfrc_int[body.parent].iter_mut().zip(wrench) {
                    *sum = *sum + x;
                }
            }
        }
    }
}

/// Writes the acceleration of a body, and to `cfrc_int` the force that it needs.
#[inline(always)]
fn accelerate<F: Num, V>(
    m: &Constants<F::Real>,
    b: &mut crate::arrays::Block<F, V>,
    k: usize,
    body: &OutputBody<F::Real>,
    base: Vec3<F>,
) {
    // c and x, both from the reference point of the tree of the body
    let center = root_center(m, b, body);
    let mass = masses::mass(m, &b.params, body.link, body.mass);
    let point = masses::position(m, b, body);
    let w = &mut b.work;
    // a(c) - ω × v(c) for cacc, a(x) for F; a static body has only the acceleration that stands for gravity
    let (at_center, at_point, alpha, omega) = match body.frame.body {
        Some(carrier) => {
            let Spatial([linear, omega]) = w.velocity[carrier];
            let (origin, acceleration) = (w.origin[carrier], w.force[carrier]);
            let classical = point_acceleration(acceleration, omega, center - origin);
            let velocity = omega.cross_add(center, linear);
            (
                classical - omega.cross(velocity),
                point_acceleration(acceleration, omega, point - origin),
                acceleration[ANGULAR],
                omega,
            )
        }
        None => (base, base, Vec3::zero(), Vec3::zero()),
    };
    w.cacc[k] = six(alpha, at_center);
    // F = m a(x), N = I α + ω × I ω + (x - c) × F
    let force = at_point * mass;
    let times = |v| masses::inertia_times(m, b, body, v);
    let moment = omega.cross_add(times(omega), times(alpha));
    b.work.cfrc_int[k] = six(moment + (point - center).cross(force), force);
}

/// Angular, then linear part.
#[inline(always)]
fn six<F: Num>(angular: Vec3<F>, linear: Vec3<F>) -> [F; 6] {
    let scalars = Spatial([angular, linear]);
    scalars.scalars()
}

/// Adds a force at a point, from the reference point of the body's tree, and a torque to `cfrc_ext` of a body.
#[inline(always)]
fn add<F: Num, V>(
    m: &Constants<F::Real>,
    b: &mut crate::arrays::Block<F, V>,
    k: usize,
    point: Vec3<F>,
    force: Vec3<F>,
    torque: Vec3<F>,
) {
    // torque about the centre of mass of the tree: τ + (p - c) × F
    let arm = point - root_center(m, b, &m.outputs.bodies[k]);
    let moved = six(arm.cross_add(force, torque), force);
    for (sum, x) in b.work.cfrc_ext[k].iter_mut().zip(moved) {
        *sum = *sum + x;
    }
}

/// Adds the forces of a connect or weld to `cfrc_ext` of its bodies.
#[inline(always)]
fn tie_wrenches<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &mut BlockOf<C>,
    frames: &Frames<<C::F as Num>::Real>,
    row: usize,
) {
    // the first three rows of a tie are the force on its first body
    let three = |first: usize| Vec3(std::array::from_fn(|i| cx.get(&b.efc_force[first + i])));
    let force = three(row);
    // of a weld, three more rows give a torque by the transpose of their Jacobian
    let torque = match frames.torque_scale {
        Some(scale) => tied_frames::torque(&b.work, frames, scale, three(row + 3)),
        None => Vec3::zero(),
    };
    // action on the first body and reaction on the second, each at the origin of its frame
    let sides = [
        (&frames.first, C::F::c(1.0)),
        (&frames.second, C::F::c(-1.0)),
    ];
    for (&k, (mount, sign)) in frames.bodies.iter().zip(sides) {
        let body = &m.outputs.bodies[k];
        if body.parent != k {
            let point = position(&b.work, mount);
            add(m, b, k, point, force * sign, torque * sign);
        }
    }
}

/// Writes the sums of contact forces on each body, with their torques about the centre of mass of its tree.
#[inline(always)]
fn contact_wrenches<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let (zero, one, half) = (C::F::c(0.0), C::F::c(1.0), C::F::c(0.5));
    for cell in &mut b.contact_wrench {
        cx.set(cell, zero);
    }
    let t = &m.contacts;
    for (number, class) in t.classes.iter().enumerate() {
        // only classes whose contacts act on bodies of the outputs
        let touched = t.bodies.of_classes.get(number);
        let Some(bodies) = touched.filter(|all| !all.is_empty()) else {
            continue;
        };
        let list = class_list(cx, t, number);
        each!(cx, r in list, {
            let pair = cx.load(t.memory.rows, r, row::PAIR);
            // which bodies of the class the pair is about, counted from 1; 0 is none of them
            let sides = [
                cx.pick(t.bodies.of_pair, pair, 0),
                cx.pick(t.bodies.of_pair, pair, 1),
            ];
            let [point, force, torque] = contact_force(cx, m, number, r);
            let there = b.work.reference[class.trees.1];
            for (place, &k) in bodies.iter().enumerate() {
                let body = &m.outputs.bodies[k];
                let slot = C::F::c((place + 1) as f64);
                // +1 on the second side, -1 on the first, 0 on neither: a factor, since each world has another pair
                let [first, second] = map(sides, |side| {
                    let is_it = (side - slot).abs().lt(half);
                    C::F::select(is_it, one, zero)
                });
                let sign = second - first;
                // arm from c to the contact; between trees add the difference of their reference points
                let mut arm = point - root_center(m, b, body);
                if body.frame.tree != Some(class.trees.1) {
                    arm = arm + (there - reference(&b.work, &body.frame));
                }
                // (τ + r × F, F), with its sign, onto the sum of the body
                let moved = six(arm.cross_add(force, torque), force);
                for (cell, x) in b.contact_wrench[6 * k..6 * k + 6].iter_mut().zip(moved) {
                    let sum = x.fma(sign, cx.get(cell));
                    cx.set(cell, sum);
                }
            }
        });
    }
}

/// Point of a contact from the reference point of its class's second tree, and force and torque on the second shape.
#[inline(always)]
fn contact_force<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, number: usize, r: C::I) -> [Vec3<C::F>; 3] {
    let t = &m.contacts;
    let rows = t.memory.rows;
    let point = load_vec3(cx, rows, r, row::POINT);
    // columns: normal and tangents, along which a contact keeps its force
    let frame = Mat3([
        load_vec3(cx, rows, r, row::NORMAL),
        load_vec3(cx, rows, r, row::TANGENTS),
        load_vec3(cx, rows, r, row::TANGENTS + 3),
    ]);
    let force = load_vec3(cx, rows, r, row::FORCE);
    let mut torque = Vec3::zero();
    // torsional and rolling rows are scaled by their friction over that of sliding, so a torque is too
    if let Some(block) = t.classes[number].turns {
        let pair = cx.load(rows, r, row::PAIR);
        let Vec3([x, y, z]) = load_vec3(cx, rows, r, block + turning::FORCE);
        let Vec3([twist, first, second]) = turning_scales(cx, t, pair);
        torque = frame.mul_add(Vec3([x * twist, y * first, z * second]), Vec3::zero());
    }
    [point, frame.mul_add(force, Vec3::zero()), torque]
}
