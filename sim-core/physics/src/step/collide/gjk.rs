//! Closest points of two convex shapes, and the axis of least depth where they penetrate: GJK at a stand-off.
//!
//! GJK (Gilbert, Johnson and Keerthi 1988) finds the point of the shapes' difference B - A that is nearest to the origin,
//! by tetrahedra of its farthest points. It is exact while the shapes are apart. Where they are not, B is first moved
//! along the best axis known until it stands off by a small gap. The axis found there is never worse than the one before;
//! the axes of least depth are those that come back unchanged.

use super::choose::select;
use super::hull_axes::Axis;
use super::manifold::Near;
use super::support::{Support, difference, get3, set3, var3};
use crate::lane::{Cx, Num, Real};
use crate::math::vec3::Vec3;
use crate::{break_if, times, when};

/// Another axis to start from, where the first leads to a depth that may not be the least.
pub(super) trait Restart<C: Cx> {
    /// How many times it is asked for.
    const TRIES: usize;
    /// Is it worth trying only where it is better than the one that is known?
    const BETTER: bool;
    /// The depth past which it is asked for [m].
    fn depth(&self) -> C::F;
    /// The axis; `known` is the best so far, `tried` the last that was started from.
    fn axis(&self, cx: &mut C, known: Axis<C::F>, tried: Vec3<C::F>) -> Axis<C::F>;
}

/// None.
pub(super) struct NoRestart;

impl<C: Cx> Restart<C> for NoRestart {
    const TRIES: usize = 0;
    const BETTER: bool = true;
    #[inline(always)]
    fn depth(&self) -> C::F {
        C::F::c(1e18)
    }
    #[inline(always)]
    fn axis(&self, _: &mut C, known: Axis<C::F>, _: Vec3<C::F>) -> Axis<C::F> {
        known
    }
}

/// How two shapes are nearest.
pub(super) struct Closest<F> {
    /// Their best axis.
    pub axis: Axis<F>,
    /// The middle of their closest points.
    pub point: Vec3<F>,
}

impl<F: Num> Closest<F> {
    /// The same, for shapes without a radius around them.
    #[inline(always)]
    pub fn near(&self) -> Near<F> {
        Near {
            normal: self.axis.normal,
            distance: self.axis.distance,
            point: self.point,
        }
    }
}

/// Gap of the stand-off, relative to the shapes' size: direction errors are rounding over it.
const fn gap<R: Real>() -> f64 {
    if R::DOUBLE { 1e-5 } else { 4e-3 }
}

/// Relative difference of upper and lower bound at which GJK ends. A direction's error is its square root.
const fn tolerance<R: Real>() -> f64 {
    if R::DOUBLE { 1e-13 } else { 1e-6 }
}

/// Rounds of GJK: a curved surface takes more, each a share of the error.
const fn rounds<R: Real>() -> usize {
    if R::DOUBLE { 64 } else { 24 }
}

/// Rounds of the stand-off.
const fn stand_offs<R: Real>() -> usize {
    if R::DOUBLE { 32 } else { 12 }
}

