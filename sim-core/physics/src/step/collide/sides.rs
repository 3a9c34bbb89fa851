//! The faces and segments of shapes that lie on others.

use super::choose::select;
use super::manifold::{Side, aligned};
use super::support::{Polyhedron, pick3, signed};
use crate::constants::hull::{CORNERS_MAX, HullTables};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::span;

/// The face of a hull that faces a direction best.
pub(super) struct HullSide<'a, F> {
    tables: &'a HullTables,
    /// Its outward unit normal.
    pub outward: Vec3<F>,
    first: F,
    count: F,
    /// Axes and centre of the hull, where it is not in its own frame.
    placed: Option<(Mat3<F>, Vec3<F>)>,
}

impl<'a, F: Num> HullSide<'a, F> {
    /// Finds it for the direction `d`.
    #[inline(always)]
    pub fn find<C: Cx<F = F>>(
        cx: &mut C,
        hull: &Polyhedron<'a, C>,
        placed: Option<(Mat3<F>, Vec3<F>)>,
        d: Vec3<F>,
    ) -> HullSide<'a, F> {
        let faces = hull.tables.faces;
        let d = match &placed {
            Some((axes, _)) => axes.transpose_mul(d),
            None => d,
        };
        let (start, end) = hull.span(cx, 1);
        let mut best = cx.var(F::c(-2.0));
        let mut at = cx.var(F::c(0.0));
        span!(cx, face in start, end, {
            let m = Vec3(cx.constants(faces, face, 0));
            let facing = m.dot(d);
            let old = cx.get(&best);
            let (number, kept) = (cx.number(face), cx.get(&at));
            cx.put(&mut at, F::select(old.lt(facing), number, kept));
            cx.put(&mut best, old.max(facing));
        });
        let at = cx.get(&at);
        let m = pick3(cx, faces, at, 0);
        HullSide {
            tables: hull.tables,
            outward: match &placed {
                Some((axes, _)) => axes * m,
                None => m,
            },
            first: cx.pick(faces, at, 4),
            count: cx.pick(faces, at, 5),
            placed,
        }
    }
}

impl<C: Cx> Side<C> for HullSide<'_, C::F> {
    #[inline(always)]
    fn normal(&self) -> Vec3<C::F> {
        self.outward
    }
    #[inline(always)]
    fn count(&self) -> C::F {
        self.count
    }
    #[inline(always)]
    fn corner(&self, cx: &mut C, i: C::I) -> Vec3<C::F> {
        let place = cx.number(i);
        let half = C::F::c(0.5);
        let place = C::F::select(place.lt(self.count - half), place, C::F::c(0.0));
        let corner = pick3(cx, self.tables.corners, self.first + place, 0);
        match &self.placed {
            Some((axes, center)) => axes.mul_add(corner, *center),
            None => corner,
        }
    }
}

/// The face of a box that faces a direction best.
pub(super) struct BoxSide<F> {
    /// Its outward unit normal.
    pub outward: Vec3<F>,
    center: Vec3<F>,
    u: Vec3<F>,
    v: Vec3<F>,
}

impl<F: Num> BoxSide<F> {
    /// Of the box with these axes, half extents and centre, for the direction `d`.
    #[inline(always)]
    pub fn find(axes: &Mat3<F>, half: Vec3<F>, center: Vec3<F>, d: Vec3<F>) -> BoxSide<F> {
        let facing = axes.transpose_mul(d);
        let mut best = BoxSide::face(axes, half, center, 0, facing[0]);
        let mut most = facing[0].abs();
        for j in 1..3 {
            let other = BoxSide::face(axes, half, center, j, facing[j]);
            let is = most.lt(facing[j].abs());
            most = most.max(facing[j].abs());
            best = BoxSide {
                outward: select(is, other.outward, best.outward),
                center: select(is, other.center, best.center),
                u: select(is, other.u, best.u),
                v: select(is, other.v, best.v),
            };
        }
        best
    }

    #[inline(always)]
    fn face(axes: &Mat3<F>, half: Vec3<F>, center: Vec3<F>, j: usize, facing: F) -> BoxSide<F> {
        let (k, l) = ((j + 1) % 3, (j + 2) % 3);
        let outward = axes[j] * signed(F::c(1.0), facing);
        BoxSide {
            outward,
            center: outward.scale_add(half[j], center),
            u: (axes[k] * half[k]),
            v: (axes[l] * signed(half[l], facing)),
        }
    }
}

impl<C: Cx> Side<C> for BoxSide<C::F> {
    #[inline(always)]
    fn normal(&self) -> Vec3<C::F> {
        self.outward
    }
    #[inline(always)]
    fn count(&self) -> C::F {
        C::F::c(4.0)
    }
    #[inline(always)]
    fn corner(&self, cx: &mut C, i: C::I) -> Vec3<C::F> {
        let c = C::F::c;
        let place = cx.number(i);
        let left = c(0.5).lt(place) & place.lt(c(2.5));
        let low = c(1.5).lt(place) & place.lt(c(3.5));
        let (x, y) = (
            C::F::select(left, c(-1.0), c(1.0)),
            C::F::select(low, c(-1.0), c(1.0)),
        );
        self.u.scale_add(x, self.v.scale_add(y, self.center))
    }
}

