//! Separating axes of a hull and a box, segment or cylinder, in the hull's frame.
//!
//! The distance of two convex shapes, negative in penetration, is at least that along any axis, and in penetration it is
//! that along the best of: normals of the hull's faces; normals of the other's faces; normals of two edges that make a
//! face of the Minkowski difference. An edge of the hull and one of a box along q do so where q lies between the
//! normals n₁, n₂ beside the hull's edge: (n₁ · q)(n₂ · q) < 0 (Gregorius, GDC 2013).

use super::choose::select;
use super::support::{Polyhedron, four, get3, negated, put3, rounding, set3, signed, var3};
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3};
use crate::{break_if, span, when};

/// What a shape about its centre reaches along a direction in its own axes.
pub(super) trait Reach<F> {
    /// Axes of it that are normals of faces.
    const FACES: &'static [usize];
    /// Axes of it along which edges run.
    const EDGES: &'static [usize];
    /// The largest d · point.
    fn reach(&self, d: Vec3<F>) -> F;
}

/// Half extents of a box.
pub(super) struct BoxReach<F>(pub Vec3<F>);
/// Half the length of a segment along z.
pub(super) struct SegmentReach<F>(pub F);
/// Radius and half height of a cylinder along z.
pub(super) struct CylinderReach<F>(pub F, pub F);
/// A point.
pub(super) struct PointReach;

impl<F: Num> Reach<F> for BoxReach<F> {
    const FACES: &'static [usize] = &[0, 1, 2];
    const EDGES: &'static [usize] = &[0, 1, 2];
    #[inline(always)]
    fn reach(&self, d: Vec3<F>) -> F {
        self.0.dot(Vec3([d[0].abs(), d[1].abs(), d[2].abs()]))
    }
}

impl<F: Num> Reach<F> for SegmentReach<F> {
    const FACES: &'static [usize] = &[];
    const EDGES: &'static [usize] = &[2];
    #[inline(always)]
    fn reach(&self, d: Vec3<F>) -> F {
        self.0 * d[2].abs()
    }
}

impl<F: Num> Reach<F> for CylinderReach<F> {
    const FACES: &'static [usize] = &[2];
    const EDGES: &'static [usize] = &[2];
    #[inline(always)]
    fn reach(&self, d: Vec3<F>) -> F {
        let width = d[0].fma(d[0], d[1] * d[1]).sqrt();
        self.0.fma(width, self.1 * d[2].abs())
    }
}

impl<F: Num> Reach<F> for PointReach {
    const FACES: &'static [usize] = &[];
    const EDGES: &'static [usize] = &[];
    #[inline(always)]
    fn reach(&self, _: Vec3<F>) -> F {
        F::c(0.0)
    }
}

/// An axis and the distance of the shapes along it.
#[derive(Clone, Copy)]
pub(super) struct Axis<F> {
    /// Unit vector from the first shape of the pair towards the second.
    pub normal: Vec3<F>,
    pub distance: F,
}

/// The best axis of a hull and another shape, and whose it is.
pub(super) struct Best<F> {
    pub axis: Axis<F>,
    /// 0: of a face of the hull; 1: of one of the other; 2: of two edges.
    kind: F,
    /// The hull's edge.
    pub edge: F,
    /// The axis along which the other's edge runs: 0, 1, 2.
    pub along: F,
}

impl<F: Num> Best<F> {
    /// Is it the normal of a face of the other shape?
    #[inline(always)]
    pub fn of_other(&self) -> F::Mask {
        F::c(0.5).lt(self.kind) & self.kind.lt(F::c(1.5))
    }

    /// Is it across two edges?
    #[inline(always)]
    pub fn of_edges(&self) -> F::Mask {
        F::c(1.5).lt(self.kind)
    }
}

/// The better of two axes: the first, unless the second is better by more than rounding.
#[inline(always)]
pub(super) fn better<F: Num>(a: Axis<F>, b: Axis<F>, slack: F) -> Axis<F> {
    let second = (a.distance + slack).lt(b.distance);
    Axis {
        normal: select(second, b.normal, a.normal),
        distance: F::select(second, b.distance, a.distance),
    }
}

