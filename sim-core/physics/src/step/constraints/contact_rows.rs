//! Constraint rows of contacts: tangents, Jacobian, stiffness and reference acceleration (Todorov 2014; MuJoCo
//! documentation, "Computation: constraint model").
//!
//! ```text
//! v = J q̇, of the second body relative to the first, along normal and tangents; along tangents, and about the normal, with
//!     the velocity of surfaces that move beside their bodies (MuJoCo: `surfacevel`)
//! elliptic      R₀ = (1 - d)/d w          D₁ = D₂ = impratio D₀
//! pyramidal     R₀ = (1 - d)/d w (1 + μ²)  D = 1 / (2 μ² R₀ / impratio), of the edges n ± μ t
//! aref = -b v - k d (r - margin)  along the normal,   -b' v along a tangent
//! aref = -b v - k d (r - margin) + F / D   along the normal of a contact that adheres with the force F
//! ```
//!
//! A contact that adheres also has a row of its normal in the gap, without friction.
//!
//! μ is that of the first tangent. Where the second one has another, it is as long as the ratio of both: cones are round then.
//! Rotations are scaled alike, by their friction over μ. A force along a scaled row is in units of that row.

use super::contact_surfaces::{Pull, SurfaceMotion};
use super::joint_rows::{impedance, impedance_between};
use super::swing::swing_between;
use crate::arrays::Array as A;
use crate::constants::contact::{
    COUNT_LEFT_OUT, Class, Cone, Contacts, pair, row, skew, soft, turning,
};
use crate::constants::{Constants, Impedance};
use crate::each;
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::spatial::Spatial;
use crate::math::vec3::{Vec3, load_vec3};
use crate::step::collide::{contact_slack, read_room};
use crate::step::{BlockOf, ConstantsOf, Stage};

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

/// Writes the rows of all contacts that the worlds have now.
#[inline(always)]
fn contact_rows<C: Cx>(cx: &mut C, m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let t = &m.contacts;
    note_overflow(cx, t, &mut b.left_out[0]);
    // contacts of a class have the same dofs as columns of J
    for (k, class) in t.classes.iter().enumerate() {
        let list = class_list(cx, t, k);
        each!(cx, r in list, {
            let contact = Contact::read(cx, t, k, r);
            let velocity = contact.write_jacobian(cx, b);
            // torsion and rolling, where a pair of the class has their friction
            if let Some(block) = class.turns {
                contact.write_turning(cx, b, block);
            }
            // ω × (ω × r) of free bodies, by which MuJoCo's J q̈ is less than ours
            let swing = swing_between(cx, m, b, class, |cx, k| contact.of_pair(cx, k));
            contact.write_softness(cx, m, velocity, swing);
        });
    }
}

/// A contact whose row is written.
struct Contact<'a, C: Cx> {
    t: &'a Contacts<<C::F as Num>::Real>,
    class: &'a Class<<C::F as Num>::Real>,
    /// Place of the class in the list.
    number: usize,
    row: C::I,
    /// Index of its pair.
    pair: C::F,
    /// From the reference point of the class's second tree [m].
    point: Vec3<C::F>,
    /// 1 with friction, 0 without.
    rubs: C::F,
    /// Normal and two tangents, of which the second is scaled; the tangents are 0 without friction.
    frame: [Vec3<C::F>; 3],
    /// From the distance at which it pushes [m].
    position: C::F,
    /// Where that is nearer than the margin, not in the gap.
    is_near: MaskOf<C>,
    /// How it adheres, in a model with such contacts.
    pull: Option<Pull<C>>,
    /// How surfaces move beside their bodies, in a model with such surfaces.
    surface: Option<SurfaceMotion<C::F>>,
}