/// The closest points of two shapes, from the axis `start`, a unit vector. `size` is the sum of their radii. Shapes that are farther apart than `limit` are only found to be so.
#[inline(always)]
pub(super) fn closest<C: Cx, R: Restart<C>>(
    cx: &mut C,
    a: &impl Support<C>,
    b: &impl Support<C>,
    start: Vec3<C::F>,
    size: C::F,
    limit: C::F,
    restart: &R,
) -> Closest<C::F> {
    let c = C::F::c;
    let (zero, one) = (c(0.0), c(1.0));
    let gap = size * c(gap::<RealOf<C>>());
    let settled_at = size * c(if RealOf::<C>::DOUBLE { 1e-13 } else { 1e-6 });
    let mut axis = var3(cx, start);
    let mut best = cx.var(c(-1e18));
    let mut normal = var3(cx, start);
    let mut point = var3(cx, Vec3([zero; 3]));
    let mut restarts = cx.var(zero);
    let mut tried = var3(cx, start);
    times!(cx, stand_offs::<RealOf<C>>(), {
        let m = get3(cx, &axis);
        let (on_a, w) = difference(cx, a, b, m);
        let before = m.dot(w);
        let known = cx.get(&best);
        cx.set(&mut best, known.max(before));
        break_if!(cx, limit.lt(before));
        let shift = (gap - before).max(zero);
        let away = m * shift;
        let found = apart(cx, a, b, m, away, on_a, w + away, size, limit + shift);
        let after = found.distance - shift * found.normal.dot(m);
        let gained = (before + settled_at).lt(after);
        let (x, n) = (
            C::F::select(gained, after, before),
            select(gained, found.normal, m),
        );
        // half-way between the closest points, B moved back
        let middle = (found.way - away).scale_add(c(0.5), found.on_a);
        let better = !x.lt(cx.get(&best));
        let (kept_normal, kept_point) = (get3(cx, &normal), get3(cx, &point));
        let old = cx.get(&best);
        cx.set(&mut best, C::F::select(better, x, old));
        set3(cx, &mut normal, select(better, n, kept_normal));
        set3(cx, &mut point, select(better, middle, kept_point));
        set3(cx, &mut axis, n);
        let settled = !gained | (gap.lt(before) | limit.lt(x));
        if R::TRIES > 0 {
            let tries = cx.get(&restarts);
            let mut again = cx.var(zero);
            let deep = x.lt(-restart.depth()) & tries.lt(c(R::TRIES as f64 - 0.5));
            when!(cx, settled & deep, {
                let known = Axis {
                    normal: get3(cx, &normal),
                    distance: cx.get(&best) + settled_at,
                };
                let from = get3(cx, &tried);
                let other = restart.axis(cx, known, from);
                set3(cx, &mut axis, other.normal);
                set3(cx, &mut tried, other.normal);
                cx.set(&mut restarts, tries + one);
                let least = if R::BETTER { known.distance } else { c(-1e17) };
                cx.set(
                    &mut again,
                    C::F::select(least.lt(other.distance), one, zero),
                );
            });
            let settled = settled & cx.get(&again).lt(c(0.5));
            break_if!(cx, settled);
        } else {
            break_if!(cx, settled);
        }
    });
    Closest {
        axis: Axis {
            normal: get3(cx, &normal),
            distance: cx.get(&best),
        },
        point: get3(cx, &point),
    }
}

type RealOf<C> = <<C as Cx>::F as Num>::Real;

/// What GJK finds.
struct Found<F> {
    /// Best axis found, and the distance along it.
    normal: Vec3<F>,
    distance: F,
    /// Closest point of A, and the way from there to B's.
    on_a: Vec3<F>,
    way: Vec3<F>,
}

