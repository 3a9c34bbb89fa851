//! Separating axes of a hull and a box, segment or cylinder, in the hull's frame.
//!
//! The distance of two convex shapes, negative in penetration, is at least that along any axis. In penetration it is that
//! along the best of these axes (Gottschalk, Lin and Manocha 1996):
//!
//! - normals of the hull's faces,
//! - normals of the other's faces,
//! - normals of two edges that make a face of the Minkowski difference. An edge of the hull and one along q do so where q
//!   lies between the normals n₁, n₂ beside the hull's edge: (n₁ · q)(n₂ · q) < 0 (Gregorius, GDC 2013).

use super::hull::{Hull, Part, vertex_row};
use super::support::rounding_error;
use crate::lane::{Cx, Num};
use crate::math::vec3::{Mat3, Vec3, select};
use crate::step::collide::manifold::select::with_sign;
use crate::step::collide::narrow::ShapePose;
use crate::step::collide::variables::{get3, put3, set3, var3};
use crate::{break_if, span, when};

/// How far a shape about its centre reaches along a direction in its own axes, in closed form.
pub(in crate::step::collide) trait Reach<F> {
    /// Which of its axes are normals of faces.
    const FACES: &'static [usize];
    /// Which of its axes edges run along.
    const EDGES: &'static [usize];
    /// The largest d · point.
    fn reach(&self, d: Vec3<F>) -> F;
}

/// Half extents of a box.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct BoxReach<F>(pub Vec3<F>);
/// Half the length of a segment along z.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct SegmentReach<F>(pub F);
/// Radius and half height of a cylinder along z.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct CylinderReach<F>(pub F, pub F);
/// A point.
#[derive(Clone, Copy)]
pub(in crate::step::collide) struct PointReach;

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
pub(in crate::step::collide) struct SeparatingAxis<F> {
    /// Unit vector from the first shape of the pair towards the second.
    pub normal: Vec3<F>,
    pub distance: F,
}

/// The best axis of a hull and another shape, and the features it belongs to.
pub(in crate::step::collide) struct HullAxis<F> {
    pub axis: SeparatingAxis<F>,
    /// 0: normal of a face of the hull; 1: of a face of the other; 2: of two edges.
    kind: F,
    /// The hull's edge.
    pub edge: F,
    /// The axis along which the other's edge runs: 0, 1, 2.
    pub along: F,
}

