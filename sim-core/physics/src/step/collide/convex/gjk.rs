//! Closest points of two convex shapes, and the axis of least depth where they penetrate: GJK at a stand-off.
//!
//! GJK (Gilbert, Johnson and Keerthi 1988) finds the point of the Minkowski difference B - A that is nearest to the origin, by
//! tetrahedra of its support points. It is exact while the shapes are apart. Where they are not, B is first moved along the
//! best axis known until it stands off by a small gap. The axis found there is never worse than the one before. A fixed
//! point of this iteration is an axis of least depth, which EPA would find with a polytope of varying size.

use super::hull_axes::SeparatingAxis;
use super::restart::Restart;
use super::simplex::{Distance, Start, gjk_distance};
use super::support::{Support, minkowski_support};
use crate::lane::{Cx, MaskOf, Num, Real};
use crate::math::vec3::{Vec3, select};
use crate::step::collide::manifold::clipped::Separation;
use crate::step::collide::variables::{get3, set3, var3};
use crate::{break_if, times, when};

/// Gap of the stand-off, relative to the shapes' size: the error of a direction is rounding over it.
const fn gap<R: Real>() -> f64 {
    if R::DOUBLE { 1e-5 } else { 4e-3 }
}

/// An axis that gains less than this, relative to the shapes' size, is final.
const fn settled_gain<R: Real>() -> f64 {
    if R::DOUBLE { 1e-13 } else { 1e-6 }
}

/// Most iterations of the stand-off.
const fn stand_offs<R: Real>() -> usize {
    if R::DOUBLE { 32 } else { 12 }
}

/// The best axis so far, and the next one to stand off along.
struct Progress<C: Cx> {
    /// The next axis.
    axis: [C::V; 3],
    /// Distance along the best axis [m].
    best: C::V,
    /// The best axis.
    normal: [C::V; 3],
    /// The middle of the closest points along it [m].
    point: [C::V; 3],
    /// Restarts so far.
    restarts: C::V,
    /// The axis of the last restart.
    tried: [C::V; 3],
}

impl<C: Cx> Progress<C> {
    #[inline(always)]
    fn new(cx: &mut C, start: Vec3<C::F>) -> Self {
        Progress {
            axis: var3(cx, start),
            best: cx.var(C::F::c(-1e18)),
            normal: var3(cx, start),
            point: var3(cx, Vec3([C::F::c(0.0); 3])),
            restarts: cx.var(C::F::c(0.0)),
            tried: var3(cx, start),
        }
    }

    /// Takes an axis with its distance and middle if it is the best, and goes on from it.
    #[inline(always)]
    fn offer(&mut self, cx: &mut C, distance: C::F, axis: Vec3<C::F>, middle: Vec3<C::F>) {
        // equal counts as better: `best` may be this axis' distance already, without its normal and point
        let better = !distance.lt(cx.get(&self.best));
        let (kept_normal, kept_point) = (get3(cx, &self.normal), get3(cx, &self.point));
        let old = cx.get(&self.best);
        cx.set(&mut self.best, C::F::select(better, distance, old));
        set3(cx, &mut self.normal, select(better, axis, kept_normal));
        set3(cx, &mut self.point, select(better, middle, kept_point));
        // the next stand-off is along this axis in any case
        set3(cx, &mut self.axis, axis);
    }

    /// Restarts the worlds of the mask from another axis, and returns those of them that have none to try.
    #[inline(always)]
    fn restart<R: Restart<C>>(
        &mut self,
        cx: &mut C,
        restart: &R,
        settled: MaskOf<C>,
        distance: C::F,
        settled_at: C::F,
    ) -> MaskOf<C> {
        let c = C::F::c;
        let (zero, one) = (c(0.0), c(1.0));
        // deep enough for a restart, with a try left
        let tries = cx.get(&self.restarts);
        let mut again = cx.var(zero);
        let deep = distance.lt(-restart.depth()) & tries.lt(c(R::TRIES as f64 - 0.5));
        when!(cx, settled & deep, {
            // what another axis must exceed: the best distance and the least gain that counts
            let known = SeparatingAxis {
                normal: get3(cx, &self.normal),
                distance: cx.get(&self.best) + settled_at,
            };
            let from = get3(cx, &self.tried);
            let other = restart.axis(cx, known, from);
            // the next stand-off is along the other axis
            set3(cx, &mut self.axis, other.normal);
            set3(cx, &mut self.tried, other.normal);
            cx.set(&mut self.restarts, tries + one);
            // any axis will do if it need not be better; a distance of -1e18 means that there was none
            let least = if R::BETTER { known.distance } else { c(-1e17) };
            cx.set(
                &mut again,
                C::F::select(least.lt(other.distance), one, zero),
            );
        });
        // settled worlds that do not start again
        settled & cx.get(&again).lt(c(0.5))
    }
}

/// The separation of two shapes, searched from the axis `start`, a unit vector.
///
/// `size` is the sum of the shapes' radii. Shapes farther apart than `limit` are only found to be so.
#[inline(always)]
pub(in crate::step::collide) fn closest_points<C: Cx, R: Restart<C>>(
    cx: &mut C,
    a: &impl Support<C>,
    b: &impl Support<C>,
    start: Vec3<C::F>,
    size: C::F,
    limit: C::F,
    restart: &R,
) -> Separation<C::F> {
    let c = C::F::c;
    // both lengths scale with the shapes
    let gap = size * c(gap::<RealOf<C>>());
    let settled_at = size * c(settled_gain::<RealOf<C>>());
    let mut progress = Progress::new(cx, start);
    times!(cx, stand_offs::<RealOf<C>>(), {
        // distance along the axis m: min m · (B - A), a lower bound of the true one
        let m = get3(cx, &progress.axis);
        let (on_a, w) = minkowski_support(cx, a, b, m);
        let before = m.dot(w);
        let known = cx.get(&progress.best);
        cx.set(&mut progress.best, known.max(before));
        // past the limit the axis itself proves that there is no contact
        break_if!(cx, limit.lt(before));
        // GJK with B moved away until the gap is open
        let shift = (gap - before).max(c(0.0));
        let away = m * shift;
        let from = Start {
            axis: m,
            away,
            on_a,
            w: w + away,
        };
        let apart: Distance<C::F> = gjk_distance(cx, a, b, &from, size, limit + shift);
        // along the new axis n with B moved back: d - shift (n · m)
        let after = apart.distance - shift * apart.normal.dot(m);
        // without a gain that counts m stays the best axis
        let gained = (before + settled_at).lt(after);
        let (x, n) = (
            C::F::select(gained, after, before),
            select(gained, apart.normal, m),
        );
        // half-way between the closest points, B moved back
        let middle = (apart.way - away).scale_add(c(0.5), apart.on_a);
        progress.offer(cx, x, n, middle);
        // settled: no gain, shapes apart by the gap, where GJK is exact, or a distance past the limit
        let settled = !gained | (gap.lt(before) | limit.lt(x));
        // a settled world goes on only from a restart
        if R::TRIES > 0 {
            let settled = progress.restart(cx, restart, settled, x, settled_at);
            break_if!(cx, settled);
        } else {
            break_if!(cx, settled);
        }
    });
    Separation {
        normal: get3(cx, &progress.normal),
        distance: cx.get(&progress.best),
        point: get3(cx, &progress.point),
    }
}

type RealOf<C> = <<C as Cx>::F as Num>::Real;
