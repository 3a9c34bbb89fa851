//! Features of shapes that touch in more than a point: faces, caps and edges, as polygons to be clipped.
//!
//! A feature is found for a direction: the face or line of its shape that faces it best. A segment is a polygon with two
//! corners, and a cap of a cylinder one with [`CORNERS_MAX`].

use super::hull::{Hull, Part};
use crate::constants::hull::{CORNERS_MAX, HullTables};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::span;
use crate::step::collide::manifold::select::with_sign;
use crate::step::collide::narrow::ShapePose;
use crate::step::collide::variables::pick3;

/// Cosine to the normal past which a face lies flat on the other shape: 1.8°.
const ALIGNED: f64 = 0.9995;

/// Whether a face with this outward normal lies flat on the other shape.
#[inline(always)]
pub(in crate::step::collide) fn aligned<F: Num>(outward: Vec3<F>, normal: Vec3<F>) -> F::Mask {
    F::c(ALIGNED).lt(outward.dot(normal).abs())
}

/// A flat polygon on the surface of a shape.
pub(in crate::step::collide) trait Feature<C: Cx> {
    /// A vector across it, outward, of any length.
    fn normal(&self) -> Vec3<C::F>;
    /// Its number of corners.
    fn count(&self) -> C::F;
    /// Corner `i`, counter-clockwise from outside; corner 0 past the last.
    fn corner(&self, cx: &mut C, i: C::I) -> Vec3<C::F>;
}

/// The face of a hull that faces a direction best.
pub(in crate::step::collide) struct HullFace<'a, F> {
    tables: &'a HullTables,
    /// Its outward unit normal.
    pub outward: Vec3<F>,
    first: F,
    count: F,
    /// Pose of the hull, where it is not in its own frame.
    pose: Option<ShapePose<F>>,
}

impl<'a, F: Num> HullFace<'a, F> {
    /// Finds it for the direction `d`.
    #[inline(always)]
    pub fn find<C: Cx<F = F>>(
        cx: &mut C,
        hull: &Hull<'a, C>,
        pose: Option<ShapePose<F>>,
        d: Vec3<F>,
    ) -> HullFace<'a, F> {
        let faces = hull.tables.faces;
        // the direction in the hull's own frame
        let d = match &pose {
            Some(pose) => pose.axes.transpose_mul(d),
            None => d,
        };
        let (start, end) = hull.span(cx, Part::Faces);
        // below any cosine
        let mut best = cx.var(F::c(-2.0));
        let mut at = cx.var(F::c(0.0));
        // the face whose normal m has the largest m · d; of equal ones the first
        span!(cx, face in start, end, {
            let m = Vec3(cx.constants(faces, face, 0));
            let facing = m.dot(d);
            let old = cx.get(&best);
            let (number, kept) = (cx.number(face), cx.get(&at));
            // unmasked: all worlds of the block search the same faces, and inactive ones are not read
            cx.put(&mut at, F::select(old.lt(facing), number, kept));
            cx.put(&mut best, old.max(facing));
        });
        // its normal in the frame that the pose is in, and its rows in the table of corners
        let at = cx.get(&at);
        let m = pick3(cx, faces, at, 0);
        HullFace {
            tables: hull.tables,
            outward: match &pose {
                Some(pose) => pose.axes * m,
                None => m,
            },
            first: cx.pick(faces, at, 4),
            count: cx.pick(faces, at, 5),
            pose,
        }
    }
}

impl<C: Cx> Feature<C> for HullFace<'_, C::F> {
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
        // past the last corner the first again
        let place = cx.number(i);
        let half = C::F::c(0.5);
        let place = C::F::select(place.lt(self.count - half), place, C::F::c(0.0));
        let corner = pick3(cx, self.tables.corners, self.first + place, 0);
        match &self.pose {
            Some(pose) => pose.axes.mul_add(corner, pose.center),
            None => corner,
        }
    }
}

/// The face of a box that faces a direction best.
pub(in crate::step::collide) struct BoxFace<F> {
    /// Its outward unit normal.
    pub outward: Vec3<F>,
    center: Vec3<F>,
    /// Half its sides.
    u: Vec3<F>,
    v: Vec3<F>,
}

impl<F: Num> BoxFace<F> {
    /// Finds it for the direction `d`, of a box with these half extents.
    #[inline(always)]
    pub fn find(pose: &ShapePose<F>, half: Vec3<F>, d: Vec3<F>) -> BoxFace<F> {
        let (axes, center) = (&pose.axes, pose.center);
        // d in the axes of the box: the largest component names the face, its sign the side
        let facing = axes.transpose_mul(d);
        let mut best = BoxFace::face(axes, half, center, 0, facing[0]);
        let mut most = facing[0].abs();
        // selected component by component, since the axis differs per world; of equal ones the first
        for j in 1..3 {
            let other = BoxFace::face(axes, half, center, j, facing[j]);
            let is = most.lt(facing[j].abs());
            most = most.max(facing[j].abs());
            best = BoxFace {
                outward: select(is, other.outward, best.outward),
                center: select(is, other.center, best.center),
                u: select(is, other.u, best.u),
                v: select(is, other.v, best.v),
            };
        }
        best
    }

