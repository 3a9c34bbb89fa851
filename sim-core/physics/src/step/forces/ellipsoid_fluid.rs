//! Forces of the medium on geoms that count as ellipsoids (MuJoCo documentation, "Computation: fluid forces, ellipsoid model").
//!
//! Added mass, lift after Kutta and Magnus, and drag, at a geom's centre and along its axes. With the velocity v of the centre
//! less the wind, the angular velocity ω, u = v / |v|, and diagonal matrices Q, μ, m, J and E:
//!
//! ```text
//! n = Q u      A² = n·n / n·u      h = (n × u) × u                 Q: squared areas across the axes, over the largest
//! f = (μ v) × ω + |v|² (k / A) h - (c + |v| r) v      r = s + b A
//! t = (m v) × v + (J ω) × ω - (d + e |E ω|) ω
//! ```
//!
//! A is the area across the flow, over the largest, and μ is the added mass m less that of the Magnus force. A step with
//! `implicitfast` is implicit in them: with g = ∂A/∂u, and B the negative derivative of (f, t) by (v, ω),
//!
//! ```text
//! g = (Q n - A² n) / (n·u A)
//! B = | [ω]× μ + (c + |v| r) 1 + |v| u (r u + b g)ᵀ - |v| (k / A) N      -[μ v]×                                       |
//!     | -∂((m v) × v)/∂v                                                 -∂((J ω) × ω)/∂ω + (d + e |E ω|) 1 + e ω yᵀ   |
//! N = n·u 1 - Q + 2 (u nᵀ - n uᵀ) - h (u + g / A)ᵀ      y = E E ω / |E ω|
//! M += h Σ Jᵀ B J      and h Jᵀ B J c less on the right, c as in [`crate::step::tree::free_joints`]
//! ```
//!
//! As in MuJoCo, B is made symmetric, except for a free body that carries nothing: that one is solved apart. A step with
//! `implicit` has B as it is.

use super::link_forces;
use crate::arrays::Workspace;
use crate::constants::passive::FluidGeom;
use crate::constants::{Constants, MassEntry};
use crate::lane::{Cx, Num};
use crate::math::spatial::{ANGULAR, LINEAR, Spatial};
use crate::math::vec3::{Mat3, Vec3};
use crate::step::{BlockOf, ConstantsOf};

/// The smallest divisor (MuJoCo: `mjMINVAL`).
const TINY: f64 = 1e-15;

/// Adds the forces on geoms to the forces on bodies.
#[inline(always)]
pub(super) fn add_forces<F: Num>(m: &Constants<F::Real>, w: &mut Workspace<F>) {
    for geom in &m.fluid_geoms {
        let flow = Flow::around(w, geom);
        let (force, torque) = (flow.force(geom), flow.torque(geom));
        let (force, torque) = (flow.axes * force, flow.axes * torque);
        link_forces::add(w, geom.body, flow.point, force, torque);
    }
}

/// How the medium flows around a geom. Vectors but the first are along its axes.
struct Flow<F> {
    /// Its centre from the robot's reference point, in world axes [m].
    point: Vec3<F>,
    /// Its axes in the world [–].
    axes: Mat3<F>,
    /// v [m/s]
    velocity: Vec3<F>,
    /// |v| [m/s]
    speed: F,
    /// ω [rad/s]
    spin: Vec3<F>,
    /// u; 0 at rest [–]
    along: Vec3<F>,
    /// n [–]
    normal: Vec3<F>,
    /// 1 / n·u [–]
    inverse_share: F,
    /// A and 1 / A [–]
    area: [F; 2],
    /// h [–]
    lift: Vec3<F>,
}

