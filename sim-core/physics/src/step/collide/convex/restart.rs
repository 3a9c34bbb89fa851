//! Restarts of GJK in penetration: another axis to start from, where the first may lead to a depth that is not the least.
//!
//! Depth as a function of the axis has local minima, so descent from one axis is not enough in deep penetration.

use super::hull::Hull;
use super::hull_axes::{Reach, SeparatingAxis};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::variables::{get3, set3, var3};
use crate::times;

/// Where to restart.
pub(in crate::step::collide) trait Restart<C: Cx> {
    /// Most restarts.
    const TRIES: usize;
    /// Only try an axis that is better than the one that is known?
    const BETTER: bool;
    /// The depth past which another axis is tried [m].
    fn depth(&self) -> C::F;
    /// The axis; `known` is the best so far, `tried` the last that was started from.
    fn axis(
        &self,
        cx: &mut C,
        known: SeparatingAxis<C::F>,
        tried: Vec3<C::F>,
    ) -> SeparatingAxis<C::F>;
}

/// Never.
pub(in crate::step::collide) struct NoRestart;

impl<C: Cx> Restart<C> for NoRestart {
    const TRIES: usize = 0;
    const BETTER: bool = true;
    #[inline(always)]
    fn depth(&self) -> C::F {
        C::F::c(1e18)
    }
    #[inline(always)]
    fn axis(&self, _: &mut C, known: SeparatingAxis<C::F>, _: Vec3<C::F>) -> SeparatingAxis<C::F> {
        known
    }
}

/// Directions on the sphere [–]: 20° apart.
const DIRECTIONS: usize = 128;
/// Directions with a larger cosine to the axes known and tried are left out: GJK has been there.
const KNOWN: f64 = 0.9;

/// How far the second shape of a pair reaches in its own frame.
pub(in crate::step::collide) trait Extent<C: Cx> {
    /// The largest d · point.
    fn extent(&self, cx: &mut C, d: Vec3<C::F>) -> C::F;
}

/// Extent of a shape that has a closed form.
pub(in crate::step::collide) struct ClosedForm<R>(pub R);

impl<C: Cx, R: Reach<C::F>> Extent<C> for ClosedForm<R> {
    #[inline(always)]
    fn extent(&self, _: &mut C, d: Vec3<C::F>) -> C::F {
        self.0.reach(d)
    }
}

impl<C: Cx> Extent<C> for Hull<'_, C> {
    #[inline(always)]
    fn extent(&self, cx: &mut C, d: Vec3<C::F>) -> C::F {
        self.reach(cx, d)
    }
}

/// Restarts from the best of many directions, for curved shapes: their axes cannot be listed.
pub(in crate::step::collide) struct DirectionSamples<F, A, B> {
    /// Axes and centre of the first shape, in the frame of the second.
    pub axes: Mat3<F>,
    pub center: Vec3<F>,
    pub a: A,
    pub b: B,
    /// Depth past which directions are tried [m].
    pub depth: F,
}

impl<C: Cx, A: Reach<C::F>, B: Extent<C>> Restart<C> for DirectionSamples<C::F, A, B> {
    const TRIES: usize = 3;
    const BETTER: bool = false;
    #[inline(always)]
    fn depth(&self) -> C::F {
        self.depth
    }

    #[inline(always)]
    fn axis(
        &self,
        cx: &mut C,
        known: SeparatingAxis<C::F>,
        tried: Vec3<C::F>,
    ) -> SeparatingAxis<C::F> {
        let c = C::F::c;
        // where every direction is left out the distance stays below any
        let mut best = cx.var(c(-1e18));
        let mut axis = var3(cx, known.normal);
        times!(cx, i in DIRECTIONS, {
            // Fibonacci's spiral: equal areas, turned by the golden angle (Vogel 1979)
            // z = (2 i + 1)/N - 1: the middle of band i of N bands of equal area
            let number = cx.number(i);
            let z = number.fma(c(2.0 / DIRECTIONS as f64), c(1.0 / DIRECTIONS as f64 - 1.0));
            let width = z.fnma(z, c(1.0)).sqrt();
            let (sin, cos) = (number * c(2.399_963_229_728_653)).sincos();
            let n = Vec3([cos * width, sin * width, z]);
            // distance along n: min n · B - max n · A
            let reach = self.b.extent(cx, -n) + self.a.reach(self.axes.transpose_mul(n));
            let distance = -(reach + n.dot(self.center));
            let old = cx.get(&best);
            // away from the best axis and from the last start
            let other = n.dot(known.normal).max(n.dot(tried)).lt(c(KNOWN));
            let is = old.lt(distance) & other;
            let kept = get3(cx, &axis);
            cx.set(&mut best, C::F::select(is, distance, old));
            set3(cx, &mut axis, select(is, n, kept));
        });
        SeparatingAxis {
            normal: get3(cx, &axis),
            distance: cx.get(&best),
        }
    }
}
