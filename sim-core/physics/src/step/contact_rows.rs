//! Constraint rows of contacts: tangents, Jacobian, stiffness and reference acceleration (Todorov 2014; MuJoCo
//! documentation, "Computation: constraint model").
//!
//! ```text
//! v = J q̇, of the second body relative to the first, along normal and tangents
//! elliptic      R₀ = (1 - d)/d w          D₁ = D₂ = impratio D₀
//! pyramidal     R₀ = (1 - d)/d w (1 + μ²)  D = 1 / (2 μ² R₀ / impratio), of the edges n ± μ t
//! aref = -b v - k d (r - margin)  along the normal,   -b' v along a tangent
//! ```

use super::{BlockOf, ConstantsOf, Stage};
use crate::arrays::Array as A;
use crate::constants::Constants;
use crate::constants::contact::Cone;
use crate::constants::contact::{COUNT_LEFT_OUT, Class, Contacts, pair, row};
use crate::each;
use crate::lane::{Cx, Num, Real};
use crate::math::spatial::Spatial;
use crate::math::vec3::{Vec3, load_vec3};
use crate::step::collide::contact_slack;
use crate::step::constraint::impedance;

/// Constraint rows of contacts.
pub struct ContactRows;

impl Stage for ContactRows {
    const READS: &'static [A] = &[
        A::LeftOut,
        A::JointQd,
        A::Origin,
        A::Reference,
        A::Motion,
        A::ContactPoints,
    ];
    const WRITES: &'static [A] = &[A::LeftOut, A::ContactRows];

    fn is_needed<R: Real>(m: &Constants<R>) -> bool {
        !m.contacts.groups.is_empty()
    }

    #[inline(always)]
    fn run<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
        contact_rows(cx, m, b);
    }
}

#[inline(always)]
fn contact_rows<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let t = &m.contacts;
    note_overflow(cx, t, &mut b.left_out[0]);
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
            let normal = load_vec3(cx, t.memory.rows, r, row::NORMAL);
            let point = load_vec3(cx, t.memory.rows, r, row::POINT);
            let number = cx.load(t.memory.rows, r, row::PAIR);
            let rubs = shared(cx, t, class, number, pair::RUBS);
            let along = match t.cone {
                Cone::Elliptic => None,
                Cone::Pyramidal => Some(load_vec3(cx, t.memory.rows, r, row::TANGENTS)),
            };
            let tangents = tangents(normal, along);
            // without friction a contact has no tangents
            let frame = [normal, tangents[0] * rubs, tangents[1] * rubs];
            let mut velocity = [zero; 3];
            let w = &b.work;
            let second = w.reference[class.trees.1];
            let point_first = match class.trees.0 {
                Some(tree) if tree != class.trees.1 => {
                    add_difference(point, second, w.reference[tree])
                }
                _ => point,
            };
            let mut torques = [[Vec3::zero(); 3]; 2];
            for (i, axis) in frame.iter().enumerate() {
                torques[0][i] = point_first.cross(*axis);
                torques[1][i] = point.cross(*axis);
            }
            for (c, column) in class.columns.iter().enumerate() {
                let Spatial([linear, angular]) = w.motion[column.dof];
                let lever = shared(cx, t, class, number, column.lever);
                let speed = cx.get(&b.joint_qd[column.dof]);
                let torques = &torques[usize::from(!column.is_first)];
                let mut jacobian = [zero; 3];
                for i in 0..3 {
                    let turned = linear.dot(frame[i]) + angular.dot(Vec3(torques[i].0));
                    jacobian[i] = lever * turned;
                    velocity[i] = jacobian[i].fma(speed, velocity[i]);
                }
                cx.fill_all(t.memory.rows, r, row::JACOBIAN + 3 * c, jacobian);
            }
            cx.fill_all(t.memory.rows, r, row::TANGENTS, frame[1].0);
            cx.fill_all(t.memory.rows, r, row::TANGENTS + 3, frame[2].0);
            let swing = swing_between(cx, m, b, class);
            let distance = cx.load(t.memory.rows, r, row::DISTANCE);
            let position = distance - shared(cx, t, class, number, pair::MARGIN);
            let d = impedance(&m.contact_impedance, position);
            let mu = match t.memory.mu.rows {
                0 => shared(cx, t, class, number, pair::MU),
                _ => cx.load(t.memory.rows, r, row::MU),
            };
            let mu = mu * rubs;
            let weight = shared(cx, t, class, number, pair::WEIGHT);
            let stiff = d.div((one - d) * weight);
            let damping = shared(cx, t, class, number, pair::DAMPING);
            let spring = shared(cx, t, class, number, pair::STIFFNESS) * d * position;
            let mut aref = [-velocity[0].fma(damping, spring), zero, zero];
            let (stiff, sliding) = match t.cone {
                Cone::Elliptic => (stiff, shared(cx, t, class, number, pair::SLIDING)),
                Cone::Pyramidal => {
                    let square = mu * mu;
                    let mut edges = C::F::k(t.impratio).div(square + square);
                    edges = edges.div(one + square);
                    if !<<C::F as Num>::Real as Real>::DOUBLE {
                        edges = edges.min(C::F::c(EDGES_MAX));
                    }
                    // without friction four edges fall together
                    let share = C::F::select(zero.lt(mu), edges, C::F::c(0.25));
                    (stiff * share, damping)
                }
            };
            for i in 1..3 {
                aref[i] = -(velocity[i] * sliding);
            }
            let smaller = shared(cx, t, class, number, pair::SMALLER);
            let pushes = position.lt(contact_slack(smaller));
            let stiff = C::F::select(pushes, stiff, zero);
            cx.fill(t.memory.rows, r, row::STIFFNESS, stiff);
            if t.cone == Cone::Elliptic {
                let ratio = C::F::c(1.0 / t.impratio.to_f64());
                let soft = stiff.div((mu * mu).fma(ratio, one));
                cx.fill(t.memory.rows, r, row::SOFT, soft);
            }
            cx.fill(t.memory.rows, r, row::MU, mu);
            for (x, axis) in aref.iter_mut().zip(frame) {
                if let Some(swing) = swing {
                    *x = *x + axis.dot(swing);
                }
                *x = C::F::select(pushes, *x, zero);
            }
            cx.fill_all(t.memory.rows, r, row::AREF, aref);
        });
    }
}