impl<F: Num> Flow<F> {
    #[inline(always)]
    fn around(w: &Workspace<F>, geom: &FluidGeom<F::Real>) -> Flow<F> {
        let (rotation, moving) = (w.rotation[geom.body], w.velocity[geom.body]);
        let (one, tiny) = (F::c(1.0), F::c(TINY));
        // the centre p, and its velocity v + ω × p - wind
        let point = rotation.mul_add(Vec3::constant(geom.center), w.origin[geom.body]);
        let moved = moving[ANGULAR].cross_add(point, moving[LINEAR]);
        let moved = moved - Vec3::constant(geom.wind);
        // both velocities along the axes
        let local = Mat3::<F>::constant(geom.axes);
        let axes = Mat3([
            rotation * local[0],
            rotation * local[1],
            rotation * local[2],
        ]);
        let velocity = axes.transpose_mul(moved);
        let spin = axes.transpose_mul(moving[ANGULAR]);
        // u = v / |v|, n = Q u, A² = n·n / n·u
        let speed = velocity.dot(velocity).sqrt();
        let along = velocity * one.div(speed.max(tiny));
        let normal = scaled(geom.areas, along);
        let inverse_share = one.div(normal.dot(along).max(tiny));
        let area = (normal.dot(normal) * inverse_share).sqrt();
        // h = (n × u) × u, n × u by differences of Q: no rounding is left of a sphere's
        let circulation = scaled(geom.area_differences, products(along));
        Flow {
            point,
            axes,
            velocity,
            speed,
            spin,
            along,
            normal,
            inverse_share,
            area: [area, one.div(area.max(tiny))],
            lift: circulation.cross(along),
        }
    }

    /// c + |v| r
    #[inline(always)]
    fn drag(&self, geom: &FluidGeom<F::Real>) -> F {
        self.speed
            .fma(self.quadratic_drag(geom), F::k(geom.viscous[LINEAR]))
    }

    /// r = s + b A
    #[inline(always)]
    fn quadratic_drag(&self, geom: &FluidGeom<F::Real>) -> F {
        self.area[0].fma(F::k(geom.blunt), F::k(geom.slender))
    }

    /// |E ω|, and d + e |E ω|
    #[inline(always)]
    fn turning_drag(&self, geom: &FluidGeom<F::Real>) -> [F; 2] {
        let turning = scaled(geom.turning_shares, self.spin);
        let norm = turning.dot(turning).sqrt();
        [
            norm,
            norm.fma(F::k(geom.turning), F::k(geom.viscous[ANGULAR])),
        ]
    }

    /// f
    #[inline(always)]
    fn force(&self, geom: &FluidGeom<F::Real>) -> Vec3<F> {
        // (μ v) × ω - (c + |v| r) v
        let pull = scaled(geom.carried, self.velocity).cross(self.spin);
        let pull = self.velocity.scale_add(-self.drag(geom), pull);
        // |v|² (k / A) h
        let lift = F::k(geom.lift) * self.area[1];
        self.lift.scale_add(self.speed * self.speed * lift, pull)
    }

    /// t
    #[inline(always)]
    fn torque(&self, geom: &FluidGeom<F::Real>) -> Vec3<F> {
        // (m v) × v + (J ω) × ω, by differences of m and of J
        let torque = scaled(geom.mass_differences, products(self.velocity));
        let torque = torque + scaled(geom.moment_differences, products(self.spin));
        // -(d + e |E ω|) ω
        let [_, drag] = self.turning_drag(geom);
        self.spin.scale_add(-drag, torque)
    }

    /// B, a column at a time
    #[inline(always)]
    fn resistance(&self, geom: &FluidGeom<F::Real>) -> Resistance<F> {
        let zero = Mat3::zero();
        let mut all = [[zero; 2]; 2];
        let (along, normal, [area, inverse_area]) = (self.along, self.normal, self.area);
        // g = (Q n - A² n) / (n·u A)
        let change = scaled(geom.areas, normal) - normal * (area * area);
        let change = change * self.inverse_share * inverse_area;
        let (drag, quadratic) = (self.drag(geom), self.quadratic_drag(geom));
        // |v| (k / A), n·u, and u + g / A
        let lift = self.speed * F::k(geom.lift) * inverse_area;
        let share = normal.dot(along);
        let shrinks = change.scale_add(inverse_area, along);
        // |E ω|, d + e |E ω| and e y = e E E ω / |E ω|
        let [norm, turning_drag] = self.turning_drag(geom);
        let turning = scaled(geom.turning_shares, self.spin);
        let turning = scaled(geom.turning_shares, turning);
        let turning = turning * F::k(geom.turning).div(norm.max(F::c(TINY)));
        let carried = scaled(geom.carried, self.velocity);
        for j in 0..3 {
            let (mut axis, mut heavy) = (Vec3::zero(), Vec3::zero());
            axis[j] = F::c(1.0);
            heavy[j] = F::k(geom.carried[j]);
            // N e = (n·u - Q) e + 2 (u n·e - n u·e) - h (u + g / A)·e
            let twice = along * normal[j] - normal * along[j];
            let bent = axis.scale_add(share - F::k(geom.areas[j]), twice + twice);
            let bent = self.lift.scale_add(-shrinks[j], bent);
            // [ω]× μ e + (c + |v| r) e + |v| u (r u + b g)·e - |v| (k / A) N e
            let slope = change[j].fma(F::k(geom.blunt), quadratic * along[j]);
            let column = self.spin.cross_add(heavy, axis * drag);
            let column = along.scale_add(self.speed * slope, column);
            all[LINEAR][LINEAR][j] = bent.scale_add(-lift, column);
            // -[μ v]× e
            all[LINEAR][ANGULAR][j] = axis.cross(carried);
            // -∂((m v) × v)/∂v e
            all[ANGULAR][LINEAR][j] = -products_change(geom.mass_differences, self.velocity, j);
            // -∂((J ω) × ω)/∂ω e + (d + e |E ω|) e + e ω y·e
            let swing = products_change(geom.moment_differences, self.spin, j);
            let column = axis * turning_drag - swing;
            all[ANGULAR][ANGULAR][j] = self.spin.scale_add(turning[j], column);
        }
        Resistance(all)
    }