/// Distance along a hull's box axes, the other's face axes and the line of centres, of the hull's bounding box and the
/// other: never more than their true distance. `axes` and `center` are the other's in the hull's frame; the normal
/// points from the other to the hull.
#[inline(always)]
pub(super) fn bounding_axis<F: Num, R: Reach<F>>(
    half: Vec3<F>,
    axes: &Mat3<F>,
    center: Vec3<F>,
    other: &R,
) -> Axis<F> {
    let own = BoxReach(half);
    let length = center.dot(center).sqrt();
    let apart = F::c(1e-12).lt(length);
    let ray = center * F::c(-1.0).div(length.max(F::c(1e-12)));
    let up = [F::c(0.0), F::c(0.0), F::c(1.0)];
    let normal = select(apart, ray, Vec3(up));
    let distance = length - own.reach(normal) - other.reach(axes.transpose_mul(normal));
    let mut best = Axis { normal, distance };
    for i in 0..3 {
        let row = [axes[0][i], axes[1][i], axes[2][i]];
        let mut normal = [F::c(0.0); 3];
        normal[i] = signed(F::c(-1.0), center[i]);
        let distance = center[i].abs() - half[i] - other.reach(Vec3(row));
        best = better(
            best,
            Axis {
                normal: Vec3(normal),
                distance,
            },
            F::c(0.0),
        );
    }
    for &j in R::FACES {
        let mut unit = [F::c(0.0); 3];
        unit[j] = F::c(1.0);
        let height = center.dot(axes[j]);
        let normal = axes[j] * signed(F::c(-1.0), height);
        let distance = height.abs() - own.reach(axes[j]) - other.reach(Vec3(unit));
        best = better(best, Axis { normal, distance }, F::c(0.0));
    }
    best
}

