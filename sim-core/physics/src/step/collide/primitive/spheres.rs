//! A sphere against sphere, capsule and box (MuJoCo: `engine_collision_primitive.c`, `engine_collision_box.c`).
//!
//! The centre of the first shape, the sphere, is the origin.

use crate::lane::{Cx, MaskOf, Num};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::manifold::points::Points;
use crate::step::collide::manifold::select::{clamp_to_box, column_at, min_component};
use crate::step::collide::narrow::ShapePair;

/// Centres this near coincide [m], and axes with this sine are parallel [–]: the normal is then across both shapes' axes z, or
/// the world's x where these are parallel (MuJoCo: `mjraw_SphereSphere`).
const COINCIDENT: f64 = 1e-15;

/// A sphere, or one that a capsule's axis carries.
pub struct Ball<F> {
    /// Its centre [m].
    pub center: Vec3<F>,
    /// Its radius [m].
    pub radius: F,
}

/// Adds the contact of two spheres that the shapes of a pair carry.
#[inline(always)]
pub fn add_sphere_sphere<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    a: &Ball<C::F>,
    b: &Ball<C::F>,
    out: &mut Points<C>,
) {
    let (zero, one) = (C::F::c(0.0), C::F::c(1.0));
    let nothing = C::F::c(COINCIDENT * COINCIDENT);
    // the normal is along the line of both centres
    let between = b.center - a.center;
    let apart = nothing.lt(between.dot(between));
    // any normal will do where centres coincide
    let across = pair.axes_a[2].cross(pair.pose_b.axes[2]);
    let turned = nothing.lt(across.dot(across));
    let any = select(turned, across, Vec3([one, zero, zero]));
    let way = select(apart, between, any);
    let length = way.dot(way).sqrt();
    let normal = way * one.div(length);
    let distance = C::F::select(apart, length, zero) - a.radius - b.radius;
    // half-way between the surfaces
    let at = normal.scale_add(distance.fma(C::F::c(0.5), a.radius), a.center);
    out.add(cx, distance.lt(pair.margin), at, distance, normal);
}

/// The first shape of a pair as a ball.
#[inline(always)]
fn ball_a<C: Cx>(pair: &ShapePair<'_, C>) -> Ball<C::F> {
    Ball {
        center: Vec3::zero(),
        radius: pair.a.radius(),
    }
}

/// Two spheres: one point.
#[inline(always)]
pub fn sphere_sphere<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let b = Ball {
        center: pair.pose_b.center,
        radius: pair.b.radius(),
    };
    add_sphere_sphere(cx, pair, &ball_a(pair), &b, out);
}

/// Sphere and capsule: one point, of the sphere around the point of the capsule's axis that is nearest.
#[inline(always)]
pub fn sphere_capsule<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (b, half_height) = (pair.pose_b, pair.b.half_height());
    // foot of the centre on the axis of the capsule, clamped to its ends
    let along = (-b.axes[2].dot(b.center))
        .min(half_height)
        .max(-half_height);
    let nearest = Ball {
        center: b.axes[2].scale_add(along, b.center),
        radius: pair.b.radius(),
    };
    add_sphere_sphere(cx, pair, &ball_a(pair), &nearest, out);
}

/// Sphere and box: one point. A centre inside the box leaves through the nearest face.
#[inline(always)]
pub fn sphere_box<C: Cx>(cx: &mut C, pair: &ShapePair<'_, C>, out: &mut Points<C>) {
    let (b, margin) = (pair.pose_b, pair.margin);
    // centre of the sphere in the axes of the box
    let center = b.axes.transpose_mul(b.center) * C::F::c(-1.0);
    let exit = BoxExit::find(center, pair.b.half_extents());
    // nothing is less than itself: a mask that holds in every world
    let always = !margin.lt(margin);
    add_sphere_box(cx, pair, always, center, &exit, out);
}

/// Adds the contact of a ball of the first shape and the second shape, a box. The ball's centre is `at` in the box's frame.
#[inline(always)]
pub fn add_sphere_box<C: Cx>(
    cx: &mut C,
    pair: &ShapePair<'_, C>,
    mask: MaskOf<C>,
    at: Vec3<C::F>,
    exit: &BoxExit<C::F>,
    out: &mut Points<C>,
) {
    let c = C::F::c;
    let (b, radius) = (pair.pose_b, pair.a.radius());
    // along the direction the surfaces are at -radius and at -distance
    let middle = exit
        .direction
        .scale_add((radius + exit.distance) * c(-0.5), at);
    let distance = exit.distance - radius;
    out.add(
        cx,
        mask & distance.lt(pair.margin),
        b.axes.mul_add(middle, b.center),
        distance,
        (b.axes * exit.direction) * c(-1.0),
    );
}

/// The shortest way from a box to a point in its frame.
pub struct BoxExit<F> {
    /// Distance, negative inside [m].
    pub distance: F,
    /// Unit direction from the box to the point.
    pub direction: Vec3<F>,
}

impl<F: Num> BoxExit<F> {
    /// Finds it: outside from the nearest point of the box, inside through the nearest face.
    #[inline(always)]
    pub fn find(point: Vec3<F>, half: Vec3<F>) -> BoxExit<F> {
        let (zero, one) = (F::c(0.0), F::c(1.0));
        // outside: from the nearest point of the box; inside, this is 0
        let apart = point - clamp_to_box(point, half);
        let square = apart.dot(apart);
        let outside = zero.lt(square);
        let length = square.sqrt();
        let inverse = one.div(F::select(outside, length, one));
        // inside: depth below each face, and the least of them
        let depths = Vec3([
            half[0] - point[0].abs(),
            half[1] - point[1].abs(),
            half[2] - point[2].abs(),
        ]);
        let (face, depth) = min_component(depths);
        // between two faces MuJoCo takes that at the negative end
        let side = |x: F| F::select(zero.lt(x), one, -one);
        let faces = Mat3([
            Vec3([side(point[0]), zero, zero]),
            Vec3([zero, side(point[1]), zero]),
            Vec3([zero, zero, side(point[2])]),
        ]);
        BoxExit {
            distance: F::select(outside, length, -depth),
            direction: select(outside, apart * inverse, column_at(face, faces)),
        }
    }
}