impl<'a, C: Cx> Contact<'a, C> {
    /// Reads what the narrow phase left, and chooses the tangents.
    #[inline(always)]
    fn read(cx: &mut C, t: &'a Contacts<<C::F as Num>::Real>, number: usize, r: C::I) -> Self {
        let class = &t.classes[number];
        let normal = load_vec3(cx, t.memory.rows, r, row::NORMAL);
        let point = load_vec3(cx, t.memory.rows, r, row::POINT);
        let pair = cx.load(t.memory.rows, r, row::PAIR);
        // pairs of one class may differ in whether they have friction
        let mut rubs = shared(cx, t, class, pair, pair::RUBS);
        // r - margin, and whether the contact pushes or is in the gap
        let distance = cx.load(t.memory.rows, r, row::DISTANCE);
        let position = distance - shared(cx, t, class, pair, pair::MARGIN);
        let smaller = shared(cx, t, class, pair, pair::SMALLER);
        let is_near = position.lt(contact_slack(t, smaller));
        let pull = Pull::read(cx, t, pair, is_near);
        // what adheres in the gap does not rub
        if let Some(pull) = &pull {
            rubs = C::F::select(is_near | !pull.adheres, rubs, C::F::c(0.0));
        }
        // where directions matter, the narrow phase chose the first
        let along = match t.has_directions() {
            false => None,
            true => Some(load_vec3(cx, t.memory.rows, r, row::TANGENTS)),
        };
        let mut tangents = tangents(normal, along);
        // |t₂| is the friction along it over that along t₁
        if t.skew.rows > 0 {
            tangents[1] = tangents[1] * cx.pick(t.skew, pair, skew::SLIDE);
        }
        let surface = SurfaceMotion::read(cx, t, r);
        Contact {
            t,
            class,
            number,
            row: r,
            pair,
            point,
            rubs,
            frame: [normal, tangents[0] * rubs, tangents[1] * rubs],
            position,
            is_near,
            pull,
            surface,
        }
    }

    /// A scalar of the contact's pair.
    #[inline(always)]
    fn of_pair(&self, cx: &mut C, k: usize) -> C::F {
        shared(cx, self.t, self.class, self.pair, k)
    }

    /// Reference stiffness or damping: a scalar of the contact's pair, or of the contact where it varies.
    #[inline(always)]
    fn softness(&self, cx: &mut C, k: usize) -> C::F {
        match self.t.varying.softness {
            false => self.of_pair(cx, k),
            true => {
                let place = row::SOFTNESS + k - pair::STIFFNESS;
                cx.load(self.t.memory.rows, self.row, place)
            }
        }
    }

    /// The contact's point from the reference point of a tree.
    #[inline(always)]
    fn point_from(&self, b: &BlockOf<C>, tree: usize) -> Vec3<C::F> {
        let (here, reference) = (self.class.trees.1, &b.work.reference);
        match tree == here {
            true => self.point,
            false => self.point + (reference[here] - reference[tree]),
        }
    }

    /// Writes J and the tangents, and returns J q̇.
    #[inline(always)]
    fn write_jacobian(&self, cx: &mut C, b: &BlockOf<C>) -> [C::F; 3] {
        let (t, frame) = (self.t, &self.frame);
        // J(i, dof) = ± (axis · v + (point × axis) · ω)
        let mut velocity = [C::F::c(0.0); 3];
        // p × axis, about the reference point of the tree whose dofs follow
        let (mut tree, mut torques) = (usize::MAX, [Vec3::zero(); 3]);
        for (c, column) in self.class.columns.iter().enumerate() {
            if column.tree != tree {
                tree = column.tree;
                for (torque, axis) in torques.iter_mut().zip(frame) {
                    *torque = self.point_from(b, tree).cross(*axis);
                }
            }
            let Spatial([linear, angular]) = b.work.motion[column.dof];
            // 1, -1, or 0 where the dof moves both bodies alike or neither
            let lever = self.of_pair(cx, column.lever);
            let speed = cx.get(&b.joint_qd[column.dof]);
            let mut jacobian = [C::F::c(0.0); 3];
            // v = J q̇, where worlds without the contact get -0, which later sums ignore
            for i in 0..3 {
                let moved = linear.dot(frame[i]) + angular.dot(torques[i]);
                jacobian[i] = cx.or_nothing(lever * moved);
                velocity[i] = jacobian[i].fma(speed, velocity[i]);
            }
            cx.fill_all(t.memory.rows, self.row, row::JACOBIAN + 3 * c, jacobian);
        }
        // a surface that moves along its normal changes nothing
        if let Some(surface) = &self.surface {
            for i in 1..3 {
                velocity[i] = velocity[i] + frame[i].dot(surface.velocity);
            }
        }
        cx.fill_all(t.memory.rows, self.row, row::TANGENTS, frame[1].0);
        cx.fill_all(t.memory.rows, self.row, row::TANGENTS + 3, frame[2].0);
        velocity
    }

