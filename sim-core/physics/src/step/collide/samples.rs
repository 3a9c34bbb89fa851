//! Another axis to start from, where a curved shape penetrates: the best of many directions away from the one known.

use super::choose::select;
use super::gjk::Restart;
use super::hull_axes::{Axis, Reach};
use super::support::{Polyhedron, get3, negated, set3, var3};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::times;

/// Directions on the sphere [–]: 20° apart.
const DIRECTIONS: usize = 128;
/// Cosine of the angle about the axes known and tried that is left out.
const KNOWN: f64 = 0.9;

/// How far a shape reaches in the frame of a pair.
pub(super) trait Extent<C: Cx> {
    /// The largest d · point.
    fn extent(&self, cx: &mut C, d: Vec3<C::F>) -> C::F;
}

/// A shape in its own axes at the origin.
pub(super) struct Own<'a, R>(pub &'a R);

impl<C: Cx, R: Reach<C::F>> Extent<C> for Own<'_, R> {
    #[inline(always)]
    fn extent(&self, _: &mut C, d: Vec3<C::F>) -> C::F {
        self.0.reach(d)
    }
}

/// A hull in its own frame.
pub(super) struct Hull<'a, 'b, C: Cx>(pub &'a Polyhedron<'b, C>);

impl<C: Cx> Extent<C> for Hull<'_, '_, C> {
    #[inline(always)]
    fn extent(&self, cx: &mut C, d: Vec3<C::F>) -> C::F {
        self.0.reach(cx, d)
    }
}

/// A pair: the first shape by its axes, centre and reach, the second in its own frame.
pub(super) struct Samples<'a, F, A, B> {
    pub axes: &'a Mat3<F>,
    pub center: Vec3<F>,
    pub a: &'a A,
    pub b: B,
    /// Depth past which they are tried [m].
    pub depth: F,
}

impl<C: Cx, A: Reach<C::F>, B: Extent<C>> Restart<C> for Samples<'_, C::F, A, B> {
    const TRIES: usize = 3;
    const BETTER: bool = false;
    #[inline(always)]
    fn depth(&self) -> C::F {
        self.depth
    }

    #[inline(always)]
    fn axis(&self, cx: &mut C, known: Axis<C::F>, tried: Vec3<C::F>) -> Axis<C::F> {
        let c = C::F::c;
        let mut best = cx.var(c(-1e18));
        let mut axis = var3(cx, known.normal);
        times!(cx, i in DIRECTIONS, {
            // a spiral of equal areas (Fibonacci's)
            let number = cx.number(i);
            let z = number.fma(c(2.0 / DIRECTIONS as f64), c(1.0 / DIRECTIONS as f64 - 1.0));
            let width = z.fnma(z, c(1.0)).sqrt();
            let (sin, cos) = (number * c(2.399_963_229_728_653)).sincos();
            let n = Vec3([cos * width, sin * width, z]);
            let reach = self.b.extent(cx, negated(n)) + self.a.reach(self.axes.transpose_mul(n));
            let distance = -(reach + n.dot(self.center));
            let old = cx.get(&best);
            let other = n.dot(known.normal).max(n.dot(tried)).lt(c(KNOWN));
            let is = old.lt(distance) & other;
            let kept = get3(cx, &axis);
            cx.set(&mut best, C::F::select(is, distance, old));
            set3(cx, &mut axis, select(is, Vec3(n.0), kept));
        });
        Axis {
            normal: get3(cx, &axis),
            distance: cx.get(&best),
        }
    }
}