    /// The force about the reference point against a motion that the body has there: B times that of the geom.
    #[inline(always)]
    fn against(&self, b: &Resistance<F>, motion: Spatial<F>) -> Spatial<F> {
        // the motion of the centre, along the axes
        let moved = motion[ANGULAR].cross_add(self.point, motion[LINEAR]);
        let (v, w) = (
            self.axes.transpose_mul(moved),
            self.axes.transpose_mul(motion[ANGULAR]),
        );
        // B times it, back in world axes
        let mut wrench = Spatial::zero();
        for part in [LINEAR, ANGULAR] {
            let [by_velocity, by_spin] = b.0[part];
            wrench[part] = self.axes * by_velocity.mul_add(v, by_spin * w);
        }
        wrench.moved(self.point)
    }
}

/// B: of force and torque, by velocity and angular velocity; columns.
#[derive(Clone, Copy)]
struct Resistance<F>([[Mat3<F>; 2]; 2]);

impl<F: Num> Resistance<F> {
    /// (B + Bᵀ) / 2
    #[inline(always)]
    fn symmetric(self) -> Resistance<F> {
        let (turned, half) = (self.transposed(), F::c(0.5));
        let mut even = self;
        for part in [LINEAR, ANGULAR] {
            for other in [LINEAR, ANGULAR] {
                for j in 0..3 {
                    even.0[part][other][j] =
                        (self.0[part][other][j] + turned.0[part][other][j]) * half;
                }
            }
        }
        even
    }

    /// Bᵀ
    #[inline(always)]
    fn transposed(self) -> Resistance<F> {
        let mut turned = self;
        for part in [LINEAR, ANGULAR] {
            for other in [LINEAR, ANGULAR] {
                for i in 0..3 {
                    for j in 0..3 {
                        turned.0[part][other][j][i] = self.0[other][part][i][j];
                    }
                }
            }
        }
        turned
    }
}

/// A diagonal matrix times a vector.
#[inline(always)]
fn scaled<F: Num>(diagonal: [F::Real; 3], v: Vec3<F>) -> Vec3<F> {
    let mut product = v;
    for i in 0..3 {
        product[i] = F::k(diagonal[i]) * v[i];
    }
    product
}

/// v(j) v(k) for each i, the other axes j and k after it: times differences of a diagonal matrix D it is (D v) × v.
#[inline(always)]
fn products<F: Num>(v: Vec3<F>) -> Vec3<F> {
    Vec3([v[1] * v[2], v[2] * v[0], v[0] * v[1]])
}

/// ∂((D v) × v)/∂v(j), by the differences of D.
#[inline(always)]
fn products_change<F: Num>(differences: [F::Real; 3], v: Vec3<F>, j: usize) -> Vec3<F> {
    let (k, l) = ((j + 1) % 3, (j + 2) % 3);
    let mut change = Vec3::zero();
    // v(j) is a factor of the other two products
    change[k] = F::k(differences[k]) * v[l];
    change[l] = F::k(differences[l]) * v[k];
    change
}

/// Dofs on the path of a dof to the root, itself among them, with their places in its row of the mass matrix.
#[inline(always)]
fn path<R>(m: &Constants<R>, dof: usize) -> &[MassEntry] {
    let (start, end) = m.dofs[dof].entries;
    &m.mass_entries[start..end]
}