/// A segment on a shape's surface.
pub(super) struct SegmentSide<F> {
    center: Vec3<F>,
    half: Vec3<F>,
    outward: Vec3<F>,
}

impl<F: Num> SegmentSide<F> {
    /// From `center - half` to `center + half`, seen along `normal`, which points outward.
    #[inline(always)]
    pub fn new(center: Vec3<F>, half: Vec3<F>, normal: Vec3<F>) -> SegmentSide<F> {
        let square = half.dot(half).max(F::c(1e-24));
        let slope = half.dot(normal).div(square);
        SegmentSide {
            center,
            half,
            outward: (normal - (half * slope)),
        }
    }
}

impl<C: Cx> Side<C> for SegmentSide<C::F> {
    #[inline(always)]
    fn normal(&self) -> Vec3<C::F> {
        self.outward
    }
    #[inline(always)]
    fn count(&self) -> C::F {
        C::F::c(2.0)
    }
    #[inline(always)]
    fn corner(&self, cx: &mut C, i: C::I) -> Vec3<C::F> {
        let c = C::F::c;
        let place = cx.number(i);
        let second = c(0.5).lt(place) & place.lt(c(1.5));
        let side = C::F::select(second, c(1.0), c(-1.0));
        self.half.scale_add(side, self.center)
    }
}

/// The cap of a cylinder as a polygon, or a line along its side.
pub(super) struct CylinderSide<F: Num> {
    /// Its outward unit normal.
    pub outward: Vec3<F>,
    center: Vec3<F>,
    u: Vec3<F>,
    v: Vec3<F>,
    count: F,
    /// Is it a cap?
    pub cap: F::Mask,
}

impl<F: Num> CylinderSide<F> {
    /// Of the cylinder with these axes and centre, for the unit direction `d`; a cap where that is steeper than 45°.
    #[inline(always)]
    pub fn find(
        axes: &Mat3<F>,
        radius: F,
        half_height: F,
        center: Vec3<F>,
        d: Vec3<F>,
    ) -> CylinderSide<F> {
        let local = axes.transpose_mul(d);
        // an upright one keeps its rim points: their direction is not left to rounding
        let width = local[0].fma(local[0], local[1] * local[1]).sqrt();
        let upright = width.lt(F::c(1e-4));
        let unit = F::c(1.0).div(width.max(F::c(1e-4)));
        let (x, y) = (
            F::select(upright, F::c(1.0), local[0] * unit),
            F::select(upright, F::c(0.0), local[1] * unit),
        );
        let rim = axes[0].scale_add(x, axes[1] * y);
        let cap = F::c(0.7).lt(local[2].abs());
        let end = axes[2] * signed(F::c(1.0), local[2]);
        let half = axes[2] * half_height;
        CylinderSide {
            outward: select(cap, end, rim),
            center: select(
                cap,
                end.scale_add(half_height, center),
                rim.scale_add(radius, center),
            ),
            u: select(cap, rim * radius, half),
            v: (end.cross(rim) * radius),
            count: F::select(cap, F::c(CORNERS_MAX as f64), F::c(2.0)),
            cap,
        }
    }

    /// Is it a cap that is flat on the other shape?
    #[inline(always)]
    pub fn flat(&self, normal: Vec3<F>) -> F::Mask {
        self.cap & aligned(self.outward, normal)
    }

    /// `a` where the mask holds, else `b`.
    #[inline(always)]
    pub fn select(mask: F::Mask, a: &CylinderSide<F>, b: &CylinderSide<F>) -> CylinderSide<F> {
        let cap = (mask & a.cap) | (!mask & b.cap);
        CylinderSide {
            outward: select(mask, a.outward, b.outward),
            center: select(mask, a.center, b.center),
            u: select(mask, a.u, b.u),
            v: select(mask, a.v, b.v),
            count: F::select(mask, a.count, b.count),
            cap,
        }
    }
}

impl<C: Cx> Side<C> for CylinderSide<C::F> {
    #[inline(always)]
    fn normal(&self) -> Vec3<C::F> {
        self.outward
    }
    #[inline(always)]
    fn count(&self) -> C::F {
        self.count
    }
    #[inline(always)]
    fn corner(&self, cx: &mut C, i: C::I) -> Vec3<C::F> {
        let c = C::F::c;
        let place = cx.number(i);
        let inside = place.lt(self.count - c(0.5));
        let place = C::F::select(inside, place, c(0.0));
        let (sin, cos) = (place * c(std::f64::consts::TAU / CORNERS_MAX as f64)).sincos();
        let (x, y) = (
            C::F::select(self.cap, cos, c(2.0).fma(place, c(-1.0))),
            C::F::select(self.cap, sin, c(0.0)),
        );
        self.u.scale_add(x, self.v.scale_add(y, self.center))
    }
}