    /// Writes the rows of rotations about the normal and the tangents, scaled by their friction over that of sliding.
    #[inline(always)]
    fn write_turning(&self, cx: &mut C, b: &BlockOf<C>, block: usize) {
        let (t, zero, one) = (self.t, C::F::c(0.0), C::F::c(1.0));
        // friction of torsion and of rolling over that of sliding
        let mut ratios = [zero; 2];
        for (k, scaled) in ratios.iter_mut().enumerate() {
            let mut ratio = cx.pick(t.turning, self.pair, k);
            // where it varies, a ratio above 0 only says that the pair has this friction
            if t.varying.turning {
                let varied = cx.load(t.memory.rows, self.row, row::VARYING + k);
                ratio = C::F::select(zero.lt(ratio), varied, zero);
            }
            *scaled = ratio * self.rubs;
        }
        let [twist, roll] = ratios;
        let scales = [twist, roll, second_roll(cx, t, self.pair, roll)];
        let mut velocity = [zero; 3];
        // J(i, dof) = ± scale (axis · ω)
        for (c, column) in self.class.columns.iter().enumerate() {
            let Spatial([_, angular]) = b.work.motion[column.dof];
            let lever = self.of_pair(cx, column.lever);
            let speed = cx.get(&b.joint_qd[column.dof]);
            let mut jacobian = [zero; 3];
            for i in 0..3 {
                jacobian[i] = cx.or_nothing(lever * scales[i] * angular.dot(self.frame[i]));
                velocity[i] = jacobian[i].fma(speed, velocity[i]);
            }
            cx.fill_all(
                t.memory.rows,
                self.row,
                block + turning::JACOBIAN + 3 * c,
                jacobian,
            );
        }
        // surfaces turn against each other as bodies do
        if let Some(surface) = &self.surface {
            velocity[0] = scales[0].fma(surface.spin, velocity[0]);
        }
        // the edges of a pyramid have the damping of the normal row
        let damping = match t.cone {
            Cone::Elliptic => self.softness(cx, pair::SLIDING),
            Cone::Pyramidal => self.softness(cx, pair::DAMPING),
        };
        // aref = -b v, and a row exists where its friction is positive
        let mut aref = [zero; 3];
        let mut exists = [zero; 3];
        for i in 0..3 {
            // no friction past the margin
            aref[i] = C::F::select(self.is_near, -(velocity[i] * damping), zero);
            exists[i] = C::F::select(zero.lt(scales[i]), one, zero);
        }
        cx.fill_all(t.memory.rows, self.row, block + turning::AREF, aref);
        cx.fill_all(t.memory.rows, self.row, block + turning::EXISTS, exists);
    }

    /// `d_min`, `d_max`, 1 / width and midpoint of the contact, where they vary.
    #[inline(always)]
    fn varied_impedance(&self, cx: &mut C) -> Option<[C::F; 4]> {
        if !self.t.varying.softness {
            return None;
        }
        let (rows, first) = (self.t.memory.rows, row::SOFTNESS + soft::IMPEDANCE);
        let mut varied = [C::F::c(0.0); 4];
        for (k, x) in varied.iter_mut().enumerate() {
            *x = cx.load(rows, self.row, first + k);
        }
        Some(varied)
    }

    /// d(r) of the contact's pair.
    #[inline(always)]
    fn impedance(&self, cx: &mut C, m: &ConstantsOf<C>, position: C::F) -> C::F {
        let varied = self.varied_impedance(cx);
        // all pairs have the same impedance, or the class lists those of its pairs
        let Some(kinds) = m.contacts.impedances.of_classes.get(self.number) else {
            return impedance_of_kind(&m.contact_impedance, varied, position);
        };
        // kind after kind, each selected where it is that of the pair
        let all = &m.contacts.impedances.all;
        let mut d = impedance_of_kind(&all[kinds[0]], varied, position);
        if let [_, others @ ..] = &kinds[..] {
            let kind_of_pair = cx.pick(m.contacts.impedances.of_pair, self.pair, 0);
            for &kind in others {
                // places are whole, so within a half they are equal
                let is_it = (kind_of_pair - C::F::c(kind as f64)).abs().lt(C::F::c(0.5));
                let of_kind = impedance_of_kind(&all[kind], varied, position);
                d = C::F::select(is_it, of_kind, d);
            }
        }
        d
    }