    /// The face across axis `j` on the side of the sign of `facing`.
    #[inline(always)]
    fn face(axes: &Mat3<F>, half: Vec3<F>, center: Vec3<F>, j: usize, facing: F) -> BoxFace<F> {
        let (k, l) = ((j + 1) % 3, (j + 2) % 3);
        // v takes the sign of the normal, so that u × v is outward and corners are counter-clockwise
        let outward = axes[j] * with_sign(F::c(1.0), facing);
        BoxFace {
            outward,
            center: outward.scale_add(half[j], center),
            u: (axes[k] * half[k]),
            v: (axes[l] * with_sign(half[l], facing)),
        }
    }
}

impl<C: Cx> Feature<C> for BoxFace<C::F> {
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
        // corners 0 to 3 and 0 again: (+, +), (-, +), (-, -), (+, -)
        let left = c(0.5).lt(place) & place.lt(c(2.5));
        let low = c(1.5).lt(place) & place.lt(c(3.5));
        let (x, y) = (
            C::F::select(left, c(-1.0), c(1.0)),
            C::F::select(low, c(-1.0), c(1.0)),
        );
        self.u.scale_add(x, self.v.scale_add(y, self.center))
    }
}

/// A line on the surface of a capsule.
pub(in crate::step::collide) struct SegmentLine<F> {
    center: Vec3<F>,
    /// From the centre to one end.
    half: Vec3<F>,
    outward: Vec3<F>,
}

impl<F: Num> SegmentLine<F> {
    /// From `center - half` to `center + half`, seen along `normal`, which points outward.
    #[inline(always)]
    pub fn new(center: Vec3<F>, half: Vec3<F>, normal: Vec3<F>) -> SegmentLine<F> {
        // n - h (h · n)/(h · h), finite for a segment without length
        let square = half.dot(half).max(F::c(1e-24));
        let slope = half.dot(normal).div(square);
        // the part of the normal across the line
        SegmentLine {
            center,
            half,
            outward: (normal - (half * slope)),
        }
    }
}

impl<C: Cx> Feature<C> for SegmentLine<C::F> {
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
        // corner 1 is the end at +half, 0 and the one past the last that at -half
        let c = C::F::c;
        let place = cx.number(i);
        let second = c(0.5).lt(place) & place.lt(c(1.5));
        let side = C::F::select(second, c(1.0), c(-1.0));
        self.half.scale_add(side, self.center)
    }
}

/// The cap of a cylinder as a regular polygon, or a line along its side.
pub(in crate::step::collide) struct CylinderFeature<F: Num> {
    /// Its outward unit normal.
    pub outward: Vec3<F>,
    center: Vec3<F>,
    /// Two radii of a cap, or half of a line.
    u: Vec3<F>,
    v: Vec3<F>,
    count: F,
    /// Is it a cap?
    pub cap: F::Mask,
}

impl<F: Num> CylinderFeature<F> {
    /// Finds it for the unit direction `d`: a cap where that is within 45° of the axis.
    #[inline(always)]
    pub fn find(pose: &ShapePose<F>, radius: F, half_height: F, d: Vec3<F>) -> CylinderFeature<F> {
        let (axes, center) = (&pose.axes, pose.center);
        // d in the cylinder's axes
        let local = axes.transpose_mul(d);
        // an upright cylinder keeps its rim points: rounding must not choose their direction
        let width = local[0].fma(local[0], local[1] * local[1]).sqrt();
        let upright = width.lt(F::c(1e-4));
        let unit = F::c(1.0).div(width.max(F::c(1e-4)));
        let (x, y) = (
            F::select(upright, F::c(1.0), local[0] * unit),
            F::select(upright, F::c(0.0), local[1] * unit),
        );
        // outward normals of the side and of the cap that d faces
        let rim = axes[0].scale_add(x, axes[1] * y);
        let cap = F::c(0.7).lt(local[2].abs());
        let end = axes[2] * with_sign(F::c(1.0), local[2]);
        let half = axes[2] * half_height;
        // u × v is along the cap's normal, so that its corners are counter-clockwise; a line has u alone
        CylinderFeature {
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

    /// Is it a cap that lies flat on the other shape?
    #[inline(always)]
    pub fn flat(&self, normal: Vec3<F>) -> F::Mask {
        self.cap & aligned(self.outward, normal)
    }

    /// `a` where the mask holds, else `b`.
    #[inline(always)]
    pub fn select(
        mask: F::Mask,
        a: &CylinderFeature<F>,
        b: &CylinderFeature<F>,
    ) -> CylinderFeature<F> {
        // `F::select` takes scalars; a mask is chosen by logic
        let cap = (mask & a.cap) | (!mask & b.cap);
        CylinderFeature {
            outward: select(mask, a.outward, b.outward),
            center: select(mask, a.center, b.center),
            u: select(mask, a.u, b.u),
            v: select(mask, a.v, b.v),
            count: F::select(mask, a.count, b.count),
            cap,
        }
    }
}

impl<C: Cx> Feature<C> for CylinderFeature<C::F> {
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
        // past the last corner the first again
        let place = cx.number(i);
        let inside = place.lt(self.count - c(0.5));
        let place = C::F::select(inside, place, c(0.0));
        // around the rim, or from one end of the line to the other
        let (sin, cos) = (place * c(std::f64::consts::TAU / CORNERS_MAX as f64)).sincos();
        let (x, y) = (
            C::F::select(self.cap, cos, c(2.0).fma(place, c(-1.0))),
            C::F::select(self.cap, sin, c(0.0)),
        );
        self.u.scale_add(x, self.v.scale_add(y, self.center))
    }
}