/// What MuJoCo's acceleration of a body has that J q̈ has not: only that of a free body's frame differs from ours.
#[inline(always)]
fn swing<F: Num>(w: &Workspace<F>, free: usize) -> Spatial<F> {
    let (spin, origin) = (w.velocity[free][ANGULAR], w.origin[free]);
    // c = (ω × (ω × o), 0)
    Spatial([spin.cross(spin.cross(origin)), Vec3::zero()])
}

/// Adds h Jᵀ B J to the mass matrix, and subtracts h Jᵀ B J c from the right-hand side, `acceleration`; B is made symmetric.
/// Geoms of bodies that are solved apart are left to [`add_to_system`].
#[inline(always)]
pub(super) fn add_damping<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    for geom in &m.fluid_geoms {
        if m.solved_bodies.contains(&geom.body) {
            continue;
        }
        let flow = Flow::around(w, geom);
        let resistance = flow.resistance(geom).symmetric();
        let last = m.bodies[geom.body].dofs().end - 1;
        add_product(m, (&flow, &resistance), &w.motion, &mut w.mass_matrix, last);
        subtract_swing(m, (&flow, &resistance), w, geom.body);
    }
}

/// The same with B as it is. The mass matrix has entries at and below the diagonal, `hessian` has those above it, transposed.
#[inline(always)]
pub(in crate::step) fn add_whole_damping<C: Cx>(m: &ConstantsOf<C>, b: &mut BlockOf<C>) {
    let w = &mut b.work;
    for geom in &m.fluid_geoms {
        let flow = Flow::around(w, geom);
        let resistance = flow.resistance(geom);
        // S(j) · B S(i) of the later dof j is S(i) · Bᵀ S(j)
        let turned = resistance.transposed();
        let last = m.bodies[geom.body].dofs().end - 1;
        add_product(m, (&flow, &turned), &w.motion, &mut w.mass_matrix, last);
        add_product(m, (&flow, &resistance), &w.motion, &mut w.hessian, last);
        subtract_swing(m, (&flow, &resistance), w, geom.body);
    }
}

/// Adds h S(i) · B S(j) of the dofs j on the path of the last dof, and of the dofs i before each.
#[inline(always)]
fn add_product<F: Num>(
    m: &Constants<F::Real>,
    (flow, resistance): (&Flow<F>, &Resistance<F>),
    motion: &[Spatial<F>],
    matrix: &mut [F],
    last: usize,
) {
    let dt = F::k(m.dt);
    for row in path(m, last) {
        // h B J of a dof, then Jᵀ of those before it on the path: each pair once
        let force = flow.against(resistance, motion[row.other] * dt);
        for entry in path(m, row.other) {
            let place = &mut matrix[entry.place];
            *place = *place + motion[entry.other].dot(force);
        }
    }
}

/// Subtracts h Jᵀ B J c of a geom of a body from the right-hand side.
#[inline(always)]
fn subtract_swing<F: Num>(
    m: &Constants<F::Real>,
    (flow, resistance): (&Flow<F>, &Resistance<F>),
    w: &mut Workspace<F>,
    body: usize,
) {
    let body = &m.bodies[body];
    if let Some(free) = m.trees[body.tree].free {
        let force = flow.against(resistance, swing(w, free) * F::k(m.dt));
        for row in path(m, body.dofs().end - 1) {
            let pulled = &mut w.acceleration[row.other];
            *pulled = *pulled - w.motion[row.other].dot(force);
        }
    }
}

/// Adds h B to the system of a free body that is solved apart, and subtracts h B c from its right-hand side, column 6.
#[inline(always)]
pub(in crate::step) fn add_to_system<C: Cx>(
    m: &ConstantsOf<C>,
    b: &BlockOf<C>,
    body: usize,
    system: &mut [[C::F; 7]; 6],
) {
    let (w, dt) = (&b.work, C::F::k(m.dt));
    for geom in &m.fluid_geoms {
        if geom.body != body {
            continue;
        }
        let flow = Flow::around(w, geom);
        let resistance = flow.resistance(geom);
        // a column of h B: J is 1 at the centre of mass, the reference point
        for j in 0..6 {
            let mut motion = Spatial::zero();
            motion[j / 3][j % 3] = dt;
            let force = flow.against(&resistance, motion).scalars();
            for i in 0..6 {
                system[i][j] = system[i][j] + force[i];
            }
        }
        // -h B c
        let force = flow.against(&resistance, swing(w, body) * dt).scalars();
        for i in 0..6 {
            system[i][6] = system[i][6] - force[i];
        }
    }
}