    /// Writes D, aref and the coefficient of friction.
    #[inline(always)]
    fn write_softness(
        &self,
        cx: &mut C,
        m: &ConstantsOf<C>,
        velocity: [C::F; 3],
        swing: Option<Vec3<C::F>>,
    ) {
        let (t, r) = (self.t, self.row);
        let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
        // r - margin, and the impedance d there
        let position = self.position;
        let d = self.impedance(cx, m, position);
        // μ of the pair, or that of the contact where it varies, and 0 without friction
        let mu = match t.varying.mu {
            false => self.of_pair(cx, pair::MU),
            true => cx.load(t.memory.rows, r, row::MU),
        };
        let mu = mu * self.rubs;
        // D₀ = d / ((1 - d) w), aref = -b v - k d (r - margin) along the normal
        let weight = match t.varying.weight {
            false => self.of_pair(cx, pair::WEIGHT),
            true => cx.load(t.memory.rows, r, row::VARYING + 2),
        };
        let stiff = d.div((one - d) * weight);
        let damping = self.softness(cx, pair::DAMPING);
        let spring = self.softness(cx, pair::STIFFNESS) * d * position;
        let mut aref = [-velocity[0].fma(damping, spring), zero, zero];
        // a pyramid has the D of its edges, and tangents are damped as its normal
        let (stiff, sliding) = match t.cone {
            Cone::Elliptic => (stiff, self.softness(cx, pair::SLIDING)),
            Cone::Pyramidal => (stiff * edge_stiffness(t.impratio, mu), damping),
        };
        // a tangent has no position: aref = -b' v
        for i in 1..3 {
            aref[i] = -(velocity[i] * sliding);
        }
        // a contact past the margin has no force, unless it adheres
        let mut pushes = self.is_near;
        if let Some(pull) = &self.pull {
            pushes = pushes | pull.adheres;
            // D is not yet 0 where nothing pushes
            aref[0] = aref[0] + pull.share.div(stiff);
        }
        let stiff = C::F::select(pushes, stiff, zero);
        cx.fill(t.memory.rows, r, row::STIFFNESS, stiff);
        // D₀ / (1 + μ²/impratio): the stiffness of a contact that slides
        if t.cone == Cone::Elliptic {
            let ratio = C::F::c(1.0 / t.impratio.to_f64());
            let soft = stiff.div((mu * mu).fma(ratio, one));
            cx.fill(t.memory.rows, r, row::SOFT, soft);
        }
        cx.fill(t.memory.rows, r, row::MU, mu);
        // J q̈ - aref as MuJoCo has it: our J q̈ has the swing more, so aref gets it, too
        for (x, axis) in aref.iter_mut().zip(self.frame) {
            if let Some(swing) = swing {
                *x = *x + axis.dot(swing);
            }
            *x = C::F::select(pushes, *x, zero);
        }
        cx.fill_all(t.memory.rows, r, row::AREF, aref);
    }
}

/// Torsional friction and rolling friction about both tangents over that of sliding, as the model has them: what scales the torques
/// of a contact.
#[inline(always)]
pub(in crate::step) fn turning_scales<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    pair: C::F,
) -> Vec3<C::F> {
    let (twist, roll) = (cx.pick(t.turning, pair, 0), cx.pick(t.turning, pair, 1));
    Vec3([twist, roll, second_roll(cx, t, pair, roll)])
}

/// What scales rotations about the second tangent, from what scales those about the first.
#[inline(always)]
fn second_roll<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    pair: C::F,
    roll: C::F,
) -> C::F {
    match t.skew.rows > 0 {
        true => roll * cx.pick(t.skew, pair, skew::ROLL),
        false => roll,
    }
}

/// d(r) of a kind of contacts, of which the power alone counts where the rest varies.
#[inline(always)]
fn impedance_of_kind<F: Num>(kind: &Impedance<F::Real>, varied: Option<[F; 4]>, position: F) -> F {
    match varied {
        None => impedance(kind, position),
        Some(varied) => impedance_between(varied, kind.power.to_f64(), position),
    }
}