/// GJK for shapes that are apart once B is moved by `away`; the first axis is `m`, with the farthest point `on_a` and the
/// difference `w` there. Past the distance `limit` it goes no further.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn apart<C: Cx>(
    cx: &mut C,
    a: &impl Support<C>,
    b: &impl Support<C>,
    m: Vec3<C::F>,
    away: Vec3<C::F>,
    on_a: Vec3<C::F>,
    w: Vec3<C::F>,
    size: C::F,
    limit: C::F,
) -> Found<C::F> {
    let c = C::F::c;
    let (zero, one) = (c(0.0), c(1.0));
    let tolerance = c(tolerance::<RealOf<C>>());
    let noise = size * c(RealOf::<C>::EPSILON);
    // three corners of the simplex: differences, and points of A; their shares in the nearest point
    let mut corners = [var3(cx, w), var3(cx, w), var3(cx, w)];
    let mut points = [var3(cx, on_a), var3(cx, on_a), var3(cx, on_a)];
    let mut shares = var3(cx, Vec3([one, zero, zero]));
    let mut nearest = var3(cx, w);
    let mut normal = var3(cx, m);
    let mut low = cx.var(m.dot(w));
    times!(cx, rounds::<RealOf<C>>(), {
        let v = get3(cx, &nearest);
        let square = v.dot(v);
        let length = square.sqrt();
        let (on_a, w) = difference(cx, a, b, v);
        let w = w + away;
        let along = v.dot(w);
        let unit = one.div(length.max(c(1e-18)));
        let bound = along * unit;
        let old = cx.get(&low);
        let better = old.lt(bound);
        let kept = get3(cx, &normal);
        cx.set(&mut low, C::F::select(better, bound, old));
        set3(cx, &mut normal, select(better, v * unit, kept));
        let done = (square - along).lt(tolerance.fma(square, noise * length));
        let done = done | limit.lt(bound);
        break_if!(cx, done);

        // the nearest point of the tetrahedron of the new corner and the three: on a corner, edge or face at the new one
        let o = [
            get3(cx, &corners[0]),
            get3(cx, &corners[1]),
            get3(cx, &corners[2]),
        ];
        let p = [
            get3(cx, &points[0]),
            get3(cx, &points[1]),
            get3(cx, &points[2]),
        ];
        let e = [o[0] - w, o[1] - w, o[2] - w];
        let ew = [e[0].dot(w), e[1].dot(w), e[2].dot(w)];
        let ee = [e[0].dot(e[0]), e[1].dot(e[1]), e[2].dot(e[2])];
        let (mut least, mut s_best, mut t_best) = (c(1e18), zero, zero);
        let mut foot = w;
        let (mut o1, mut o2, mut p1, mut p2) = (o[0], o[1], p[0], p[1]);
        for k in 0..3 {
            let t = (-ew[k]).div(ee[k].max(c(1e-30))).max(zero).min(one);
            let x = e[k].scale_add(t, w);
            let distance = x.dot(x);
            let is = distance.lt(least);
            let l = (k + 1) % 3;
            least = C::F::select(is, distance, least);
            foot = select(is, x, foot);
            s_best = C::F::select(is, t, s_best);
            (o1, o2) = (select(is, o[k], o1), select(is, o[l], o2));
            (p1, p2) = (select(is, p[k], p1), select(is, p[l], p2));
        }
        // by cross products: of thin triangles, as many near points of a curved surface make, dots lose too much
        let moment = [e[0].cross(w), e[1].cross(w), e[2].cross(w)];
        for k in 0..3 {
            let l = (k + 1) % 3;
            let area = e[k].cross(e[l]);
            let square = area.dot(area);
            let inverse = one.div(square.max(c(1e-36)));
            let s = moment[l].dot(area) * inverse;
            let t = -(moment[k].dot(area) * inverse);
            let height = area.dot(w);
            let distance = height * height * inverse;
            let wide =
                (ee[k] * ee[l] * c(1e4 * RealOf::<C>::EPSILON * RealOf::<C>::EPSILON)).lt(square);
            let inside = zero.lt(s) & zero.lt(t) & (s + t).lt(one);
            let is = wide & inside & distance.lt(least);
            least = C::F::select(is, distance, least);
            foot = select(is, area * (height * inverse), foot);
            s_best = C::F::select(is, s, s_best);
            t_best = C::F::select(is, t, t_best);
            (o1, o2) = (select(is, o[k], o1), select(is, o[l], o2));
            (p1, p2) = (select(is, p[k], p1), select(is, p[l], p2));
        }
        let stuck = !least.lt(square);
        break_if!(cx, stuck);
        for (place, x) in [(0, w), (1, o1), (2, o2)] {
            set3(cx, &mut corners[place], x);
        }
        for (place, x) in [(0, on_a), (1, p1), (2, p2)] {
            set3(cx, &mut points[place], x);
        }
        set3(
            cx,
            &mut shares,
            Vec3([one - s_best - t_best, s_best, t_best]),
        );
        set3(cx, &mut nearest, foot);
    });
    let share = get3(cx, &shares);
    let (p0, p1, p2) = (
        get3(cx, &points[0]),
        get3(cx, &points[1]),
        get3(cx, &points[2]),
    );
    Found {
        normal: get3(cx, &normal),
        distance: cx.get(&low),
        on_a: p0.scale_add(share[0], p1.scale_add(share[1], p2 * share[2])),
        way: get3(cx, &nearest),
    }
}