impl<F: Num> HullAxis<F> {
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

/// The axis of larger distance: the first, unless the second exceeds it by more than the tolerance.
#[inline(always)]
pub(in crate::step::collide) fn better_axis<F: Num>(
    a: SeparatingAxis<F>,
    b: SeparatingAxis<F>,
    tolerance: F,
) -> SeparatingAxis<F> {
    let second = (a.distance + tolerance).lt(b.distance);
    SeparatingAxis {
        normal: select(second, b.normal, a.normal),
        distance: F::select(second, b.distance, a.distance),
    }
}

/// The best of a few axes of a hull's bounding box and another shape: the box axes, the other's face axes and the line of
/// centres. Its distance is a lower bound of the true one, which rejects most pairs.
///
/// The pose is that of the other in the hull's frame; the normal points from the other to the hull.
#[inline(always)]
pub(in crate::step::collide) fn bounding_box_axis<F: Num, R: Reach<F>>(
    half: Vec3<F>,
    pose: &ShapePose<F>,
    other: &R,
) -> SeparatingAxis<F> {
    let (axes, center) = (&pose.axes, pose.center);
    let box_reach = BoxReach(half);
    // line of centres, from the other to the hull: n = -center/|center|, or z where centres coincide
    let length = center.dot(center).sqrt();
    let apart = F::c(1e-12).lt(length);
    let ray = center * F::c(-1.0).div(length.max(F::c(1e-12)));
    let up = [F::c(0.0), F::c(0.0), F::c(1.0)];
    let normal = select(apart, ray, Vec3(up));
    // along n the centres are |center| apart, less the reach of either
    let distance = length - box_reach.reach(normal) - other.reach(axes.transpose_mul(normal));
    let mut best = SeparatingAxis { normal, distance };
    // axes of the bounding box, against the side of the other's centre; row i is axis i in the other's axes
    for i in 0..3 {
        let row = [axes[0][i], axes[1][i], axes[2][i]];
        let mut normal = [F::c(0.0); 3];
        normal[i] = with_sign(F::c(-1.0), center[i]);
        let distance = center[i].abs() - half[i] - other.reach(Vec3(row));
        best = better_axis(
            best,
            SeparatingAxis {
                normal: Vec3(normal),
                distance,
            },
            F::c(0.0),
        );
    }
    // normals of the other's faces, likewise
    for &j in R::FACES {
        let mut unit = [F::c(0.0); 3];
        unit[j] = F::c(1.0);
        let height = center.dot(axes[j]);
        let normal = axes[j] * with_sign(F::c(-1.0), height);
        let distance = height.abs() - box_reach.reach(axes[j]) - other.reach(Vec3(unit));
        best = better_axis(best, SeparatingAxis { normal, distance }, F::c(0.0));
    }
    best
}

/// The axes of a hull and another shape, which is posed in the hull's frame.
///
/// Normals point from the other shape to the hull.
pub(in crate::step::collide) struct HullAxes<'a, 'b, C: Cx, R> {
    pub hull: &'a Hull<'b, C>,
    /// Axes and centre of the other shape.
    pub axes: &'a Mat3<C::F>,
    pub center: Vec3<C::F>,
    pub other: &'a R,
    /// Past this distance the search ends at any axis that proves it [m].
    pub limit: C::F,
    /// A face is preferred to an edge that is better by no more than this [m].
    pub tolerance: C::F,
}

/// Variables of the best axis.
struct Search<C: Cx> {
    distance: C::V,
    normal: [C::V; 3],
    kind: C::V,
    /// The hull's edge, and the axis of the other's.
    place: [C::V; 2],
}

/// Variables of the best axis of two edges.
struct EdgeSearch<C: Cx> {
    distance: C::V,
    normal: [C::V; 3],
}

/// An edge of a hull.
struct HullEdge<F> {
    /// One end, and the unit direction to the other.
    point: Vec3<F>,
    along: Vec3<F>,
    /// Sum of the normals beside it.
    outward: Vec3<F>,
    /// The normals beside it.
    normals: [Vec3<F>; 2],
}

impl<C: Cx, R: Reach<C::F>> HullAxes<'_, '_, C, R> {
    /// The best separating axis.
    #[inline(always)]
    pub fn best(&self, cx: &mut C) -> HullAxis<C::F> {
        // each part is skipped in worlds where an axis so far proves the limit
        let mut search = self.hull_faces(cx);
        if !R::FACES.is_empty() {
            let near = cx.get(&search.distance).lt(self.limit);
            when!(cx, near, {
                self.other_faces(cx, &mut search);
            });
        }
        if !R::EDGES.is_empty() {
            let near = cx.get(&search.distance).lt(self.limit);
            when!(cx, near, {
                self.edge_pairs(cx, &mut search);
            });
        }
        // the search has normals from the hull to the other: the pair's point the other way
        HullAxis {
            axis: SeparatingAxis {
                normal: -get3(cx, &search.normal),
                distance: cx.get(&search.distance),
            },
            kind: cx.get(&search.kind),
            edge: cx.get(&search.place[0]),
            along: cx.get(&search.place[1]),
        }
    }

    /// How far the other shape reaches along a direction of the hull's frame.
    #[inline(always)]
    fn reach(&self, d: Vec3<C::F>) -> C::F {
        self.other.reach(self.axes.transpose_mul(d))
    }