/// The best separating axis of a hull and another shape; where the distance exceeds `limit`, only one that shows it.
///
/// `axes` and `center` are the other's in the hull's frame; the normal points from the other to the hull. A face is
/// preferred to an edge that is better by no more than `slack`.
#[inline(always)]
pub(super) fn hull_axis<C: Cx, R: Reach<C::F>>(
    cx: &mut C,
    hull: &Polyhedron<C>,
    axes: &Mat3<C::F>,
    center: Vec3<C::F>,
    other: &R,
    limit: C::F,
    slack: C::F,
) -> Best<C::F> {
    let c = C::F::c;
    let tables = hull.tables;
    let (first, end) = hull.span(cx, 1);
    let mut best = cx.var(c(-1e18));
    let mut normal = var3(cx, Vec3([c(0.0); 3]));
    let mut kind = cx.var(c(0.0));
    let mut place = [cx.var(c(0.0)), cx.var(c(0.0))];
    span!(cx, face in first, end, {
        let [mx, my, mz, offset] = cx.constants(tables.faces, face, 0);
        let m = Vec3([mx, my, mz]);
        let x = m.dot(center) - offset - other.reach(axes.transpose_mul(m));
        let old = cx.get(&best);
        let farther = old.lt(x);
        let kept = get3(cx, &normal);
        cx.put(&mut best, C::F::select(farther, x, old));
        put3(cx, &mut normal, select(farther, Vec3(m.0), kept));
        // farther apart than asked, by whichever face
        break_if!(cx, limit.lt(x));
    });
    if !R::FACES.is_empty() {
        let near = cx.get(&best).lt(limit);
        when!(cx, near, {
            let mut highest = var3(cx, Vec3([c(-1e18); 3]));
            let mut lowest = var3(cx, Vec3([c(1e18); 3]));
            let (first, end) = hull.span(cx, 0);
            span!(cx, row in first, end, {
                let (mut high, mut low) = (get3(cx, &highest), get3(cx, &lowest));
                for vertex in four(cx, tables, row) {
                    for &j in R::FACES {
                        let x = vertex.dot(axes[j]);
                        high[j] = high[j].max(x);
                        low[j] = low[j].min(x);
                    }
                }
                put3(cx, &mut highest, high);
                put3(cx, &mut lowest, low);
            });
            let (high, low) = (get3(cx, &highest), get3(cx, &lowest));
            for &j in R::FACES {
                let mut unit = [c(0.0); 3];
                unit[j] = c(1.0);
                let (height, half) = (axes[j].dot(center), other.reach(Vec3(unit)));
                let above = height - half - high[j];
                let below = low[j] - height - half;
                let side = signed(c(1.0), above - below);
                let x = above.max(below);
                let old = cx.get(&best);
                let farther = old.lt(x);
                let kept = get3(cx, &normal);
                cx.set(&mut best, C::F::select(farther, x, old));
                set3(cx, &mut normal, select(farther, axes[j] * side, kept));
                let was = cx.get(&kind);
                cx.set(&mut kind, C::F::select(farther, c(1.0), was));
            }
        });
    }
    if !R::EDGES.is_empty() {
        let near = cx.get(&best).lt(limit);
        when!(cx, near, {
            let start = cx.get(&best) + slack;
            let mut edge_best = cx.var(start);
            let mut edge_normal = var3(cx, Vec3([c(0.0); 3]));
            let (first, end) = hull.span(cx, 2);
            // Two edges that are the way out pass each other at the depth that they tell. The other shape reaches along the
            // best axis so far to that axis' depth below the hull's end, and an edge to no more than twice that.
            let (m, x) = (get3(cx, &normal), cx.get(&best));
            let top = m.dot(center) - other.reach(axes.transpose_mul(m)) - x;
            let is_apart = !x.lt(c(0.0));
            let floor = C::F::select(is_apart, c(-1e18), top + (x + x) - slack);
            span!(cx, edge in first, end, {
                let [px, py, pz, ax, ay, az] = cx.constants(tables.edges, edge, 0);
                let (point, along) = (Vec3([px, py, pz]), Vec3([ax, ay, az]));
                let length = cx.constant(tables.edges, edge, 12);
                let height = m.dot(point) + (m.dot(along) * length).max(c(0.0));
                let reaches = !height.lt(floor);
                when!(cx, reaches, {
                let [n1x, n1y, n1z, n2x, n2y, n2z] = cx.constants(tables.edges, edge, 6);
                let (n1, n2) = (Vec3([n1x, n1y, n1z]), Vec3([n2x, n2y, n2z]));
                let (way, outward) = (center - point, n1 + n2);
                for &j in R::EDGES {
                    let q = axes[j];
                    let crosses = (n1.dot(q) * n2.dot(q)).lt(c(0.0));
                    when!(cx, crosses, {
                        let axis = along.cross(q);
                        let square = axis.dot(axis);
                        let unit = c(1.0).div(square.max(c(1e-6)).sqrt());
                        let unit = axis * signed(unit, axis.dot(outward));
                        let x = unit.dot(way) - other.reach(axes.transpose_mul(unit));
                        let old = cx.get(&edge_best);
                        // of nearly parallel edges the normal is a face's
                        let farther = old.lt(x) & c(1e-6).lt(square);
                        cx.set(&mut edge_best, C::F::select(farther, x, old));
                        let kept = get3(cx, &edge_normal);
                        set3(cx, &mut edge_normal, select(farther, unit, kept));
                        let (number, at, along) = (cx.number(edge), cx.get(&place[0]), cx.get(&place[1]));
                        cx.set(&mut place[0], C::F::select(farther, number, at));
                        cx.set(&mut place[1], C::F::select(farther, c(j as f64), along));
                    });
                }
                });
            });
            let (x, old) = (cx.get(&edge_best), cx.get(&best));
            let farther = (old + slack).lt(x);
            let (unit, kept) = (get3(cx, &edge_normal), get3(cx, &normal));
            cx.set(&mut best, C::F::select(farther, x, old));
            set3(cx, &mut normal, select(farther, unit, kept));
            let was = cx.get(&kind);
            cx.set(&mut kind, C::F::select(farther, c(2.0), was));
        });
    }
    Best {
        axis: Axis {
            normal: negated(get3(cx, &normal)),
            distance: cx.get(&best),
        },
        kind: cx.get(&kind),
        edge: cx.get(&place[0]),
        along: cx.get(&place[1]),
    }
}

/// Rounding of distances between shapes whose radii have this sum.
#[inline(always)]
pub(super) fn slack<F: Num>(size: F) -> F {
    size * rounding::<F>()
}