/// Most stiffness in `f32` of a pyramid's edge over that of the elliptic cone's normal row [–].
///
/// An edge is as rigid then as `f32` can tell; with 20 times as much, rounding threw bodies off. MuJoCo's is more
/// below mu = 0.22 at the default impratio of 1000.
const EDGES_MAX: f64 = 1e4;

/// What MuJoCo's J q̈ lacks of ours: a free joint's acceleration is of its frame's origin there, of the centre of mass
/// here, and they differ by ω × (ω × r). None where no centre lies off its frame.
#[inline(always)]
fn swing_between<C: Cx>(
    cx: &mut C,
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    class: &Class<<C::F as Num>::Real>,
) -> Option<Vec3<C::F>> {
    let (first, second) = class.trees;
    if first == Some(second) {
        // both bodies are carried by it
        return None;
    }
    let first = first.and_then(|tree| swing(cx, m, b, tree));
    let second = swing(cx, m, b, second);
    match (first, second) {
        (Some(first), Some(second)) => Some(second - first),
        (Some(first), None) => Some(first * -C::F::c(1.0)),
        (None, second) => second,
    }
}

/// ω × (ω × r) of a tree's free body, whose centre of mass is at r from its frame's origin.
#[inline(always)]
fn swing<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &BlockOf<C>, tree: usize) -> Option<Vec3<C::F>> {
    let free = m.trees[tree].free?;
    let body = &m.bodies[free];
    if body.center.iter().all(|x| x.to_f64() == 0.0) {
        return None;
    }
    let mut spin = Vec3::zero();
    for (i, x) in spin.iter_mut().enumerate() {
        *x = cx.get(&b.joint_qd[body.dof + 3 + i]);
    }
    // the frame's origin is kept relative to the centre
    Some(spin.cross(b.work.origin[free].cross(spin)))
}

/// Keeps the largest number of contacts that did not fit.
#[inline(always)]
fn note_overflow<C: Cx>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, most: &mut C::V) {
    let mut left_out = C::F::c(0.0);
    if t.may_overflow {
        let row = cx.at(t.classes.len() + COUNT_LEFT_OUT);
        left_out = cx.load(t.memory.counts, row, 0);
    }
    for (k, class) in t.classes.iter().enumerate() {
        let row = cx.at(k);
        let over = cx.load(t.memory.counts, row, 0) - C::F::c(class.capacity as f64);
        left_out = left_out + over.max(C::F::c(0.0));
    }
    let left_out = cx.get(most).max(left_out);
    cx.set(most, left_out);
}

/// The contacts of a class that the worlds have now.
#[inline(always)]
pub(super) fn class_list<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    class: usize,
) -> C::List {
    let (at, first) = (cx.at(class), cx.at(t.classes[class].first));
    let capacity = cx.at(t.classes[class].capacity);
    cx.kept(t.memory.counts, at, first, capacity)
}

/// A number of a contact's pair, which may be the same for all pairs of the class.
#[inline(always)]
fn shared<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    class: &Class<<C::F as Num>::Real>,
    number: C::F,
    k: usize,
) -> C::F {
    match class.shared[k] {
        Some(x) => C::F::k(x),
        None => cx.pick(t.handles.pair_numbers, number, k),
    }
}

/// a + (b - c)
#[inline(always)]
fn add_difference<F: Num>(a: Vec3<F>, b: Vec3<F>, c: Vec3<F>) -> Vec3<F> {
    a + (b - c)
}

/// Two unit vectors across the normal, as MuJoCo's `mju_makeFrame` chooses them: the first lies along a direction if one
/// is given, else along y unless the normal is near y, then z.
#[inline(always)]
fn tangents<F: Num>(normal: Vec3<F>, along: Option<Vec3<F>>) -> [Vec3<F>; 2] {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    let steep = normal[1].abs().lt(F::c(0.5));
    let axis = Vec3([
        zero,
        F::select(steep, one, zero),
        F::select(steep, zero, one),
    ]);
    let mut across = across(normal, axis);
    if let Some(along) = along {
        let first = self::across(normal, along);
        // a capsule that stands upright has no direction, to the rounding of f32
        let lies = F::c(1e-12).lt(first.dot(first));
        for (x, y) in across.iter_mut().zip(*first) {
            *x = F::select(lies, y, *x);
        }
    }
    let first = across * one.div(across.dot(across).sqrt());
    [first, normal.cross(first)]
}

/// The part of a direction across the normal.
#[inline(always)]
fn across<F: Num>(normal: Vec3<F>, axis: Vec3<F>) -> Vec3<F> {
    normal.scale_add(-axis.dot(normal), axis)
}