    /// Normals of the hull's faces.
    #[inline(always)]
    fn hull_faces(&self, cx: &mut C) -> Search<C> {
        let c = C::F::c;
        let tables = self.hull.tables;
        let (first, end) = self.hull.span(cx, Part::Faces);
        let mut search = Search {
            distance: cx.var(c(-1e18)),
            normal: var3(cx, Vec3([c(0.0); 3])),
            kind: cx.var(c(0.0)),
            place: [cx.var(c(0.0)), cx.var(c(0.0))],
        };
        span!(cx, face in first, end, {
            let [mx, my, mz, offset] = cx.constants(tables.faces, face, 0);
            let m = Vec3([mx, my, mz]);
            // distance along an outward normal m: m · center - offset - reach of the other
            let x = m.dot(self.center) - offset - self.reach(m);
            let old = cx.get(&search.distance);
            let farther = old.lt(x);
            let kept = get3(cx, &search.normal);
            // unmasked: in a world that has ended the distance only grows, and stays past the limit
            cx.put(&mut search.distance, C::F::select(farther, x, old));
            put3(cx, &mut search.normal, select(farther, m, kept));
            // any face that proves the limit is enough
            break_if!(cx, self.limit.lt(x));
        });
        search
    }

    /// Normals of the other shape's faces: the hull's extent along each, from both sides.
    #[inline(always)]
    fn other_faces(&self, cx: &mut C, search: &mut Search<C>) {
        let (c, axes) = (C::F::c, self.axes);
        let (high, low) = self.hull_extents(cx);
        for &j in R::FACES {
            // along its axis the other covers height ± half, the hull low to high
            let mut unit = [c(0.0); 3];
            unit[j] = c(1.0);
            let (height, half) = (axes[j].dot(self.center), self.other.reach(Vec3(unit)));
            let above = height - half - high[j];
            let below = low[j] - height - half;
            // the side with the larger distance, as seen from the hull
            let side = with_sign(c(1.0), above - below);
            let x = above.max(below);
            let old = cx.get(&search.distance);
            let farther = old.lt(x);
            let kept = get3(cx, &search.normal);
            cx.set(&mut search.distance, C::F::select(farther, x, old));
            set3(
                cx,
                &mut search.normal,
                select(farther, axes[j] * side, kept),
            );
            let was = cx.get(&search.kind);
            cx.set(&mut search.kind, C::F::select(farther, c(1.0), was));
        }
    }

    /// Highest and lowest vertices of the hull along the other's axes.
    #[inline(always)]
    fn hull_extents(&self, cx: &mut C) -> (Vec3<C::F>, Vec3<C::F>) {
        let (c, axes, tables) = (C::F::c, self.axes, self.hull.tables);
        let mut highest = var3(cx, Vec3([c(-1e18); 3]));
        let mut lowest = var3(cx, Vec3([c(1e18); 3]));
        let (first, end) = self.hull.span(cx, Part::Vertices);
        span!(cx, row in first, end, {
            // only the axes that are normals of faces are filled
            let (mut high, mut low) = (get3(cx, &highest), get3(cx, &lowest));
            for vertex in vertex_row(cx, tables, row) {
                for &j in R::FACES {
                    let x = vertex.dot(axes[j]);
                    high[j] = high[j].max(x);
                    low[j] = low[j].min(x);
                }
            }
            put3(cx, &mut highest, high);
            put3(cx, &mut lowest, low);
        });
        (get3(cx, &highest), get3(cx, &lowest))
    }