/// D of a pyramid's edge over that of the elliptic cone's normal row: impratio / (2 μ² (1 + μ²)).
#[inline(always)]
pub fn edge_stiffness<F: Num>(impratio: F::Real, mu: F) -> F {
    // D / D₀, bounded in `f32`
    let square = mu * mu;
    let mut edges = F::k(impratio).div(square + square);
    edges = edges.div(F::c(1.0) + square);
    if !F::Real::DOUBLE {
        edges = edges.min(F::c(EDGES_MAX));
    }
    // without friction the four edges coincide
    F::select(F::c(0.0).lt(mu), edges, F::c(0.25))
}

/// Upper bound of [`edge_stiffness`] in `f32` [–].
///
/// With 20 times as much, rounding threw bodies off before stiff contacts were added to factors (`solver::updates`). MuJoCo's is larger
/// for mu < 0.22 at the default impratio of 1000.
pub const EDGES_MAX: f64 = 1e4;

/// Keeps the largest count of contacts that did not fit.
#[inline(always)]
fn note_overflow<C: Cx>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, most: &mut C::V) {
    // contacts that the world has no room for
    let mut left_out = C::F::c(0.0);
    if t.may_overflow {
        let row = cx.at(t.classes.len() + COUNT_LEFT_OUT);
        left_out = cx.load(t.memory.counts, row, 0);
    }
    // and those that their class has none for, which are counted, but not kept
    for k in 0..t.classes.len() {
        let row = cx.at(k);
        let [_, capacity] = room(cx, t, k);
        let over = cx.load(t.memory.counts, row, 0) - cx.number(capacity);
        left_out = left_out + over.max(C::F::c(0.0));
    }
    // the largest of all steps since it was cleared
    let left_out = cx.get(most).max(left_out);
    cx.set(most, left_out);
}

/// First row and capacity of a class.
#[inline(always)]
fn room<C: Cx>(cx: &mut C, t: &Contacts<<C::F as Num>::Real>, class: usize) -> [C::I; 2] {
    // a program that is compiled once serves all rooms that worlds get
    if t.room_grows {
        let class = cx.at(class);
        return read_room(cx, t, class);
    }
    // else both are part of the program
    let class = &t.classes[class];
    [cx.at(class.first), cx.at(class.capacity)]
}

/// The list of a class's contacts.
#[inline(always)]
pub(crate) fn class_list<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    class: usize,
) -> C::List {
    let [first, capacity] = room(cx, t, class);
    let at = cx.at(class);
    cx.kept(t.memory.counts, at, first, capacity)
}

/// A scalar of a contact's pair: a constant where all pairs of the class share it.
#[inline(always)]
fn shared<C: Cx>(
    cx: &mut C,
    t: &Contacts<<C::F as Num>::Real>,
    class: &Class<<C::F as Num>::Real>,
    pair: C::F,
    k: usize,
) -> C::F {
    match class.shared[k] {
        Some(x) => C::F::k(x),
        None => cx.pick(t.handles.pair_numbers, pair, k),
    }
}

/// Two unit vectors across the normal, as MuJoCo's `mju_makeFrame` chooses them: the first is along a direction if one is
/// given, else along y, or along z where the normal is near y.
#[inline(always)]
pub(in crate::step) fn tangents<F: Num>(normal: Vec3<F>, along: Option<Vec3<F>>) -> [Vec3<F>; 2] {
    let (zero, one) = (F::c(0.0), F::c(1.0));
    // y, or z where the normal is within 60° of y
    let steep = normal[1].abs().lt(F::c(0.5));
    let axis = Vec3([
        zero,
        F::select(steep, one, zero),
        F::select(steep, zero, one),
    ]);
    // the part of it across the normal, or that of the given direction
    let mut across = across(normal, axis);
    if let Some(along) = along {
        let first = self::across(normal, along);
        // an upright capsule has no direction across the normal, up to the rounding of `f32`
        let lies = F::c(1e-12).lt(first.dot(first));
        for (x, y) in across.iter_mut().zip(*first) {
            *x = F::select(lies, y, *x);
        }
    }
    // both of unit length: normal, first and second are a right-handed frame
    let first = across * one.div(across.dot(across).sqrt());
    [first, normal.cross(first)]
}

/// The part of a direction across the normal.
#[inline(always)]
fn across<F: Num>(normal: Vec3<F>, axis: Vec3<F>) -> Vec3<F> {
    normal.scale_add(-axis.dot(normal), axis)
}