    /// Normals of an edge of the hull and one of the other shape.
    #[inline(always)]
    fn edge_pairs(&self, cx: &mut C, search: &mut Search<C>) {
        let c = C::F::c;
        let tables = self.hull.tables;
        // a face stays the best unless two edges exceed it by the tolerance
        let start = cx.get(&search.distance) + self.tolerance;
        let mut best = EdgeSearch {
            distance: cx.var(start),
            normal: var3(cx, Vec3([c(0.0); 3])),
        };
        let (first, end) = self.hull.span(cx, Part::Edges);
        // Two edges that are the way out pass each other at the depth of their axis. The other shape reaches along the best
        // axis to that axis' depth below the hull's end, and an edge to no more than twice that.
        let (m, x) = (get3(cx, &search.normal), cx.get(&search.distance));
        let top = m.dot(self.center) - self.reach(m) - x;
        let is_apart = !x.lt(c(0.0));
        let floor = C::F::select(is_apart, c(-1e18), top + (x + x) - self.tolerance);
        span!(cx, edge in first, end, {
            let [px, py, pz, ax, ay, az] = cx.constants(tables.edges, edge, 0);
            let (point, along) = (Vec3([px, py, pz]), Vec3([ax, ay, az]));
            let length = cx.constant(tables.edges, edge, 12);
            // the higher end of the edge along m
            let height = m.dot(point) + (m.dot(along) * length).max(c(0.0));
            let reaches = !height.lt(floor);
            when!(cx, reaches, {
                // normals of the faces beside the edge, for edges that reach the floor
                let [n1x, n1y, n1z, n2x, n2y, n2z] = cx.constants(tables.edges, edge, 6);
                let (n1, n2) = (Vec3([n1x, n1y, n1z]), Vec3([n2x, n2y, n2z]));
                let hull_edge = HullEdge { point, along, outward: n1 + n2, normals: [n1, n2] };
                self.edge_with_others(cx, edge, &hull_edge, &mut best, search);
            });
        });
        // the best axis of two edges replaces that of a face
        let (x, old) = (cx.get(&best.distance), cx.get(&search.distance));
        let farther = (old + self.tolerance).lt(x);
        let (unit, kept) = (get3(cx, &best.normal), get3(cx, &search.normal));
        cx.set(&mut search.distance, C::F::select(farther, x, old));
        set3(cx, &mut search.normal, select(farther, unit, kept));
        let was = cx.get(&search.kind);
        cx.set(&mut search.kind, C::F::select(farther, c(2.0), was));
    }

    /// An edge of the hull with each direction of the other's edges.
    #[inline(always)]
    fn edge_with_others(
        &self,
        cx: &mut C,
        edge: C::I,
        hull_edge: &HullEdge<C::F>,
        best: &mut EdgeSearch<C>,
        search: &mut Search<C>,
    ) {
        let c = C::F::c;
        // from the edge to the other's centre
        let (way, [n1, n2]) = (self.center - hull_edge.point, hull_edge.normals);
        for &j in R::EDGES {
            let q = self.axes[j];
            // the two edges make a face of the Minkowski difference
            let crosses = (n1.dot(q) * n2.dot(q)).lt(c(0.0));
            when!(cx, crosses, {
                // n = d × q, of unit length, outward of the hull; guarded for parallel edges
                let axis = hull_edge.along.cross(q);
                let square = axis.dot(axis);
                let unit = c(1.0).div(square.max(c(1e-6)).sqrt());
                let unit = axis * with_sign(unit, axis.dot(hull_edge.outward));
                // distance along n: n · (center - p) - reach of the other
                let x = unit.dot(way) - self.reach(unit);
                let old = cx.get(&best.distance);
                // of nearly parallel edges the normal is that of a face
                let farther = old.lt(x) & c(1e-6).lt(square);
                cx.set(&mut best.distance, C::F::select(farther, x, old));
                let kept = get3(cx, &best.normal);
                set3(cx, &mut best.normal, select(farther, unit, kept));
                // which edges they are, for the point of contact
                let place = &mut search.place;
                let (number, at, along) = (cx.number(edge), cx.get(&place[0]), cx.get(&place[1]));
                cx.set(&mut place[0], C::F::select(farther, number, at));
                cx.set(&mut place[1], C::F::select(farther, c(j as f64), along));
            });
        }
    }
}

/// Rounding of distances between shapes whose radii have this sum [m].
#[inline(always)]
pub(in crate::step::collide) fn axis_tolerance<F: Num>(size: F) -> F {
    size * rounding_error::<F>()
}
